"""State of charge that the counted charge of a record begins at: anchors, full end, capacity."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.relaxing import still_to_go_volt
from cellwright.records.conditions import AT_REST_C_RATE, SAME_CHECKUP_CYCLES, low_current
from cellwright.records.facts import stated_capacity
from cellwright.refusal import Refusal
from cellwright.settings import Instrument

WHOLE_SWING = 0.9  # of the capacity: a record that moves so much has its place on the scale
SLOW_C_RATE = 1.1 / 15  # a slow test: C/15 by a rating that the cell need not have
CUTOFF_SHARE = 0.005  # of the upper cut-off: how near to it the end of a full charge is
SOC_RANGE = (-0.1, 1.1)  # counted SoC beyond it: the anchor, the charge or the capacity is wrong


AS_STATED = "stated at the start"  # what a record is counted from
REST_VOLT = 0.02  # that a rest may err by, beside half of what is between charge and discharge
# ASSUME: After ten minutes without load a cell is within 20 mV of its OCV, before within 100 mV.
RELAXED_SECOND, UNRELAXED_VOLT = 600.0, 0.1
EMPTY_REACHES = 0.6  # of the window: an emptied LFP cell relaxes towards its plateau
STATED_SOC = 0.05  # beyond what the rest allows, by which a stated SoC contradicts it


class FirstRest(NamedTuple):
    """How long a record rests at its start [s], and by how much it goes on to relax then [V]."""

    second: float = 0.0
    to_go_volt: float = 0.0


NO_REST = FirstRest()


def first_rest_of(time, voltage):
    """FirstRest of the rows of a record's first rest: (n,) [s], [V]; (n,) may be 0."""
    if not len(time):
        return FirstRest()
    ahead, std = still_to_go_volt(time, voltage, float(time[0]))
    return FirstRest(float(time[-1] - time[0]), abs(ahead) + 2 * std)


def contradiction(soc_at_start, rest_volt, limits, curve=None, *, rest=NO_REST):
    """Why a record's first rest contradicts the stated state of charge, "" where it does not.

    With an open-circuit voltage it tells a range of SoC: where the curve lies within 20 mV (of a
    rest of less than ten minutes, 100 mV), what it goes on to relax, and half of what is between
    charge and discharge, of the rest. The stated one may be 5 % beyond. Without, only a cell that
    is full below the middle of its window, or empty in its highest two fifths.

    Parameters
    ----------
    soc_at_start : stated [1]. rest_volt : at the end of the first rest [V], NaN under load: no
        contradiction.
    limits : lower and upper cut-off [V] or None. curve : mapping with soc [1], ocv_volt [V] and
        half_gap_volt [V, NaN or absent where not known], (m,) each; None: there is none.
    rest : FirstRest of the record; what was before it is not known.
    """
    if np.isnan(rest_volt):
        return ""
    if curve is not None:
        error = REST_VOLT if rest.second >= RELAXED_SECOND else UNRELAXED_VOLT
        low, high = soc_range_of_rest(rest_volt, curve, error_volt=error + rest.to_go_volt)
        if low - STATED_SOC <= soc_at_start <= high + STATED_SOC:
            return ""
        tells = f"{low:.2f} to {high:.2f} by the OCV"
    else:
        beyond = None in limits or STATED_SOC < soc_at_start < 1 - STATED_SOC
        if beyond or in_its_half(rest_volt, limits, full=soc_at_start > 0.5):
            return ""
        tells = f"no such cell between {limits[0]:g} and {limits[1]:g} V"
    return (
        f"the stated SoC of {soc_at_start:g} is not used: a rest at {rest_volt:.3f} V tells {tells}"
    )


def in_its_half(volt, limits, *, full):
    """Whether a voltage [V] is in the part of the window in which a full, or empty, cell may rest.

    Parameters
    ----------
    volt : of a rest [V]. limits : lower and upper cut-off [V]. full : of a full cell, else empty.
    """
    share = (volt - limits[0]) / (limits[1] - limits[0])
    return bool(share > 0.5) if full else bool(share <= EMPTY_REACHES)


def soc_range_of_rest(rest_volt, curve, *, error_volt=REST_VOLT):
    """Lowest and highest SoC that a rest voltage [V] may be, by a curve as in `contradiction`."""
    soc, ocv = (np.asarray(curve[name], float) for name in ("soc", "ocv_volt"))
    gap = curve.get("half_gap_volt")
    gap = np.zeros(len(soc)) if gap is None else np.nan_to_num(np.asarray(gap, float))
    above, below = (
        np.maximum.accumulate(ocv + way * (error_volt + np.abs(gap))) for way in (1, -1)
    )
    return float(np.interp(rest_volt, above, soc)), float(np.interp(rest_volt, below, soc))


