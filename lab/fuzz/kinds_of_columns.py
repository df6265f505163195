"""More ways in which a record goes wrong: what its columns are, its digits, clock and thermometers.

As in `kinds`: functions of a clean record and of a generator, None where the record has not what
the kind changes.
"""

from datetime import UTC, datetime, timedelta

import numpy as np

from fuzz.record import (
    AMBIENT,
    CHARGED,
    CURRENT,
    DISCHARGED,
    SURFACE,
    TIME,
    UNIX,
    VOLTAGE,
    counters,
    discharges,
    row_count,
)

STATED_CELSIUS = "ambient_temperature_celsius"
# A table of nobody in particular, whose clock says no unit.
PLAIN = {
    TIME: "Time",
    CURRENT: "Current (A)",
    VOLTAGE: "Voltage (V)",
    CHARGED: "Charge Capacity (Ah)",
    DISCHARGED: "Discharge Capacity (Ah)",
    SURFACE: "Temperature (degC)",
    AMBIENT: "Ambient Temperature (degC)",
}
SECOND_CLOCKS = ("Time / s", "Time (s)", "Elapsed Time (s)", "Total Time (s)")
EXCEL_DAY = 45_000.0  # in 2023


def _to_digit(change):
    """The current changed to whole multiples of 0.5 or 1 A."""

    def kind(record, rng):
        digit, current = rng.choice((0.5, 1.0)), record.columns[CURRENT]
        return record.having(current=change(current / digit) * digit)

    return kind


def _second_clock(record, rng):
    """Two columns of time, one of which runs by a tenth too fast: either may be the right one."""
    fast, right = 1.1 * record.columns[TIME], record.columns[TIME]
    own, other = (fast, right) if rng.random() < 0.5 else (right, fast)
    label = str(rng.choice(SECOND_CLOCKS))
    labels, columns = {}, {"second": other, TIME: own}
    if "(" in label:
        labels = PLAIN | {TIME: "Test Time (s)"}
    if rng.random() < 0.5:
        columns = dict(reversed(columns.items()))
    rest = {name: c for name, c in record.columns.items() if name not in (TIME, UNIX)}
    return record._replace(columns=columns | rest, labels=labels | {"second": label})


def _chamber_misstated(record, rng):
    if SURFACE not in record.columns or record.test.get(STATED_CELSIUS) is None:
        return None
    wrong = record.test[STATED_CELSIUS] + rng.choice((-47.0, -25.0, 20.0, 35.0))
    return record._replace(test=record.test | {STATED_CELSIUS: float(wrong)})


def _with_ambient(record):
    """A record with both thermometers, that of the chamber as stated where none was logged."""
    if SURFACE not in record.columns or record.test.get(STATED_CELSIUS) is None:
        return None
    if AMBIENT in record.columns:
        return record
    swing = 0.2 * np.sin(record.columns[TIME] / 300.0)
    return record._replace(columns=record.columns | {AMBIENT: record.test[STATED_CELSIUS] + swing})


def _thermometers_exchanged(record, rng):
    both = _with_ambient(record)
    if both is None:
        return None
    columns = both.columns
    return both._replace(columns=columns | {SURFACE: columns[AMBIENT], AMBIENT: columns[SURFACE]})


def _thermometer(change):
    def kind(record, rng):
        if SURFACE not in record.columns:
            return None
        return record.having(surface=change(record, rng, record.columns[SURFACE].copy()))

    return kind


def _zero_for_a_stretch(record, rng, celsius):
    first, size = rng.uniform(0.1, 0.6), rng.uniform(0.05, 0.4)
    celsius[int(first * len(celsius)) : int((first + size) * len(celsius))] = 0.0
    return celsius


def _of_another_cell(record, rng):
    """The thermometer of a cell of the same campaign, for as long as it goes, then its last."""
    if SURFACE not in record.columns or not record.beside or SURFACE not in record.beside:
        return None
    time, other = record.columns[TIME], record.beside
    shown = np.interp(time - time[0], other[TIME] - other[TIME][0], other[SURFACE])
    return record.having(surface=shown)


def _low_range(record, rng):
    current = record.columns[CURRENT].copy()
    low = np.abs(current) < 0.1 * np.abs(current).max()
    current[low] *= rng.choice((0.1, 10.0))
    return record.having(current=current) if np.any(current[low]) else None


def _offset_of_low_range(record, rng):
    """An offset in all that is read below a tenth to two thirds of the largest current."""
    current = record.columns[CURRENT].copy()
    largest = np.abs(current).max()
    low = np.abs(current) < largest * rng.uniform(0.1, 0.67)
    current[low] += rng.choice((-1, 1)) * largest * rng.uniform(0.01, 0.05)
    return record.having(current=current)


