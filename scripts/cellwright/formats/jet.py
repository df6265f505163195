"""Jet data bases (Microsoft Access) as tables of numbers: all rows that a table counts, or none.

The library access-parser (Apache 2.0) tells tables and columns. Rows are taken from the pages here:
by the library each takes a third of a millisecond.
"""

import struct
from contextlib import contextmanager

import numpy as np

from cellwright.refusal import Refusal

MARKS = (b"\x00\x01\x00\x00Standard Jet DB", b"\x00\x01\x00\x00Standard ACE DB")
DATA = b"\x01\x01"  # begins a page of rows
DELETED, ELSEWHERE, PLACE = 0x8000, 0x4000, 0x1FFF  # of the two bytes that say where a row begins
# Types of columns that hold numbers: as they lie in a row, and what one of them is worth.
NUMBERS = {
    2: ("u1", 1.0), 3: ("<i2", 1.0), 4: ("<i4", 1.0), 5: ("<i8", 1e-4), 6: ("<f4", 1.0),
    7: ("<f8", 1.0), 8: ("<f8", 1.0),
}  # fmt: skip
# How the library fails on damaged bytes.
FAULTS = (ArithmeticError, AttributeError, LookupError, OSError, TypeError, ValueError)
FAULTS = (*FAULTS, RuntimeError, struct.error)


class Base:
    """A data base in memory.

    data : the whole file. What it cannot hold as a whole is refused here, and by each method.
    """

    def __init__(self, data: bytes):
        self.data, self.content = data, np.frombuffer(data, np.uint8)
        with _faults_refused():
            self.base = _opened(data)
        self.size = self.base.page_size
        # Of Jet 4 and later: places of the number of rows in a page, and bytes that count columns.
        self.count_at, self.counting = (12, 2) if self.base.version > 3 else (8, 1)
        if len(data) % self.size:
            raise Refusal(
                f"the data base is cut off: {len(data)} bytes are no whole number of its pages of "
                f"{self.size} bytes"
            )

    def numbers(self, name: str) -> dict[str, np.ndarray]:
        """Columns (n,) of a table that hold numbers, NaN where blank, rows as they lie on pages.

        Dates are days since 30 December 1899.

        Raises
        ------
        Refusal
            No table of this name, another number of rows than it counts, or a damaged row.
        """
        with _faults_refused():
            table = self.base.get_table(name) if name in self.base.catalog else None
            if table is None:
                raise Refusal(f"the data base has no table {name!r}; is it whole, and of Arbin?")
            starts, ends = self._rows(table.table.offset // self.size)
            counted = table.table_header.number_of_rows
            if len(starts) != counted:
                raise Refusal(
                    f"the data base is cut off or damaged: its table {name!r} counts {counted} "
                    f"rows, {len(starts)} are there"
                )
            columns = [column for column in table.columns.values() if column.type in NUMBERS]
            return {c.col_name_str: self._column(c, starts, ends) for c in columns}

    def texts(self, name: str) -> dict[str, list]:
        """All columns of a short table as lists, by the library; empty where there is none."""
        with _faults_refused():
            found = self.base.parse_table(name) if name in self.base.catalog else {}
            return {label: list(values) for label, values in found.items()}

    def _rows(self, owner):
        """First byte in the file of each row of a table, and the byte behind its last one."""
        starts, ends, marks = [], [], []
        for page in range(0, len(self.data), self.size):
            owned = int.from_bytes(self.data[page + 4 : page + 8], "little") == owner
            if owned and self.data.startswith(DATA, page):
                for kept, found in zip((starts, ends, marks), self._bounds(page), strict=True):
                    kept.append(found)
        starts, ends, marks = (
            np.concatenate([np.empty(0, int), *x]) for x in (starts, ends, marks)
        )
        there = marks & DELETED == 0
        for row in np.flatnonzero(there & (marks & ELSEWHERE != 0)):
            number, *page = self.data[starts[row] : starts[row] + 4]
            other = self._bounds(int.from_bytes(page, "little") * self.size)
            starts[row], ends[row] = other[0][number], other[1][number]
        return starts[there], ends[there]

    def _bounds(self, page):
        """First bytes of the rows of a page, the bytes behind their last ones, and their marks."""
        at = page + self.count_at
        count = int.from_bytes(self.data[at : at + 2], "little")
        marks = np.frombuffer(self.data, "<u2", count, at + 2).astype(int)
        starts = marks & PLACE
        ends = np.concatenate([[self.size], starts[:-1]])[:count]  # laid from the page's end on
        if np.any(starts > ends):
            raise Refusal(f"the data base is damaged: rows of page {page // self.size} overlap")
        return page + starts, page + ends, marks

    def _column(self, column, starts, ends):
        """Numbers (n,) of a column of fixed length in rows, NaN where blank."""
        kind, worth = NUMBERS[column.type]
        # Columns that there were when a row was written; a bit of each, at its end, if not blank.
        known = self.content[starts].astype(int)
        known += 256 * self.content[starts + 1].astype(int) if self.counting == 2 else 0
        place = column.column_id
        shown = self.content[np.minimum(ends - (known + 7) // 8 + place // 8, ends - 1)]
        filled = (place < known) & (shown >> place % 8 & 1 == 1)
        first = starts[filled] + self.counting + column.fixed_offset
        width = np.dtype(kind).itemsize
        if np.any(first + width > ends[filled]):
            raise Refusal(f"the data base is damaged: a row ends before {column.col_name_str!r}")
        values = np.full(len(starts), np.nan)
        read = np.ascontiguousarray(self.content[first[:, None] + np.arange(width)])
        values[filled] = read.view(kind)[:, 0] * worth
        return values


@contextmanager
def _faults_refused():
    """Refuse what the library fails at."""
    from construct import ConstructError

    try:
        yield
    except Refusal:
        raise
    except (*FAULTS, ConstructError) as fault:
        raise Refusal(f"the data base is cut off or damaged: {fault!r}") from None


def _opened(data):
    """The library's view of a data base, without what it would read of how columns are shown."""
    from access_parser import access_parser, utils

    class Parser(access_parser.AccessParser):
        def __init__(self, data):  # theirs opens a file by name
            self.db_data, self.extra_props = data, {}
            self._parse_file_header(data)
            pages = utils.categorize_pages(data, self.page_size)
            self._table_defs, self._data_pages, self._all_pages = pages
            _refuse_rings(self)
            self._tables_with_data = self._link_tables_to_data()
            self.catalog = self._parse_catalog()

    access_parser.LOGGER.disabled = utils.LOGGER.disabled = True  # a refusal says it
    return Parser(data)


def _refuse_rings(base):
    """Refuse a definition whose pages lead back to one of them: it would be read for ever."""
    following = {
        place: int.from_bytes(page[4:8], "little") * base.page_size
        for place, page in base._table_defs.items()
    }
    for place in following:
        met = set()
        while following.get(place):
            if place in met:
                raise Refusal("the data base is damaged: the definition of a table has no end")
            met.add(place)
            place = following[place]
