"""Records of one cell of a campaign: read from its raw files, laid out, written again as BDF."""

import io
from pathlib import Path
from typing import NamedTuple

import numpy as np

import cellwright as cw
from runtime import raw_files

# Tests that a search for missing effects reads; what is planted changes all of them alike.
KINDS = ("ocv", "capacity", "hppc", "pulse_resistance", "drive")
REST_C_RATE = 0.01
FROM_FULL = 0.5  # of the capacity: a record that moves so much reaches full once
REFERENCE_CELSIUS = 25.0
MOST_ROWS = 6000  # of one record that are compared
SOC_RANGE = (0.15, 1.0)  # below, a loaded cell is near its end, where any plain circuit fails
COUNTER = "net_capacity_ampere_hour"
LABELS = {
    "test_time_second": "Test Time / s",
    "unix_time_second": "Unix Time / s",
    "current_ampere": "Current / A",
    "voltage_volt": "Voltage / V",
    COUNTER: "Net Capacity / Ah",
    "ambient_temperature_celsius": "Ambient Temperature / degC",
    "surface_temperature_celsius": "Surface Temperature T1 / degC",
    "step_index": "Step Index / 1",
    "step_count": "Step Count / 1",
    "cycle_count": "Cycle Count / 1",
}


class Record(NamedTuple):
    """One test of a real cell.

    `columns`: as the pipeline's reader gives them, (m,) each. `rows`: (n,) places of the rows that
    the pipeline's cleaning keeps. `row`: of tests.tsv. The other arrays, (n,) each, are of these
    rows: `second` since the first one, the clock put right; `ampere`, positive on charge; `volt`;
    `celsius` as logged, else as the sheet says; `step_second` since the row before; `mean_ampere`
    that flowed since then; `counted_ampere_hour` since the first row; `soc` [1] (NaN until
    `laid_out`); `fits` and `judges`: rows on which a model is fitted, or judged, thinned evenly.
    """

    row: dict
    columns: dict[str, np.ndarray]
    rows: np.ndarray
    second: np.ndarray
    ampere: np.ndarray
    volt: np.ndarray
    celsius: np.ndarray
    step_second: np.ndarray
    mean_ampere: np.ndarray
    counted_ampere_hour: np.ndarray
    soc: np.ndarray
    fits: np.ndarray
    judges: np.ndarray

    def with_volt(self, change_volt):
        """The record with (n,) volts added to its readings."""
        columns = dict(self.columns)
        columns["voltage_volt"] = columns["voltage_volt"].copy()
        columns["voltage_volt"][self.rows] += change_volt
        return self._replace(columns=columns, volt=self.volt + change_volt)

    def with_ampere(self, gain, offset_ampere):
        """The record as an ammeter with this gain [1] and offset [A] shows it, its counter too."""
        columns = dict(self.columns)
        columns["current_ampere"] = columns["current_ampere"].copy()
        columns["current_ampere"][self.rows] = gain * self.ampere + offset_ampere
        if COUNTER in columns:
            hour = (columns["test_time_second"] - columns["test_time_second"][0]) / 3600
            columns[COUNTER] = gain * columns[COUNTER] + offset_ampere * hour
        flowing = self.step_second > 0
        return self._replace(
            columns=columns,
            ampere=gain * self.ampere + offset_ampere,
            mean_ampere=gain * self.mean_ampere + offset_ampere * flowing,
            counted_ampere_hour=gain * self.counted_ampere_hour
            + offset_ampere * self.second / 3600,
        )


class RealCell(NamedTuple):
    """A cell's row of cells.tsv, its capacity [Ah], its records, and the place of the slow test.

    `slow`: number of the slow test nearest 25 °C among the records, None without one.
    """

    row: dict
    capacity_ampere_hour: float
    records: tuple[Record, ...]
    slow: int | None


JUDGING = ("validation", "split")


def cells_with_proof(campaign, proof=()) -> list[str]:
    """Cells of a campaign with a test that judges and a test that is fitted, of `KINDS`.

    Parameters
    ----------
    campaign : `runtime.sheets.Campaign`. proof : names of tests of role fit that are set aside.
    """
    roles = {row["cell"]: set() for row in campaign.cells}
    for row in (row for row in campaign.tests if row["kind"] in KINDS):
        roles[row["cell"]].add("validation" if row["test"] in proof else row["role"])
    return [cell for cell, has in roles.items() if has & set(JUDGING) and has & {"fit", "split"}]


