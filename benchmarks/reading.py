"""A large text file to columns."""

import tempfile
from pathlib import Path

import numpy as np
from timing import Entry, Goal, Topic, where_importable

from cellwright import formats

ROWS, COLUMNS = 2_000_000, 15
KEPT = ("Test Time / s", "Current / A", "Voltage / V")


def topic():
    """Topic: 2,000,000 rows of 15 columns."""
    path = _written()
    table = {}
    makers = {
        "**Cellwright**": lambda: Entry("**Cellwright**", lambda: _ours(path), None),
        "pandas": lambda: _pandas(path),
        "pyarrow": lambda: _pyarrow(path),
    }
    entries, skipped = where_importable({"pandas": ("pandas",), "pyarrow": ("pyarrow",)}, makers)

    def judge(columns):
        table.setdefault("first", columns)
        same = all(np.array_equal(a, b) for a, b in zip(columns, table["first"], strict=True))
        return "equal" if same else "differs"

    size = path.stat().st_size / 1e6
    return Topic(
        "Reading a text file",
        f"{ROWS:,} rows of {COLUMNS} numbers ({size:.0f} MB of BDF), from the disk's cache to "
        "arrays of time, current and voltage; ours also checks clock, sign and range of every row",
        "values equal to ours",
        [entry._replace(accuracy=judge) for entry in entries],
        skipped,
        goals=(Goal("**Cellwright**", times=1.5, of="pyarrow read_csv, three columns"),),
    )


def _written():
    """The file, in a folder that ends with the machine's session; made once."""
    import pyarrow as pa
    from pyarrow import csv

    path = Path(tempfile.gettempdir()) / f"cellwright-benchmark-{ROWS}.bdf.csv"
    if not path.exists():
        rng = np.random.default_rng(3)
        columns = {name: _column(name, rng) for name in KEPT}
        for k in range(COLUMNS - len(KEPT)):
            columns[f"Auxiliary {k} / 1"] = np.round(rng.normal(size=ROWS), 4)
        csv.write_csv(pa.table(columns), path, csv.WriteOptions(quoting_style="none"))
    return path


def _column(name, rng):
    if name == KEPT[0]:
        return np.arange(ROWS) * 0.1
    if name == KEPT[1]:
        return np.round(np.repeat(rng.uniform(-3, 3, ROWS // 1000), 1000), 4)
    return np.round(3.7 + 0.1 * np.sin(np.arange(ROWS) / 1e4), 4)


def _ours(path):
    columns = formats.read(path.read_bytes(), name=path.name, instrument="bdf").columns
    return [columns[name] for name in ("test_time_second", "current_ampere", "voltage_volt")]


def _pandas(path):
    import pandas

    def run():
        frame = pandas.read_csv(path, usecols=list(KEPT))
        return [frame[name].to_numpy() for name in KEPT]

    return Entry("pandas read_csv, three columns", run, None)


def _pyarrow(path):
    from pyarrow import csv

    def run():
        options = csv.ConvertOptions(include_columns=list(KEPT))
        found = csv.read_csv(path, convert_options=options)
        return [found[name].to_numpy() for name in KEPT]

    return Entry("pyarrow read_csv, three columns", run, None)
