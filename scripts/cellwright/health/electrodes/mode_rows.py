"""Degradation modes as rows of a table, with the reason where they are not known."""

import numpy as np

from cellwright.health.electrodes.alignment import CORRELATED_SOC
from cellwright.health.electrodes.names import MODES
from cellwright.numerics.statistics import NORMAL_95


def mode_rows(found, pair, curves):
    """Rows of the stage `degradation_modes`, one a check-up, as list of dict.

    A mode that the curve does not tell better than the capacity alone is NaN, and the reason says
    so with its interval.

    Parameters
    ----------
    found : Modes. pair : Pair. curves : list of SlowCurve; the first is the fresh state.
    """
    half_cells = {f"{electrode}_half_cell": one.name for electrode, one in pair._asdict().items()}
    facts = half_cells | {
        "fresh_state": f"{curves[0].cell}/{curves[0].test}",
        "fresh_ampere_hour": float(curves[0].capacity_ampere_hour),
    }
    own = [k for k, curve in enumerate(curves) if k or curve.cell == curves[-1].cell]
    return [_row(found, k, curves[k]) | _of_blends(found, k, pair) | facts for k in own]


def _row(found, k, curve):
    alignment, known = found.alignments[k], found.known[k]
    row = {"cell": curve.cell, "test": curve.test, "cycle": curve.cycle}
    for j, mode in enumerate(MODES):
        row[mode] = float(found.joint[k, j]) if known[j] else np.nan
        row[f"{mode}_std"] = float(found.joint_std[k, j]) if known[j] else np.nan
        row[f"{mode}_single"] = float(found.single[k, j])
        row[f"{mode}_single_std"] = float(found.single_std[k, j])
    names = ("negative_at_empty", "negative_at_full", "positive_at_empty", "positive_at_full")
    limits = zip((*names, "shift_volt"), map(float, alignment.limits[:5]), strict=True)
    about = {
        "capacity_ampere_hour": float(curve.capacity_ampere_hour),
        "rmse_volt": alignment.rmse_volt,
        "identifiable": bool(known.all()),
        "reason": _reason(found, k),
        "doubt": _doubt(found, k, curve),
    }
    return row | about | dict(limits)


def _reason(found, k):
    """Which modes the window does not tell, and by how much."""
    words = [
        f"{mode} not identifiable from this window: {100 * found.single[k, j]:.0f} ± "
        f"{_points(found.single_std[k, j]):.0f} % (95 %), the capacity alone allows up to "
        f"{100 * found.possible[k, j]:.0f} %"
        for j, mode in enumerate(MODES)
        if not found.known[k, j]
    ]
    return "; ".join(words)


def _points(std):
    """Half of a 95 % interval, in percent."""
    return 100 * NORMAL_95 * std


def _doubt(found, k, curve):
    """On what modes hang more than on the curve's own misfit, by how much, and where."""
    hanging = {}
    for j, mode in enumerate(MODES):
        stds = {source: std[k, j] for source, std in found.doubts.items()}
        source = max(stds, key=stds.get)
        words = f"{mode} ± {_points(stds[source]):.1f}"
        if source == "window":
            most = np.abs(found.left_out[:, k, j]).argmax()
            without = 100 * (found.single[k, j] + found.left_out[most, k, j])
            low, high = (round(100 * CORRELATED_SOC * edge) for edge in (most, most + 1))
            words += f" ({without:.1f} % without {low} to {high} % of SoC)"
        # A mode hangs on what leaves it half as uncertain again as the misfit does.
        if source != "data" and stds[source] > 1.5 * stds.get("data", 0.0):
            hanging.setdefault(source, []).append(words)
    names = {"branch": f"branch, a {curve.branches} alone of a cell that may hold silicon"}
    return "; ".join(
        f"hangs on the {names.get(source, source)}: {', '.join(modes)} points (95 %)"
        for source, modes in hanging.items()
    )


def _of_blends(found, k, pair):
    """Shares of the second materials of blends, and losses of a blended negative's materials."""
    row, shares = {}, iter(zip(found.shares[k], found.shares_std[k], strict=True))
    for electrode, half_cell in pair._asdict().items():
        share = (np.nan, np.nan) if half_cell.parts is None else next(shares)
        row[f"{electrode}_blend_share"], row[f"{electrode}_blend_share_std"] = map(float, share)
    materials = np.full((2, 2), np.nan)
    if found.materials.size:
        materials = np.stack([found.materials[k], found.materials_std[k]], axis=1)
        materials[2 * NORMAL_95 * materials[:, 1] >= 1] = np.nan  # from nothing to all of it
    for name, (loss, std) in zip(("first", "second"), materials, strict=True):
        row[f"lam_negative_{name}"], row[f"lam_negative_{name}_std"] = float(loss), float(std)
    return row


def notes(found, fitting, *, given):
    """Sentences on the half cells: whose they are, their sources, how well they fit.

    Parameters
    ----------
    found : Modes. fitting : list of (Pair, rmse_volt), best first.
    given : whether the user gave both half cells.
    """
    pair = fitting[0][0]
    names = (
        one.name if one.name == one.source else f"{one.name} ({one.source})"
        for one in (pair.negative, pair.positive)
    )
    words = [f"half cells: {' and '.join(names)}"]
    if not given:
        words.append(
            "half cells of the chemistry's published curves, chosen by misfit, not measured on "
            "this cell: give negative_half_cell and positive_half_cell in cells.tsv"
        )
    worst = max(alignment.rmse_volt for alignment in found.alignments)
    if worst > 0.003:
        words.append(f"the half cells fit poorly: misfit up to {1e3 * worst:.1f} mV")
    others = [f"{one.negative.name} with {one.positive.name}" for one, _ in fitting[1:]]
    if others:
        words.append(
            f"fit too, what they give instead is counted into the intervals: {', '.join(others)}"
        )
    return words