def cell_of(campaign, cell: str, folder, *, proof=()) -> RealCell:
    """One cell of a campaign, with at least one record that judges.

    Parameters
    ----------
    campaign : `runtime.sheets.Campaign`, read from `folder`.
    proof : names of tests of role fit that are set aside to judge.

    Raises
    ------
    ValueError : no such cell or test, no record that judges or none that is fitted, or a record
        whose state of charge is not known.
    """
    cells = {row["cell"]: row for row in campaign.cells}
    if cell not in cells:
        raise ValueError(f"{folder}: no cell {cell!r} in cells.tsv; there are {', '.join(cells)}")
    rows = [row for row in campaign.tests if row["cell"] == cell and row["kind"] in KINDS]
    if unknown := sorted(set(proof) - {row["test"] for row in rows}):
        raise ValueError(f"{folder}: {cell} has no test {', '.join(unknown)} to set aside")
    rows = [row | ({"role": "validation"} if row["test"] in proof else {}) for row in rows]
    if not any(row["role"] in JUDGING for row in rows):
        names = ", ".join(row["test"] for row in rows) or "none"
        raise ValueError(
            f"{folder}: {cell} has no proof record: no test has role validation or split, so "
            f"nothing could judge a name. Set tests aside with `proof`; its tests are {names}"
        )
    records = tuple(_read(row, Path(folder), campaign.config) for row in rows)
    if not any(record.fits.any() for record in records):
        raise ValueError(f"{folder}: {cell} has no record to fit: all its tests judge")
    whole = laid_out(cells[cell], records)
    return whole._replace(records=tuple(_compared(one) for one in whole.records))


def _compared(record):
    """The record with fewer rows of either role: evenly thinned, none on the steep ends."""
    rows = every_so_many(record)
    rows &= (record.soc >= SOC_RANGE[0]) & (record.soc <= SOC_RANGE[1])
    return record._replace(fits=record.fits & rows, judges=record.judges & rows)


