"""Delimited text as arrays of numbers, and date and clock texts as seconds."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

NO_NUMBER = ("", "NaN", "nan", "NA", "N/A", "null", "NULL")
DELIMITERS = ",;\t"


class Layout(NamedTuple):
    """How a text file is laid out."""

    labels: tuple[str, ...]  # one per field of a row, in the file's order
    delimiter: str
    first_line: int  # 1-based number, in the file, of the first line of data
    decimal_point: str = "."


def decoded(data: bytes) -> str:
    """Text of `data`: UTF-8, with or without its mark, else Latin-1, which instruments write."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def line_of(data: bytes, number: int) -> str:
    """Line `number` (1-based) of the file, without its end; empty beyond the last."""
    start = offset_of(data, number)
    end = data.find(b"\n", start)
    return decoded(data[start : len(data) if end < 0 else end]).rstrip("\r")


def offset_of(data: bytes, number: int) -> int:
    """Position of the first byte of line `number` (1-based); the file's length beyond the last."""
    position = 0
    for _ in range(number - 1):
        end = data.find(b"\n", position)
        if end < 0:
            return len(data)
        position = end + 1
    return position


def layout_of(data: bytes, *, header_line: int = 1, units_lines: int = 0) -> Layout:
    """Layout of a file with its labels in `header_line`, data below it (and below its units)."""
    header = line_of(data, header_line)
    delimiter = max(DELIMITERS, key=header.count)
    labels = tuple(label.strip().strip('"').strip() for label in header.split(delimiter))
    first_line = header_line + 1 + units_lines
    return _with_trailing_delimiter(data, Layout(labels, delimiter, first_line))


def _with_trailing_delimiter(data: bytes, layout: Layout) -> Layout:
    """The layout with one more, nameless field where rows end in a delimiter, the header not."""
    row = line_of(data, layout.first_line).split(layout.delimiter)
    if len(row) == len(layout.labels) + 1 and not row[-1].strip():
        return layout._replace(labels=(*layout.labels, ""))
    return layout


def read_numbers(
    data: bytes, layout: Layout, labels: Sequence[str], *, texts: Sequence[str] = ()
) -> dict:
    """Read the named columns of a delimited text.

    Parameters
    ----------
    data : bytes
        The whole file, unpacked.
    layout : Layout
    labels, texts : sequences of str
        Columns to read as numbers and as text; of equal labels the first in the file is read.

    Returns
    -------
    dict
        label → float64 array (missing numbers are NaN), or pyarrow string array for `texts`.

    Raises
    ------
    Refusal
        No row, a row with another number of fields, text where a number belongs.
    """
    import pyarrow as pa
    from pyarrow import csv

    body = pa.py_buffer(data).slice(offset_of(data, layout.first_line))
    place = {label: str(layout.labels.index(label)) for label in (*labels, *texts)}
    types = {place[label]: pa.float64() for label in labels}
    types |= {place[label]: pa.string() for label in texts}
    try:
        found = csv.read_csv(
            pa.BufferReader(body),
            csv.ReadOptions(column_names=[str(k) for k in range(len(layout.labels))]),
            csv.ParseOptions(delimiter=layout.delimiter),
            csv.ConvertOptions(
                include_columns=list(types),
                column_types=types,
                null_values=list(NO_NUMBER),
                decimal_point=layout.decimal_point,
            ),
        )
    except pa.ArrowInvalid as fault:
        raise _fault(data, layout, labels, str(fault)) from None
    # A column of one block is the table's own memory, which must not be written to: that one alone
    # is copied.
    numbers = {label: np.require(found[place[label]].to_numpy(), float, "W") for label in labels}
    return numbers | {label: found[place[label]].combine_chunks() for label in texts}


def _fault(data: bytes, layout: Layout, labels: Sequence[str], otherwise: str) -> Refusal:
    """The first faulty line and what is wrong with it; slow, and only called where one is."""
    import csv

    lines = decoded(data[offset_of(data, layout.first_line) :]).splitlines()
    if not any(line.strip() for line in lines):
        return Refusal("the file has a header and no row of data")
    rows = csv.reader(lines, delimiter=layout.delimiter)
    faults = (_row_fault(layout, labels, row) for row in rows)
    number, fault = next(
        ((k, fault) for k, fault in enumerate(faults, layout.first_line) if fault), (0, "")
    )
    return Refusal(f"line {number}: {fault}" if fault else f"not a readable table: {otherwise}")


def _row_fault(layout: Layout, labels: Sequence[str], row: list[str]) -> str:
    if not row:  # an empty line is no row
        return ""
    if len(row) != len(layout.labels):
        return (
            f"{len(row)} fields where {len(layout.labels)} are expected; "
            "the row is cut off or damaged"
        )
    cells = ((label, row[layout.labels.index(label)].strip()) for label in labels)
    point = layout.decimal_point
    wrong = next(((n, cell) for n, cell in cells if not _is_number(cell.replace(point, "."))), None)
    return f"column {wrong[0]!r}: found {wrong[1]!r}, a number is wanted" if wrong else ""


def _is_number(cell: str) -> bool:
    if cell in NO_NUMBER:
        return True
    try:
        np.float64(cell)
    except ValueError:
        return False
    return True


CLOCK = (
    r"^\s*(?:(?P<day>\d+)\s*d\s+)?"
    r"(?P<hour>\d+):(?P<minute>\d+):(?P<second>\d+(?:\.\d+)?)\s*$"
)


def unix_time_second(texts, formats: Sequence[str]) -> np.ndarray | None:
    """Seconds since 1970 of date texts (a pyarrow string array) in the first format that fits all.

    The instrument's local time is taken as it stands: only differences are used. None where no
    format fits, for a date that cannot be read is no date.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    texts = pc.utf8_trim_whitespace(texts)
    fraction = pc.extract_regex(texts, r"(?P<part>\.\d+)$")
    whole = pc.replace_substring_regex(texts, r"\.\d+$", "")
    for form in formats:
        try:
            seconds = pc.strptime(whole, format=form, unit="s").cast(pa.int64())
        except pa.ArrowInvalid:
            continue
        part = pc.fill_null(pc.cast(pc.struct_field(fraction, "part"), pa.float64()), 0.0)
        return seconds.to_numpy(zero_copy_only=False).astype(float) + part.to_numpy()
    return None


def clock_second(texts) -> np.ndarray:
    """Seconds of texts hh:mm:ss.mmm, hours beyond 24, or 2d hh:mm:ss; NaN where one is none."""
    import pyarrow as pa
    import pyarrow.compute as pc

    parts = pc.extract_regex(texts, CLOCK)
    day, hour, minute, second = (
        pc.cast(_or_zero(pc.struct_field(parts, name)), pa.float64()).to_numpy(zero_copy_only=False)
        for name in ("day", "hour", "minute", "second")
    )
    return day * 86400 + hour * 3600 + minute * 60 + second


def _or_zero(texts):
    """Texts with "0" in place of what a pattern found blank."""
    import pyarrow.compute as pc

    return pc.if_else(pc.equal(texts, ""), "0", texts)
