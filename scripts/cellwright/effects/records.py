"""Records of a cell or of a parallel group laid end to end, and what they excite."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.instrument import load_direction
from cellwright.records.conditions import AT_REST_C_RATE, low_current
from cellwright.records.record import STATED, checked
from cellwright.records.thinning import driven
from cellwright.refusal import Refusal

GAP_SECOND = 30.0  # between two rows, from which the charge between them is the counter's
UNSEEN_SOC = 2e-3  # between two rows: less is error of the current, more is a gap
ALIKE = 5.0  # ratio of changes of the current in two rows, up to which they are alike
NEAR_END = 0.1  # of the SoC: a record that starts there was filled or emptied before
MOST_BRANCHES = 64
ADDS_UP = 0.25  # of the total's size, by which the branch currents may miss it
KELVIN = 5.0
SOC_RANGE = 0.3
REST_SECOND = 540.0
RATE_RATIO = 2.0
BOTH_SHARE = 0.02
EDGES = 20
SAMPLING_SECOND = 2.0
PARTS = 4  # of each record
DAY_SECOND = 86400.0
AGED_DAY = 7.0  # between the first and the last test, from which they may see different ages
AGE_SHARE = 0.25  # of that time, which the records fitted must span
MOST_EARLY_SECOND = 4.0  # by which an effect (`time_skew`) may read a voltage before its time


class Stack(NamedTuple):
    """Rows of several records of a cell or of a group, one record after the other.

    tests : names of the records. first : (f,) index of their first rows.
    file : (n,) number of the record of each row. second : (n,) time within the record [s].
    step_second : (n,) time since the row before [s], 0 in first rows.
    fresh : (n,) 1.0 in the first row of a record, else 0.0.
    current_ampere, voltage_volt, celsius : (n,) of the cell or the whole group [A], [V], [degC].
    hold : of the current between rows, see `stacked`.
    soc_at_start : (f,) of a cell, (f, branches) of a group [1].

    Of a group alone:
    branch_current_ampere : (n, branches) [A], None where one was not logged.

    Of a cell alone:
    kinds : of the records. held_ampere : (n,) current that flowed since the row before [A], 0 in
    first rows. linear : (n,) 1 where it moved on a straight line since the row before, else 0.
    direction : (n,) sign of the last load above C/100; before the first one that of the charge or
    discharge that led to the start, where that was full or empty, else 0.
    template_volt : (n,) part of the voltage that is given beside the circuit's: mean residual of
    healthy cells (paired mode), what a given model has and its companion has not (`own`) [V].
    used : (n,) bool, rows that are compared. unseen_ampere_hour : (n,) charge since
    the row before that the current between them does not explain: a gap in the record [Ah].
    responses : lags of the measured current, by time constant; kept, as most
    parameters of a model change neither. courses : `base.Course` of the last parameters that moved
    the charge, by their values; kept likewise.
    stated : (f,) bool, records of which no sensor told the temperature.
    least_digit_ampere, least_digit_volt : (f,) of the readings [A], [V].
    ohmic_course, slow_courses : (n,) resistance of a given model at each row over its mean, ohmic,
    and two of (n,) of the RC pairs, or None. tau_course : (n,) the same of their time constants.
    age : (f,) date of each record, from that of the test to which the model's capacity and
    resistances belong, over the time between the first and the last test of the search [1], None
    where a date is not known. aged_day : that time [d].
    anchor_row : (f,) row of each record whose SoC is known, the end of a full charge say; None
    where that is the first row of all. anchor_rise : (f,) its SoC over that at the start, as it was
    counted first [1].
    """

    tests: tuple
    first: np.ndarray
    file: np.ndarray
    second: np.ndarray
    step_second: np.ndarray
    fresh: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    celsius: np.ndarray
    hold: str
    soc_at_start: np.ndarray | None = None
    branch_current_ampere: np.ndarray | None = None
    kinds: tuple = ()
    held_ampere: np.ndarray | None = None
    linear: np.ndarray | None = None
    direction: np.ndarray | None = None
    template_volt: np.ndarray | None = None
    used: np.ndarray | None = None
    unseen_ampere_hour: np.ndarray | None = None
    responses: dict | None = None
    courses: dict | None = None
    stated: np.ndarray | None = None
    least_digit_ampere: np.ndarray | None = None
    least_digit_volt: np.ndarray | None = None
    ohmic_course: np.ndarray | None = None
    slow_courses: tuple | None = None
    tau_course: np.ndarray | float = 1.0
    anchor_row: np.ndarray | None = None
    anchor_rise: np.ndarray | None = None
    late_second: np.ndarray | None = None
    age: np.ndarray | None = None
    aged_day: float = 0.0

    @property
    def mean_celsius(self):
        """Mean temperature of each record (f,) [degC]."""
        return np.bincount(self.file, self.celsius) / np.bincount(self.file)

    def with_courses(self, ohmic, slow):
        """The same rows with courses of resistances (n,) or None: ohmic, and of either RC pair."""
        slow = None if slow is None else (slow, slow)
        return self._replace(ohmic_course=ohmic, slow_courses=slow, courses={})

    def first_rows(self, ends):
        """The first rows of each record: enough to simulate those before `ends` as the whole does.

        Every effect is causal but for a voltage that is read early and for the row from which a
        record's charge is counted; rows up to these are kept as well.

        Parameters
        ----------
        ends : (f,) of each record, the row behind the last one that is wanted.

        Returns
        -------
        stack : Stack of these rows. moved_up : (f,) by how many rows each record begins earlier.
        """
        ends = np.maximum(ends, self.first + 1)
        if self.anchor_row is not None:
            ends = np.maximum(ends, self.anchor_row + 1)
        pieces = []
        for begin, end, behind in zip(
            self.first, ends, [*self.first[1:], len(self.file)], strict=True
        ):
            early = self.second[end - 1] + MOST_EARLY_SECOND
            later = begin + int(np.searchsorted(self.second[begin:behind], early, side="right"))
            pieces.append(np.arange(begin, min(later + 1, behind)))
        rows = np.concatenate(pieces)
        first = np.cumsum([0, *map(len, pieces[:-1])])
        moved_up = self.first - first
        columns = {
            name: column[rows]
            for name, column in self._asdict().items()
            if isinstance(column, np.ndarray) and len(column) == len(self.file)
        }
        columns |= {"first": first, "responses": {}, "courses": {}}
        if self.slow_courses is not None:
            columns["slow_courses"] = tuple(course[rows] for course in self.slow_courses)
        if self.anchor_row is not None:
            columns["anchor_row"] = self.anchor_row - moved_up
        return self._replace(**columns), moved_up

    def part(self, files):
        """The rows of some of the records, by their numbers, as a mask (n,)."""
        return np.isin(self.file, files)


def stacked(records, *, capacity_ampere_hour, hold="zero_order", ages=None):
    """Stack of the records of a cell, one after the other.

    Parameters
    ----------
    records : sequence of Record.
    capacity_ampere_hour : of the cell, for the smallest load that counts [Ah].
    hold : in a drive, "zero_order": between two rows the current of the earlier one flows;
        "first_order": it moves on a straight line. Where it only steps between steady stretches,
        it is held at a step and moves on a straight line elsewhere.
    ages : Ages of all records of the search, or None.

    Returns
    -------
    stack : Stack.

    Raises
    ------
    Refusal : no record; a value that is not finite, or a clock that runs back, with test and row.
    """
    if not records:
        raise Refusal("no record to look for a missing effect in")
    for record in records:
        _check(record)
    rows = _rows(records, hold)
    step, fresh, current = rows["step_second"], rows["fresh"], rows["current_ampere"]
    before = np.concatenate([[0.0], current[:-1]])
    linear = np.concatenate([_linear(r, hold) for r in records])
    held = np.where(linear, (before + current) / 2, before)
    held = held * (1.0 - fresh)
    least = {"least_ampere": AT_REST_C_RATE * capacity_ampere_hour, "near_end_soc": NEAR_END}
    loads = [load_direction(r.current_ampere, soc_at_start=r.soc[0], **least) for r in records]
    held, unseen = _counted(records, held, step, linear, capacity_ampere_hour)
    moved = np.cumsum(held * step / 3600.0 + unseen) / capacity_ampere_hour
    anchors = rows["first"] + np.array([_anchor_row(record) for record in records])
    return Stack(
        **rows,
        kinds=tuple(record.kind for record in records),
        held_ampere=held,
        direction=np.concatenate(loads),
        soc_at_start=np.array([record.soc[0] for record in records]),
        linear=linear * (1.0 - fresh),
        template_volt=np.zeros(len(fresh)),
        used=np.concatenate([record.used for record in records]),
        unseen_ampere_hour=unseen,
        responses={},
        courses={},
        stated=np.array([record.temperature_source in STATED for record in records]),
        least_digit_ampere=np.array([record.least_digit_ampere for record in records]),
        least_digit_volt=np.array([record.least_digit_volt for record in records]),
        anchor_row=None if np.all(anchors == rows["first"]) else anchors,
        anchor_rise=moved[anchors] - moved[rows["first"]],
        age=None if ages is None else np.array([ages.of(record) for record in records]),
        aged_day=0.0 if ages is None else ages.day,
    )


class Ages(NamedTuple):
    """Dates between which the tests of a search were made, and that which its model belongs to.

    first_second, last_second, reference_second : since 1970 [s].
    """

    first_second: float
    last_second: float
    reference_second: float

    @property
    def day(self):
        """Time between the first and the last test [d]."""
        return (self.last_second - self.first_second) / DAY_SECOND

    def of(self, record):
        """Age of a record: its date from that of the model, over the time between all tests [1]."""
        return (record.started_second - self.reference_second) / (DAY_SECOND * self.day)


def ages_of(records, *, reference=None):
    """Ages of the records of a search, fitted and judging: Ages, or None.

    None where a date is not known, or where all tests were made within `AGED_DAY`: no cell ages by
    what shows in a few days. The model belongs to the date of the reference, whose capacity and
    OCV it has, else to the mean date.

    Parameters
    ----------
    records : sequence of Record. reference : name of the test that the OCV is from, or None.
    """
    dates = [record.started_second for record in records]
    if not dates or None in dates or max(dates) - min(dates) < AGED_DAY * DAY_SECOND:
        return None
    known = [d for d, record in zip(dates, records, strict=True) if record.test == reference]
    return Ages(min(dates), max(dates), known[0] if known else float(np.mean(dates)))


def _anchor_row(record):
    """Number of the row of a record from which its SoC is counted, or of the nearest in time."""
    if record.anchor_second is None:
        return 0
    return int(np.argmin(np.abs(record.test_time_second - record.anchor_second)))


def parts_of(stack):
    """Which quarter of which record each row is in: number (n,), counted over all records.

    Errors of different quarters are taken as independent.

    Parameters
    ----------
    stack : Stack.
    """
    part = np.zeros(len(stack.file), int)
    for k in range(len(stack.first)):
        rows = np.flatnonzero(stack.file == k)
        part[rows] = PARTS * k + PARTS * np.arange(len(rows)) // len(rows)
    return part


def _rows(records, hold):
    """Columns of any stack, by name: records one after the other."""
    sizes = [len(record.test_time_second) for record in records]
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    fresh = np.zeros(sum(sizes))
    fresh[first] = 1.0
    second = _joined(records, "test_time_second")
    return {
        "tests": tuple(record.test for record in records),
        "first": first,
        "file": np.repeat(np.arange(len(records)), sizes),
        "second": second,
        "step_second": np.diff(second, prepend=second[0]) * (1.0 - fresh),
        "fresh": fresh,
        "current_ampere": _joined(records, "current_ampere"),
        "voltage_volt": _joined(records, "voltage_volt"),
        "celsius": _joined(records, "celsius"),
        "hold": hold,
    }


def _joined(records, name):
    return np.ascontiguousarray(np.concatenate([getattr(r, name) for r in records]), float)


def _linear(record, hold):
    """Mask of rows to which the current moved on a straight line; in a drive all or none, by hold.

    Where rows were thinned out of a drive, its current has moved little, by steps or gradually.
    Between steady stretches it steps, unless it changes alike in three rows (constant voltage).
    Held from row to row there, it would count up to a percent of a charge too much.
    """
    moved = np.diff(record.current_ampere, prepend=record.current_ampere[:1])
    thinned = record.thinned
    if driven(np.cumsum(np.where(thinned, 0.0, moved))):
        return thinned | (hold == "first_order")
    size = np.abs(moved)
    alike = np.maximum(size[1:], size[:-1]) <= ALIKE * np.minimum(size[1:], size[:-1])
    alike &= moved[1:] * moved[:-1] > 0
    gradual = thinned.copy()
    three = alike[1:] & alike[:-1]
    for first in range(3):
        gradual[first : first + len(three)] |= three
    return gradual


def _counted(records, held, step, linear, capacity):
    """Mean currents between rows by the charge counter [A], and charge that none explains [Ah].

    Where rows were thinned out and the current has not stepped, the counter has the charge between
    the rows left; across a gap of the record only the counter has it, beyond rounding.
    """
    passed = np.concatenate([np.diff(r.soc, prepend=r.soc[:1]) for r in records]) * capacity
    beyond = np.nan_to_num(passed - held * step / 3600.0)
    unseen = np.where((step > GAP_SECOND) & (np.abs(beyond) > UNSEEN_SOC * capacity), beyond, 0.0)
    thinned = np.concatenate([r.thinned for r in records])
    gradual = thinned & linear & (step > 0) & (unseen == 0)
    more = np.divide(3600.0 * beyond, step, out=np.zeros(len(step)), where=gradual)
    return held + more, unseen


def _check(record):
    """Refuse a record that `checked` refuses, with the name of its test."""
    try:
        checked(record)
    except Refusal as refusal:
        raise Refusal(f"{record.test}: {refusal}") from refusal


def group_stacked(records, *, branches, hold="zero_order"):
    """Stack of the records of a group, one after the other.

    Parameters
    ----------
    records : Records of a group. branches : how many cells are in parallel.
    hold : "zero_order": between two rows the total of the earlier one flows; "first_order": it
        moves on a straight line.

    Returns
    -------
    stack : Stack, without SoC at the starts. Where one record lacks branch currents, those of the
        others are not used.

    Raises
    ------
    Refusal : no record; fewer than two branches; a value that is not finite; a clock that runs
        back; another number of branch currents than branches; branch currents that do not add up
        to the total (a turned sign, another unit).
    """
    if not records:
        raise Refusal("no record to look for a missing effect of a group in")
    if not 2 <= branches <= MOST_BRANCHES:
        raise Refusal(f"a group of {branches} branches; 2 to {MOST_BRANCHES} were wanted")
    for record in records:
        _check(record)
        if record.branch_current_ampere is not None:
            _check_sum(record, branches)
    logged = all(record.branch_current_ampere is not None for record in records)
    currents = _joined(records, "branch_current_ampere") if logged else None
    return Stack(**_rows(records, hold), branch_current_ampere=currents, responses={})


def _check_sum(record, branches):
    currents = np.asarray(record.branch_current_ampere, float)
    wrong = np.argwhere(~np.isfinite(currents))
    if len(wrong):
        (row, *_), value = wrong[0], currents[tuple(wrong[0])]
        raise Refusal(f"{record.test}: row {row} of branch_current_ampere is {value}, not a number")
    if currents.shape != (len(record.test_time_second), branches):
        raise Refusal(f"{record.test}: branch currents {currents.shape} of {branches} branches")
    total = record.current_ampere
    miss, size = (np.sqrt(np.mean(np.square(x))) for x in (currents.sum(axis=1) - total, total))
    if miss > ADDS_UP * size:
        raise Refusal(
            f"{record.test}: the branch currents miss the total by {miss:.3g} A (root mean square) "
            f"of {size:.3g} A: is a sign turned, a branch missing, or a unit another?"
        )


def two_temperatures(stack, capacity=None):
    """Whether the records of a stack are at two temperatures; whatever the capacity is."""
    means = [stack.celsius[stack.file == k].mean() for k in range(len(stack.first))]
    return bool(np.ptp(means) >= KELVIN)


def _both(stack, capacity):
    loads = np.abs(stack.current_ampere) * stack.step_second
    total = loads.sum()
    charging = loads[stack.current_ampere > 0].sum()
    return total > 0 and min(charging, total - charging) / total >= BOTH_SHARE


def _soc_range(stack, capacity):
    moved = stack.held_ampere * stack.step_second / 3600.0 / capacity
    spans = [np.ptp(np.cumsum(moved[stack.file == k])) for k in range(len(stack.first))]
    starts = stack.soc_at_start
    return max(spans) >= SOC_RANGE or np.ptp(starts) >= SOC_RANGE


def _rates(stack, capacity):
    loads = np.abs(stack.current_ampere)
    loads = loads[~low_current(loads, capacity)]
    low, high = np.percentile(loads, [10, 95]) if len(loads) else (1.0, 1.0)
    return high / low >= RATE_RATIO


def _long_rest(stack, capacity):
    rest = low_current(stack.current_ampere, capacity)
    edges = np.flatnonzero(np.diff(np.r_[0, rest & (stack.fresh == 0), 0]))
    clock = np.cumsum(stack.step_second)
    lasting = [clock[end - 1] - clock[begin] for begin, end in edges.reshape(-1, 2)]
    return max(lasting, default=0.0) >= REST_SECOND


def _edges(stack, capacity):
    step = np.abs(np.diff(stack.current_ampere, prepend=stack.current_ampere[0]))
    sharp = (step > 0.2 * capacity) & (stack.fresh == 0) & (stack.step_second <= SAMPLING_SECOND)
    return sharp.sum() >= EDGES


def _age(stack, capacity):
    return stack.age is not None and np.ptp(stack.age) >= AGE_SHARE


FACTORS = {
    "temperature": (two_temperatures, f"mean temperatures of the records {KELVIN:g} K apart"),
    "both_directions": (_both, "charge and discharge within the records"),
    "soc_range": (_soc_range, f"{100 * SOC_RANGE:g} % of the state of charge"),
    "rates": (_rates, f"loads that differ by a factor of {RATE_RATIO:g}"),
    "long_rest": (_long_rest, f"a rest of {REST_SECOND / 60:g} min"),
    "edges": (_edges, f"{EDGES} sharp steps of the current, sampled every {SAMPLING_SECOND:g} s"),
    "age": (_age, f"dates of all tests, the first and the last {AGED_DAY:g} days apart"),
}


def lacking(effect, stack, capacity_ampere_hour):
    """Needs of an effect that a stack of records does not excite, in words: tuple of str."""
    return tuple(
        FACTORS[name][1]
        for name in effect.needs
        if not FACTORS[name][0](stack, capacity_ampere_hour)
    )
