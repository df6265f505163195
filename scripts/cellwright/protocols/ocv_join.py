"""One open-circuit voltage from the two branches of a slow test."""

import numpy as np

from cellwright.refusal import Refusal


def joined(soc, discharge_volt, charge_volt, discharge, charge, way):
    """OCV over SoC, and where it rests on measurement alone.

    Parameters
    ----------
    soc : (n,) [1], evenly from 0 to 1 with a point at 0.5.
    discharge_volt, charge_volt : (n,) [V], NaN where a branch does not reach.
    discharge, charge : Leg of each branch, or None.
    way : "single", "mean" or "equilibrium".

    Returns
    -------
    ocv_volt : (n,) [V]. measured : (n,) bool.

    Raises
    ------
    Refusal : the branches do not overlap at 50 % SoC.
    """
    if way == "single":
        only = discharge_volt if charge is None else charge_volt
        known = np.isfinite(only)
        return np.interp(soc, soc[known], only[known]), known
    if way == "mean":
        return _mean(soc, discharge_volt, charge_volt)
    return from_equilibrium(soc, discharge_volt, charge_volt, discharge, charge)


def _mean(soc, discharge_volt, charge_volt):
    """Mean of the branches where both hold; beyond, one branch moved by half the gap there."""
    # ASSUME: Where one slow branch has ended or drops into its polarisation knee (half gap above
    # three times the usual), the OCV is the other branch moved by half the gap at that edge.
    half, middle = (charge_volt - discharge_volt) / 2, len(soc) // 2
    if np.isnan(half[middle]):
        raise Refusal("slow discharge and slow charge do not overlap at 50 % SoC")
    usual = np.nanmedian(half[(soc > 0.2) & (soc < 0.8)])
    good = half < 3 * usual
    first = np.append(-1, np.flatnonzero(~good[:middle]))[-1] + 1
    last = np.append(np.flatnonzero(~good[middle:]), len(soc) - middle)[0] + middle - 1
    gap = half[np.clip(np.arange(len(soc)), first, last)]
    ocv = np.where(soc < soc[first], charge_volt - gap, discharge_volt + gap)
    both = (soc >= soc[first]) & (soc <= soc[last])
    return np.where(both, (charge_volt + discharge_volt) / 2, ocv), both


def from_equilibrium(soc, discharge_volt, charge_volt, discharge, charge):
    """Each half from the branch that began there in equilibrium (Plett's processOCV).

    The drop seen as the current starts and stops is taken off each branch, linear in SoC between;
    the gap that remains at half charge is taken to grow linearly from zero at the branch's start.
    """
    # ASSUME: In a four-file OCV test a branch starts in equilibrium and the hysteresis grows
    # linearly from there to half charge, so the low half of the OCV is the charge branch less
    # that part of the gap, the high half the discharge branch plus it.
    twice_in, twice_out = 2 * charge.step_in_volt, 2 * charge.step_out_volt
    from_full = np.fmin(discharge.step_in_volt, twice_out)
    to_empty = np.fmin(discharge.step_out_volt, twice_in)
    from_empty = np.fmin(charge.step_in_volt, 2 * discharge.step_out_volt)
    to_full = np.fmin(charge.step_out_volt, 2 * discharge.step_in_volt)
    drops = np.nan_to_num([from_full, to_empty, from_empty, to_full])
    high = discharge_volt + drops[1] + (drops[0] - drops[1]) * soc
    low = charge_volt - drops[2] - (drops[3] - drops[2]) * soc
    middle = len(soc) // 2
    gap = low[middle] - high[middle]
    ocv = np.where(soc < 0.5, low - gap * soc, high + gap * (1 - soc))
    known = np.isfinite(ocv)
    if not (np.isfinite(gap) and known.any()):
        raise Refusal("slow discharge and slow charge do not overlap at 50 % SoC")
    return np.interp(soc, soc[known], ocv[known]), known
