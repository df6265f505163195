"""A workbook's sheets as the csv that they would be saved as: with labels, of any maker or of none.

A table that fills a sheet goes on in others of the same labels.
"""

from itertools import pairwise

import numpy as np

from cellwright.formats.workbook import is_workbook, texts_of
from cellwright.refusal import Refusal

NAME = "workbook"
recognises = is_workbook


def read(data: bytes, known, read_one):
    """Name of the reader of a workbook's table, its columns, notes, sign, formats of its dates.

    Parameters
    ----------
    data : the workbook.
    known : function, csv → (name of its reader, number of the line of its labels), or None.
    read_one : function, name of a reader and csv → columns, notes, sign and so on.

    Raises
    ------
    Refusal
        No sheet holds readings, or several do that do not go on in each other.
    """
    texts = texts_of(data)
    found = {sheet: about for sheet, text in texts.items() if (about := known(text))}
    if not found:
        raise Refusal(
            f"an Excel workbook of no instrument known here: its sheets are {_named(texts)}; none "
            "has labels of time, current and voltage, or of frequency and impedance, such as "
            "Time (s), Current (A), Voltage (V), in one row"
        )
    lines = {sheet: texts[sheet].splitlines() for sheet in found}
    tables = {(reader, lines[sheet][row - 1]) for sheet, (reader, row) in found.items()}
    if len(tables) > 1:
        raise Refusal(
            f"sheets {_named(found)} hold tables of different labels; one table a file is wanted: "
            "save the sheet that is meant as a file of its own"
        )
    reader = next(iter(found.values()))[0]
    order = list(found)
    if len(found) > 1:
        parts = {sheet: _of_sheet(sheet, read_one, reader, texts[sheet])[0] for sheet in found}
        order = _in_order(parts)
    first, *others = order
    rows = [row for sheet in others for row in lines[sheet][found[sheet][1] :]]
    joined = b"\n".join([*lines[first], *rows])
    columns, notes, *rest = _of_sheet(first, read_one, reader, joined)
    left = [sheet for sheet in texts if sheet not in found]
    notes = [*notes, f"sheets that are not read: {_named(left)}"] if left else list(notes)
    return reader, columns, notes, *rest


def _named(sheets):
    return ", ".join(map(repr, sheets)) or "none"


def _of_sheet(sheet, read_one, reader, text):
    """What is read of a sheet; its refusals name it, their lines are its rows."""
    try:
        return read_one(reader, text)
    except Refusal as reason:
        raise Refusal(f"sheet {sheet!r}, whose rows are called lines: {reason}") from None


def _in_order(parts):
    """Names of sheets in the order of their clocks.

    In that of the workbook where a clock begins anew within one, as those of steps do.
    """
    name = "unix_time_second" if all("unix_time_second" in p for p in parts.values()) else None
    clocks = {sheet: part[name or "test_time_second"] for sheet, part in parts.items()}
    if any(np.any(np.diff(clock) < 0) for clock in clocks.values()):
        return list(parts)
    order = sorted(parts, key=lambda sheet: clocks[sheet][0])
    for before, after in pairwise(order):
        end, start = clocks[before][-1], clocks[after][0]
        if start < end:
            raise Refusal(
                f"sheets {_named(parts)} run at the same time ({after!r} begins {end - start:g} s "
                f"before {before!r} ends), so they are several channels; one channel a file is "
                "wanted"
            )
    return order
