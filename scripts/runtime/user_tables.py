"""Tables of numbers that a user knows of a cell, from CSV files that cells.tsv names."""

import csv
import io

from cellwright import gate
from cellwright.health.electrodes.half_cells import half_cell
from cellwright.health.electrodes.names import half_cell_files
from cellwright.health.electrodes.tables import from_table
from cellwright.refusal import Refusal
from runtime import provenance, raw_files

MODEL = ("soc", "ocv_volt", "resistance_ohm")
HALF_CELL = ("lithiation", "potential_volt")


def half_cells(materials, paths) -> tuple:
    """Negative and positive half cell: HalfCell of a file, name of the library, None where blank.

    `paths` are the job's inputs among which the files are. A blend may be of files, of names of the
    library, or of one of each.
    """
    files = {provenance.name_of(path): path for path in paths}
    names = [materials[f"{electrode}_half_cell"] for electrode in ("negative", "positive")]
    own = {
        file: from_table(*read(files.get(file, file), file, HALF_CELL).values(), name=file)
        for name in names
        for file in half_cell_files(name)
    }
    return tuple(half_cell(name, own) if half_cell_files(name) else name or None for name in names)


def read(path, name, columns) -> dict:
    """Columns of a file, by name, as lists of numbers.

    Raises
    ------
    Refusal
        Where the gate does not open the file, a column is missing or a value is no number.
    """
    reason = gate.obstacle(path, raw_files.CAMPAIGN)
    if reason:
        raise Refusal(f"{name}: {reason}")
    data = gate.contents(path, within=raw_files.CAMPAIGN)
    try:
        # Spreadsheets write a byte-order mark, which would be part of the first column's name.
        reader = csv.DictReader(io.StringIO(data.decode("utf-8-sig"), newline=""))
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
