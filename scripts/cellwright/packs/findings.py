"""What cells in parallel do to each other: capacity lost, spread over SoC, peaks, what flows after.

All of it once from the measured and once from the simulated branch currents of the same record.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.packs.compare import discharging, passed_ampere_hour
from cellwright.records.conditions import at_rest_in_record

LOW_SOC = 0.15  # of the group: below it branch currents part (thesis 5.4)


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


def whole_discharge(compared):
    """Rows of the longest steady discharge: slice; None where it passes less than half of the SoC.

    Parameters
    ----------
    compared : Compared.
    """
    down = discharging(compared.total_ampere)
    edges = np.flatnonzero(np.diff(down.astype(int), prepend=0, append=0))
    passed = passed_ampere_hour(compared.time_second, compared.total_ampere)
    charge = np.append(0.0, passed.cumsum())
    spans = [(charge[a] - charge[b - 1], a, b) for a, b in edges.reshape(-1, 2)]
    most, first, stop = max(spans, default=(0.0, 0, 0))
    whole = most >= 0.5 * compared.capacity_ampere_hour.sum()
    return slice(int(first), int(stop)) if whole else None


def longer(compared, rows):
    """Time [s] and total current [A] (m,) of a record up to a discharge's end, its load run on.

    Parameters
    ----------
    compared : Compared. rows : slice, from `whole_discharge`.
    """
    time, total = compared.time_second[: rows.stop], compared.total_ampere[: rows.stop]
    # Steps and load as most of the discharge had them.
    step = np.median(np.diff(time[rows]))
    # 15 % longer: models that miss a capacity by more are wrong in other ways.
    count = int(np.ceil(0.15 * (time[-1] - time[rows.start]) / step))
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
    ampere_hour : (branches,) each branch has given by then [Ah]. largest_ampere : (branches,) [A].
        NaN where the voltage is not reached.
    """
    end_volt = compared.voltage_volt[rows.stop - 1]
    below = np.flatnonzero(simulated_volt[rows.start :] <= end_volt)
    if not len(below):
        return np.full((2, simulated_ampere.shape[1]), np.nan)
    last = rows.start + below[0]
    until = slice(rows.start, last + 1)
    passed = passed_ampere_hour(time_second[until], simulated_ampere[until])
    high, low = simulated_volt[last - 1], simulated_volt[last]
    # The voltage is met between two samples.
    late = (high - end_volt) / (high - low) if high > low else 1.0
    given = passed[:-1].sum(axis=0) + late * passed[-1:].sum(axis=0)
    return -given, np.abs(simulated_ampere[until]).max(axis=0)


def findings_of(compared, rows, end_ampere_hour):
    """Row of table `pack_findings`: what the group loses, how its branches part, what flows after.

    Parameters
    ----------
    compared : Compared. rows : slice of the discharge, or None.
    end_ampere_hour : (branches,) by `simulated_end` [Ah].

    Returns
    -------
    row : dict; NaN where the record has no whole discharge, or no rest after it.
    """
    cells = float(compared.capacity_ampere_hour.sum())
    row = {"branches": len(compared.capacity_ampere_hour), "cells_capacity_ampere_hour": cells}
    if rows is None:
        return row | dict.fromkeys(DISCHARGED, np.nan)
    time, total, volt = compared.time_second, compared.total_ampere, compared.voltage_volt
    capacity = float(-passed_ampere_hour(time[rows], total[rows]).sum())
    simulated = float(end_ampere_hour.sum())
    row |= {
        "current_c_rate": float(-np.median(total[rows]) / cells),
        "group_capacity_ampere_hour": capacity,
        "simulated_group_capacity_ampere_hour": simulated,
        "lost_ampere_hour": cells - capacity,
        "lost_share": 1 - capacity / cells,
        "simulated_lost_share": 1 - simulated / cells,
    }
    # At the edges of the load branch sensors are read one after the other.
    inside = slice(rows.start + 1, max(rows.stop - 1, rows.start + 2))
    mean = np.abs(total[inside]) / len(compared.capacity_ampere_hour)
    row |= _both(
        compared, "peak_share", lambda ampere: (np.abs(ampere[inside]).max(axis=1) / mean).max()
    )
    low = np.flatnonzero(compared.soc[rows] <= LOW_SOC) + rows.start
    high = np.setdiff1d(np.arange(rows.start, rows.stop), low)
    for name, part in (("spread_above_15_soc", high), ("spread_below_15_soc", low)):
        row |= _both(compared, name, lambda ampere, part=part: _spread(total, ampere, part))
    row["last_15_soc_charge_share"] = _share_below(compared, rows, np.abs(total))
    row["last_15_soc_energy_share"] = _share_below(compared, rows, np.abs(total) * volt)
    by_model = np.abs(total) * compared.simulated_volt
    row["simulated_last_15_soc_energy_share"] = _share_below(compared, rows, by_model)
    after = _rest_after(compared, rows)
    row |= _both(compared, "circulating_ampere", lambda ampere: _largest(ampere[after]))
    return row | _both(
        compared, "circulated_ampere_hour", lambda ampere: _circulated(time[after], ampere[after])
    )


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


