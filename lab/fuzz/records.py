"""Clean records that are made wrong: of the demo, and of real campaigns where they lie beside."""

import csv
import gzip
from functools import cache
from pathlib import Path

import numpy as np

import cellwright as cw
from fuzz.record import (
    AMBIENT,
    CHARGED,
    CURRENT,
    CUTOFFS,
    DISCHARGED,
    SURFACE,
    TIME,
    UNIX,
    VOLTAGE,
    Record,
)

HERE = Path(__file__).resolve().parents[2]
KINDS_OF_TEST = ("capacity", "ocv", "hppc", "pulse_resistance", "ica")
MOST_ROWS = 40_000
NAMES = {
    "test_time_second": TIME,
    "current_ampere": CURRENT,
    "voltage_volt": VOLTAGE,
    "surface_temperature_celsius": SURFACE,
    "ambient_temperature_celsius": AMBIENT,
    "unix_time_second": UNIX,
}


def campaigns():
    """Folders of campaigns: the demo, and those of `../shared/campaigns` where there are any."""
    shared = HERE.parent / "shared" / "campaigns"
    names = ("a123", "panasonic", "samsung30q", "dmegc", "lg_hg2_traps", "tum_p45b", "lgm50")
    return [HERE, *(shared / name for name in names if (shared / name).is_dir())]


@cache
def entries():
    """(folder, cell facts, test facts, files) of each test that a number is taken of."""
    found = []
    for folder in campaigns():
        cells = {row["cell"]: row for row in _sheet(folder, "cells.tsv")}
        for row in _sheet(folder, "tests.tsv"):
            if row["kind"] not in KINDS_OF_TEST or row["cell"] not in cells or ";" in row["file"]:
                continue
            cell = {
                n: _number(cells[row["cell"]].get(n))
                for n in ("rated_capacity_ampere_hour", *CUTOFFS)
            }
            if None in cell.values():
                continue
            test = {"test": row["test"], "kind": row["kind"]}
            test |= {
                n: _number(row.get(n)) for n in ("ambient_temperature_celsius", "soc", "cycle")
            }
            found.append((folder, {"cell": row["cell"], **cell}, test, row["file"]))
    return found


def record_of(entry):
    """Record of an entry with the sign turned to charge positive, or None: too long, or refused."""
    folder, cell, test, file = entry
    try:
        series = cw.read(str(folder / file)).columns
    except cw.Refusal:
        return None
    if len(series["test_time_second"]) > MOST_ROWS:
        return None
    columns = {NAMES[name]: np.asarray(c, float) for name, c in series.items() if name in NAMES}
    counter = series.get("net_capacity_ampere_hour")
    if counter is not None and np.isfinite(counter).all():
        step = np.diff(counter, prepend=counter[0])
        columns[CHARGED] = np.cumsum(np.maximum(step, 0))
        columns[DISCHARGED] = np.cumsum(np.maximum(-step, 0))
    return Record(columns, cell, test, {})


def _sheet(folder, name):
    path = folder / "config" / name
    if not path.exists():
        return []
    opened = gzip.open if path.suffix == ".gz" else open
    with opened(path, "rt", encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def _number(text):
    return float(text) if text not in (None, "") else None
