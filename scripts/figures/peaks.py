"""Figures of peaks of dQ/dV followed through the life of a cell."""

import numpy as np

from cellwright.health.peaks.sequences import count_before
from cellwright.records.conditions import SAME_CELSIUS, same_rate
from figures import style
from figures.style import rows_where

MOST_PANELS = 3
TOO_FEW = "Each rate and temperature has one slow charge: how peaks move takes two."
GAP = 0.45  # between two curves, as a share of what counts as full height
FULL_SHARE = 0.98  # quantile of all heights that counts as full


def draw_ica_tracks(tracks, curves):
    """dQ/dV over a life, one curve above the other, with the tracked peaks joined.

    `tracks` are columns of stage `ica_tracks`, `curves` is {(test, cycle): (voltage, dQ/dV)}. One
    panel a rate and temperature, those with most charges first; a single charge is no life.
    """
    parts = [part for part in _sequences(tracks) if len(_charges(part)) > 1][:MOST_PANELS]
    if not parts:
        return style.message(TOO_FEW)
    # A report shows a figure as wide as its page: one panel alone would be magnified.
    columns = max(len(parts), 2)
    figure, axes = style.subplots(1, columns, width=4.2 * columns, height=5.0)
    for panel, part in zip(axes[0], parts, strict=False):
        _waterfall(panel, part, curves)
    style.hide(axes[0, len(parts) :])
    return figure


def _sequences(tracks):
    """Columns of the tracks of each rate and temperature, most charges first."""
    sequences, left = [], np.ones(len(tracks["cycle"]), bool)
    celsius = np.nan_to_num(tracks["ambient_temperature_celsius"], nan=25.0)
    while left.any():
        first = int(np.argmax(left))
        same = left & same_rate(tracks["c_rate"], tracks["c_rate"][first])
        same &= np.abs(celsius - celsius[first]) <= SAME_CELSIUS
        sequences.append(rows_where(tracks, same))
        left &= ~same
    return sorted(sequences, key=lambda part: -len(set(part["cycle"])))


def _charges(part):
    """Charges of a sequence as (cycle, test), in order."""
    return sorted(set(zip(part["cycle"].tolist(), part["test"].tolist(), strict=True)))


def _waterfall(panel, part, curves):
    """Curves of one sequence, freshest at the bottom, and its peaks."""
    charges = _charges(part)
    heights = [curves[t, c][1] for c, t in charges if (t, c) in curves]
    peaks = part["height_ampere_hour_per_volt"]
    # The highest peak of one charge may be noise; all curves share one scale.
    full = np.quantile(np.concatenate([*heights, peaks[np.isfinite(peaks)]]), FULL_SHARE)
    base = {charge: GAP * k for k, charge in enumerate(charges)}
    for k, (cycle, test) in enumerate(charges):
        if (test, cycle) in curves:
            volt, height = curves[test, cycle]
            colour = style.QUIET if k % 2 else style.MEASURED
            shown = np.minimum(height / full, 1.5) + base[cycle, test]
            style.plot_thinned(panel, volt, shown, color=colour, linewidth=0.6)
    for number, identity in enumerate(dict.fromkeys(part["identity"])):
        own = rows_where(part, part["identity"] == identity)
        places = [base[charge] for charge in zip(own["cycle"], own["test"], strict=True)]
        tall = np.minimum(own["height_ampere_hour_per_volt"] / full, 1.5) + places
        colour = style.SERIES[number % len(style.SERIES)]
        panel.plot(own["voltage_volt"], tall, "o-", ms=3, color=colour, label=identity)
    some = charges[:: max(len(charges) // 8, 1)]
    panel.set_yticks([base[charge] for charge in some], [f"{cycle:g}" for cycle, _ in some])
    rate = np.median(part["c_rate"])
    celsius = part["ambient_temperature_celsius"]
    at = style.temperature_label(float(celsius[0]) if np.isfinite(celsius[0]) else None)
    panel.set(xlabel="voltage [V]", ylabel="cycle", title=f"dQ/dV at {rate:.2g}C, {at}")
    style.legend_once(panel, fontsize=7, loc="upper left")


def curves_by_charge(check_ups, lives, tracks):
    """{(test, cycle of the tracks): (voltage [V], dQ/dV [Ah/V])} of all charges.

    `check_ups`, `lives` : (columns, about) of stages `ica_curve` and `ica_life_curve`. Records that
    count on from one another have cycles of their own in their curves.
    """
    curves = {}
    for columns, about in [*check_ups, *lives]:
        test = about["wildcards"]["test"]
        cycles = np.unique(tracks["cycle"][tracks["test"] == test])
        if len(cycles):
            curves |= _of_test(columns, test, cycles)
    return curves


def _of_test(columns, test, cycles):
    """Curves of one test by its cycles in the tracks."""
    own = columns.get("cycle", np.full(len(columns["voltage_volt"]), cycles[0]))
    # Records without a stated cycle count on in the tracks, and from 1 in their own curves.
    before = count_before(np.unique(own), set(cycles.tolist()))
    names = ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    return {
        (test, float(cycle + before)): tuple(columns[name][own == cycle] for name in names)
        for cycle in np.unique(own)
    }
