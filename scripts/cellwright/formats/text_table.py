"""One engine for instruments' tables of text: where the table begins, what its columns mean."""

import csv
import re
from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.formats.content import (
    Content,
    head_of,
    whole_of,
    with_lines_changed,
)
from cellwright.formats.dates import Dates, Times, date_readings, over_midnight
from cellwright.formats.fields import (
    ENERGY,
    IMPEDANCE,
    MINUS,
    NET,
    SERIES,
    UNITS,
    Field,
    converted,
    known_fields,
    label_of,
    refuse_repeated,
    require,
)
from cellwright.formats.second_clock import refuse_contradicting
from cellwright.formats.table import (
    CHANNEL,
    DELIMITERS,
    Layout,
    Words,
    decimal_point_of,
    decoded,
    first_rows,
    is_number,
    is_written,
    line_of,
    offset_of,
    read_table,
    refuse_channels,
    unquoted,
    with_trailing_delimiter,
)
from cellwright.formats.unsaid_units import (
    NOT_SAID,
    told_by_pace,
    unit_by_dates,
    with_unit_of_counter,
)
from cellwright.refusal import Refusal

HEAD = 1 << 17  # byte within which the labels of a table must stand
MOST_LABELS = 12  # that a message names
MOST_LINES = 500  # among which the labels of a table of nobody in particular stand
TIME, STEP_TIME, UNIX = "test_time_second", "step_time_second", "unix_time_second"
IMAGINARY = "impedance_imaginary_ohm"
# Impedance as it may be written instead of its real and imaginary part.
POLAR = {"impedance_ohm": "impedance_real_ohm", "phase_degree": IMAGINARY}
PARTS = (*IMPEDANCE, MINUS, *POLAR)
STEP_CHARGE, STEP_ENERGY = "step_capacity_ampere_hour", "step_energy_watt_hour"
# Electrodes of a cell against a third one; its own voltage is their difference.
WORKING, COUNTER = "working_electrode_volt", "counter_electrode_volt"
# Columns whose meaning the others of a table tell.
UNTOLD = (STEP_TIME, STEP_CHARGE, STEP_ENERGY, MINUS, *POLAR)
SPELT = {
    "test_time_second": "time",
    "current_ampere": "current",
    "voltage_volt": "voltage",
    "frequency_hertz": "frequency",
    "impedance_real_ohm": "real part of the impedance",
    "impedance_imaginary_ohm": "imaginary part of the impedance",
}
# As makers spell the units of `fields.UNITS`.
SAME_UNIT = {
    "s": "s", "sec": "s", "seconds": "s", "min": "min", "h": "h", "hr": "h", "hours": "h",
    "a": "A", "ma": "mA", "ua": "uA", "µa": "µA", "v": "V", "mv": "mV", "ah": "Ah", "mah": "mAh",
    "a.h": "Ah", "ma.h": "mAh", "ohm": "ohm", "ohms": "ohm", "hz": "Hz", "khz": "kHz",
    "mohm": "mohm", "mω": "mohm", "ω": "ohm", "wh": "Wh", "mwh": "mWh", "w.h": "Wh", "c": "degC",
    "degc": "degC", "°c": "degC", "k": "K", "°f": "degF", "degf": "degF", "deg": "deg",
    "°": "deg", "rad": "rad", "ms": "ms", "秒": "s",
}  # fmt: skip
CLOCK = "clock"  # unit of a time that is written as [days d] hours:minutes:seconds
STATES = "charge, discharge and rest, with CC, CV or CCCV before them, in several languages"
ABORTED = "the sweep was broken off"  # begins a note that stands as a doubt at its numbers


