"""One life of a cell from its ageing records: joined, in order, what is comparable marked."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.health.table import CHECK_UP, CYCLES
from cellwright.numerics.statistics import robust_std
from cellwright.records.conditions import same_rate, same_temperature
from cellwright.refusal import Refusal

# Columns of stage `ageing_cycles` that a life is made of.
COLUMNS = (
    *("cycle", "direction", "start_time_second", "c_rate"),
    *("capacity_ampere_hour", "energy_watt_hour", "coulombic_efficiency"),
)
NEIGHBOURS = 4  # discharges on each side of which the median tells what one should be


class AgeingRecord(NamedTuple):
    """One ageing record of a cell, as a test of its sheet.

    first_cycle : of the sheet, None where blank. ambient_temperature_celsius : likewise [°C].
    columns : of stage `ageing_cycles`. shift_ampere_hour : by start_time_second, what temperature
    added to a discharge [Ah]; empty where that is not told from nothing.
    """

    test: str
    first_cycle: float | None
    ambient_temperature_celsius: float | None
    columns: dict
    shift_ampere_hour: dict


class Life(NamedTuple):
    """Discharges of a life in order, arrays of shape (n,), and sentences on what was left out.

    test : record of each. cycle : [1]. start_time_second : within its record [s].
    throughput_ampere_hour : discharged up to its end, of what the records hold [Ah].
    capacity_ampere_hour : measured. at_reference_ampere_hour : temperature taken out.
    energy_watt_hour, coulombic_efficiency, energy_efficiency : of the discharge; over the charge
    before it. pause_hour : rest before it beyond what is usual; 0 none, NaN at the start of a
    record that follows another one (length not known). used : whether comparable with the others.
    reason : why not. source : CYCLES of ageing records, or CHECK_UP where nothing else is known.
    """

    test: np.ndarray
    cycle: np.ndarray
    start_time_second: np.ndarray
    throughput_ampere_hour: np.ndarray
    capacity_ampere_hour: np.ndarray
    at_reference_ampere_hour: np.ndarray
    energy_watt_hour: np.ndarray
    coulombic_efficiency: np.ndarray
    energy_efficiency: np.ndarray
    pause_hour: np.ndarray
    used: np.ndarray
    reason: np.ndarray
    notes: tuple
    source: str = CYCLES


# ASSUME: Where records overlap on the sheet's cycle numbers these count equivalent full cycles.
def life_of(records, *, rated_capacity_ampere_hour):
    """Discharges of all ageing records of a cell as one life.

    1. Records are put in order of their first cycle; at one chamber temperature only (the one
    with most discharges), since age must not pass for temperature. 2. Discharges are numbered on
    from the first cycle of their record. Where a record so overtakes the next one, its discharges
    count as what they moved over the rating (equivalent full cycles), as the sheet's numbers then
    do. 3. A discharge is left out whose rate differs from the usual one by more than 12 %, or
    whose capacity is further than eight typical steps from what its neighbours let expect: it
    did not begin or end like them. So is the first one of the life: what came before it is not
    known, and a cell that rested long, full, gives more.

    Parameters
    ----------
    records : list of AgeingRecord. rated_capacity_ampere_hour : [Ah] or None.

    Returns
    -------
    life : Life.

    Raises
    ------
    Refusal : a record among several lacks its first cycle; records overlap; no discharge.
    """
    kept, notes = _at_one_temperature(_in_order(records))
    rated = rated_capacity_ampere_hour
    counts = [_cycle_numbers(record, None) for record in kept]
    if any(_overlaps(counts)) and rated:
        counts = [_cycle_numbers(record, rated) for record in kept]
        notes += ("cycles are equivalent full cycles: counted discharges would overlap",)
    for place in np.flatnonzero(list(_overlaps(counts))):
        raise Refusal(
            f"cycles out of order: {kept[place].test} ends at cycle {counts[place][-1]:.1f}, "
            f"{kept[place + 1].test} begins with {counts[place + 1][0]:.1f}; wanted records "
            "that follow each other"
        )
    parts = [_columns(*part) for part in zip(kept, counts, strict=True)]
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    joined["pause_hour"][0] = 0.0
    joined["throughput_ampere_hour"] = np.cumsum(joined["capacity_ampere_hour"])
    used, reason = _comparable(joined)
    left = [f"{np.sum(reason == word)} discharges: {word}" for word in np.unique(reason[~used])]
    del joined["c_rate"]
    return Life(**joined, used=used, reason=reason, notes=(*notes, *left))


def life_of_check_ups(check_ups):
    """Life of a cell that was cycled between check-ups without a record, from these alone.

    Each check-up counts: nothing tells which one is unlike its neighbours. What was discharged in
    between is not known, nor how long the cell rested.

    Parameters
    ----------
    check_ups : rows of stage `checkups`, of one rate, direction and temperature each.

    Raises
    ------
    Refusal : no check-up has a capacity.
    """
    rows = [row for row in check_ups if np.isfinite(row["capacity_ampere_hour"])]
    if not rows:
        raise Refusal("no capacity at any check-up")
    rows = sorted(rows, key=lambda row: row["cycle"])
    capacity, cycle, energy = (
        np.array([row[name] for row in rows], float)
        for name in ("capacity_ampere_hour", "cycle", "energy_watt_hour")
    )
    unknown = np.full(len(rows), np.nan)
    return Life(
        test=np.full(len(rows), CHECK_UP),
        cycle=cycle,
        start_time_second=unknown,
        throughput_ampere_hour=unknown,
        capacity_ampere_hour=capacity,
        at_reference_ampere_hour=capacity,
        energy_watt_hour=energy,
        coulombic_efficiency=unknown,
        energy_efficiency=unknown,
        pause_hour=np.zeros(len(rows)),
        used=np.ones(len(rows), bool),
        reason=np.full(len(rows), ""),
        notes=(f"no ageing record: the fade is that of {len(rows)} check-ups",),
        source=CHECK_UP,
    )


def _in_order(records):
    """Records with discharges in order of their first cycles."""
    able = [record for record in records if np.any(record.columns["direction"] == "discharge")]
    if not able:
        raise Refusal("no complete discharge in any ageing record")
    blank = [record.test for record in able if record.first_cycle is None]
    if len(blank) > 1:
        raise Refusal(
            f"ageing records without a cycle number: {', '.join(blank)}; wanted `cycle` of the "
            "sheet in all but the first, else their order is not known"
        )
    return sorted(able, key=lambda record: record.first_cycle or 0.0)


def _at_one_temperature(records):
    """Records at the chamber temperature with most discharges, and a sentence on the others."""
    stated = [r for r in records if r.ambient_temperature_celsius is not None]
    known = sorted({r.ambient_temperature_celsius for r in stated})
    if not known or same_temperature(known[0], known[-1]):
        return records, ()
    sizes = dict.fromkeys(known, 0)
    for record in stated:
        sizes[record.ambient_temperature_celsius] += len(record.columns["cycle"])
    usual = max(sizes, key=sizes.get)
    kept = [r for r in stated if same_temperature(r.ambient_temperature_celsius, usual)]
    others = [r.test for r in records if r not in kept]
    temperatures = ", ".join(f"{value:g}" for value in known)
    return kept, (
        f"mixed temperatures ({temperatures} °C): the life is that at {usual:g} °C; left out "
        f"{', '.join(others)}",
    )


def _cycle_numbers(record, rated):
    """Cycle of each discharge; with a rating, in equivalent full cycles."""
    discharges = record.columns["direction"] == "discharge"
    if rated is None:
        return record.columns["cycle"][discharges]
    moved = np.cumsum(record.columns["capacity_ampere_hour"][discharges])
    return (record.first_cycle or 0.0) + moved / rated


def _overlaps(counts):
    """Of each pair of records in order, whether the second begins before the first one ends."""
    return (later[0] <= earlier[-1] for earlier, later in pairwise(counts))


def _columns(record, cycle):
    """Columns of a Life of one record, and the rate of each discharge."""
    columns = record.columns
    discharge = np.flatnonzero(columns["direction"] == "discharge")
    capacity = columns["capacity_ampere_hour"][discharge]
    start = columns["start_time_second"][discharge]
    shift = np.array([record.shift_ampere_hour.get(float(second), 0.0) for second in start])
    # Energy efficiency needs the charge right before a discharge.
    before = np.maximum(discharge - 1, 0)
    follows = (columns["direction"][before] == "charge") & np.isfinite(
        columns["coulombic_efficiency"][discharge]
    )
    energy = columns["energy_watt_hour"]
    return {
        "test": np.full(len(discharge), record.test),
        "cycle": np.asarray(cycle, float),
        "start_time_second": start,
        "capacity_ampere_hour": capacity,
        "at_reference_ampere_hour": capacity - shift,
        "energy_watt_hour": energy[discharge],
        "coulombic_efficiency": columns["coulombic_efficiency"][discharge],
        "energy_efficiency": np.where(follows, energy[discharge] / energy[before], np.nan),
        "pause_hour": _pauses(start / 3600, cycle),
        "c_rate": columns["c_rate"][discharge],
    }


def _pauses(hour, cycle):
    """Time beyond the usual interval before each discharge [h]; NaN before the first one."""
    interval = np.diff(hour)
    if not len(interval):
        return np.array([np.nan])
    # Where the record skips cycles, an interval spans several usual ones.
    steps = np.maximum(np.diff(cycle), 1.0) if np.all(np.diff(cycle) >= 1) else 1.0
    usual = np.median(interval / steps)
    beyond = interval - usual * steps
    # Twice the usual interval, and some hours: what is shorter brings nothing back.
    return np.append(np.nan, np.where(beyond > max(usual, 6.0), beyond, 0.0))


def _comparable(joined):
    """Which discharges are like their neighbours, and why the others are not."""
    rate, capacity = joined["c_rate"], joined["at_reference_ampere_hour"]
    usual = np.median(rate)
    reason = np.where(same_rate(rate, usual), "", f"not at the usual rate of {usual:.2g}C")
    reason = reason.astype(object)
    if len(reason) > 12:  # of a short life each discharge counts
        reason[0] = "the first of the life: what came before it is not known"
    # The first round's outliers widen the typical step, the second is without them.
    for _ in range(2):
        able = np.flatnonzero(reason == "")
        step = robust_std(np.diff(capacity[able]))
        # What is within 0.3 % of the capacity is never an outlier, however quiet the life.
        limit = max(8.0 * step, 0.003 * np.median(capacity))
        off = np.array([_deviation(capacity[able], k) for k in range(len(able))])
        reason[able[off > limit]] = "capacity unlike that of its neighbours"
    return reason == "", reason.astype(str)


def _deviation(capacity, place):
    """How far a discharge lies from what its neighbours let expect [Ah].

    Nothing between the median of those before and that of those after it, which a bend or a jump
    after a pause obeys too; at an end, from the line through its neighbours.
    """
    before = capacity[max(place - NEIGHBOURS, 0) : place]
    after = capacity[place + 1 : place + 1 + NEIGHBOURS]
    if min(len(before), len(after)) > 1:
        low, high = sorted((np.median(before), np.median(after)))
        return max(low - capacity[place], capacity[place] - high, 0.0)
    side = before[::-1] if len(before) > len(after) else after
    if len(side) < NEIGHBOURS:
        return 0.0
    steps = np.arange(1.0, len(side) + 1)
    line = np.polynomial.polynomial.polyfit(steps, side, 1)
    options = (line[0], np.median(side))
    return min(abs(capacity[place] - value) for value in options)


def temperature_shift(summary, cycles):
    """What temperature added to each discharge [Ah], by its start time [s]: dict.

    Empty where the slope is within two standard deviations of none, for taking out what is not
    known would add the fade's own course to it.

    Parameters
    ----------
    summary : row of stage `ageing_temperature`. cycles : columns of `ageing_temperature_cycles`.
    """
    slope = summary["slope_percent_per_kelvin"]
    std = summary["slope_std_percent_per_kelvin"]
    if not np.isfinite(slope) or abs(slope) < 2.0 * std:
        return {}
    shift = cycles["capacity_ampere_hour"] - cycles["capacity_at_reference_ampere_hour"]
    seconds = cycles["start_time_second"]
    return {float(second): float(value) for second, value in zip(seconds, shift, strict=True)}
