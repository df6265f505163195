"""Tables of OCV and resistance that a user knows of a cell, from CSV files that cells.tsv names."""

import csv
from pathlib import Path

from cellwright.refusal import Refusal

COLUMNS = ("soc", "ocv_volt", "resistance_ohm")


def read(path, name) -> dict:
    """Columns of a file, as lists of numbers.

    Raises
    ------
    Refusal
        Where there is no such file, a column is missing or a value is no number.
    """
    if not Path(path).is_file():
        raise Refusal(f"model_table: no file {name} in the campaign")
    with Path(path).open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    found = list(rows[0]) if rows else []
    if not set(COLUMNS) <= set(found):
        wanted = ", ".join(COLUMNS)
        raise Refusal(f"{name}: found columns {', '.join(found) or 'none'}, wanted {wanted}")
    try:
        return {column: [float(row[column]) for row in rows] for column in COLUMNS}
    except (TypeError, ValueError) as error:
        raise Refusal(f"{name}: a value of {', '.join(COLUMNS)} is no number: {error}") from error
