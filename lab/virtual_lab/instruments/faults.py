"""Faults put into records and files on purpose, and exactly where.

A fault of a record takes columns and gives them back spoiled, with rows that say what it did:
`fault`, `row` (counted from 0 in the columns it gives back) and `value` (what now stands there, or
what the fault says it is). `spoiled` applies several and counts the rows as they end up in the
file. The columns handed in are never changed.

A fault of a whole file takes bytes and gives bytes and one such row; a file spoiled in one of
these ways is beyond use, and only the message about it can be good or bad.
"""

import gzip
from collections.abc import Callable, Iterable

import numpy as np

from virtual_lab.instruments.measurement import Columns

Spoiled = tuple[Columns, list[dict]]
Fault = Callable[[Columns], Spoiled]
MARGIN_ROWS = 100


def spoiled(columns: Columns, faults: Iterable[Fault]) -> Spoiled:
    """Several faults, one after the other.

    Returns
    -------
    The columns, and a row for each fault done; rows are counted in the columns given back. Rows
    that a later fault removed from the file are not listed.
    """
    # Each row has a number that stays with it; a row written twice gets one of its own.
    number = np.arange(columns["time_second"].size)
    marked, done = columns | {"number": number}, []
    for fault in faults:
        marked, did = fault(marked)
        moved, free = marked["number"], number.max() + 1
        again = np.append(False, moved[1:] == moved[:-1]) if moved.size else np.zeros(0, bool)
        number = np.where(again, free + np.cumsum(again), moved)
        marked["number"] = number
        done += [row | {"row": int(number[row["row"]])} for row in did]
    place = {int(one): row for row, one in enumerate(marked.pop("number"))}
    return marked, [row | {"row": place[row["row"]]} for row in done if row["row"] in place]


def spikes(
    columns: Columns,
    *,
    seed: int,
    count: int = 2,
    size_volt: float = 0.06,
    channel: str = "voltage_volt",
) -> Spoiled:
    """Single corrupt samples, one up, one down, as in the thesis (figure 5.3: within 50 mV).

    `size_volt` is in the channel's own unit where that is not the voltage.
    """
    random = np.random.default_rng(seed)
    inside = np.arange(MARGIN_ROWS, columns[channel].size - MARGIN_ROWS)
    rows = random.choice(inside, count, replace=False)
    values = columns[channel].copy()
    values[rows] += size_volt * np.resize([1.0, -1.0], count)
    return columns | {channel: values}, _rows("spike", rows, values[rows])


def noise_bursts(
    columns: Columns, *, seed: int, count: int = 3, rows_each: int = 5, size_volt: float = 0.02
) -> Spoiled:
    """Short bursts of corrupt voltage, as another device on the same supply leaves them."""
    random = np.random.default_rng(seed)
    begins = _apart(random, columns["step"].size, count=count, length=rows_each)
    rows = (begins[:, None] + np.arange(rows_each)).ravel()
    volt = columns["voltage_volt"].copy()
    volt[rows] += (
        random.uniform(0.3, 1.0, rows.size) * size_volt * random.choice([-1, 1], rows.size)
    )
    return columns | {"voltage_volt": volt}, _rows("burst", rows, volt[rows])


def repeats(columns: Columns, *, seed: int, count: int = 4) -> Spoiled:
    """Some rows written twice; the second of each is listed, with its time [s]."""
    random = np.random.default_rng(seed)
    rows = np.arange(columns["step"].size)
    twice = np.sort(np.append(rows, random.choice(rows[10:-10], count, replace=False)))
    shown = {name: column[twice] for name, column in columns.items()}
    again = np.flatnonzero(np.diff(twice) == 0) + 1
    return shown, _rows("repeat", again, shown["time_second"][again])


def gap(columns: Columns, *, begin_second: float, end_second: float) -> Spoiled:
    """A gap in the record while the test goes on.

    Listed is the first row after it, with the length of the gap [s].
    """
    time = columns["time_second"]
    kept = (time < begin_second) | (time > end_second)
    shown = {name: column[kept] for name, column in columns.items()}
    after = np.count_nonzero(time < begin_second)
    if not 0 < after < shown["time_second"].size:
        raise ValueError(f"the gap from {begin_second} to {end_second} s is not within the record")
    return shown, _rows("gap", [after], [np.diff(shown["time_second"])[after - 1]])


def lost_records(columns: Columns, *, seed: int, share: float = 0.01) -> Spoiled:
    """Single rows missing here and there; listed is the row that follows, with the gap [s]."""
    random = np.random.default_rng(seed)
    kept = random.uniform(size=columns["step"].size) >= share
    kept[[0, -1]] = True
    shown = {name: column[kept] for name, column in columns.items()}
    places = np.flatnonzero(kept)
    after = np.flatnonzero(np.diff(places) > 1) + 1
    waits = np.diff(shown["time_second"], prepend=0.0)
    return shown, _rows("lost", after, waits[after])