def _both(compared, name, quantity):
    """A quantity of the measured and of the simulated branch currents (n, branches)."""
    pairs = (("", compared.measured_ampere), ("simulated_", compared.simulated_ampere))
    return {prefix + name: float(quantity(ampere)) for prefix, ampere in pairs}


def _spread(total, ampere, rows):
    """Range of the branch currents over their mean, mean over some rows [1]."""
    if not len(rows):
        return np.nan
    return np.mean(np.ptp(ampere[rows], axis=1) * ampere.shape[1] / np.abs(total[rows]))


def _share_below(compared, rows, power):
    """Share of a quantity that passes in the last 15 % of SoC [1]."""
    passed = passed_ampere_hour(compared.time_second[rows], power[rows])
    low = compared.soc[rows][1:] <= LOW_SOC
    return float(passed[low].sum() / passed.sum())


def _rest_after(compared, rows):
    """Rows of the rest after a discharge: slice, of no rows where there is none.

    What is sampled within a second of the load's end may lie within its edge.
    """
    loaded = ~at_rest_in_record(compared.total_ampere)
    stop = rows.stop + int(np.argmax(np.append(loaded[rows.stop :], True)))
    begin = compared.time_second[min(rows.stop, len(compared.time_second) - 1)] + 1.0
    first = int(np.searchsorted(compared.time_second, begin))
    return slice(min(first, stop), stop)


def _largest(ampere):
    """Largest branch current in the rest after the discharge [A]."""
    return np.abs(ampere).max() if len(ampere) else np.nan


def _circulated(time, ampere):
    """Charge that flows from branch to branch in that rest [Ah]: what one gives, another takes."""
    if len(ampere) < 2:
        return np.nan
    return np.abs(passed_ampere_hour(time, ampere).sum(axis=0)).sum() / 2


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
    down, bins = discharging(compared.total_ampere), np.round(np.linspace(0.0, 1.0, 21), 2)
    place = np.clip(np.digitize(compared.soc, bins) - 1, 0, len(bins) - 2)
    rows = []
    for k, (low, high) in enumerate(pairwise(bins)):
        inside = np.flatnonzero(down & (place == k))
        if len(inside):
            rows.append({"soc_low": low, "soc_high": high} | _of_bin(compared, inside))
    return rows


def _of_bin(compared, inside):
    total, branches = np.abs(compared.total_ampere[inside]), compared.measured_ampere.shape[1]
    ideal = total.mean() / branches
    error = compared.measured_ampere[inside] - compared.simulated_ampere[inside]
    row = {"samples": len(inside), "mean_branch_current_ampere": float(ideal)}

    def spread(ampere):
        return np.ptp(ampere[inside], axis=1).mean() * branches / total.mean()

    def largest(ampere):
        return np.abs(ampere[inside]).max(axis=1).mean() * branches / total.mean()

    row |= _both(compared, "spread", spread) | _both(compared, "largest_share", largest)
    return row | {"relative_current_rmse": rms(error) / float(ideal)}
