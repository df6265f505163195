"""Columns of numbers and dates as rows of a text file, with the digits that Python gives."""

import gzip
import io
from datetime import datetime
from functools import cache
from typing import NamedTuple

import numpy as np

from virtual_lab.behaviour import running_integral

TIGHTLY_PACKED_BYTES = 2_000_000


class Written(NamedTuple):
    """A column of a file: label, values, and decimals; None: whole numbers, or text as it is.

    Numbers with decimals that are NaN are written as `missing`.
    """

    label: str
    values: object
    decimals: int | None = None
    missing: str = ""


def rows_of(columns: list[Written], *, delimiter: str = ",") -> bytes:
    """Rows of a delimited text, without a header, each ended by a line feed."""
    import pyarrow as pa
    from pyarrow import csv

    arrays = [_array(column) for column in columns]
    table = pa.table(arrays, names=[str(k) for k in range(len(columns))])
    buffer = io.BytesIO()
    options = csv.WriteOptions(include_header=False, delimiter=delimiter, quoting_style="none")
    csv.write_csv(table, buffer, options)
    return buffer.getvalue()


def labels_of(columns: list[Written], *, delimiter: str = ",") -> bytes:
    """The header line with the columns' labels."""
    return (delimiter.join(column.label for column in columns) + "\n").encode()


def packed(content: bytes) -> bytes:
    """Gzipped without name and time, so that equal content gives equal bytes.

    Large files are compressed less: a sixth larger, and ten times as fast.
    """
    level = 9 if len(content) <= TIGHTLY_PACKED_BYTES else 4
    return gzip.compress(content, compresslevel=level, mtime=0)


def same(value, rows: int) -> np.ndarray:
    """A column of one value."""
    return np.full(rows, value)


def signed(current_ampere: np.ndarray, discharge_positive: bool) -> np.ndarray:
    """The current in the file's sign; adding zero turns -0.0, written as "-0.000", into 0.0."""
    return (-current_ampere if discharge_positive else current_ampere) + 0.0


def step_begins(step: np.ndarray) -> np.ndarray:
    """For each row, the first row of its step."""
    first = np.concatenate([[True], step[1:] != step[:-1]])
    return np.flatnonzero(first)[np.cumsum(first) - 1]


def energy_watt_hour(columns) -> np.ndarray:
    """Net energy [Wh] since the first row, by the trapezoid rule on the values shown."""
    power = np.nan_to_num(columns["voltage_volt"] * columns["current_ampere"])
    return running_integral(columns["time_second"], power) / 3600


def cycles(columns) -> np.ndarray:
    """Cycle number where the record has one, else 1."""
    return columns.get("cycle", same(1, columns["step"].size))


def _array(column: Written):
    import pyarrow as pa

    if column.decimals is not None:
        return _fixed(np.asarray(column.values, float), column.decimals, column.missing)
    if isinstance(column.values, np.ndarray) and column.values.dtype.kind == "f":
        return pa.array(np.rint(column.values).astype(np.int64))
    return pa.array(column.values)


def _fixed(values: np.ndarray, decimals: int, nothing: str):
    """Numbers with so many decimals, as "%.3f" would write them."""
    import pyarrow as pa

    missing = ~np.isfinite(values)
    whole = _scaled(np.where(missing, 0.0, values), decimals)
    # A decimal number of 128 bits is this integer with its sign in the upper half.
    bits = np.column_stack([whole, whole >> 63]).astype("<i8")
    kind = pa.decimal128(18, decimals)
    shown = pa.Array.from_buffers(kind, whole.size, [None, pa.py_buffer(bits.tobytes())])
    negative_zero = (whole == 0) & np.signbit(values) & ~missing
    if not (missing.any() or negative_zero.any()):
        return shown
    return _patched(shown, {f"{-0.0:.{decimals}f}": negative_zero, nothing: missing})


def _patched(shown, texts: dict):
    """The numbers as text, with other text where a mask is true."""
    import pyarrow as pa
    import pyarrow.compute as pc

    shown = pc.cast(shown, pa.string())
    for text, mask in texts.items():
        shown = pc.if_else(pa.array(mask), pa.scalar(text, pa.string()), shown)
    return shown


def _scaled(values, decimals):
    """Value × 10^decimals, rounded; values nearly halfway are rounded by Python itself."""
    if np.abs(values).max(initial=0.0) * 10**decimals > 9e17:
        raise ValueError(f"{np.abs(values).max():g} has too many digits for a fixed-point column")
    scaled = values * 10.0**decimals
    whole = np.rint(scaled).astype(np.int64)
    doubtful = np.flatnonzero(np.abs(np.abs(scaled - np.floor(scaled)) - 0.5) < 1e-4)
    for row in doubtful:
        whole[row] = int(f"{values[row]:.{decimals}f}".replace(".", ""))
    return whole


START = datetime(2024, 3, 4, 8, 0, 0)
UNIX_START_SECOND = 1_709_539_200.0
DAY_SECOND = 86_400


def date_texts(time_second: np.ndarray, *, day: str, clock: str):
    """Date of each row, to the whole second, as a pyarrow array of texts.

    Parameters
    ----------
    time_second : since the start of the test [s].
    day, clock : forms of strftime; an hour in the form %-I has no leading zero, as in Windows.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    start = START - datetime(START.year, START.month, START.day)
    since = np.floor(np.asarray(time_second)).astype(np.int64) + int(start.total_seconds())
    days, which = np.unique(since // DAY_SECOND, return_inverse=True)
    first = np.datetime64(START, "D")
    texts = pc.strftime(pa.array((first + days).astype("datetime64[s]")), format=day)
    clocks = _clock_texts(clock).take(pa.array(since % DAY_SECOND))
    return pc.binary_join_element_wise(texts.take(pa.array(which)), clocks, " ")


@cache
def _clock_texts(form):
    """Every second of a day."""
    import pyarrow as pa
    import pyarrow.compute as pc

    seconds = pa.array(np.arange(DAY_SECOND).astype("datetime64[s]"))
    texts = pc.strftime(seconds, format=form.replace("%-I", "%I"))
    return pc.replace_substring_regex(texts, "^0", "") if "%-I" in form else texts
