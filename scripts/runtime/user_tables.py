"""Tables of numbers that a user knows of a cell, from CSV files that cells.tsv names."""

import csv
import io

from cellwright.health.electrodes.half_cells import half_cell
from cellwright.health.electrodes.names import half_cell_files
from cellwright.health.electrodes.tables import from_table
from cellwright.refusal import Refusal
from runtime import raw_files

MODEL = ("soc", "ocv_volt", "resistance_ohm")
HALF_CELL = ("lithiation", "potential_volt")


def half_cells(materials, content=None) -> tuple:
    """Negative and positive half cell: HalfCell of a file, name of the library, None where blank.

    A blend may be of files, of names of the library, or of one of each. `content` as of
    `raw_files.contents`.
    """
    names = [materials[f"{electrode}_half_cell"] for electrode in ("negative", "positive")]
    own = {
        file: from_table(*read(file, HALF_CELL, content).values(), name=file)
        for name in names
        for file in half_cell_files(name)
    }
    return tuple(half_cell(name, own) if half_cell_files(name) else name or None for name in names)


def read(name, columns, content=None) -> dict:
    """Columns of a file of the campaign, by name, as lists of numbers.

    `content` as of `raw_files.contents`.

    Raises
    ------
    Refusal
        Where the gate does not open the file, a column is missing or a value is no number.
    raw_files.Changed
        It is another one than the run was planned with.
    """
    _, data = raw_files.single([name], None, content=content)
    file = io.BytesIO(data) if isinstance(data, bytes) else data
    try:
        # Spreadsheets write a byte-order mark, which would be part of the first column's name.
        reader = csv.DictReader(io.TextIOWrapper(file, encoding="utf-8-sig", newline=""))
        rows = [(reader.line_num, row) for row in reader]
    except (UnicodeDecodeError, csv.Error) as fault:
        raise Refusal(f"{name}: {fault}, wanted a CSV file in UTF-8") from None
    found = list(rows[0][1]) if rows else []
    if not set(columns) <= set(found):
        wanted = ", ".join(columns)
        raise Refusal(f"{name}: found columns {', '.join(found) or 'none'}, wanted {wanted}")
    return {
        column: [_number(row[column], name, line, column) for line, row in rows]
        for column in columns
    }


def _number(text, name, line, column):
    try:
        return float(text)
    except (TypeError, ValueError):
        raise Refusal(
            f"{name}: line {line}, column {column}: found {text!r}, wanted a number"
        ) from None
