"""Records made wrong, as whole campaigns.

    ./run python -m fuzz.campaigns --seed 1 --cases 200 --cells 50 --to FOLDER

Each case of `cases.py` is a cell with one test in a campaign of the input contract. What its
tables and `excluded.csv` say is held against the clean numbers, and against what the functions say
of the same record: the same verdict is wanted.
"""

import argparse
import csv
import json
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np

from fuzz.cases import ORDER, drawn, verdict
from fuzz.kinds import BENIGN
from fuzz.published import Outcome, file_of, outcome_of
from fuzz.record import CUTOFFS
from fuzz.records import HERE

TABLES = ("capacity", "resistance")
# A charge for dQ/dV is in no table as it is: here it is a capacity test. What each kind tells:
WRITTEN_AS = {"ica": "capacity"}
OF_KIND = {"hppc": ("resistance",), "pulse_resistance": ("resistance",)}
WITHOUT_NUMBERS = ("models", "identify")  # stages whose absence says nothing of a number
CELL = ("cell", "rated_capacity_ampere_hour", *CUTOFFS)
TEST = ("cell", "test", "kind", "file", "ambient_temperature_celsius", "cycle", "soc")


def write_campaign(folder, records):
    """A campaign in a folder: a cell, a test and a file for each record, by the cell's name."""
    cells, tests = [], []
    for name, (record, data) in records.items():
        path = Path("raw") / f"{name}.bdf.csv"
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)
        cells.append(record.cell | {"cell": name})
        kind = WRITTEN_AS.get(record.test["kind"], record.test["kind"])
        facts = {"cell": name, "test": "t", "kind": kind, "file": str(path)}
        tests.append(record.test | facts)
    (folder / "config").mkdir(exist_ok=True)
    # Models take most of the time, and none is of what is looked at here.
    (folder / "config" / "config.yaml").write_text("models: {members: [1RC]}\n")
    for sheet, columns, rows in (("cells", CELL, cells), ("tests", TEST, tests)):
        with open(folder / "config" / f"{sheet}.tsv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, columns, delimiter="\t", extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)


def run(folder):
    """Snakemake on a campaign, to its tables and what was left out; its log beside it."""
    paths = [f"results/tables/{name}.csv" for name in (*TABLES, "excluded")]
    command = ["snakemake", "--cores", "1", "--keep-going", "--directory", str(folder), *paths]
    with open(folder / "log.txt", "w", encoding="utf-8") as log:
        done = subprocess.run(command, cwd=HERE, stdout=log, stderr=subprocess.STDOUT)
    if done.returncode:
        raise SystemExit(f"snakemake failed on {folder}: see its log.txt")


def outcomes(folder, names):
    """Outcome of each cell of a campaign, as its tables and `excluded.csv` tell it."""
    tables = {name: _rows(folder, name) for name in TABLES}
    left_out = _rows(folder, "excluded")
    return {name: _outcome(name, tables, left_out) for name in names}


def _rows(folder, table):
    with open(folder / "results" / "tables" / f"{table}.csv", encoding="utf-8") as file:
        return [{key: _value(text) for key, text in row.items()} for row in csv.DictReader(file)]


def _value(text):
    """A cell of a table as number or text; None where it is blank."""
    try:
        return float(text)
    except ValueError:
        return text


def _outcome(cell, tables, left_out):
    own = [row for row in left_out if row["cell"] == cell]
    reasons = [row["reason"] for row in own if row["stage"] not in WITHOUT_NUMBERS]
    rows = {
        name: [_numbers(row) for row in of if row["cell"] == cell] for name, of in tables.items()
    }
    rows = {name: found for name, found in rows.items() if found}
    crash = next((row["reason"] for row in own if "itself failed" in row["reason"]), "")
    return Outcome(rows, tuple(reasons), "" if rows else "; ".join(reasons) or "no row", crash)


TEXTS = ("doubt", "direction", "cell", "test")


def _numbers(row):
    """A row with NaN for what is blank, but for its texts, and None for facts not stated."""
    facts = ("cycle", "ambient_temperature_celsius")
    blank = {name: None if name in facts else np.nan for name in row if name not in TEXTS}
    return {name: blank.get(name, "") if value == "" else value for name, value in row.items()}


def main():
    """Write the campaigns, run them, print both tables and where they differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--cells", type=int, default=50, help="of one campaign")
    parser.add_argument("--to", type=Path, required=True, help="an empty folder")
    chosen = parser.parse_args()
    found = []
    for begin in range(0, chosen.cases, chosen.cells):
        numbers = range(begin, min(begin + chosen.cells, chosen.cases))
        found += of_campaign(chosen.to / f"{begin:04d}", chosen.seed, numbers)
    for which, place in (("campaigns", 1), ("functions", 2)):
        total = Counter(row[place][0] for row in found)
        print(f"{which:12s}" + "".join(f"{name:>10s}" for name in ORDER))
        print(f"{'':12s}" + "".join(f"{total[name]:10d}" for name in ORDER))
    unlike = [row for row in found if row[1][0] != row[2][0]]
    print(f"{len(unlike)} of {len(found)} with another verdict")
    with open(chosen.to / "cases.json", "w", encoding="utf-8") as file:
        file.writelines(json.dumps(row) + "\n" for row in found)


def of_campaign(folder, seed, numbers):
    """(kind, verdict by the campaign, verdict by the functions, where) of each case."""
    cases, records = {}, {}
    for number in numbers:
        kind, entry, changed, clean, _ = drawn(1_000_000 * seed + number)
        data = file_of(changed)
        # Where a text is damaged chance tells anew each time it is written.
        text = data.decode("utf-8", "surrogateescape")
        cases[f"F{number:04d}"] = kind, entry, changed._replace(text=lambda _, t=text: t), clean
        records[f"F{number:04d}"] = changed, data
    write_campaign(folder, records)
    run(folder)
    told = outcomes(folder, list(records))
    return [
        (
            kind,
            verdict(told[name], clean, (), kind in BENIGN),
            verdict(_in_tables(outcome_of(changed), changed), clean, (), kind in BENIGN),
            f"{name} {entry[0].name} {entry[1]['cell']} {entry[2]['test']}",
        )
        for name, (kind, entry, changed, clean) in cases.items()
    ]


def _in_tables(outcome, record):
    """What the functions say of a record (Outcome), as far as tables of its kind hold it."""
    tables = OF_KIND.get(record.test["kind"], ("capacity",))
    rows = {name: found for name, found in outcome.rows.items() if name in tables}
    refused = outcome.refused or "" if rows else "; ".join(outcome.notes[-1:])
    return outcome._replace(rows=rows, refused=outcome.refused or refused)


if __name__ == "__main__":
    main()
