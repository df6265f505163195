"""A large text file to columns."""

import shutil
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


# Of the Arbin file, what all readers are asked for; the first three are compared.
ARBIN = ("Test Time (s)", "Current (A)", "Voltage (V)", "Charge Capacity (Ah)")
ARBIN += ("Discharge Capacity (Ah)", "Step Index", "Aux_Temperature_1 (C)")


def arbin():
    """Topic: 2,000,000 rows of 15 columns of an Arbin csv."""
    path = arbin_file(ROWS)
    table = {}
    makers = {
        "**Cellwright**": lambda: Entry("**Cellwright**", lambda: arbin_columns(path), None),
        "pyarrow": lambda: _pyarrow_arbin(path),
        "pandas": lambda: _pandas_arbin(path),
        "PyProBE": lambda: Entry("PyProBE", lambda: _pyprobe(path), None),
        "cellpy": lambda: Entry("cellpy", lambda: _cellpy(path), None, runs=1),
    }
    needed = {"pyarrow": ("pyarrow",), "pandas": ("pandas",), "PyProBE": ("pyprobe", "polars")}
    entries, skipped = where_importable(needed | {"cellpy": ("cellpy",)}, makers)

    def judge(columns):
        table.setdefault("first", columns)
        same = all(np.allclose(a, b) for a, b in zip(columns, table["first"], strict=True))
        return "equal" if same else "differs"

    size = path.stat().st_size / 1e6
    return Topic(
        "Reading an Arbin csv",
        f"{ROWS:,} rows of {COLUMNS} columns ({size:.0f} MB), from the disk's cache to columns of "
        "time, date, current, voltage, both counters, step and temperature; ours holds them "
        "against each other",
        "values equal to ours",
        [entry._replace(accuracy=judge) for entry in entries],
        skipped,
        goals=(Goal("**Cellwright**", second=1.2),),
    )


def arbin_file(rows):
    """An Arbin csv of so many rows, in a folder that ends with the machine's session; made once.

    Cycles of 140 min at 1 C of a 2.5 Ah cell, a row every 0.5 s.
    """
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow import csv

    # Not in the folder for temporary files itself: cellpy copies what it reads to there.
    path = Path(tempfile.gettempdir()) / "cellwright-benchmark" / f"arbin-{rows}.csv"
    if path.exists():
        return path
    path.parent.mkdir(exist_ok=True)
    rng = np.random.default_rng(1)
    second = 0.5 * np.arange(rows)
    phase = second % 8400
    step = np.searchsorted([3600, 4200, 7800], phase, side="right")
    ampere = np.array([2.5, 0.0, -2.5, 0.0])[step]
    ampere = np.round(ampere + rng.normal(0, 2e-4, rows) * (ampere != 0), 6)
    charge, discharge = (np.cumsum(np.maximum(s * ampere, 0)) * 0.5 / 3600 for s in (1, -1))
    soc = np.clip((charge - discharge) / 2.5, 0, 1)
    volt = np.round(3.2 + 0.9 * soc + 0.012 * ampere + rng.normal(0, 1e-4, rows), 6)
    stamps = pa.array((1_704_067_200_000 + 1000 * second).astype("datetime64[ms]"))
    columns = {
        "Data Point": np.arange(1, rows + 1),
        "Date Time": pc.strftime(stamps, "%m/%d/%Y %H:%M:%S"),
        "Test Time (s)": second,
        "Step Time (s)": np.round(phase % 600, 4),
        "Cycle Index": (second // 8400).astype(int) + 1,
        "Step Index": step + 1,
        "Current (A)": ampere,
        "Voltage (V)": volt,
        "Power (W)": np.round(ampere * volt, 6),
        "Charge Capacity (Ah)": np.round(charge, 9),
        "Discharge Capacity (Ah)": np.round(discharge, 9),
        "Charge Energy (Wh)": np.round(3.7 * charge, 8),
        "Discharge Energy (Wh)": np.round(3.6 * discharge, 8),
        "Internal Resistance (Ohm)": np.full(rows, 0.0213),
        "Aux_Temperature_1 (C)": np.round(25 + rng.normal(0, 0.05, rows), 3),
    }
    table = pa.table(columns)
    with path.open("wb") as file:  # pyarrow would put the labels between quotation marks
        file.write(",".join(table.column_names).encode() + b"\n")
        options = csv.WriteOptions(include_header=False, quoting_style="none")
        csv.write_csv(table, file, options)
    return path


def arbin_columns(path):
    """Time [s], current [A] and voltage [V], read by ours with all else that it knows."""
    with path.open("rb") as file:
        columns = formats.read(file, name=path.name).columns
    return [columns[name] for name in ("test_time_second", "current_ampere", "voltage_volt")]


def _pyarrow_arbin(path):
    from pyarrow import csv

    def run():
        options = csv.ConvertOptions(include_columns=[*ARBIN, "Date Time"])
        found = csv.read_csv(path, convert_options=options)
        return [found[name].to_numpy() for name in ARBIN[:3]]

    return Entry("pyarrow read_csv, eight columns, dates as text", run, None)


def _pandas_arbin(path):
    import pandas

    def run():
        frame = pandas.read_csv(path, usecols=[*ARBIN, "Date Time"])
        return [frame[name].to_numpy() for name in ARBIN[:3]]

    return Entry("pandas read_csv, eight columns, dates as text", run, None)


def _pyprobe(path):
    from pyprobe.cyclers.arbin import Arbin

    frame = Arbin(input_data_path=str(path)).get_pyprobe_dataframe()
    names = ("Time [s]", "Current [A]", "Voltage [V]")
    frame = frame.select(names)
    frame = frame.collect() if hasattr(frame, "collect") else frame
    return [frame[name].to_numpy() for name in names]


def _cellpy(path):
    """Its loader wants Arbin's labels with underscores: the same file with another first line."""
    import cellpy

    own = path.with_name(f"{path.stem}-underscores.csv")
    if not own.exists():
        with path.open("rb") as plain, own.open("wb") as file:
            header = plain.readline().replace(b" (", b"(").replace(b" ", b"_")
            file.write(header)
            shutil.copyfileobj(plain, file)
    cellpy.prms.Reader.sep = ","
    cell = cellpy.get(str(own), instrument="arbin_sql_csv")
    names = ("test_time", "current", "voltage")
    return [cell.data.raw[name].to_numpy() for name in names]


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