class Anchored(NamedTuple):
    """State of charge (n,) [1], in words which anchor it is counted from, and the anchor's row.

    contradicted : why the first rest contradicts the stated SoC, "" where it does not.
    """

    soc: np.ndarray
    anchor: str
    row: int = 0
    contradicted: str = ""


# ASSUME: A charge that ends at the upper cut-off voltage with at most C/10 leaves the cell full.
# ASSUME: Where a record is anchored by its rest voltage, the cell had relaxed when it began.
# ASSUME: A record without another anchor that moves 90 % of the capacity leaves equal ends unused.
def soc_series(
    charge_ampere_hour,
    current_ampere,
    voltage_volt,
    *,
    capacity_ampere_hour,
    lower_cutoff_volt,
    upper_cutoff_volt,
    soc_at_start=None,
    curve=None,
    full_c_rate=0.1,
    test_time_second=None,
):
    """State of charge over a record: counted charge over capacity, from the best anchor there is.

    The first that applies: 1. the state of charge at the start, as stated, unless the rest that the
    record begins with contradicts it (`contradiction`), which is then said; 2. the record itself
    reaches full: a charge that ends at the upper cut-off with a current of at most `full_c_rate`;
    3. the record starts at rest, and its first voltage is looked up in the OCV table;
    4. the record moves at least 90 % of the capacity: what it leaves is shared by the two ends.

    Parameters
    ----------
    charge_ampere_hour : (n,) net charge since the first row, + on charge [Ah].
    current_ampere : (n,) [A], positive on charge.
    voltage_volt : (n,) [V].
    capacity_ampere_hour : what the scale from 0 to 1 refers to [Ah].
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None (not stated).
    soc_at_start : stated state of charge at the first row, 0 to 1 [1], or None.
    curve : open-circuit voltage, as in `contradiction`, SoC ascending; None: there is none.
    full_c_rate : largest current over capacity that may end a full charge [1/h].
    test_time_second : (n,) by which the rest that the record begins with is long or short [s]; None
        counts as short.

    Returns
    -------
    Anchored : the array may leave 0 to 1 where counting does; it is never clipped.

    Raises
    ------
    Refusal : no capacity, a stated SoC outside 0 to 1, or nothing to anchor to.
    """
    if not capacity_ampere_hour or not capacity_ampere_hour > 0:
        raise Refusal(f"capacity is {capacity_ampere_hour}; SoC needs a positive one")
    counted = np.asarray(charge_ampere_hour, float) / capacity_ampere_hour
    rate = np.asarray(current_ampere, float) / capacity_ampere_hour
    if soc_at_start is None:
        return _by_record(counted, rate, voltage_volt, upper_cutoff_volt, curve, full_c_rate)
    if not 0 <= soc_at_start <= 1:
        raise Refusal(f"stated SoC at the start is {soc_at_start}; allowed is 0 to 1")
    volt, rest = _first_rest(rate, voltage_volt, test_time_second)
    limits = lower_cutoff_volt, upper_cutoff_volt
    wrong = contradiction(soc_at_start, volt, limits, curve, rest=rest)
    if not wrong:
        return Anchored(float(soc_at_start) + counted - counted[0], AS_STATED)
    found = _by_record(counted, rate, voltage_volt, upper_cutoff_volt, curve, full_c_rate)
    return found._replace(anchor=f"{found.anchor}; {wrong}", contradicted=wrong)


def _first_rest(rate, voltage_volt, test_time_second):
    """Voltage at the end of the rest that a record begins with [V], NaN of none; its FirstRest."""
    idle = low_current(rate, 1.0)
    if not idle[0]:
        return np.nan, FirstRest()
    stop = len(idle) if idle.all() else int(np.argmin(idle))
    if test_time_second is None:
        return float(voltage_volt[stop - 1]), FirstRest()
    time, voltage = (np.asarray(c, float)[:stop] for c in (test_time_second, voltage_volt))
    return float(voltage[-1]), first_rest_of(time, voltage)


