"""What cells in parallel do to each other: capacity lost, spread over SoC, peaks, what flows after.

All of it once from the measured and once from the simulated branch currents of the same record.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.records.conditions import at_rest_in_record

LOW_SOC = 0.15  # of the group: below it branch currents part (thesis 5.4)
WHOLE_SHARE = 0.5  # of the cells' capacity, which a discharge of the group passes at least
LONGER = 0.15  # of its duration, by which a discharge is run on to find the simulated end
BINS = np.round(np.linspace(0.0, 1.0, 21), 2)
AFTER_SECOND = 1.0  # after the load ended: what is sampled sooner may lie within the edge


class Compared(NamedTuple):
    """A group's record beside its simulation; (n,), of branches (n, branches).

    time_second, total_ampere, voltage_volt : measured. measured_ampere : of the branches, without
    the offsets of their sensors. simulated_volt, simulated_ampere : the same, simulated.
    soc : of the group, by the charge that passed [1]. scored : bool, rows that no fit has seen.
    capacity_ampere_hour : (branches,) of the models [Ah].
    """

    time_second: np.ndarray
    total_ampere: np.ndarray
    voltage_volt: np.ndarray
    measured_ampere: np.ndarray
    simulated_volt: np.ndarray
    simulated_ampere: np.ndarray
    soc: np.ndarray
    scored: np.ndarray
    capacity_ampere_hour: np.ndarray


class End(NamedTuple):
    """Where a discharge ends by the simulation, at the voltage at which the measured one ended.

    ampere_hour : (branches,) each branch has given [Ah]. largest_ampere : (branches,) [A].
    """

    ampere_hour: np.ndarray
    largest_ampere: np.ndarray


def loaded(total_ampere):
    """Rows under load: bool (n,).

    Parameters
    ----------
    total_ampere : (n,) [A].
    """
    return ~at_rest_in_record(total_ampere)


def whole_discharge(compared):
    """Rows of the longest steady discharge: slice; None where it passes less than half of the SoC.

    Parameters
    ----------
    compared : Compared.
    """
    down = loaded(compared.total_ampere) & (compared.total_ampere < 0)
    edges = np.flatnonzero(np.diff(down.astype(int), prepend=0, append=0))
    charge = np.append(0.0, _passed(compared.time_second, compared.total_ampere).cumsum())
    spans = [(charge[a] - charge[b - 1], a, b) for a, b in edges.reshape(-1, 2)]
    most, first, stop = max(spans, default=(0.0, 0, 0))
    whole = most >= WHOLE_SHARE * compared.capacity_ampere_hour.sum()
    return slice(int(first), int(stop)) if whole else None


def _passed(time_second, ampere):
    """Charge from sample to sample [Ah], (n − 1, ...)."""
    steps = np.diff(time_second).reshape(-1, *[1] * (np.ndim(ampere) - 1))
    return steps * (ampere[1:] + ampere[:-1]) / 7200.0


def longer(compared, rows):
    """Time [s] and total current [A] of a record up to a discharge's end, and its load run on.

    Parameters
    ----------
    compared : Compared. rows : slice, from `whole_discharge`.

    Returns
    -------
    test_time_second, total_ampere : (m,).
    """
    time, total = compared.time_second[: rows.stop], compared.total_ampere[: rows.stop]
    step = np.median(np.diff(time[rows]))
    count = int(np.ceil(LONGER * (time[-1] - time[rows.start]) / step))
    more = time[-1] + step * np.arange(1, count + 1)
    load = np.median(total[rows])
    return np.append(time, more), np.append(total, np.full(count, load))


def simulated_end(compared, rows, time_second, simulated_ampere, simulated_volt):
    """Charge and largest current of each branch when the simulated voltage reaches the end.

    Parameters
    ----------
    compared : Compared. rows : slice of the discharge.
    time_second, simulated_ampere, simulated_volt : (m,), (m, branches), (m,) of the longer record.

    Returns
    -------
    end : End; NaN where the voltage is not reached.
    """
    end_volt = compared.voltage_volt[rows.stop - 1]
    below = np.flatnonzero(simulated_volt[rows.start :] <= end_volt)
    if not len(below):
        return End(*np.full((2, simulated_ampere.shape[1]), np.nan))
    last = rows.start + below[0]
    passed = _passed(time_second[rows.start : last + 1], simulated_ampere[rows.start : last + 1])
    high, low = simulated_volt[last - 1], simulated_volt[last]
    late = (high - end_volt) / (high - low) if high > low else 1.0
    given = -(passed[:-1].sum(axis=0) + late * passed[-1]) if len(passed) else np.zeros(0)
    largest = np.abs(simulated_ampere[rows.start : last + 1]).max(axis=0)
    return End(given, largest)


def findings_of(compared, rows, end):
    """Row of table `pack_findings`: what the group loses, how its branches part, what flows after.

    Parameters
    ----------
    compared : Compared. rows : slice of the discharge, or None. end : End, or None.

    Returns
    -------
    row : dict; NaN where the record has no whole discharge, or no rest after it.
    """
    cells = float(compared.capacity_ampere_hour.sum())
    row = {"branches": len(compared.capacity_ampere_hour), "cells_capacity_ampere_hour": cells}
    if rows is None:
        return row | dict.fromkeys(DISCHARGED, np.nan)
    time, total = compared.time_second, compared.total_ampere
    capacity = float(-_passed(time[rows], total[rows]).sum())
    simulated = float(end.ampere_hour.sum())
    row |= {
        "current_c_rate": float(-np.median(total[rows]) / cells),
        "group_capacity_ampere_hour": capacity,
        "simulated_group_capacity_ampere_hour": simulated,
        "lost_ampere_hour": cells - capacity,
        "lost_share": 1 - capacity / cells,
        "simulated_lost_share": 1 - simulated / cells,
    }
    row |= _both(compared, rows, "peak_share", _peak_share)
    row |= _both(compared, rows, "spread_above_15_soc", _spread_above)
    row |= _both(compared, rows, "spread_below_15_soc", _spread_below)
    row["last_15_soc_charge_share"] = _share_below(compared, rows, np.abs(total))
    row["last_15_soc_energy_share"] = _share_below(
        compared, rows, np.abs(total) * compared.voltage_volt
    )
    row["simulated_last_15_soc_energy_share"] = _share_below(
        compared, rows, np.abs(total) * compared.simulated_volt
    )
    after = _rest_after(compared, rows)
    row |= _both(compared, after, "circulating_ampere", _circulating)
    return row | _both(compared, after, "circulated_ampere_hour", _circulated)


TWICE = (
    *("peak_share", "spread_above_15_soc", "spread_below_15_soc"),
    *("circulating_ampere", "circulated_ampere_hour"),
)
DISCHARGED = (
    *("current_c_rate", "group_capacity_ampere_hour", "simulated_group_capacity_ampere_hour"),
    *("lost_ampere_hour", "lost_share", "simulated_lost_share", "last_15_soc_charge_share"),
    *("last_15_soc_energy_share", "simulated_last_15_soc_energy_share"),
    *(prefix + name for name in TWICE for prefix in ("", "simulated_")),
)


def _both(compared, rows, name, quantity):
    """A quantity from the measured and from the simulated branch currents."""
    pairs = (("", compared.measured_ampere), ("simulated_", compared.simulated_ampere))
    return {prefix + name: quantity(compared, rows, ampere) for prefix, ampere in pairs}


def _peak_share(compared, rows, ampere):
    """Largest branch current over the mean of all branches, without the edges of the load [1]."""
    inside = slice(rows.start + 1, max(rows.stop - 1, rows.start + 2))
    ideal = np.abs(compared.total_ampere[inside]) / ampere.shape[1]
    return float((np.abs(ampere[inside]).max(axis=1) / ideal).max())


def _spread_above(compared, rows, ampere):
    return _mean_spread(compared, rows, ampere, compared.soc[rows] > LOW_SOC)


def _spread_below(compared, rows, ampere):
    return _mean_spread(compared, rows, ampere, compared.soc[rows] <= LOW_SOC)


def _mean_spread(compared, rows, ampere, wanted):
    total, inside = compared.total_ampere[rows][wanted], ampere[rows][wanted]
    if not len(total):
        return np.nan
    return float(np.mean(np.ptp(inside, axis=1) * ampere.shape[1] / np.abs(total)))


def _share_below(compared, rows, power):
    """Share of a quantity that passes in the last 15 % of SoC [1]."""
    passed = _passed(compared.time_second[rows], power[rows])
    low = compared.soc[rows][1:] <= LOW_SOC
    return float(passed[low].sum() / passed.sum())


def _rest_after(compared, rows):
    """Rows of the rest after a discharge: slice, of no rows where there is none."""
    under_load = np.append(loaded(compared.total_ampere)[rows.stop :], True)
    stop = rows.stop + int(np.argmax(under_load))
    begin = compared.time_second[min(rows.stop, len(compared.time_second) - 1)] + AFTER_SECOND
    first = int(np.searchsorted(compared.time_second, begin))
    return slice(min(first, stop), stop)


def _circulating(_compared, rows, ampere):
    """Largest branch current in the rest after the discharge [A]."""
    return float(np.abs(ampere[rows]).max()) if rows.stop > rows.start else np.nan


def _circulated(compared, rows, ampere):
    """Charge that flows from branch to branch in that rest [Ah]."""
    if rows.stop - rows.start < 2:
        return np.nan
    passed = _passed(compared.time_second[rows], ampere[rows]).sum(axis=0)
    return float(np.abs(passed).sum() / 2)


def spread_over_soc(compared):
    """Rows of table `pack_spread`: branch currents over SoC, while the group is discharged.

    Parameters
    ----------
    compared : Compared.

    Returns
    -------
    rows : list of dict, one a bin of SoC that the record passes: mean spread of the branch currents
        over their mean, largest branch current over the mean, RMS error over the mean; measured and
        simulated [1].
    """
    down = loaded(compared.total_ampere) & (compared.total_ampere < 0)
    place = np.clip(np.digitize(compared.soc, BINS) - 1, 0, len(BINS) - 2)
    rows = []
    for k, (low, high) in enumerate(pairwise(BINS)):
        inside = np.flatnonzero(down & (place == k))
        if len(inside):
            rows.append({"soc_low": low, "soc_high": high} | _of_bin(compared, inside))
    return rows


def _of_bin(compared, inside):
    ideal = np.abs(compared.total_ampere[inside]).mean() / compared.measured_ampere.shape[1]
    error = compared.measured_ampere[inside] - compared.simulated_ampere[inside]
    row = {"samples": len(inside), "mean_branch_current_ampere": float(ideal)}
    row |= _both(compared, inside, "spread", _spread_of_bin)
    row |= _both(compared, inside, "largest_share", _largest_of_bin)
    return row | {"relative_current_rmse": rms(error) / float(ideal)}


def _spread_of_bin(compared, inside, ampere):
    total = np.abs(compared.total_ampere[inside])
    return float(np.ptp(ampere[inside], axis=1).mean() * ampere.shape[1] / total.mean())


def _largest_of_bin(compared, inside, ampere):
    total = np.abs(compared.total_ampere[inside])
    return float(np.abs(ampere[inside]).max(axis=1).mean() * ampere.shape[1] / total.mean())