def no_values(
    columns: Columns, *, seed: int, channel: str, count: int = 3, value: float = 3276.7
) -> Spoiled:
    """Single samples without a value: NaN (an empty field), or an instrument's code for none.

    Such codes are 3276.7 (the end of a 16-bit count of 0.1 K), 1372 (an open thermocouple of type
    K), 9999, -999 and 3.4e38 (the end of a single-precision number).
    """
    random = np.random.default_rng(seed)
    inside = np.arange(MARGIN_ROWS, columns[channel].size - MARGIN_ROWS)
    rows = np.sort(random.choice(inside, count, replace=False))
    values = columns[channel].astype(float)
    values[rows] = value
    return columns | {channel: values}, _rows("no_value", rows, values[rows])


def frozen(
    columns: Columns, *, channel: str, begin_second: float, end_second: float = np.inf
) -> Spoiled:
    """A channel that stays at the value it had at `begin_second`; all later rows are listed."""
    time = columns["time_second"]
    rows = np.flatnonzero((time >= begin_second) & (time < end_second))
    if rows.size < 2:
        raise ValueError(f"fewer than two rows between {begin_second} and {end_second} s")
    values = columns[channel].copy()
    values[rows] = values[rows[0]]
    return columns | {channel: values}, _rows("frozen", rows[1:], values[rows[1:]])


def dead(columns: Columns, *, channel: str, value: float = 0.0) -> Spoiled:
    """A channel that was not connected: one value throughout; listed is the first row."""
    values = np.full(columns[channel].size, float(value))
    return columns | {channel: values}, _rows("dead", [0], [value])


def clock_reset(columns: Columns, *, at_second: float) -> Spoiled:
    """A clock that starts again at zero; listed is the first row after, with its time [s]."""
    time = columns["time_second"]
    row = int(np.searchsorted(time, at_second))
    if not 0 < row < time.size:
        raise ValueError(f"{at_second} s is not within the record")
    shown = time.copy()
    shown[row:] = np.round(shown[row:] - time[row], 3)
    return columns | {"time_second": shown}, _rows("clock_reset", [row], [shown[row]])


def swapped_rows(columns: Columns, *, seed: int, count: int = 2) -> Spoiled:
    """Neighbouring rows in the wrong order; both of each pair are listed, with their times [s]."""
    random = np.random.default_rng(seed)
    first = _apart(random, columns["step"].size, count=count, length=2)
    order = np.arange(columns["step"].size)
    order[first], order[first + 1] = first + 1, first
    shown = {name: column[order] for name, column in columns.items()}
    rows = np.sort(np.concatenate([first, first + 1]))
    return shown, _rows("swapped", rows, shown["time_second"][rows])


def _apart(random, rows, *, count, length):
    """First rows of pieces that do not touch one another or the ends of the record."""
    free = (rows - 2 * MARGIN_ROWS) // (2 * length)
    return MARGIN_ROWS + 2 * length * np.sort(random.choice(free, count, replace=False))


def _rows(fault, rows, values) -> list[dict]:
    return [
        {"fault": fault, "row": int(row), "value": "" if np.isnan(value) else float(value)}
        for row, value in zip(rows, values, strict=True)
    ]


GZIP = b"\x1f\x8b"
HEADER_LINES = 40

SpoiledFile = tuple[bytes, list[dict]]


def cut_off(content: bytes, *, share: float = 0.6) -> SpoiledFile:
    """A file whose copying ended early; listed is how many bytes remain."""
    size = int(share * len(content))
    return content[:size], _file_row("cut_off", size)


def emptied(content: bytes) -> SpoiledFile:
    """A file of no bytes; listed is how many there were."""
    return b"", _file_row("emptied", len(content))


def header_only(content: bytes, *, lines: int = 1) -> SpoiledFile:
    """A test that never began: only the header lines; listed is how many lines remain."""
    text = _unpacked(content).splitlines(keepends=True)[:lines]
    return _as_before(content, b"".join(text)), _file_row("header_only", len(text))


def damaged(content: bytes, *, seed: int, count: int = 8) -> SpoiledFile:
    """Single bytes changed in the second half, as by a failing disk; listed is the first place."""
    random = np.random.default_rng(seed)
    places = len(content) // 2 + random.choice(len(content) // 2, count, replace=False)
    changed = np.frombuffer(content, np.uint8).copy()
    changed[places] ^= random.integers(1, 256, count, dtype=np.uint8)
    return changed.tobytes(), _file_row("damaged", int(places.min()))


def torn_row(content: bytes, *, seed: int) -> SpoiledFile:
    """A row of text that is cut in the middle; listed is its line number, from 1."""
    random = np.random.default_rng(seed)
    lines = _unpacked(content).splitlines(keepends=True)
    number = int(random.integers(min(HEADER_LINES, len(lines) // 2), len(lines) - 1))
    lines[number] = lines[number][: len(lines[number]) // 2] + b"\n"
    return _as_before(content, b"".join(lines)), _file_row("torn_row", number + 1)


def _unpacked(content):
    return gzip.decompress(content) if content.startswith(GZIP) else content


def _as_before(content, changed):
    """Compressed again if it was compressed."""
    return gzip.compress(changed, mtime=0) if content.startswith(GZIP) else changed


def _file_row(fault, value) -> list[dict]:
    return [{"fault": fault, "row": "", "value": value}]