def _by_record(counted, rate, voltage_volt, upper_cutoff_volt, curve, full_c_rate):
    """Anchored by the record itself: the end of a full charge, a rest, or a whole swing."""
    full = full_row(rate, voltage_volt, upper_cutoff_volt, full_c_rate=full_c_rate)
    if full is not None:
        return Anchored(1.0 + counted - counted[full], "end of the full charge in the record", full)
    if curve is not None and low_current(rate[0], 1.0):
        # 0 or 1 beyond the table; a flat stretch gives its upper end.
        rising = np.maximum.accumulate(np.asarray(curve["ocv_volt"], float))
        start = float(np.interp(voltage_volt[0], rising, np.asarray(curve["soc"], float)))
        return Anchored(start + counted - counted[0], "rest voltage at the start, by the OCV table")
    span = float(np.ptp(counted))
    if span >= WHOLE_SWING:
        top = min((1 + span) / 2, 1.0)
        words = f"the record moves {span:.1%} of the capacity: its highest SoC is {top:.3f}"
        words = f"{words} ± {max(1 - span, 0) / 2:.3f}"
        return Anchored(top + counted - counted.max(), words, int(np.argmax(counted)))
    raise Refusal(_why_not_anchored(rate[0], upper_cutoff_volt, curve))


def refuse_impossible_soc(low, high, anchor, *, capacity_ampere_hour, source):
    """Refuse a counted SoC that no cell can have: its anchor, its charge and the capacity disagree.

    Which of the three is wrong is not known, and with it no SoC of the record.

    Parameters
    ----------
    low, high : least and largest SoC that was counted [1].
    anchor, source : what the SoC is counted from and what tells the capacity, in words.
    capacity_ampere_hour : that the SoC refers to [Ah].

    Raises
    ------
    Refusal : a SoC outside −0.1 to 1.1.
    """
    if low >= SOC_RANGE[0] and high <= SOC_RANGE[1]:
        return
    moved = (high - low) * capacity_ampere_hour
    raise Refusal(
        f"SoC of the record runs from {low:.3f} to {high:.3f}, outside −0.1 to 1.1: its SoC "
        f"({anchor}), its charge ({moved:.3g} Ah between the two) and the capacity of "
        f"{capacity_ampere_hour:.4g} Ah ({source}) contradict each other"
    )


def slow_soc(charge_ampere_hour, *, capacity_ampere_hour):
    """State of charge over the slow test that an OCV is from: empty where its discharge ends.

    That is what the scale of the OCV means by empty; its charge is slow from the start, so that no
    low current tells where it ends full.

    Parameters
    ----------
    charge_ampere_hour : (n,) net charge since the first row, + on charge [Ah].
    capacity_ampere_hour : what the scale from 0 to 1 refers to [Ah].

    Returns
    -------
    Anchored.
    """
    counted = np.asarray(charge_ampere_hour, float) / capacity_ampere_hour
    empty = int(np.argmin(counted))
    return Anchored(counted - counted[empty], "end of its slow discharge", empty)


def full_row(rate, voltage_volt, upper_cutoff_volt, *, full_c_rate=0.1):
    """Last row of the first charge that ends full, or None.

    Parameters: rate (n,) current over capacity [1/h], voltage_volt (n,) [V], cut-off [V] or None.
    """
    if upper_cutoff_volt is None:
        return None
    at_cutoff = np.asarray(voltage_volt) >= upper_cutoff_volt * (1 - CUTOFF_SHARE)
    charging = at_cutoff & (rate > AT_REST_C_RATE)
    slow = charging & (rate <= full_c_rate)
    ends = np.flatnonzero(slow & ~np.append(charging[1:], False))
    return int(ends[0]) if len(ends) else None


def _why_not_anchored(first_rate, upper_cutoff_volt, curve):
    """Why no anchor of the SoC applies to a record, in one sentence."""
    full = (
        "the upper cut-off is not stated, so no full charge can be told"
        if upper_cutoff_volt is None
        else f"the record never ends a charge full at {upper_cutoff_volt} V"
    )
    table = (
        "there is no OCV table"
        if curve is None
        else f"the record starts under a load of {abs(first_rate):.3g} C, not at rest"
    )
    return f"no state of charge: none is stated at the start, {full}, and {table}"


FULL_WINDOW = 0.03  # of the voltage window: how near to the upper cut-off a full cell rests
EMPTY_WINDOW = 0.01  # of it: how near to the lower cut-off a discharge ends empty
USUAL_CURRENT = 1.1  # of the usual current of the portions: the last of them may be short
WINDOW_VOLT = 1.0  # the window where no upper cut-off is stated


class Scale(NamedTuple):
    """SoC = 1 + (charge − full_ampere_hour) / capacity_ampere_hour.

    full_ampere_hour : net charge of the record at which the cell is full [Ah]. first_volt : voltage
    of its first row where that is at rest, else NaN [V]. source : of the capacity, start : of the
    full end, both in words.
    """

    full_ampere_hour: float
    capacity_ampere_hour: float
    first_volt: float
    source: str
    start: str