class Format(NamedTuple):
    """How one maker writes a table, as data.

    Attributes
    ----------
    name, title : as `instrument` in tests.tsv, and in messages.
    mark : pattern by which the head of a file is recognised (`^` at each line).
    header : pattern of the line that holds the labels; it stands in the first 128 kB. "": the line
        is found by its labels, as one of `columns` that make a series or a spectrum.
    columns : pattern of a label (in full, case ignored) → (column of the house, quantity, unit).
        A group `unit` of the pattern goes first; unit None without one: the file does not say it.
    header_lines, units_lines : lines from the match of `header` to the labels, and below them.
    labels : names of the columns, where the header's own cannot be split.
    delimiter : "" where it is the one of comma, semicolon and tab that the labels hold most.
    rows_begin, rows_are : bytes with which each row begins that is a reading, of files that have
        other rows between them; or the pattern of a row.
    end : pattern of the first line below the table.
    aborted : pattern of a line that says, anywhere, that a sweep was broken off.
    short_rows : rows end before the last labels do, of which the maker writes no values.
    state, signs : pattern of the column of letters, and pattern of a letter → sign of a current
        that is written as a magnitude. One that is not among them goes with a current of zero.
    date, dates : pattern of the column of dates, and how they may be written.
    channel : pattern of columns that name the channel of a row: several are refused.
    units_taken : labels may go without a unit; that those of `columns` are taken is then noted.
    """

    name: str
    title: str
    mark: str
    header: str
    columns: Mapping[str, tuple]
    header_lines: int = 0
    units_lines: int = 0
    labels: tuple[str, ...] = ()
    delimiter: str = ""
    rows_begin: bytes = b""
    rows_are: str = ""
    end: str = ""
    aborted: str = ""
    short_rows: bool = False
    state: str = ""
    signs: Mapping[str, float] = {}
    date: str = ""
    dates: tuple[str, ...] = ()
    units_taken: bool = False
    channel: str = CHANNEL


def recognises(form: Format, head: str) -> bool:
    """Whether the text of a file's head is one of this maker's."""
    if not form.header:
        return header_of(form, head) is not None
    return any(re.search(form.mark, text, re.M) for text in (head, head.replace('"', "")))


def header_of(form: Format, head: str) -> int | None:
    """Number of the line whose labels make a series or a spectrum; None where there is none."""
    for number, line in enumerate(head.split("\n")[:MOST_LINES], start=1):
        labels = [unquoted(label) for label in line.split(max(DELIMITERS, key=line.count))]
        if len(labels) < len(SERIES):
            continue
        columns = {field.column for label in labels if (field := meaning_of(form, label))}
        columns |= {POLAR.get(name, name.removeprefix("minus_")) for name in columns}
        timed = columns & {TIME, STEP_TIME, UNIX} or any(_is(form.date, label) for label in labels)
        if columns.issuperset(IMPEDANCE) or (timed and columns.issuperset(SERIES[1:])):
            return number
    return None


def labels_seen(head: str) -> list[str]:
    """What stands above the first line of numbers in a text, as the labels of columns or nothing.

    head : the beginning of any text.
    """
    lines = [line for line in head.split("\n")[:MOST_LINES] if line.strip()]
    for above, line in pairwise(lines):
        delimiter = max(DELIMITERS, key=line.count)
        cells, labels = line.split(delimiter), [unquoted(x) for x in above.split(delimiter)]
        numbers = sum(any(letter.isdigit() for letter in cell) for cell in cells)
        if len(SERIES) <= len(cells) == len(labels) and 2 * numbers > len(cells):
            return [] if any(map(is_number, filter(None, labels))) else labels[:MOST_LABELS]
    return []


class Read(NamedTuple):
    """What a table of text holds."""

    columns: dict[str, np.ndarray]  # as of `formats.read`
    notes: list[str]
    sign: int = 0  # 1 where letters make the current positive on charge, else 0
    dates: tuple[str, ...] = ()  # formats in which its dates can be read, the one taken first


def read(form: Format, data: bytes | Content, kind: str | None = None) -> Read:
    """Columns of a table in the house's names and units, and notes on what was left out.

    Parameters
    ----------
    form : Format
    data : the file, unpacked, in UTF-8, GB 18030 or Latin-1.
    kind : of a table that holds a series and a spectrum, the one that is wanted: "series" or
        "impedance"; None: the one of more rows.

    Returns
    -------
    Read; the current is positive on charge where letters say so.

    Raises
    ------
    Refusal
        No labels, a column that is missing or said twice, a row that is damaged, text where a
        number belongs, a clock whose unit nothing says, a current under a letter without a sign.
    """
    raw = whole_of(data) if form.aborted else b""
    data, layout = _table(form, data)
    fields = fields_of(form, layout.labels)
    swept = _swept_rows(form, data, layout, fields)
    if len(swept) and (kind == "impedance" or _is_spectrum(swept, kind)):
        # Not what a spectrum's file says of the voltage and current at each frequency.
        found = _read_spectrum(data, layout, [f for f in fields if f.column in PARTS])
        aborted = form.aborted and re.search(form.aborted.encode(), raw, re.M)
        lowest = np.nanmin(found.columns["frequency_hertz"], initial=np.inf)
        said = [f"{ABORTED}, as its file says: its points end at {lowest:.4g} Hz"] * bool(aborted)
        return found._replace(notes=[*found.notes, *_other_rows(swept), *said])
    return _read_series(form, data, layout, [f for f in fields if f.column not in PARTS], swept)


