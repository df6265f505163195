"""A campaign as its sheets and config say it; every fault of all of them told at once."""

import posixpath
import re
from pathlib import Path
from typing import NamedTuple

import schema
import settings
import sheet
from schema import fault


class Campaign(NamedTuple):
    """One laboratory's tests: choices with all defaults, and one dict of typed values per row."""

    config: dict
    cells: list[dict]
    tests: list[dict]
    groups: list[dict]


class CampaignError(ValueError):
    """All faults of a campaign's sheets and config, one per line."""


def read(folder, schemas, given=None) -> Campaign:
    """Read and check a campaign. Whether its raw files are there and sound is not looked at.

    Parameters
    ----------
    folder : path
        The campaign; its sheets lie in `config/`. config.yaml and groups.tsv may be absent.
    schemas : path
        Folder of the schemas.
    given : dict, optional
        Settings that go before config.yaml (Snakemake's --config).

    Raises
    ------
    CampaignError
        Names every fault with file, row, line, column, what was found and what is wanted.
    """
    folder = Path(folder)
    config, faults = settings.read(folder, schema.load(schemas, "config"), given or {})
    cells, tests = (_sheet(folder, schemas, name) for name in ("cells", "tests"))
    groups = sheet.Sheet([], [], [])
    if (folder / "config" / "groups.tsv").exists():
        groups = _sheet(folder, schemas, "groups")
    faults += [*cells.faults, *tests.faults, *groups.faults]
    faults += [*_cells(cells), *_groups(groups, cells), *_tests(tests, cells, groups)]
    if faults:
        count = "one fault" if len(faults) == 1 else f"{len(faults)} faults"
        raise CampaignError("\n".join([f"{count} in the campaign's sheets and config:", *faults]))
    return Campaign(config, cells.rows, tests.rows, groups.rows)


def choices(config: dict, schemas) -> dict:
    """What a campaign chose otherwise than the defaults: dotted key → value."""
    standard = settings.flat(settings.defaults(schema.load(schemas, "config")))
    return {key: value for key, value in settings.flat(config).items() if value != standard[key]}


def _sheet(folder, schemas, name):
    read = sheet.read(folder, f"{name}.tsv", schema.load(schemas, name))
    if not read.rows and not read.faults:
        read.faults.append(f"config/{name}.tsv: found no row below the header, wanted at least one")
    return read


def _repeated(rows: sheet.Sheet, *columns):
    """A fault for each row whose values in `columns` stand in an earlier row."""
    first = {}
    for row, place in zip(rows.rows, rows.places, strict=True):
        key = tuple(row[column] for column in columns)
        if None in key:
            continue
        if key in first:
            wanted = f"each once within the sheet (also {first[key].split(', ', 1)[1]})"
            yield fault(f"{place}, {' and '.join(columns)}", " ".join(map(str, key)), wanted)
        first.setdefault(key, place)


def _cells(cells):
    yield from _repeated(cells, "cell")
    for row, place in zip(cells.rows, cells.places, strict=True):
        low, high = row["lower_cutoff_volt"], row["upper_cutoff_volt"]
        if None not in (low, high) and low >= high:
            yield fault(
                f"{place}, upper_cutoff_volt", high, f"more than lower_cutoff_volt, {low:g}"
            )


def _groups(groups, cells):
    yield from _repeated(groups, "group", "position")
    yield from _repeated(groups, "group", "cell")
    known = {row["cell"] for row in cells.rows}
    for row, place in zip(groups.rows, groups.places, strict=True):
        if row["cell"] is not None and row["cell"] not in known:
            yield fault(f"{place}, cell", row["cell"], "a cell of cells.tsv", known)
        if row["group"] in known and row["group"] is not None:
            yield fault(f"{place}, group", row["group"], "a name that no cell of cells.tsv has")


def _tests(tests, cells, groups):
    yield from _repeated(tests, "cell", "test")
    known = {row["cell"] for row in cells.rows}
    known_groups = {row["group"] for row in groups.rows}
    for row, place in zip(tests.rows, tests.places, strict=True):
        group = row["kind"] == "group"
        owners, sheet_name = (known_groups, "groups.tsv") if group else (known, "cells.tsv")
        unread = not (group or known)  # no cell at all is one fault, not one for each test
        if row["cell"] is not None and row["cell"] not in owners and not unread:
            wanted = f"a {'group' if group else 'cell'} of {sheet_name} (kind {row['kind']})"
            yield fault(f"{place}, cell", row["cell"], wanted, owners)
        yield from _files(row, place)
    yield from _leaks(tests)


def _files(row, place):
    files, sums = row["file"] or [], row["sha256"]
    for file in files:
        if re.match(r"[/\\~]|[A-Za-z]:[/\\]", file):
            yield fault(f"{place}, file", file, "a path relative to the campaign")
        elif ".." in re.split(r"[/\\]", file):
            yield fault(f"{place}, file", file, "a path inside the campaign, without ..")
    for file in sorted({file for file in files if files.count(file) > 1}):
        yield fault(f"{place}, file", file, "each file of a test once")
    if files and sums is not None and len(sums) != len(files):
        wanted = f"one for each file, {len(files)}, joined with ;"
        yield fault(f"{place}, sha256", f"{len(sums)} checksums", wanted)


def _leaks(tests):
    """What a model was fitted to cannot validate it: by path, and by checksum for copies."""
    rows = list(zip(tests.rows, tests.places, strict=True))
    fits = [(row, place) for row, place in rows if row["role"] in ("fit", "split")]
    fitted = {key: place for row, place in reversed(fits) for key in _identities(row)}
    for row, place in rows:
        shared = [key for key in _identities(row) if key in fitted]
        if row["role"] == "validation" and shared:
            wanted = f"a file that {fitted[shared[0]].split(', ', 1)[1]} does not use to fit"
            yield fault(f"{place}, file", ";".join(row["file"]), wanted)


def _identities(row):
    files = [posixpath.normpath(file) for file in row["file"] or []]
    return [(row["cell"], key) for key in [*files, *map(str.lower, row["sha256"] or [])]]