def every_so_many(record: Record) -> np.ndarray:
    """Mask (n,) of at most `MOST_ROWS` rows, evenly."""
    kept = np.zeros(record.rows.size, bool)
    kept[:: max(1, -(-record.rows.size // MOST_ROWS))] = True
    return kept


def _read(row, folder, config):
    contents = raw_files.contents([str(folder / file) for file in row["file"]], row["sha256"])
    raw = cw.read(contents, instrument=row["instrument"], current_sign=row["current_sign"])
    columns = {name: np.asarray(values, float) for name, values in raw.columns.items()}
    record = _record(row, columns, config["clean"])
    if row["role"] == "validation":
        return record._replace(fits=record.judges, judges=record.fits)
    if row["role"] == "split":
        even = _blocks(record, config["models"]["split_rest_second"]) % 2 == 1
        return record._replace(fits=~even, judges=even)
    return record


def _record(row, columns, cleaning):
    """A record from the columns of its files; the state of charge and the roles are left open."""
    numbered = columns | {"row_number": np.arange(columns["voltage_volt"].size, dtype=float)}
    clean = cw.clean(numbered, cleaning).columns
    rows = clean["row_number"].astype(int)
    second, counted = clean["test_time_second"], clean["charge_ampere_hour"]
    step = np.diff(second, prepend=second[0])
    moved = np.diff(counted, prepend=counted[0])
    return Record(
        row=row,
        columns=columns,
        rows=rows,
        second=second - second[0],
        ampere=columns["current_ampere"][rows],
        volt=columns["voltage_volt"][rows],
        celsius=_celsius(row, columns, rows),
        step_second=step,
        mean_ampere=np.divide(3600 * moved, step, out=np.zeros(rows.size), where=step > 0),
        counted_ampere_hour=counted - counted[0],
        soc=np.full(rows.size, np.nan),
        fits=np.ones(rows.size, bool),
        judges=np.zeros(rows.size, bool),
    )


def _celsius(row, columns, rows):
    """Temperature (n,) [°C]: of the surface where it was logged, else of the chamber."""
    stated = row["ambient_temperature_celsius"]
    celsius = np.full(rows.size, REFERENCE_CELSIUS if stated is None else stated, float)
    for name in ("ambient_temperature_celsius", "surface_temperature_celsius"):
        logged = columns.get(name, np.full(rows[-1] + 1, np.nan))[rows]
        celsius = np.where(np.isfinite(logged) & (np.abs(logged) < 100), logged, celsius)
    return celsius


def _blocks(record, rest_second):
    """Number of the block (n,) of each row; a block is a load and the long rest after it."""
    largest = np.abs(record.ampere).max()
    rest = np.abs(record.ampere) < REST_C_RATE * largest
    edges = np.flatnonzero(np.diff(rest.astype(int), prepend=0, append=0))
    begins, ends = edges[::2], edges[1::2]
    last = np.minimum(ends, rest.size - 1)
    long = record.second[last] - record.second[begins] >= rest_second
    # A rest at the very start belongs to the first load.
    cuts = ends[long & (begins > 0) & (ends < rest.size)]
    return np.searchsorted(cuts, np.arange(rest.size), side="right")


def laid_out(row: dict, records: tuple[Record, ...]) -> RealCell:
    """A cell from its records: its capacity, and the state of charge of all rows.

    1. The capacity is what the slow test nearest 25 °C discharged; without one, the most that a
    capacity test moved, else any test. 2. Each branch of this slow test runs from end to end of the
    scale by its own count. 3. Another record starts at the state of charge that the sheet says;
    else the record that moves more than half of the capacity is full where its count is highest.

    Raises
    ------
    ValueError : a record of which neither is known.
    """
    # ASSUME: A record of more than half of the capacity, of unstated start, reaches full once.
    slow = [
        k for k, one in enumerate(records) if one.row["kind"] == "ocv" and one.row["role"] == "fit"
    ]
    slow.sort(key=lambda k: abs(np.median(records[k].celsius) - REFERENCE_CELSIUS))
    if slow:
        capacity, soc = _slow_soc(records[slow[0]])
    else:
        whole = [one for one in records if one.row["kind"] == "capacity"]
        capacity = max(float(np.ptp(one.counted_ampere_hour)) for one in whole or records)
    placed = tuple(
        one._replace(soc=soc if k in slow[:1] else _soc(one, capacity))
        for k, one in enumerate(records)
    )
    return RealCell(row, capacity, placed, slow[0] if slow else None)


def _slow_soc(record):
    """(capacity [Ah], state of charge (n,)) of a slow test: each branch by its own count."""
    counted = record.counted_ampere_hour
    empty = int(np.argmin(counted))
    down, up = counted[: empty + 1], counted[empty:]
    swings = [float(np.ptp(down)), float(np.ptp(up))]
    # A test of one direction alone, and the rest before or after it.
    discharged, charged = (swing > FROM_FULL * max(swings) for swing in swings)
    capacity = swings[0] if discharged else swings[1]
    scale = [swings[0] if discharged else capacity, swings[1] if charged else capacity]
    soc = np.concatenate([(down - counted[empty]) / scale[0], (up[1:] - counted[empty]) / scale[1]])
    return capacity, soc


def _soc(record, capacity):
    counted = record.counted_ampere_hour / capacity
    if record.row["soc"] is not None:
        return record.row["soc"] + counted
    if np.ptp(counted) < FROM_FULL:
        raise ValueError(
            f"{record.row['cell']}/{record.row['test']}: the state of charge at its start is not "
            f"stated, and it moves only {np.ptp(counted):.0%} of the capacity; state `soc`"
        )
    return 1.0 + counted - counted.max()


def files_of(record: Record) -> list[bytes]:
    """The record as BDF files (Parquet, all digits), one for each file that it was read from."""
    import pyarrow as pa
    from pyarrow import parquet

    number = record.columns.get("file_index", np.zeros(record.columns["voltage_volt"].size))
    names = [name for name in LABELS if name in record.columns]
    contents = []
    for one in np.unique(number):
        mine = number == one
        # A column that only other files of the test have holds no number here.
        held = [name for name in names if np.isfinite(record.columns[name][mine]).any()]
        table = pa.table({LABELS[name]: record.columns[name][mine] for name in held})
        sink = io.BytesIO()
        parquet.write_table(table, sink, compression="zstd")
        contents.append(sink.getvalue())
    return contents