def _read_spectrum(data, layout, fields):
    parts = [f._replace(column=POLAR.get(f.column, f.column)) for f in fields]
    parts = [f._replace(column=f.column.removeprefix("minus_")) for f in parts]
    require(parts, IMPEDANCE, SPELT, layout.labels)
    found = read_table(data, layout, [field.label for field in fields])
    return Read(_spectrum(converted(found.columns, fields)), list(found.notes))


def _read_series(form, data, layout, fields, swept):
    """Read of a series; swept : (n,) rows that are a spectrum's, or empty."""
    date = next((x for x in layout.labels if _is(form.date, x)), None)
    fields, date = _timed(fields, date, lambda label: is_written(data, layout, label))
    fields, counter, notes = _of_electrodes(fields)
    require(fields, SERIES, SPELT, layout.labels)
    written = [f for f in fields if f.quantity == "time" and is_written(data, layout, f.label)]
    state = next((x for x in layout.labels if _is(form.state, x)), None)
    channels = [label for label in layout.labels if _is(form.channel, label)]
    texts = dict.fromkeys([*filter(None, [state]), *channels], Words)
    texts |= {label: partial(Dates, form.dates) for label in filter(None, [date])}
    texts |= {f.label: partial(Times, form.dates) for f in written}
    others = [field for field in fields if field not in written] + counter
    found, more = read_table(data, layout, [field.label for field in others], texts=texts)
    refuse_channels(found, channels)
    dates = _dates_beside(found, date, others) if date else {}
    unix = next(iter(dates.values()), None)
    others, told = _with_units_of_clocks(form, others, found, unix)
    notes += told
    unproved = [f for f in others if f.quantity == "charge" and f.unit == NOT_SAID]
    others = [f._replace(unit="Ah") if f in unproved else f for f in others]
    columns = converted(found, others)
    clock = next((field.label for field in others if field.column == TIME), None)
    if clock:
        refuse_contradicting(clock, columns[TIME], _other_clocks(form, fields, data, layout))
    if counter:
        columns["voltage_volt"] = columns["voltage_volt"] - columns.pop(COUNTER, 0.0)
    for field in written:
        columns[field.column], seen = _seconds(field, found[field.label])
        dates = dates or seen
        unix = next(iter(dates.values()), None)
    columns |= {} if unix is None else {"unix_time_second": unix}
    if state and not form.header and np.nanmin(columns["current_ampere"]) < 0:
        notes.append(f"column {state!r} is not needed: the current has its own sign")
        state = None
    if state:
        columns["current_ampere"] = _signed(form, columns["current_ampere"], found[state])
    filled = np.any([np.isfinite(columns[name]) for name in SERIES], axis=0)
    if swept.any():
        filled &= ~swept
        said = f"{swept.sum()} rows of a spectrum are left out: a test of kind eis reads them"
        more = [*more, said]
    if not filled.all():  # rows of nothing but delimiters, as spreadsheets leave them at the end
        columns = {name: values[filled] for name, values in columns.items()}
    notes += more
    columns = _with_counters(_without_dead(_without_still_counters(columns, notes), notes))
    columns = with_unit_of_counter(columns, unproved, notes) if unproved else columns
    return Read(columns, notes, int(state is not None), tuple(dates))


def _other_clocks(form, fields, data, layout):
    """Seconds (n,) of further columns of the test's time, by label: numbers whose unit it says."""
    read = [field.label for field in fields]
    known = [field for x in dict.fromkeys(layout.labels) if (field := meaning_of(form, x))]
    clocks = [
        field
        for field in known
        if field.column == TIME
        and field.label not in read
        and field.unit in UNITS["time"]
        and not _is_bare(form, field)
        and not is_written(data, layout, field.label)
    ]
    if not clocks:
        return {}
    found = read_table(data, layout, [field.label for field in clocks]).columns
    return {f.label: np.asarray(found[f.label]) * UNITS["time"][f.unit] for f in clocks}


