"""Charge of each plateau of a slow curve, and what each has lost between two check-ups."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.linear import savitzky_golay_weights
from cellwright.numerics.statistics import white_noise_of
from cellwright.refusal import Refusal

SMOOTH_SOC = 0.04  # window over which dV/dSoC is taken
PROMINENCE = 0.25  # of a boundary's steepness above its valleys, over the median steepness
NEAR_VOLT = 0.05  # a boundary of the next check-up is the same if this near
NOISE_FACTOR = 8.0  # standard deviations of dV/dSoC: its noise alone ranges over six of them
END_SOC = 0.03  # at either end the curve is steep by itself


class Boundaries(NamedTuple):
    """Steepest points between plateaus, in rising order (m,).

    voltage_volt [V]. charge_ampere_hour : counted from the empty end [Ah]. charge_std_ampere_hour :
    by how far the steepest point could lie elsewhere [Ah].
    """

    voltage_volt: np.ndarray
    charge_ampere_hour: np.ndarray
    charge_std_ampere_hour: np.ndarray


class PlateauLoss(NamedTuple):
    """One plateau at one check-up against the first.

    plateau : number from the empty end, from 1. lower_volt, upper_volt : its boundaries at the
    first check-up [V]; the ends of the curve where it is the first or last. charge_ampere_hour,
    fresh_ampere_hour : its charge then and at the first check-up [Ah]. loss_ampere_hour : of it,
    with std. share_of_loss : of all that the cell has lost [1]. reason : why it is not known.
    """

    cell: str
    test: str
    cycle: float
    plateau: int
    lower_volt: float
    upper_volt: float
    charge_ampere_hour: float
    fresh_ampere_hour: float
    loss_ampere_hour: float
    loss_std_ampere_hour: float
    share_of_loss: float
    reason: str


def boundaries(curve, *, prominence=PROMINENCE):
    """Maxima of dV/dQ, which part a slow curve into plateaus.

    1. dV/dSoC by a parabola over 4 % of SoC. 2. Maxima that rise above both of their valleys by
    more than `prominence` of the curve's median steepness, and than its noise. 3. How well each is
    placed: where the steepness falls short of the maximum by its noise.

    Parameters
    ----------
    curve : SlowCurve. prominence : [1].

    Returns
    -------
    found : Boundaries; none where dV/dQ has no maximum inside.

    Source: thesis 4.3 (plateaus of LFP); Dahn et al., J. Electrochem. Soc. 159 (2012) A1405.
    """
    soc, volt = _evenly(curve)
    step = soc[1] - soc[0]
    half = max(round(SMOOTH_SOC / step / 2), 2)
    line = savitzky_golay_weights(half, step, 0)[::-1]
    weights = savitzky_golay_weights(half, step, 1)
    slope = np.convolve(volt, weights[::-1], "valid")
    smooth, inner = np.convolve(volt, line, "valid"), soc[half:-half]
    usual = np.median(slope)
    # The median passes over the steep ends, whose second differences are no noise.
    noise = white_noise_of(volt) * np.linalg.norm(weights)
    least = max(prominence * usual, NOISE_FACTOR * noise)
    tops = np.flatnonzero((slope[1:-1] > slope[:-2]) & (slope[1:-1] >= slope[2:])) + 1
    tops = [top for top in tops if _rise(slope, top) > least]
    tops = np.array([t for t in tops if END_SOC < inner[t] < 1 - END_SOC], int)
    bend = -(slope[tops - 1] - 2 * slope[tops] + slope[tops + 1]) / step**2
    width = np.sqrt(2 * noise / np.maximum(bend, 1e-9))
    std = np.maximum(np.minimum(width, SMOOTH_SOC), step / 2) * curve.capacity_ampere_hour
    return Boundaries(smooth[tops], inner[tops] * curve.capacity_ampere_hour, std)


def _evenly(curve):
    """SoC and voltage on an even grid of the curve's own step."""
    soc = np.linspace(curve.soc[0], curve.soc[-1], len(curve.soc))
    return soc, np.interp(soc, curve.soc, curve.voltage_volt)


def _rise(slope, top):
    """Rise of a maximum above the higher of the two valleys that part it from steeper points."""
    steeper = np.flatnonzero(slope > slope[top])
    left = steeper[steeper < top].max(initial=-1) + 1
    right = steeper[steeper > top].min(initial=len(slope))
    return slope[top] - max(slope[left : top + 1].min(), slope[top:right].min())


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
    losses : list of PlateauLoss, one a plateau and check-up after the first.

    Raises
    ------
    Refusal : dV/dQ of the first check-up has no maximum inside: one plateau, or none.
    """
    fresh = boundaries(curves[0])
    if not len(fresh.voltage_volt):
        raise Refusal(
            f"{curves[0].test}: dV/dQ has no maximum between 3 and 97 % of the charge: no plateaus "
            "to tell apart"
        )
    losses, last_volt = [], fresh.voltage_volt
    for curve in curves[1:]:
        charge, std, last_volt = _matched(last_volt, boundaries(curve))
        losses += _against(curves[0], fresh, curve, (charge, std))
    return losses


def _matched(last_volt, aged):
    """Charges, stds and voltages (m,) of known boundaries at the next check-up; charge NaN if lost.

    A boundary that is not found is looked for again at later check-ups where it was last.
    """
    charge, std = np.full((2, len(last_volt)), np.nan)
    volt = last_volt.copy()
    if not len(aged.voltage_volt):
        return charge, std, volt
    gaps = np.abs(aged.voltage_volt[None, :] - last_volt[:, None])
    for row, column in enumerate(gaps.argmin(axis=1)):
        mutual = gaps[:, column].argmin() == row
        if mutual and gaps[row, column] < NEAR_VOLT:
            charge[row] = aged.charge_ampere_hour[column]
            std[row] = aged.charge_std_ampere_hour[column]
            volt[row] = aged.voltage_volt[column]
    return charge, std, volt


def _against(first, fresh, curve, matched):
    """Losses of all plateaus of one check-up."""
    before = np.array([0.0, *fresh.charge_ampere_hour, first.capacity_ampere_hour])
    after = np.array([0.0, *matched[0], curve.capacity_ampere_hour])
    spread = [np.array([0.0, *std, 0.0]) for std in (fresh.charge_std_ampere_hour, matched[1])]
    volt = [first.voltage_volt[0], *fresh.voltage_volt, first.voltage_volt[-1]]
    lost = first.capacity_ampere_hour - curve.capacity_ampere_hour
    rows = []
    for number, (low, high) in enumerate(pairwise(range(len(before))), start=1):
        was, now = before[high] - before[low], after[high] - after[low]
        std = np.sqrt(sum(part[low] ** 2 + part[high] ** 2 for part in spread))
        known = np.isfinite(now)
        rows.append(
            PlateauLoss(
                cell=curve.cell,
                test=curve.test,
                cycle=curve.cycle,
                plateau=number,
                lower_volt=float(volt[low]),
                upper_volt=float(volt[high]),
                charge_ampere_hour=float(now),
                fresh_ampere_hour=float(was),
                loss_ampere_hour=float(was - now),
                loss_std_ampere_hour=float(std) if known else np.nan,
                share_of_loss=float((was - now) / lost) if known and lost > 0 else np.nan,
                reason="" if known else "a boundary of this plateau is not found at this check-up",
            )
        )
    return rows
