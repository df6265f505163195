"""Excel workbooks (.xlsx): a sheet's labelled columns as numbers, and dates as seconds."""

import csv
import io
from collections.abc import Sequence
from datetime import date, datetime, time, timedelta
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

EXCEL_EPOCH_DAY = 25569.0  # of 1 January 1970 in Excel's count of days
DAY_SECOND = 86400.0
# A span of more than a day that is shown as a time of the day is read as a date of 1900.
EXCEL_EPOCH, SPAN_YEAR = datetime(1899, 12, 30), 1905


class Sheet(NamedTuple):
    """A sheet with its labels in the first row: values as they stand, one list a column."""

    name: str
    labels: tuple[str, ...]
    rows: list[list]


def is_workbook(head: bytes) -> bool:
    """Whether a file begins as a zip archive of Office's parts."""
    return head.startswith(b"PK\x03\x04") and (b"[Content_Types].xml" in head or b"xl/" in head)


def sheet_names(data: bytes) -> list[str]:
    """Names of the sheets of a workbook, in its order; raises Refusal as `sheets_of`."""
    return list(_opened(data).sheet_names)


def texts_of(data: bytes) -> dict[str, bytes]:
    """Each sheet as the csv (UTF-8) that it could be saved as, a line a row, by its name.

    Dates are written as 2024-03-01 12:00:00, spans of time as hours:minutes:seconds. A sheet
    without cells is left out. Raises Refusal as `sheets_of`.
    """
    book = _opened(data)
    return {
        name: _as_csv(rows)
        for name in book.sheet_names
        if (rows := _rows(book, name, skip_empty_area=False))
    }


def sheets_of(data: bytes, wanted) -> list[Sheet]:
    """Sheets whose name `wanted` (function, name → bool) accepts, in the order of the workbook.

    Raises
    ------
    Refusal
        The workbook is cut off or damaged, or a sheet holds no row below its labels.
    """
    book = _opened(data)
    tables = {name: _rows(book, name) for name in _named(book, wanted)}
    return [_sheet(name, rows) for name, rows in tables.items()]


def _opened(data):
    import python_calamine

    # The library reads other kinds too, whose blank cells the gate has not counted.
    if b"xl/workbook.xml" not in data:
        raise Refusal("a workbook of another kind than .xlsx; save it as .xlsx")
    try:
        return python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
    except (python_calamine.CalamineError, OSError) as fault:
        raise _damaged(fault) from None


def _rows(book, name, **how):
    """Rows of a sheet, lists of cells as they stand."""
    import python_calamine

    try:
        return book.get_sheet_by_name(name).to_python(**how)
    except (python_calamine.CalamineError, OSError) as fault:
        raise _damaged(fault) from None


def _damaged(fault):
    return Refusal(f"the Excel workbook is cut off or damaged: {fault}")


def _as_csv(rows):
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in rows:
        cells = [_written(cell) for cell in row]
        if any(cells):
            writer.writerow(cells)
        else:  # so that lines keep the numbers of rows
            text.write("\n")
    return text.getvalue().encode()


def _written(cell):
    """A cell as the text that stands in a csv."""
    if isinstance(cell, float):
        return repr(cell)
    if isinstance(cell, datetime) and cell.year < SPAN_YEAR:
        cell = cell - EXCEL_EPOCH
    if isinstance(cell, timedelta):
        seconds = cell.total_seconds()
        return f"{int(seconds // 3600)}:{int(seconds // 60 % 60):02}:{seconds % 60:.10g}"
    if isinstance(cell, date) and not isinstance(cell, datetime):
        return f"{cell} 00:00:00"
    return " ".join(str(cell).split())


def _named(book, wanted):
    """Names of the sheets that are wanted; refused where there is none."""
    names = [name for name in book.sheet_names if wanted(name)]
    if not names:
        have = ", ".join(map(repr, book.sheet_names))
        raise Refusal(f"an Excel workbook of no instrument known here: its sheets are {have}")
    return names


def _sheet(name, rows):
    filled = [row for row in rows if any(cell != "" for cell in row)]
    if len(filled) < 2:
        raise Refusal(f"sheet {name!r} has no row of data")
    return Sheet(name, tuple(str(cell).strip() for cell in filled[0]), filled[1:])


def numbers(sheet: Sheet, labels: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of a sheet as numbers, blank cells NaN; of equal labels the first one.

    Raises
    ------
    Refusal
        Text, or a date, where a number belongs, with sheet, row of data and column.
    """
    return {label: _numbers(sheet, label) for label in labels}


def _numbers(sheet, label):
    place = sheet.labels.index(label)
    cells = [np.nan if row[place] == "" else row[place] for row in sheet.rows]
    wrong = next((k for k, cell in enumerate(cells) if not isinstance(cell, int | float)), None)
    if wrong is not None:
        found = f"found {cells[wrong]!r}, a number is wanted"
        raise Refusal(f"sheet {sheet.name!r}, row {wrong + 1} of data, column {label!r}: {found}")
    return np.array(cells, float)


def dates(sheet: Sheet, label: str) -> np.ndarray | None:
    """Seconds since 1970 of a column of dates, in local time as it stands; None where one is none.

    Excel's dates may be cells of type date, or bare counts of days since 1900.
    """
    place = sheet.labels.index(label)
    seconds = [_second(row[place]) for row in sheet.rows]
    return None if None in seconds else np.array(seconds)


def _second(cell):
    if isinstance(cell, date):  # midnight is read as a date without a time
        cell = cell if isinstance(cell, datetime) else datetime.combine(cell, time())
        return (cell - datetime(1970, 1, 1)).total_seconds()
    if isinstance(cell, float | int) and cell > EXCEL_EPOCH_DAY:
        return (cell - EXCEL_EPOCH_DAY) * DAY_SECOND
    return None
