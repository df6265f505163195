"""A campaign small enough to run whole: a few cells of known truth, and every bad input at once.

The cells are one resistor and one RC pair behind a smooth OCV, computed step by step here, in no
line of code that the pipeline shares. Records are coarse, as little as each protocol needs.
"""

import gzip
import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

LOWER, UPPER = 3.0, 4.2
R1_OHM, TAU_SECOND = 0.015, 40.0
RATED_AMPERE_HOUR = 2.0
CELLS = "cell\tchemistry\trated_capacity_ampere_hour\tlower_cutoff_volt\tupper_cutoff_volt"
CELLS += "\treference\n"
TESTS = "cell\ttest\tkind\tfile\tambient_temperature_celsius\tcurrent_sign\trole\tsha256\n"
GROUPS = "group\tposition\tcell\n"
BDF = "Test Time / s,Current / A,Voltage / V"


class Truth(NamedTuple):
    """What a cell is: capacity [Ah], series resistance [ohm]."""

    capacity_ampere_hour: float
    r0_ohm: float


TRUTH = {"A": Truth(2.0, 0.030), "B": Truth(1.8, 0.036)}
# Each kind of bad file, and what its reason must say.
BAD = {
    "missing": "raw/missing.csv: there is no such file",
    "checksum": "SHA-256 is {digest}, tests.tsv says " + "0" * 64,
    "empty": "raw/empty.csv: the file is empty (0 bytes)",
    "truncated": "raw/truncated.csv.gz: the gzip file is cut off",
    "text": "raw/text.csv: line 201: column 'Voltage / V': found '3.7oops'",
    "frozen": "raw/frozen.csv: time never moves",
    "sign": "current_sign says discharge_positive, the voltage shows charge_positive",
    "folder": "raw/folder.csv: is a folder",
    "brace": "raw/brace{{d}}.csv: has a brace in its name; rename it",
    "pathvariable": "raw/pathvariable<name>.csv: has a word between < and > in its name; rename it",
    "bomb": "raw/bomb.csv.gz: unpacks to more than 100 times its ",
}
# Those that hold a good record.
USABLE = ("checksum", "sign", "brace", "pathvariable")


def write(folder: Path) -> Path:
    """Write the campaign: A with every test, B with a capacity, a drive and all the bad files, and
    both in parallel."""
    (folder / "raw").mkdir(parents=True)
    (folder / "config").mkdir()
    (folder / "config/config.yaml").write_text("title: Tiny\n")
    known = f"NMC\t{RATED_AMPERE_HOUR}\t{LOWER}\t{UPPER}"
    (folder / "config/cells.tsv").write_text(f"{CELLS}A\t{known}\tyes\nB\t{known}\t\n")
    (folder / "config/groups.tsv").write_text(f"{GROUPS}pair\t1\tA\npair\t2\tB\n")
    plan = [("A", "ocv"), ("A", "hppc"), *((c, k) for c in TRUTH for k in ("capacity", "drive"))]
    rows = [_row(cell, kind, kind, save(folder, cell, kind)) for cell, kind in plan]
    _text(folder / "raw/pair.csv", *pair())
    rows += [_row("pair", "group", "group", folder / "raw/pair.csv"), *_bad(folder)]
    (folder / "config/tests.tsv").write_text(TESTS + "".join(rows))
    return folder


def save(folder, cell, kind, *, seed=1) -> Path:
    """Write one test of a cell as a BDF file; returns its path."""
    path = folder / f"raw/{cell}_{kind}.csv"
    columns = RECORDS[kind](TRUTH[cell])
    columns[2] += np.random.default_rng(seed).normal(0, 2e-4, len(columns[2]))
    _text(path, BDF, columns)
    return path


def restate(folder, path):
    """Put a file's present checksum into the sheet."""
    name, rows = f"raw/{path.name}\t", []
    for row in (folder / "config/tests.tsv").read_text().splitlines():
        cells = row.split("\t")
        rows.append("\t".join([*cells[:-1], digest(path)]) if name in row else row)
    (folder / "config/tests.tsv").write_text("\n".join(rows) + "\n")