def rest_scale(
    current_ampere,
    voltage_volt,
    charge_ampere_hour,
    steps,
    capacities=(),
    *,
    ambient_temperature_celsius=None,
    cycle=None,
    soc_at_start=None,
    state_before="",
    rated_capacity_ampere_hour=None,
    state_of_health=None,
    lower_cutoff_volt,
    upper_cutoff_volt=None,
):
    """Full end and capacity of a record that discharges a cell in portions.

    SoC is known, by the first that applies, from: the stated one of the first row; the end of a
    full charge in the record; a first row at rest near the upper cut-off; a first row at rest after
    a test that left the cell full, which an aged cell needs: it rests lower; where no upper cut-off
    is stated, from a record that moves 90 % of the capacity, which then begins full. The capacity
    is what the record takes out where a constant current ends at the lower cut-off, else that of
    the cell's capacity test of the same check-up (else of the nearest in cycles) nearest in
    temperature (the slowest of them), else the rating, times the state of health that the sheet
    states; never less than the record takes out.

    Parameters
    ----------
    current_ampere, voltage_volt, charge_ampere_hour : (n,) [A] positive on charge, [V], net [Ah].
    steps : series.segments.Steps of the record.
    capacities : list of dict, rows of the capacity stage with test, cycle and
        ambient_temperature_celsius.
    ambient_temperature_celsius : of the record [°C] or None. cycle : of the record, None as 0.
    soc_at_start : stated [1] or None. state_before : "full", as the test before in time left the
        cell; "": not known.
    rated_capacity_ampere_hour, state_of_health : of the sheet [Ah], [1], or None.
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None.

    Returns
    -------
    Scale.

    Raises
    ------
    Refusal : no capacity is known, nothing tells where the record begins, or a stated SoC that
        contradicts the record's charge and the capacity.
    """
    current, voltage, charge = (
        np.asarray(column, float) for column in (current_ampere, voltage_volt, charge_ampere_hour)
    )
    if lower_cutoff_volt is None:
        raise Refusal(
            "the lower cut-off is not stated, so whether the record ends empty is unknown"
        )
    upper, window = upper_cutoff_volt, WINDOW_VOLT
    if upper is not None:
        window = upper - lower_cutoff_volt
    stated = stated_capacity(rated_capacity_ampere_hour, state_of_health)
    nominal, source = _nominal_capacity(capacities, ambient_temperature_celsius, cycle, stated)
    ends_empty = _ends_empty(steps, lower_cutoff_volt + EMPTY_WINDOW * window)
    rate = current / max(nominal, float(np.ptp(charge)))
    first = float(voltage[0]) if low_current(rate[0], 1.0) else np.nan
    share = 1.0 if ends_empty or not nominal else float(np.ptp(charge)) / nominal
    wrong = ""
    if soc_at_start is not None:
        wrong = contradiction(soc_at_start, first, (lower_cutoff_volt, upper))
    if soc_at_start is not None and not wrong:
        soc, at_charge = soc_at_start, charge[0]
        words = f"SoC {soc:g} is stated at its start"
        _refuse_stated(soc, charge, words, nominal, source)
    else:
        near = FULL_WINDOW * window if state_before != "full" else np.inf
        row, words = _full_row(rate, voltage, upper, near, share, first, wrong)
        soc, at_charge = 1.0, charge[row]
        words = "; ".join(filter(None, [words, wrong]))
    discharged = float(at_charge - charge.min())
    by_record = discharged / soc if soc > STATED_SOC else 0.0
    if ends_empty and by_record:
        nominal, source = by_record, "taken out to the lower cut-off, with rests between"
    elif not nominal:
        raise Refusal("no capacity: the record does not end empty, no capacity test and no rating")
    capacity = max(nominal, by_record)
    full = at_charge + (1 - soc) * capacity
    return Scale(float(full), capacity, first, source, words)


def first_rest(steps, time, voltage):
    """FirstRest of a record of these Steps and columns (n,) [s], [V]."""
    rests = len(steps.kind) and steps.kind[0] == "rest"
    stop = int(steps.last_row[0]) + 1 if rests else 0
    return first_rest_of(np.asarray(time, float)[:stop], np.asarray(voltage, float)[:stop])