def _swept_rows(form, data, layout, fields):
    """Rows (n,) in which a spectrum is swept, empty where the table has no frequency.

    All of them, where the table has no series beside it.
    """
    columns = {field.column: field.label for field in _of_electrodes(fields)[0]}
    label = columns.get("frequency_hertz")
    if label is None:
        return np.empty(0, bool)
    frequency = read_table(data, layout, [label]).columns[label]
    dated = any(_is(form.date, x) for x in layout.labels)
    timed = dated or not columns.keys().isdisjoint({TIME, STEP_TIME, UNIX})
    both = timed and columns.keys() >= set(SERIES[1:])
    return frequency > 0 if both else np.ones(len(frequency), bool)


def _is_spectrum(swept, kind):
    """Whether rows of a table with a frequency are taken for a spectrum's."""
    return swept.all() or (kind is None and 2 * np.count_nonzero(swept) >= len(swept))


def _other_rows(swept):
    """A sentence on rows between those of a spectrum that could be a series."""
    rows = np.count_nonzero(~swept)
    return [f"{rows} rows without a frequency are left out: tests of other kinds read them"][:rows]


def _table(form, data):
    """The file with its rows made regular, and their layout.

    Lines that are no rows are made blank, not taken away: messages count the file's own lines.
    """
    head = head_of(data)[:HEAD].decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    number = _header_line(form, head)
    if not number:  # where every label stands between quotation marks
        number = _header_line(form, head.replace('"', ""))
    if not number:
        seen = ", ".join(map(repr, labels_seen(head))) or "none"
        raise Refusal(f"{form.title}: no line names its columns; labels found: {seen}")
    header = line_of(data, number)
    first = number + 1 + form.units_lines
    quoted = header.startswith('"') and header.endswith('"') and header.count('"') == 2
    header = header[1:-1] if quoted else header
    change = _change_of(form, header, quoted)
    if form.end:  # where a table ends is not to be seen in a part of it: such files are short
        data = whole_of(data)
    if change:
        data = with_lines_changed(data, offset_of(data, first), change)
    rows = first_rows(data, first)
    filled = rows[0] if rows else ""
    delimiter = form.delimiter or max(DELIMITERS, key=(filled if form.labels else header).count)
    labels = form.labels or tuple(unquoted(x) for x in header.split(delimiter))
    width = _width(filled, delimiter)
    labels = labels[:width] if form.short_rows else labels
    if not form.header and (units := _units_below(labels, filled, delimiter)):
        labels, first, rows = units, first + 1, rows[1:]
    if width == len(labels) - 1 and not labels[-1]:
        labels = labels[:-1]
    layout = Layout(labels, delimiter, first, decimal_point_of(rows, delimiter))
    return data, with_trailing_delimiter(rows, layout)


def labels_of(form: Format, data: bytes | Content) -> list[str]:
    """Labels of a table of this maker, as they stand in the file."""
    return [label for label in _table(form, data)[1].labels if label]


def _header_line(form, head):
    """Number of the line of labels in a file's head, None where it is not found."""
    if not form.header:
        return header_of(form, decoded(head.encode("latin-1")))
    found = re.search(form.header, head, re.M)
    return found and head.count("\n", 0, found.start()) + 1 + form.header_lines


def _units_below(labels, row, delimiter):
    """Labels with their units, where the row below them holds units and no number; else None."""
    cells = [unquoted(cell) for cell in row.split(delimiter)]
    if len(cells) != len(labels) or not all(x.lower() in ("", "-", *SAME_UNIT) for x in cells):
        return None
    pairs = zip(labels, cells, strict=True)
    return tuple(f"{label} [{unit}]" if unit.strip("-") else label for label, unit in pairs)


def _timed(fields, date, is_text):
    """Fields with one clock of the test, and the label of dates beside it or None.

    The elapsed time, else the steps' own, which `physics.clock_of_steps` counts on, else the dates.
    is_text : function, label → whether its cells are no numbers.
    """
    named = {field.column: field for field in fields}
    if UNIX in named and is_text(named[UNIX].label):
        date = date or named.pop(UNIX).label
    step = named.pop(STEP_TIME, None)
    if TIME not in named:
        clock = step or named.pop(UNIX, None) or (date and Field(date, TIME, "time", NOT_SAID))
        if clock:
            named[TIME] = clock._replace(column=TIME)
            date = None if date == clock.label else date
    return list(named.values()), date


