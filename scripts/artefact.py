"""The only place that opens artefacts: load, save with provenance, check against the contract.

An artefact is a Parquet table (columns in the contract, facts in its metadata), a JSON document
or, for people, a CSV table. What could not be made is an artefact too: no rows, and a reason that
every later stage passes on, so that one bad file never takes the others down.
"""

import csv
import json
import sys
import traceback
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

import provenance
from cellwright.refusal import Refusal
from storage import KEY, plain, write


class Passed(Refusal):
    """A refusal that an earlier stage made and this one only passes on."""

    def __init__(self, reason: str, origin: str):
        super().__init__(reason)
        self.origin = origin


class Job:
    """One job's way to the disk: `with artefact.Job(snakemake) as job: … job.save(columns)`.

    A refusal inside the block is written as the reason into every output that is not saved yet.
    So is any other exception, as an internal error with its traceback in the log: a fault in one
    cell's job must not cost the other cells their report, and the report names it on top.
    """

    def __init__(self, snakemake):
        self.snakemake = snakemake
        self.saved = set()
        self.notes = []

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if error is None or not isinstance(error, Exception):
            return False
        expected = isinstance(error, Refusal)
        reason = str(error) if expected else f"internal error: {kind.__name__}: {error}"
        log = "".join(traceback.format_exception(error)) if not expected else reason + "\n"
        self.log(log)
        for path in self.snakemake.output:
            if path not in self.saved:
                write(path, {}, self.about(reason, getattr(error, "origin", path)))
        return True

    def load(self, path) -> dict:
        """Content of an artefact. Raises Passed where the artefact carries a reason."""
        return load(path)

    def save(self, content, path=None, **facts):
        """Write `content` (columns, rows or a JSON document) with facts beside it.

        `path` is one of the job's outputs (default: the only one).
        """
        path = path or self.snakemake.output[0]
        write(path, content, self.about() | {"facts": plain(facts)})
        self.saved.add(path)

    def note(self, *notes):
        """Sentences for the report about what was done or left out."""
        self.notes += [str(note) for note in notes]
        self.log("".join(f"{note}\n" for note in notes))

    def log(self, text: str):
        """Write to the rule's log file; internal errors go to the terminal as well."""
        for path in self.snakemake.log:
            with open(path, "a", encoding="utf-8") as file:
                file.write(text)
        if "Traceback" in text:
            sys.stderr.write(text)

    def about(self, reason=None, origin=None) -> dict:
        """What an artefact of this job says of itself."""
        return provenance.record(self.snakemake) | {
            "reason": reason,
            "origin": origin,
            "notes": self.notes,
            "facts": {},
        }


def load(path) -> dict:
    """Columns of a Parquet artefact (name → array) or content of a JSON one.

    Raises
    ------
    Passed
        Where the artefact is empty for a reason.
    """
    about = read_about(path)
    if about["reason"] is not None:
        raise Passed(about["reason"], about["origin"])
    if Path(path).suffix == ".json":
        return {key: value for key, value in _read_json(path).items() if key != "provenance"}
    with pq.ParquetFile(path) as file:
        table = file.read(use_threads=False)
    return {name: table[name].to_numpy() for name in table.column_names}


def load_all(paths) -> list[tuple[dict, dict]]:
    """(content, about) of each artefact that is not empty for a reason, in the order given."""
    abouts = [(path, read_about(path)) for path in paths]
    return [(load(path), about) for path, about in abouts if about["reason"] is None]


def load_first(paths):
    """Content of the first artefact that is not empty for a reason; None where there is none."""
    return next((content for content, _ in load_all(paths)), None)


def load_some(paths) -> list[tuple[dict, dict]]:
    """As `load_all`, for where at least one is needed.

    Raises
    ------
    Passed
        With the first artefact's reason, where all are empty for a reason.
    """
    found = load_all(paths)
    if not found:
        load(paths[0])
    return found


def load_together(pairs) -> list[tuple[dict, dict, dict]]:
    """(first, second, about of the second) of each pair of artefacts where both have content."""
    pairs = list(pairs)
    abouts = [[read_about(path) for path in pair] for pair in pairs]
    found = [
        (load(first), load(second), about[1])
        for (first, second), about in zip(pairs, abouts, strict=True)
        if all(one["reason"] is None for one in about)
    ]
    if not found:
        for path in (path for pair in pairs for path in pair):
            load(path)
    return found


def load_table(path) -> list[dict]:
    """Rows of a CSV table as text, an empty cell for what is not known."""
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


UNITS = {"test_time": "second", "current": "ampere", "voltage": "volt", "charge": "ampere_hour"}


def columns(series: dict, *names) -> list[np.ndarray]:
    """Columns of a series by their quantity, in the order asked: `"voltage"` → voltage_volt."""
    return [series[f"{name}_{UNITS[name]}"] for name in names]


def split(result) -> tuple[dict, dict]:
    """Columns and facts of a NamedTuple: its arrays, and everything else."""
    fields = result._asdict()
    arrays = {name: value for name, value in fields.items() if isinstance(value, np.ndarray)}
    return arrays, {name: value for name, value in fields.items() if name not in arrays}


def rows(columns: dict) -> list[dict]:
    """Columns as a list of rows of plain Python values."""
    plain = {name: np.asarray(values).tolist() for name, values in columns.items()}
    return [dict(zip(plain, row, strict=True)) for row in zip(*plain.values(), strict=True)]


def read_about(path) -> dict:
    """What an artefact says of itself: its provenance, reason, origin, notes and facts."""
    if Path(path).suffix == ".json":
        return _read_json(path)["provenance"]
    return json.loads(pq.read_schema(path).metadata[KEY])


@cache
def _read_json(path) -> dict:
    return json.loads(Path(path).read_text(encoding="utf-8"))