def _refuse_stated(soc, charge, words, nominal, source):
    """Refuse a SoC stated at the start from which the charge leaves the scale of the capacity.

    Of a cell that is stated full a discharge beyond it contradicts the capacity alone, which the
    record itself then tells.
    """
    up, down = (float(moved - charge[0]) for moved in (charge.max(), charge.min()))
    capacity = nominal or max(up, -down)
    if not capacity:
        return
    low = soc + (down / capacity if soc < 1 else 0.0)
    about = {"capacity_ampere_hour": capacity, "source": source}
    refuse_impossible_soc(low, soc + up / capacity, words, **about)


# Of a capacity, by which two readings of one instrument may differ: less says nothing of how it
# repeats.
SINGLE_SHARE = 2.0 * Instrument().current_accuracy_share
UNSURE_SHARE = 0.03  # of a capacity: less sure ones count after the sure ones of their check-up


def is_unsure(row):
    """Whether the start of a capacity row, or its repeats, leave more than 3 % of it open."""
    std = row.get("capacity_std_ampere_hour")
    return std is not None and std > UNSURE_SHARE * row["capacity_ampere_hour"]


def tells_repeats(row):
    """Whether the standard deviation of a capacity says more than how sure one reading is."""
    unsure = row["capacity_std_ampere_hour"] > SINGLE_SHARE * row["capacity_ampere_hour"]
    return row.get("repeats", 1) > 1 or unsure


def capacity_in_words(row):
    """Which test a capacity row is of, and its standard deviation where that is large."""
    words = f"{row['direction']} of {row['test']} at {row['c_rate']:.2g}C"
    return f"{words}, ± {row['capacity_std_ampere_hour']:.2g} Ah" if is_unsure(row) else words


# ASSUME: A complete charge at C/15 or slower puts in what a discharge as slow takes out.
def telling_capacity(capacities):
    """Rows that tell a cell's capacity: its discharges, and its charges at C/15 or slower.

    Parameters
    ----------
    capacities : list of dict, rows of the capacity stage.
    """
    return [
        row for row in capacities if row["direction"] == "discharge" or row["c_rate"] <= SLOW_C_RATE
    ]


def _nominal_capacity(capacities, celsius, cycle, stated):
    """Capacity [Ah] of the nearest test in age, then temperature, else as stated; its source."""
    rows = telling_capacity(capacities)
    if not rows:
        return stated[0] or 0.0, stated[1]

    def distance(row):
        cycles = abs((row.get("cycle") or 0) - (cycle or 0))
        temperatures = row["ambient_temperature_celsius"], celsius
        kelvin = 0.0 if None in temperatures else abs(temperatures[0] - temperatures[1])
        return max(cycles, SAME_CHECKUP_CYCLES), is_unsure(row), kelvin, row["c_rate"]

    best = min(rows, key=distance)
    return best["capacity_ampere_hour"], capacity_in_words(best)


def _ends_empty(steps, limit_volt):
    """Whether a discharge at the usual current, not a larger pulse, ends at the lower cut-off."""
    kind, current = np.asarray(steps.kind), steps.current_mean_ampere
    portions = -current[(kind == "CC") & (current < 0)]
    usual = np.median(portions) if len(portions) else 0.0
    down = np.isin(kind, ("CC", "pulse")) & (current < 0) & (-current <= USUAL_CURRENT * usual)
    return bool((down & (steps.voltage_end_volt <= limit_volt)).any())


# ASSUME: A record that begins at rest within 3 % of the voltage window of the upper cut-off begins
# full; where no upper cut-off is stated, one that moves 90 % of the capacity begins full.
def _full_row(rate, voltage, upper, near_volt, share, first_volt, wrong):
    """Row at which a record is full, and in words why; wrong : what contradicts a stated SoC."""
    row = full_row(rate, voltage, upper)
    if row is not None:
        return row, "full at the end of its full charge"
    if upper is not None and first_volt >= upper - near_volt:
        return 0, f"full at its start, {1e3 * (upper - first_volt):.0f} mV below the upper cut-off"
    if upper is None and share >= WHOLE_SWING:
        moved = f"{share:.1%} of the capacity" if share < 1 else "all of the capacity"
        return 0, f"full at its start, taken so for it moves {moved}"
    beginning = "under load" if np.isnan(first_volt) else f"at {first_volt:.4g} V"
    wanted = f"rest within {near_volt:.2g} V of {upper:g} V" if upper is not None else ""
    wanted = (
        wanted or f"{WHOLE_SWING:.0%} of the capacity moved (found {share:.1%}), for want of limits"
    )
    stated = wrong or "none is stated"
    raise Refusal(f"no SoC at the start: {stated}, it begins {beginning}; wanted: {wanted}")