def _of_electrodes(fields):
    """Fields with the voltage of the cell, those of the counter electrode to take off it, a note.

    What is measured of one electrode alone is no cell's voltage; without another it is taken for
    one, for so do the files of cells with two electrodes name it.
    """
    named = {field.column: field for field in fields}
    working, counter = (named.pop(name, None) for name in (WORKING, COUNTER))
    if working is None or "voltage_volt" in named:
        return list(named.values()), [], []
    named["voltage_volt"] = working._replace(column="voltage_volt")
    if counter is None:
        return list(named.values()), [], []
    note = f"the cell's voltage is {working.label} less {counter.label}: a third electrode is used"
    return list(named.values()), [counter], [note]


def _width(row, delimiter):
    """Number of fields of a row, in which a delimiter between quotation marks is none."""
    return len(next(csv.reader([row], delimiter=delimiter), [""]))


def _change_of(form, header, quoted):
    """What is done to the lines below the labels (function, bytes → bytes); None for nothing."""
    begin = form.rows_begin if header.startswith(form.rows_begin.decode()) else b""
    pattern = re.compile(form.rows_are.encode()) if form.rows_are else None
    end = re.compile(form.end.encode()) if form.end else None
    if not (quoted or begin or pattern or end):
        return None

    def change(data):
        rows = (data.replace(b'"', b"") if quoted else data).split(b"\n")
        if end:
            rows = rows[: next((k for k, row in enumerate(rows) if end.match(row)), len(rows))]
        if begin:
            rows = [row if row.startswith(begin) else b"" for row in rows]
        elif pattern:
            rows = [row if pattern.match(row) else b"" for row in rows]
        return b"\n".join(rows)

    return change


def _is(pattern, label):
    return bool(pattern) and re.fullmatch(pattern, label_of(label), re.I) is not None


def meaning_of(form: Format, label: str) -> Field | None:
    """What a label means in tables of this maker; None where it is not known."""
    for pattern, (column, quantity, unit) in form.columns.items():
        parts = re.fullmatch(pattern, label_of(label), re.I)
        if parts:
            said = parts.groupdict().get("unit")
            said = SAME_UNIT.get(said.lower(), said) if said else unit or NOT_SAID
            return Field(label, column, quantity, said)
    return None


def is_known(form: Format, label: str) -> bool:
    """Whether a column of a label is read from tables of this maker, as a number or as a text."""
    texts = (form.date, form.state, form.channel)
    return meaning_of(form, label) is not None or any(_is(text, label) for text in texts)


def fields_of(form: Format, labels) -> list[Field]:
    """Known fields among the labels: of several for one column those of the pattern that is first.

    Raises
    ------
    Refusal
        Two labels of one pattern.
    """
    refuse_repeated(list(labels), lambda label: meaning_of(form, label))
    places = list(form.columns)
    found = {label: field for label in labels if (field := meaning_of(form, label))}
    ranks = {
        label: next(k for k, x in enumerate(places) if re.fullmatch(x, label_of(label), re.I))
        for label in found
    }
    first = {}
    for label, field in found.items():
        first[field.column] = min(ranks[label], first.get(field.column, len(places)))
    return known_fields(
        [label for label, field in found.items() if ranks[label] == first[field.column]], found.get
    )


def _is_bare(form, field):
    """Whether the unit of a column is taken, for neither its label nor its maker says it."""
    if not form.units_taken:
        return False
    patterns = (re.fullmatch(pattern, label_of(field.label), re.I) for pattern in form.columns)
    parts = next(filter(None, patterns), None)
    return parts is not None and parts.groupdict().get("unit") is None


def _with_units_of_clocks(form, fields, found, unix):
    """Fields whose clocks have a unit, also where no label says it, and notes on bare labels."""
    told, notes = [], []
    for field in fields:
        if field.quantity == "time" and field.unit == NOT_SAID:
            unit = unit_by_dates(field, found[field.label], unix, form.title)
            field = field._replace(unit=unit)
        elif field.column == TIME and _is_bare(form, field):
            field, said = told_by_pace(field, found[field.label], unix)
            notes += said
        told.append(field)
    bare = [
        f"{f.label} in {f.unit}"
        for f in told
        if f.column in SERIES and _is_bare(form, f) and (f.column != TIME or f.unit == "s")
    ]
    if bare:
        notes.append(f"labels without a unit are taken as it is usual: {', '.join(bare)}")
    return told, notes


