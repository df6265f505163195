"""Charge of each plateau of a slow curve, and what each has lost between two check-ups."""

from itertools import pairwise

import numpy as np

from cellwright.numerics.linear import savitzky_golay_weights
from cellwright.numerics.statistics import white_noise_of
from cellwright.refusal import Refusal

SMOOTH_SOC = 0.04  # window over which dV/dSoC is taken


def boundaries(curve):
    """Maxima of dV/dQ, which part a slow curve into plateaus.

    1. dV/dSoC by a parabola over 4 % of SoC. 2. Maxima that rise above both of their valleys by
    more than a quarter of the curve's median steepness, and than its noise. 3. How well each is
    placed: where the steepness falls short of the maximum by its noise. `charge_slope` is not used:
    it needs the readings of one charge, and a slow curve may be the mean of two branches.

    Parameters
    ----------
    curve : SlowCurve.

    Returns
    -------
    voltage_volt, charge_ampere_hour, charge_std_ampere_hour : (m,) of the boundaries, in rising
        order [V], [Ah]: charge counted from the empty end, and by how far the steepest point could
        lie elsewhere. Empty where dV/dQ has no maximum inside.

    Source: thesis 4.3 (plateaus of LFP); Dahn et al., J. Electrochem. Soc. 159 (2012) A1405.
    """
    from scipy.signal import find_peaks

    soc = np.linspace(curve.soc[0], curve.soc[-1], len(curve.soc))
    volt = np.interp(soc, curve.soc, curve.voltage_volt)
    step = soc[1] - soc[0]
    half = max(round(SMOOTH_SOC / step / 2), 2)
    line = savitzky_golay_weights(half, step, 0)[::-1]
    weights = savitzky_golay_weights(half, step, 1)
    slope = np.convolve(volt, weights[::-1], "valid")
    smooth, inner = np.convolve(volt, line, "valid"), soc[half:-half]
    # The median passes over the steep ends, whose second differences are no noise.
    noise = white_noise_of(volt) * np.linalg.norm(weights)
    # Eight standard deviations: the noise of dV/dSoC alone ranges over six of them.
    least = max(0.25 * np.median(slope), 8.0 * noise)
    tops, _ = find_peaks(slope, prominence=least)
    # At either end the curve is steep by itself.
    tops = tops[np.abs(inner[tops] - 0.5) < 0.5 - 0.03]
    bend = -(slope[tops - 1] - 2 * slope[tops] + slope[tops + 1]) / step**2
    # Within this distance a parabola falls by the noise of its top.
    width = np.sqrt(2 * noise / np.maximum(bend, 1e-9))
    std = np.maximum(np.minimum(width, SMOOTH_SOC), step / 2) * curve.capacity_ampere_hour
    return smooth[tops], inner[tops] * curve.capacity_ampere_hour, std


def plateau_losses(curves):
    """Charge lost by each plateau at each check-up since the first.

    A boundary is the same as that of the check-up before which lies nearest in voltage, each being
    the other's nearest. Where one is not found again, both plateaus beside it are not known at that
    check-up.

    Parameters
    ----------
    curves : list of SlowCurve in the order of age, two or more, as of `check_ups`.

    Returns
    -------
    losses : list of dict as of stage `plateau_losses`, one a plateau and check-up after the first.

    Raises
    ------
    Refusal : dV/dQ of the first check-up has no maximum inside: one plateau, or none.
    """
    fresh = boundaries(curves[0])
    if not len(fresh[0]):
        raise Refusal(
            f"{curves[0].test}: dV/dQ has no maximum between 3 and 97 % of the charge: no plateaus "
            "to tell apart"
        )
    losses, last_volt = [], fresh[0]
    for curve in curves[1:]:
        last_volt, *matched = _matched(last_volt, boundaries(curve))
        losses += _against(curves[0], fresh, curve, matched)
    return losses


def _matched(last_volt, aged):
    """Voltages, charges and stds (m,) of known boundaries at the next check-up; charge NaN if lost.

    A boundary that is not found is looked for again at later check-ups where it was last.
    """
    found = np.stack([last_volt, *np.full((2, len(last_volt)), np.nan)])
    if not len(aged[0]):
        return found
    gaps = np.abs(aged[0][None, :] - last_volt[:, None])
    for row, column in enumerate(gaps.argmin(axis=1)):
        mutual = gaps[:, column].argmin() == row
        # Boundaries of one curve lie some 0.1 V apart: half of that is still the same one.
        if mutual and gaps[row, column] < 0.05:
            found[:, row] = [values[column] for values in aged]
    return found


def _against(first, fresh, curve, matched):
    """Losses of all plateaus of one check-up."""
    before = np.array([0.0, *fresh[1], first.capacity_ampere_hour])
    after = np.array([0.0, *matched[0], curve.capacity_ampere_hour])
    spread = [np.array([0.0, *std, 0.0]) for std in (fresh[2], matched[1])]
    volt = [first.voltage_volt[0], *fresh[0], first.voltage_volt[-1]]
    lost = first.capacity_ampere_hour - curve.capacity_ampere_hour
    rows = []
    for number, (low, high) in enumerate(pairwise(range(len(before))), start=1):
        was, now = before[high] - before[low], after[high] - after[low]
        std = np.sqrt(sum(part[low] ** 2 + part[high] ** 2 for part in spread))
        known = np.isfinite(now)
        lacking = "a boundary of this plateau is not found at this check-up"
        row = {
            "cell": curve.cell,
            "test": curve.test,
            "cycle": curve.cycle,
            "plateau": number,
            "lower_volt": float(volt[low]),
            "upper_volt": float(volt[high]),
            "charge_ampere_hour": float(now),
            "fresh_ampere_hour": float(was),
            "loss_ampere_hour": float(was - now),
            "loss_std_ampere_hour": float(std) if known else np.nan,
            "share_of_loss": float((was - now) / lost) if known and lost > 0 else np.nan,
            "reason": "" if known else lacking,
        }
        rows.append(row)
    return rows
