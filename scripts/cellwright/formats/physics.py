"""What was read, checked against physics: what cannot be what its label says is refused."""

import numpy as np

from cellwright.formats.fields import IMPEDANCE, MINUS, NET, SERIES
from cellwright.formats.pieces import (
    all_where,
    any_where,
    count_where,
    median_of,
    pieces,
    rows_where,
)
from cellwright.refusal import Refusal

# Times by which clock × current may differ from the instrument's counter by a wrong unit alone, and
# what is then wrong: of the clock, the current, the counter.
SUSPICIONS = {
    1000.0: ("ms read as s", "mA read as A", "Ah under a label in mAh"),
    3600.0: ("s read as h", "", ""),
    60.0: ("s read as min", "", ""),
    1 / 1000: ("s read as ms", "A read as mA", "mAh under a label in Ah"),
    1 / 60: ("min read as s", "", ""),
    1 / 3600: ("h read as s", "", "ampere-seconds read as ampere-hours"),
    1 / 86400: ("days read as s", "", ""),
}


COLDEST, HOTTEST = -60.0, 150.0  # degC that a thermometer on a cell may show


def checked_series(columns: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """The columns of a series, if they can be one, and notes on what was converted or left out.

    Channels that were not connected are left out.

    Raises
    ------
    Refusal
        Fewer than two rows, a column without numbers, time that never moves, a voltage that is
        none, a clock or current at odds with the instrument's ampere-hour counter.
    """
    _refuse_empty(columns, SERIES)
    time, current, voltage = (columns[name] for name in SERIES)
    _refuse_channels_by_rows(current, voltage)
    if np.nanmin(time) == np.nanmax(time):
        raise Refusal(f"time never moves: all {time.size} rows say {np.nanmin(time):g} s")
    _refuse_voltage(voltage)
    columns, said = clock_of_steps(_dates_in_seconds(columns))
    columns, notes = clock_by_dates(columns)
    notes = [*said, *notes]
    time = columns["test_time_second"]
    if NET in columns:
        _refuse_clock(columns)
    return _without_impossible_channels(_without_dead_channel(columns, notes), notes), notes


def checked_impedance(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns of an impedance spectrum, if they can be one.

    minus_impedance_imaginary_ohm, as a file may label it, becomes impedance_imaginary_ohm.

    Raises
    ------
    Refusal
        Fewer than two rows, a column without numbers, a frequency that is not above zero or
        never moves, a cell that would be inductive at its lowest frequencies.
    """
    columns = dict(columns)
    labelled_minus = MINUS in columns
    if labelled_minus:
        columns[IMPEDANCE[2]] = -columns.pop(MINUS)
    _refuse_empty(columns, IMPEDANCE)
    frequency, _, imaginary = (columns[name] for name in IMPEDANCE)
    if not (np.nanmin(frequency) > 0 and np.nanmin(frequency) < np.nanmax(frequency)):
        raise Refusal(f"frequencies run from {np.nanmin(frequency):g} Hz and must move above 0 Hz")
    level = np.log(frequency[frequency > 0])
    risen = np.max(level - np.minimum.accumulate(level))
    fallen = np.max(np.maximum.accumulate(level) - level)
    if min(risen, fallen) > 0.5 * np.ptp(level):
        raise Refusal(
            "the frequency runs more than once through its range: several spectra; export each to "
            "a file of its own"
        )
    slow = frequency <= np.nanmedian(frequency)
    if np.nanmedian(imaginary[slow]) > 0:
        holds = "Im(Z) under a label of -Im(Z)" if labelled_minus else "-Im(Z)"
        raise Refusal(
            "imaginary impedance is positive at low frequencies, where a cell's is negative: the "
            f"column holds {holds}, "
            "or this is no cell but a shunt, a lead or a coil; correct its label: Z'' (Ohm) is "
            "negative where a cell is capacitive, -Z'' (Ohm) positive"
        )
    return columns


def _refuse_empty(columns: dict[str, np.ndarray], required: tuple[str, ...]) -> None:
    rows = columns[required[0]].size
    if rows < 2:
        raise Refusal(f"{rows} row(s) of data; at least two are wanted")
    for name in required:
        if not any_where(np.isfinite, columns[name]):
            raise Refusal(f"column {name} holds no number in any of its {rows} rows")


def _refuse_channels_by_rows(current, voltage):
    """Refuse rows of which each holds a current or a voltage, but hardly one both."""
    alone = count_where(lambda i, v: np.isfinite(i) ^ np.isfinite(v), current, voltage)
    if 2 * alone > len(current):
        raise Refusal(
            f"current and voltage stand in rows of their own ({alone} of {len(current)} rows hold "
            "one of them): export one row for each time, with both"
        )


def _refuse_voltage(voltage: np.ndarray) -> None:
    """Refuse a voltage that no cell has; wide limits, for a wrong unit or a dead channel."""
    lowest, highest = 0.01, 1000.0
    # Where most rows lie within, so does their median.
    if _mostly_within(voltage, lowest, highest):
        return
    middle = float(np.nanmedian(np.abs(voltage)))
    if middle == 0:
        raise Refusal("voltage is 0 V in most rows: the sense leads were not connected")
    if not lowest <= middle <= highest:
        raise Refusal(f"voltages around {middle:g} V are no cell's: millivolt and volt confused?")


def _mostly_within(values, lowest, highest):
    """Whether most of values lie within limits, and therefore their median does."""
    within = count_where(lambda x: (x >= lowest) & (x <= highest), values)
    return 2 * within > len(values)


def _refuse_clock(columns) -> None:
    """Refuse a record whose charge by clock and current contradicts its counter by a unit.

    Dates that run with the clock leave the current and the counter.
    """
    time, current, counter = (columns[name] for name in (*SERIES[:2], NET))
    expected, seen = charge_by_clock_and_counter(time, current, counter)
    unix = columns.get("unix_time_second")
    dated = unix is not None and abs(np.nanmedian(date_slopes(time, unix)) - 1) <= SAME_CLOCK
    for factor, wrong in SUSPICIONS.items():
        if abs(expected / seen / factor - 1) < 0.1:
            names = ("time", "current", "charge counter")[int(dated) :]
            which = [f"the {n} ({w})" for n, w in zip(names, wrong[int(dated) :], strict=True) if w]
            raise Refusal(
                f"time × current moves {expected:.4g} Ah, the file's own charge counter "
                f"{seen:.4g} Ah, {factor:.4g} times apart. The unit is wrong for "
                f"{' or '.join(which) or 'one of them'}: correct the label of that column"
            )


def charge_by_clock_and_counter(time, current, counter) -> tuple[float, float]:
    """∫|I|dt and the counter's own travel [Ah]; NaN where either did not move.

    Only intervals in which the current is steady count: there the trapezoid is right whatever the
    sampling. Gaps and resets are left out by the same condition on the clock.
    """
    typical = median_of(lambda t: _above_zero(np.diff(t)), time, beside=1)
    expected = seen = 0.0
    resolution = np.inf
    for rows in pieces(len(time), beside=1):
        step, moved = np.diff(time[rows]), np.abs(np.diff(counter[rows]))
        mean = 0.5 * np.abs(current[rows][1:] + current[rows][:-1])
        change = np.abs(np.diff(current[rows]))
        steady = (change < 0.05 * mean) & (step > 0) & (step <= 10 * typical)
        expected += np.nansum((mean * step)[steady]) / 3600
        seen += np.nansum(moved[steady])
        resolution = np.min(moved[moved != 0], initial=resolution)
    # A counter shown with few digits has to move by many of its steps before it can be a judge.
    told = seen > 20 * resolution and expected > 0
    return (float(expected), float(seen)) if told else (np.nan, np.nan)


def _above_zero(values):
    return values[values > 0]


# No record begins 30 years after its clock did, and none holds a date beyond the year 5000, or one
# in milliseconds before 1990.
LONGEST_RECORD, LATEST_DATE, FIRST_DATE = 1e9, 1e11, 6.3e8  # s
YEAR_SECOND = 31_556_952
EDGE_SHARE = 0.01  # of the largest current: a change by more is a step, as in `cleaning.flag`
SAME_SECOND = 2.0  # s within which a clock and dates of whole seconds agree


def _dates_in_seconds(columns):
    """Columns whose dates are seconds since 1970, and whose clock is no date."""
    columns, unix = dict(columns), "unix_time_second"
    if _median_beyond(columns["test_time_second"], LONGEST_RECORD):
        columns.setdefault(unix, columns["test_time_second"])
    # Milliseconds, and what other software counts: micro- and nanoseconds.
    while unix in columns and _median_beyond(columns[unix], LATEST_DATE):
        found, columns[unix] = columns[unix], columns[unix] / 1e3
        if not _median_beyond(columns[unix], FIRST_DATE):
            year = 1970 + np.nanmedian(found) / YEAR_SECOND
            raise Refusal(
                f"its dates lie about the year {year:.0f}: a placeholder? leave that column out"
            )
    if _median_beyond(columns["test_time_second"], LONGEST_RECORD):
        known = columns[unix][np.isfinite(columns[unix])]
        columns["test_time_second"] = columns[unix] - known[0]
    return columns


def _median_beyond(values, limit):
    """Whether the median of the numbers among values exceeds a limit."""
    return bool(any_where(lambda x: x > limit, values) and np.nanmedian(values) > limit)


def clock_of_steps(columns: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns whose clock goes on where it began anew with each step; a note then.

    A step's clock counts from the row before its first one. It is one where it begins anew just
    where the number of the step changes, or else more than once and only where the current steps,
    each time within two intervals of zero; where dates lie beside it that say of the time between
    two steps otherwise, they are right.
    """
    time, current = columns["test_time_second"], columns["current_ampere"]
    step = columns.get("step_count", columns.get("step_index"))
    falls = rows_where(lambda t: np.diff(t) < 0, time, beside=1) + 1
    if not len(falls) or (step is None and len(falls) < 2):
        return columns, []
    interval = np.diff(time)
    if step is None:
        edges = np.abs(np.diff(current)) > EDGE_SHARE * np.nanmax(np.abs(current))
        changes = np.intersect1d(falls, np.flatnonzero(edges) + 1)
    else:
        changes = np.flatnonzero(np.diff(step) != 0) + 1
    usual = np.median(interval[interval > 0]) if np.any(interval > 0) else 0.0
    if not np.array_equal(falls, changes) or np.any(time[changes] > 2 * usual + SAME_SECOND):
        return columns, []
    interval[changes - 1] = time[changes]
    unix = columns.get("unix_time_second")
    if unix is not None and np.isfinite(unix).all():
        by_dates = np.diff(unix)[changes - 1]
        other = np.abs(by_dates - time[changes]) > SAME_SECOND
        interval[changes - 1] = np.where(other, by_dates, time[changes])
    note = f"the clock begins anew with each of {len(changes) + 1} steps: counted on"
    clock = time[0] + np.concatenate([[0.0], np.cumsum(interval)])
    return columns | {"test_time_second": clock}, [note]


# Seconds of dates a unit of the clock that only a wrong unit explains.
CLOCK_FACTORS = {1e-3: "milliseconds", 60.0: "minutes", 3600.0: "hours"}
SAME_CLOCK = 0.01
MOST_SLOPES = 4096


def clock_by_dates(columns: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns whose clock is in seconds, where their dates prove another unit; a note then.

    The dates are exact over hours: a factor of 1000, 60 or 3600 to within 1 % is no drift.
    """
    time, unix = columns["test_time_second"], columns.get("unix_time_second")
    if unix is None or not all_where(np.isfinite, unix):
        return columns, []
    if any_where(lambda x: np.diff(x) < 0, unix, beside=1):
        return columns, []
    slopes = date_slopes(time, unix)
    ratio = float(np.nanmedian(slopes)) if np.isfinite(slopes).any() else np.nan
    for factor, unit in CLOCK_FACTORS.items():
        if abs(ratio / factor - 1) <= SAME_CLOCK:
            note = f"the clock counts {unit}, as its dates prove, not seconds: converted"
            return columns | {"test_time_second": time * factor}, [note]
    return columns, []


def date_slopes(time: np.ndarray, unix: np.ndarray) -> np.ndarray:
    """Seconds of dates a unit of the clock over tenths of the record, NaN where it stands still.

    From some thousand rows on: their median is what is asked for.
    """
    span = max(float(np.ptp(unix)) / 10, 1.0)
    rows = np.arange(0, len(time), max(len(time) // MOST_SLOPES, 1))
    stop = np.searchsorted(unix, unix[rows] + span)
    start, stop = rows[stop < len(time)], stop[stop < len(time)]
    if not len(start):
        return np.full(1, np.nan)
    step = time[stop] - time[start]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(step > 0, (unix[stop] - unix[start]) / step, np.nan)


def _without_impossible_channels(columns, notes):
    """Columns without thermometers whose readings no cell survives, with a note on each."""
    kept = dict(columns)
    for name in [name for name in columns if name.endswith("temperature_celsius")]:
        if _mostly_within(columns[name], np.nextafter(COLDEST, 0), np.nextafter(HOTTEST, 0)):
            continue
        middle = float(np.nanmedian(columns[name]))
        if not COLDEST < middle < HOTTEST:
            kelvin = 200 < middle < 273.15 + HOTTEST
            guess = "kelvin under degC? " if kelvin else ""
            notes.append(f"{name} reads {middle:.4g} °C: {guess}left out")
            del kept[name]
    return kept


def _without_dead_channel(columns: dict[str, np.ndarray], notes) -> dict[str, np.ndarray]:
    """The columns without a chamber channel that reads 0 degC beside a warm cell: unconnected."""
    chamber = columns.get("ambient_temperature_celsius", np.ones(1))
    surface = columns.get("surface_temperature_celsius", np.zeros(1))
    if np.any(chamber) or abs(np.nanmedian(surface)) < 10:
        return columns
    notes.append("ambient_temperature_celsius shows 0 °C in all rows: not connected, and left out")
    return {name: c for name, c in columns.items() if name != "ambient_temperature_celsius"}