def _seconds(field, times):
    """Elapsed time [s] of `Times`, and where they are dates the seconds since 1970 by format."""
    if times.clock is not None:
        return over_midnight(times.clock), {}
    dates = date_readings(times.dates, 0.0)
    if not dates:
        raise Refusal(f"column {field.label!r}: found {times.example!r}, a time is wanted")
    first = next(iter(dates.values()))
    known = np.isfinite(first)
    return first - (first[known][0] if known.any() else np.nan), dates


def _dates_beside(found, date, fields):
    """Seconds since 1970 of a column of dates by format; the clock tells days from months."""
    spans = [
        np.ptp(values[np.isfinite(values)]) * UNITS["time"][field.unit]
        for field in fields
        if field.column == "test_time_second"
        and field.unit in UNITS["time"]
        and np.isfinite(values := found[field.label]).any()
    ]
    return date_readings(found[date], max(spans, default=np.nan))


def _signed(form, current, letters):
    """Current [A], positive on charge, from magnitudes and the letters of the steps."""
    codes = letters.indices.to_numpy()
    signs = np.zeros(len(codes))
    for code, written in enumerate(letters.dictionary.to_pylist()):
        name, rows = written.strip(), codes == code
        sign = next((s for letter, s in form.signs.items() if _is(letter, name)), None)
        if sign is None and np.any(np.abs(current[rows]) > 0):
            plain = all(letter.isalnum() for letter in form.signs)
            known = ", ".join(form.signs) if plain else STATES
            where = int(np.flatnonzero(rows & (np.abs(current) > 0))[0]) + 1
            raise Refusal(
                f"row {where} of data: a current of {current[where - 1]:g} A in a step of state "
                f"{str(name)!r}, whose sign is not known; known states: {known}"
            )
        signs[rows] = sign or 0.0
    # ASSUME: A current in a resting step keeps the sign it is written with: it is an offset.
    return np.where(signs == 0, current, np.abs(current) * signs)


def _without_still_counters(columns, notes):
    """Columns without a counter of charge that shows one number in all rows, under a current."""
    kept = dict(columns)
    for name in {STEP_CHARGE, NET} & columns.keys():
        if np.any(columns["current_ampere"]) and np.nanmin(kept[name]) == np.nanmax(kept[name]):
            notes.append(f"{name} is {kept[name][0]:g} in all rows: not counted, and left out")
            del kept[name]
    return kept


def _with_counters(columns):
    """Columns with the net counter that one of unknown scope is: what it counts, its falls tell."""
    energy = columns.pop(STEP_ENERGY, None)
    if energy is not None:
        columns[ENERGY] = _net(np.abs(energy), columns["current_ampere"])
    counter = columns.pop(STEP_CHARGE, None)
    if counter is not None and NET not in columns:
        fallen = np.flatnonzero(np.diff(counter) < 0)
        # Magnitudes fall where they begin anew from zero; one that falls row by row counts net.
        by_rows = np.abs(counter[fallen + 1]) > 0.5 * np.abs(counter[fallen])
        net = 2 * np.count_nonzero(by_rows) > len(fallen)
        columns[NET] = counter if net else _net(np.abs(counter), columns["current_ampere"])
    return columns


def _net(magnitude, current):
    """Net charge [Ah], or energy, from a counter of magnitudes that begins anew with steps."""
    sign = np.sign(current)
    moved = np.diff(magnitude, prepend=magnitude[:1])
    moved = np.where(moved < 0, magnitude, moved)
    return np.cumsum(moved * sign)


def _spectrum(columns):
    size, phase = (columns.pop(name, None) for name in POLAR)
    if "impedance_real_ohm" not in columns:
        turned = size * np.exp(1j * np.radians(phase))
        columns |= {"impedance_real_ohm": turned.real, IMAGINARY: turned.imag}
    rows = columns["frequency_hertz"] > 0  # others are the load before the sweep, as Parstat writes
    return {name: values[rows] for name, values in columns.items()}


def _without_dead(columns, notes):
    """Columns without thermometers that show 0 in all rows, as inputs that are not connected do.

    Those beyond what a cell survives are left out for every reader, in `physics`.
    """
    for name in [name for name in columns if name.endswith("temperature_celsius")]:
        shown = columns[name][np.isfinite(columns[name])]
        if len(shown) and not np.any(shown):
            notes.append(f"{name} shows 0 °C in all rows: not connected, and left out")
            del columns[name]
    return columns