def _zero_potential(record, rng):
    voltage, current = record.columns[VOLTAGE].copy(), np.abs(record.columns[CURRENT])
    loaded = np.flatnonzero(current > 0.05 * current.max())
    voltage[rng.choice(loaded, max(len(loaded) // 200, 1), replace=False)] = 0.0
    return record.having(voltage=voltage)


def _unsaid_unit(record, rng):
    """The clock in hours, minutes, days or as Excel numbers dates, under a label without a unit."""
    time, unit = record.columns[TIME], str(rng.choice(("h", "min", "d", "date")))
    second = {"h": 3600.0, "min": 60.0, "d": 86400.0, "date": 86400.0}[unit]
    digits = "%.10f" if unit == "date" else "%.10g"
    written = np.char.mod(digits, time / second + EXCEL_DAY * (unit == "date"))
    columns = {n: c for n, c in record.columns.items() if n != UNIX}
    if rng.random() < 0.5:
        columns = {n: c for n, c in columns.items() if n not in (CHARGED, DISCHARGED)}
    return record._replace(columns=columns | {TIME: written}, labels=PLAIN)


def _numbered(label):
    """A row number in front of each row, with or without a label of its own."""

    def kind(record, rng):
        def change(text):
            first, *rows = text.rstrip("\n").split("\n")
            numbered = [f"{k},{row}" for k, row in enumerate(rows, start=1)]
            return "\n".join([label + first, *numbered, ""])

        return record._replace(text=change)

    return kind


def _two_of_a_label(record, rng):
    name, factor = str(rng.choice((TIME, CURRENT, VOLTAGE))), rng.uniform(0.5, 0.95)
    second = {"second": record.columns[name] * factor}
    columns = second | record.columns if rng.random() < 0.5 else record.columns | second
    return record._replace(columns=columns, labels=record.labels | {"second": name})


def _dated(exchanged):
    """Dates beside the clock, or instead of it; days up to 12 exchanged with their months."""

    def kind(record, rng):
        time = record.columns[TIME] - record.columns[TIME][0]
        # Midnight of the twelfth of a month falls into the record: from it on no month is meant.
        start = datetime(2023, 3, 13, tzinfo=UTC) - timedelta(
            seconds=float(rng.uniform(0.1, 0.9) * time[-1])
        )
        moments = [start + timedelta(seconds=float(second)) for second in time]
        dates = [
            m.strftime("%m/%d/%Y %H:%M:%S.%f" if exchanged and m.day <= 12 else
                       "%d/%m/%Y %H:%M:%S.%f")[:-3]
            for m in moments
        ]  # fmt: skip
        columns = {n: c for n, c in record.columns.items() if n != UNIX}
        alone = rng.random() < 0.5
        if alone:
            columns = {"date": np.array(dates)} | {n: c for n, c in columns.items() if n != TIME}
        else:
            columns["date"] = np.array(dates)
        labels = PLAIN | {TIME: "Time (s)", "date": "Date Time"}
        return record._replace(columns=columns, labels=labels)

    return kind


def _begins_late(record, rng):
    """The first rows of one discharge are missing, the clock going on."""
    found = discharges(record)
    if not found:
        return None
    first, stop = found[int(rng.integers(len(found)))]
    most = max(int((stop - first) * rng.uniform(0.02, 0.15)), 2)
    return record.of_rows(np.r_[0:first, first + most : row_count(record)])


def _gone_over_a_pause(record, rng):
    """A pause of one row in a discharge, over which 9 % of it are missing."""
    found = discharges(record)
    if not found:
        return None
    first, stop = max(found, key=lambda rows: rows[1] - rows[0])
    row = first + int(rng.uniform(0.1, 0.85) * (stop - first))
    columns = {name: values.copy() for name, values in record.columns.items()}
    gone = max(int(0.09 * (stop - first)), 1)
    answer = np.ptp(columns[VOLTAGE][max(first - 1, 0) : first + 2])
    columns[VOLTAGE][row] += 0.4 * answer
    columns[CURRENT][row] = 0.0
    if rng.random() < 0.5:  # the clock closed up over it
        behind = slice(row + gone + 1, None)
        columns[TIME][behind] -= columns[TIME][row + gone] - columns[TIME][row]
    kept = np.r_[0 : row + 1, row + gone + 1 : row_count(record)]
    return record._replace(columns=columns).of_rows(kept)


def _clock_drifts(record, rng):
    """The clock runs ever faster, or slower, to 5 to 20 % at the end of the record."""
    time = record.columns[TIME]
    share = (time - time[0]) / (time[-1] - time[0])
    rate = rng.choice((-1, 1)) * rng.uniform(0.05, 0.2)
    return record.having(time=time[0] + (time - time[0]) * (1 + 0.5 * rate * share))


def _gain_beside_counter(record, rng):
    current = record.columns[CURRENT] * (1 + rng.uniform(0.03, 0.18))
    return record._replace(columns=record.columns | counters(record) | {CURRENT: current})


def _with_counters(record, rng):
    return record._replace(columns=record.columns | counters(record))


def _with_both_thermometers(record, rng):
    return _with_ambient(record)


BENIGN_COLUMNS = {
    "counters beside": _with_counters,
    "row numbers with a label": _numbered("No.,"),
    "both thermometers": _with_both_thermometers,
    "dates as they are": _dated(exchanged=False),
}
KINDS_OF_COLUMNS = {
    "truncated current": _to_digit(np.trunc),
    "rounded current": _to_digit(np.rint),
    "second time column": _second_clock,
    "chamber misstated": _chamber_misstated,
    "surface and ambient exchanged": _thermometers_exchanged,
    "thermometer zero for a stretch": _thermometer(_zero_for_a_stretch),
    "thermometer off by 40 K": _thermometer(lambda r, g, c: c + g.choice((-40.0, 40.0))),
    "another cell's thermometer": _of_another_cell,
    "low range at a tenth": _low_range,
    "range switch's offset": _offset_of_low_range,
    "zero potential": _zero_potential,
    "time in another unit without a unit": _unsaid_unit,
    "columns shifted": _numbered(""),
    "two labels": _two_of_a_label,
    "dates": _dated(exchanged=True),
    "first rows of a discharge missing": _begins_late,
    "9 % gone over a pause of one row": _gone_over_a_pause,
    "clock drifts": _clock_drifts,
    "counter says otherwise": _gain_beside_counter,
}  # fmt: skip