def _bad(folder):
    raw = folder / "raw"
    good = (raw / "B_capacity.csv").read_text()
    lines = good.splitlines()
    frozen = [lines[0], *("0.000," + line.split(",", 1)[1] for line in lines[1:])]
    text = [*lines[:200], lines[200].rsplit(",", 1)[0] + ",3.7oops", *lines[201:]]
    files = {name: raw / f"{name}.csv" for name in BAD} | {"brace": raw / "brace{d}.csv"}
    files["pathvariable"] = raw / "pathvariable<name>.csv"
    files |= {name: raw / f"{name}.csv.gz" for name in ("truncated", "bomb")}
    for name, content in {**dict.fromkeys(USABLE, good), "empty": ""}.items():
        files[name].write_text(content)
    files["text"].write_text("\n".join(text) + "\n")
    files["frozen"].write_text("\n".join(frozen) + "\n")
    whole = gzip.compress(good.encode(), mtime=0)
    files["truncated"].write_bytes(whole[: len(whole) // 2])
    files["bomb"].write_bytes(gzip.compress(good.encode() + bytes(40_000_000), mtime=0))
    files["folder"].mkdir()
    stated, said = {"checksum": "0" * 64}, {"sign": "discharge_positive"}
    return [
        _row(
            "B", bad, "relaxation", files[bad], sign=said.get(bad, ""), checksum=stated.get(bad, "")
        )
        for bad in BAD
    ]


def _row(cell, test, kind, path, *, sign="", checksum=None):
    checksum = digest(path) if checksum is None else checksum
    return f"{cell}\t{test}\t{kind}\traw/{path.name}\t25\t{sign}\t\t{checksum}\n"


def digest(path):
    """SHA-256 of a file as the sheet has it."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _text(path, head, columns):
    values = np.column_stack(columns)
    np.savetxt(path, values, fmt="%.6f", delimiter=",", header=head, comments="")


# A record: lists of (current [A], longest duration [s], sampling [s]) run from full at rest.


def ocv(soc):
    """Open-circuit voltage [V]; the cut-offs are its ends."""
    return LOWER + (UPPER - LOWER) * (0.75 * soc + 0.25 * np.tanh(6 * soc) / np.tanh(6))


def delivered(cell, ampere):
    """Charge of a discharge from full at a steady current, to the lower cut-off [Ah]."""
    grid = np.linspace(0.0, 1.0, 100_001)
    end = np.interp(LOWER + ampere * (TRUTH[cell].r0_ohm + R1_OHM), ocv(grid), grid)
    return TRUTH[cell].capacity_ampere_hour * (1 - end)


class _Cell:
    """The true cell under load, one sample after the other."""

    def __init__(self, truth, soc=1.0):
        self.truth, self.soc, self.relaxed, self.time = truth, soc, 0.0, 0.0
        self.rows = [(0.0, 0.0, float(ocv(soc)))]

    def _sample(self, current, step):
        keep = np.exp(-step / TAU_SECOND)
        self.relaxed = keep * self.relaxed + R1_OHM * (1 - keep) * current
        self.soc += current * step / 3600 / self.truth.capacity_ampere_hour
        self.time += step
        volt = float(ocv(self.soc)) + self.truth.r0_ohm * current + self.relaxed
        self.rows.append((self.time, current, volt))
        return volt

    def _edge(self, current):
        """The first sample of a load, at the time stamp of the last one before it."""
        volt = float(ocv(self.soc)) + self.truth.r0_ohm * current + self.relaxed
        self.rows.append((self.time, current, volt))

    def run(self, current, seconds, step):
        """Constant current until the time is over or a cut-off is reached."""
        self._edge(current)
        for _ in range(round(seconds / step)):
            volt = self._sample(current, step)
            if (current < 0 and volt <= LOWER) or (current > 0 and volt >= UPPER):
                break
        return self

    def hold(self, least_ampere, step=20.0):
        """Constant voltage at the upper cut-off until the current has fallen."""
        current, keep = np.inf, np.exp(-step / TAU_SECOND)
        while current > least_ampere:
            inner = self.truth.r0_ohm + R1_OHM * (1 - keep)
            current = (UPPER - float(ocv(self.soc)) - self.relaxed * keep) / inner
            self._edge(current)
            self._sample(current, step)
        return self

    def columns(self):
        return list(np.array(self.rows).T)


def _capacity(truth):
    cell = _Cell(truth).run(0, 600, 20).run(-2.0, 9000, 10).run(0, 1800, 30)
    return cell.run(1.0, 15000, 20).hold(0.02).run(0, 1800, 30).columns()


def _ocv(truth):
    cell = _Cell(truth).run(0, 600, 60).run(-0.1, 90000, 120).run(0, 3600, 120)
    return cell.run(0.1, 90000, 120).run(0, 3600, 120).columns()


def _hppc(truth):
    cell = _Cell(truth).run(0, 600, 20)
    for _ in range(9):
        cell.run(-1.0, 0.1 * truth.capacity_ampere_hour * 3600, 20).run(0, 600, 10)
        cell.run(-2.0, 10, 1).run(0, 40, 2).run(1.5, 10, 1).run(0, 40, 2)
    return cell.columns()


def _drive(truth):
    cell, rng = _Cell(truth).run(0, 300, 10), np.random.default_rng(7)
    for load in rng.uniform(-4.0, 1.0, 100):
        cell.run(load, 30, 2)
    return cell.run(0, 300, 10).columns()


RECORDS = {"capacity": _capacity, "ocv": _ocv, "hppc": _hppc, "drive": _drive}


def pair():
    """Head and columns of A and B in parallel: R0 and R1 of each, stepped with what KCL wants."""
    cells = [_Cell(TRUTH["A"]), _Cell(TRUTH["B"])]
    keep, rows = np.exp(-10 / TAU_SECOND), []
    for total in [0.0] * 60 + [-2.0] * 300 + [1.0] * 120 + [0.0] * 60:
        inner = np.array([cell.truth.r0_ohm + R1_OHM * (1 - keep) for cell in cells])
        source = np.array([float(ocv(cell.soc)) + keep * cell.relaxed for cell in cells])
        volt = (total + (source / inner).sum()) / (1 / inner).sum()
        branch = (volt - source) / inner
        for cell, current in zip(cells, branch, strict=True):
            cell._sample(float(current), 10.0)
        rows.append((cells[0].time, total, volt, *branch))
    return f"{BDF},Branch 1 Current / A,Branch 2 Current / A", list(np.array(rows).T)
