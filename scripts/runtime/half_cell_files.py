"""Half cells that a user measured, from CSV files that cells.tsv names."""

import csv
from pathlib import Path

from cellwright.health.electrodes.half_cells import from_table
from cellwright.refusal import Refusal
from runtime import provenance

COLUMNS = ("lithiation", "potential_volt")


def given(materials, paths) -> tuple:
    """Negative and positive half cell: HalfCell of a file, name of the library, None where blank.

    `paths` are the job's inputs among which the files are.
    """
    files = {provenance.name_of(path): path for path in paths}
    names = [materials[f"{electrode}_half_cell"] for electrode in ("negative", "positive")]
    return tuple(read(files[name], name) if name in files else name or None for name in names)


def read(path, name):
    """Half cell of a file.

    Raises
    ------
    Refusal
        Where a column is missing or a value is no number.
    """
    with Path(path).open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    found = list(rows[0]) if rows else []
    if not set(COLUMNS) <= set(found):
        wanted = ", ".join(COLUMNS)
        raise Refusal(f"{name}: found columns {', '.join(found) or 'none'}, wanted {wanted}")
    try:
        columns = [[float(row[column]) for row in rows] for column in COLUMNS]
    except (TypeError, ValueError) as error:
        raise Refusal(f"{name}: a value of {' or '.join(COLUMNS)} is no number: {error}") from error
    return from_table(*columns, name=name)
