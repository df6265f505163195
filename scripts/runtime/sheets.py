"""Sheets and settings of a campaign: read, checked, completed by defaults."""

import csv
import io
import math
import os
import posixpath
import re
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import NamedTuple

from cellwright import gate
from cellwright.packs.wiring import wiring_faults
from cellwright.refusal import Refusal
from runtime import settings
from runtime.settings import fault, wanted

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
QUANTITY = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)+")  # with its unit: thickness_millimetre
MADE = ("results", "logs", ".snakemake")  # folders of what runs write
LONGEST_NUMBER = 100  # characters: a double has 17 digits
# What spreadsheets save by themselves: how such a file begins, and how it is called.
WORKBOOK = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
OTHERS = (".xlsx", ".xls", ".ods", ".csv", ".txt", ".tsv.txt")
AS_TABS = "text with tabs (in the spreadsheet: save as text, tab delimited, UTF-8) called"
# A note that begins with when its test was started, and how such a date may be written. The month
# is taken as first, as most cyclers write it, unless a day above 12 in any note contradicts that.
STARTED_NOTE = re.compile(r"started ([0-9][0-9/.:\- ]*[0-9](?: ?[AP]M)?)", re.IGNORECASE)
CLOCKS = (" %I:%M:%S %p", " %H:%M:%S", " %H:%M", "")
DATES = ("%Y-%m-%d", "%m/%d/%Y", "%d/%m/%Y", "%d.%m.%Y")
# What numbers too large for their column are often written in: unit of the column, least number
# that is told, other unit, factor and shift from it.
OTHER_UNITS = (
    ("1", 2.0, "percent", 0.01, 0.0),
    ("°C", 200.0, "kelvin", 1.0, -273.15),
    ("V", 1000.0, "millivolt", 1e-3, 0.0),
)
COMMA = re.compile(r"[+-]?\d+,\d+")


class Sheet(NamedTuple):
    """A sheet: one dict of typed values and one place ("file, row, line") per row, and faults."""

    rows: list[dict]
    places: list[str]
    faults: list[str]


def sheet_rows(folder, name: str, schema: dict) -> Sheet:
    """Read `config/<name>` of a campaign. A missing sheet or a bad value is a fault, not an error.

    Byte-order marks, any line ends, blank lines, spaces around values, and rows without their
    last blank cells are all read as what they mean.
    """
    file = f"config/{name}"
    try:
        data = gate.contents(file, within=folder)
    except Refusal as reason:
        stem = Path(file).with_suffix("")
        named = [f"{stem}{end}" for end in OTHERS if Path(folder, f"{stem}{end}").is_file()]
        if named and not Path(folder, file).is_file():
            instead = f"{named[0]}: found in the place of a sheet, wanted {AS_TABS} {file}"
            return Sheet([], [], [instead])
        return Sheet([], [], [f"{reason}; wanted a tab-separated sheet in {folder}"])
    if data.startswith(WORKBOOK):
        return Sheet([], [], [f"{file}: found a workbook, wanted {AS_TABS} {file}"])
    text, faults = _decoded(data, file)
    lines, broken = _lines(text, file)
    if not lines:
        return Sheet([], [], faults + broken + [fault(file, "", "a row of column names")])
    header, wrong = _header(*lines[0], file, schema)
    faults += broken + wrong
    places = [f"{file}, row {n} (line {line})" for n, (line, _) in enumerate(lines[1:], 1)]
    readers = {name: _reader(spec) for name, spec in schema["properties"].items()}
    rows = []
    for place, (_, cells) in zip(places, lines[1:], strict=True):
        rows.append(_row(cells, header, readers, place, faults))
    return Sheet(_with_defaults(rows, schema), places, faults)


def _decoded(data: bytes, file: str) -> tuple[str, list[str]]:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):  # what spreadsheets call Unicode text
        return data.decode("utf-16", errors="replace"), []
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start : error.start + 1].decode("latin-1")
        wrong = fault(f"{file}, line {line}", byte, "UTF-8, not Latin-1; save the sheet as UTF-8")
        return data.decode("latin-1"), [wrong]


def _lines(text: str, file: str) -> tuple[list, list[str]]:
    """(line number, cells) of each line that is not blank."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter="\t", strict=True)
    lines, faults, start = [], [], 1
    try:
        for cells in reader:
            lines.append((start, [cell.strip() for cell in cells]))
            start = reader.line_num + 1
    except csv.Error as error:
        faults.append(
            fault(f"{file}, line {start}", str(error), 'each " doubled and closed, or no "')
        )
    return [(line, cells) for line, cells in lines if any(cells)], faults


def _header(line, cells, file, schema) -> tuple[list[str], list[str]]:
    """Column names of a sheet, and their faults."""
    place, names = f"{file}, line {line}", list(schema["properties"])
    if len(cells) > gate.MOST_COLUMNS:
        return cells, [f"{place}: found {len(cells)} columns, wanted {len(names)} at most"]
    if len(cells) == 1 and re.search(r"[,;\s]", cells[0]):
        mark = next((m for m in ",;" if m in cells[0]), "a blank")
        return cells, [fault(place, cells[0], f"columns separated by tabs, not by {mark}")]
    columns = f"one of the columns {', '.join(names)}"
    columns += "; rename it or delete the column"
    columns += " (remarks stand in note)" if "note" in names else ""
    unknown = [name for name in cells if name and name not in names]
    blanks = [name for name in unknown if set(name.split()) <= set(names)]
    unknown = [name for name in unknown if name not in blanks]
    twice = sorted({name for name in cells if name and cells.count(name) > 1})
    missing = [name for name in schema["required"] if name not in cells]
    faults = [fault(place, name, "a tab between two columns, not a blank") for name in blanks]
    faults += [fault(place, name, columns, names) for name in unknown]
    faults += [fault(place, name, "each column once") for name in twice]
    faults += [f"{place}: found no column {name!r}, wanted one" for name in missing]
    return cells, faults


def _row(cells, header, readers, place, faults) -> dict:
    # No first column has values with blanks in them.
    if len(header) > 1 and " " in cells[0] and not any(cells[1:]):
        faults.append(fault(place, cells[0], "values separated by tabs, not by blanks"))
        return dict.fromkeys(readers)
    beyond = [cell for cell in cells[len(header) :] if cell]
    beyond += [cell for name, cell in zip(header, cells, strict=False) if not name and cell]
    faults += [fault(place, cell, "nothing here, no column has this place") for cell in beyond]
    texts = dict.fromkeys(header, "") | dict(zip(header, cells, strict=False))
    row = dict.fromkeys(readers)
    for name in (name for name in row if name in texts):
        row[name], unfit = readers[name](texts[name])
        if unfit:
            faults.append(fault(f"{place}, {name}", texts[name], *unfit))
    return row


def _reader(spec: dict):
    """Function text → (value, None) or (None, (what is allowed, allowed values)) of one column."""
    memory = {}

    def reader(text):
        if text not in memory:
            memory[text] = _read_value(text, spec)
        return memory[text]

    return reader


def _read_value(text: str, spec: dict):
    if not text:
        return None, (f"a value: {wanted(spec)}",) if spec.get("filled") else None
    if spec["type"] == "array":
        parts = [
            _read_value(part.strip(), spec["items"] | {"filled": True})
            for part in text.split(spec["separator"])
        ]
        bad = any(unfit for _, unfit in parts)
        return (None, (wanted(spec),)) if bad else ([value for value, _ in parts], None)
    reader = {"number": _number, "integer": partial(_number, kind=int), "string": _text}
    return reader[spec["type"]](text, spec)


def _text(text, spec):
    names = spec.get("enum", ())
    if (names and text not in names) or not re.fullmatch(spec.get("pattern", r"[\s\S]*"), text):
        return None, (wanted(spec), names)
    return text, None


def _number(text, spec, kind=float):
    if COMMA.fullmatch(text):
        return None, (f"{wanted(spec)}, with a point: {text.replace(',', '.')}",)
    fits = re.fullmatch(r"\d+", text) if kind is int else NUMBER.fullmatch(text)
    if not fits or len(text) > LONGEST_NUMBER:
        return None, (wanted(spec),)
    value = kind(text)
    low, high = spec.get("minimum", -math.inf), spec.get("maximum", math.inf)
    inside = low <= value <= high and value > spec.get("exclusiveMinimum", -math.inf)
    if inside and math.isfinite(value):
        return value, None
    return None, (wanted(spec) + _in_other_unit(value, spec),)


def _in_other_unit(value, spec):
    """What a number beyond its range would be, had another unit been meant; "" where none is."""
    for unit, least, other, factor, shift in OTHER_UNITS:
        meant = factor * value + shift
        if spec.get("unit") == unit and value >= least and spec["minimum"] <= meant:
            fits = meant <= spec["maximum"]
            return f"; in {other}? Write {meant:.6g}" if fits else ""
    return ""


def _with_defaults(rows, schema) -> list[dict]:
    for name, spec in schema["properties"].items():
        special = spec.get("default_of_kind", {})
        for row in (row for row in rows if row[name] is None):
            row[name] = special.get(row.get("kind"), spec.get("default"))
    return rows


class Campaign(NamedTuple):
    """A campaign: settings with all defaults, and one dict of typed values per row of a sheet."""

    config: dict
    cells: list[dict]
    tests: list[dict]
    groups: list[dict]
    check_ups: list[dict]


class CampaignError(ValueError):
    """All faults of a campaign's sheets and config, one per line."""


def read(folder, schemas, overrides=None, *, alone=False) -> Campaign:
    """Read and check a campaign. Whether its raw files are there and sound is not looked at.

    Parameters
    ----------
    folder : path
        The campaign; its sheets lie in `config/`. config.yaml and groups.tsv may be absent.
    schemas : path
        Folder of the schemas.
    overrides : dict, optional
        Settings that go before config.yaml (Snakemake's --config).
    alone : bool
        Whether `overrides` stands for config.yaml (the `config:` of a module), which is not read.

    Raises
    ------
    CampaignError
        Names every fault with file, row, line, column, what was found and what is wanted.
    """
    folder = Path(folder)
    config, faults = settings.read(
        folder, settings.load(schemas, "config"), overrides or {}, alone=alone
    )
    cells, tests = (_sheet(folder, schemas, name) for name in ("cells", "tests"))
    groups, check_ups = (
        _sheet(folder, schemas, name)
        if os.path.lexists(folder / "config" / f"{name}.tsv")  # also one that cannot be read
        else Sheet([], [], [])
        for name in ("groups", "checkups")
    )
    faults += [*cells.faults, *tests.faults, *groups.faults, *check_ups.faults]
    faults += [*_check_ups(check_ups, cells, tests)]
    faults += [*_cells(cells), *_groups(groups, cells), *_tests(tests, cells, groups)]
    if faults:
        count = "one fault" if len(faults) == 1 else f"{len(faults)} faults"
        raise CampaignError("\n".join([f"{count} in the campaign's sheets and config:", *faults]))
    dated = _with_dates_of_notes(tests.rows)
    return Campaign(config, cells.rows, dated, groups.rows, check_ups.rows)


def type_name(facts) -> str:
    """Chemistry and rating of a cell of the sheet, such as `NMC, 5 Ah`."""
    rated = facts.get("rated_capacity_ampere_hour")
    parts = [facts.get("chemistry"), f"{rated:g} Ah" if rated else None]
    return ", ".join(filter(None, parts))


def choices(config: dict, schemas) -> dict:
    """Settings of a campaign that differ from the defaults: dotted key → value."""
    standard = settings.flat(settings.defaults(settings.load(schemas, "config")))
    return {
        key: value for key, value in settings.flat(config).items() if value != standard.get(key)
    }


def _sheet(folder, schemas, name):
    schema = settings.load(schemas, name)
    if name == "checkups":
        schema = _with_quantities(folder, schema)
    read = sheet_rows(folder, f"{name}.tsv", schema)
    if not read.rows and not read.faults:
        read.faults.append(f"config/{name}.tsv: found no row below the header, wanted at least one")
    return read


def _with_quantities(folder, schema):
    """The schema of check-ups with the sheet's further columns, if named `quantity_unit`."""
    file = "config/checkups.tsv"
    try:
        lines, _ = _lines(_decoded(gate.contents(file, within=folder), file)[0], file)
    except Refusal:  # told where the sheet is read
        return schema
    names = [name for name in (lines[0][1] if lines else []) if QUANTITY.fullmatch(name)]
    further = {name: {"type": "number", "description": "measured"} for name in names}
    return schema | {"properties": further | schema["properties"]}


def _check_ups(check_ups, cells, tests):
    yield from _repeated(check_ups, "cell", "cycle")
    names = {row["cell"] for row in cells.rows}
    made = {(row["cell"], row["cycle"] or 0.0) for row in tests.rows}
    for row, place in zip(check_ups.rows, check_ups.places, strict=True):
        if row["cell"] is not None and row["cell"] not in names:
            yield fault(f"{place}, cell", row["cell"], "a cell of cells.tsv", names)
        elif None not in (row["cell"], row["cycle"]) and (row["cell"], row["cycle"]) not in made:
            wanted = f"a cycle at which tests.tsv has a test of {row['cell']} (blank there is 0)"
            yield fault(f"{place}, cycle", row["cycle"], wanted)


def _repeated(rows: Sheet, *columns):
    """A fault for each row whose values in `columns` stand in an earlier row.

    Names that differ in case alone are one: a folder of Windows or macOS holds one of them.
    """
    first = {}
    for row, place in zip(rows.rows, rows.places, strict=True):
        found = tuple(row[column] for column in columns)
        key = tuple(_caseless(value) for value in found)
        if None in key:
            continue
        before, spelt = first.setdefault(key, (place, found))
        if before != place:
            same = "" if spelt == found else ", whatever the case of its letters"
            wanted = f"each once within the sheet{same} (also {before.split(', ', 1)[1]})"
            yield fault(f"{place}, {' and '.join(columns)}", " ".join(map(str, found)), wanted)


def _caseless(value):
    return value.casefold() if isinstance(value, str) else value


def _cells(cells):
    yield from _repeated(cells, "cell")
    for row, place in zip(cells.rows, cells.places, strict=True):
        low, high = row["lower_cutoff_volt"], row["upper_cutoff_volt"]
        if row["state_of_health"] and not row["rated_capacity_ampere_hour"]:
            wanted = "a rated_capacity_ampere_hour in the same row, which it refers to"
            yield fault(f"{place}, state_of_health", row["state_of_health"], wanted)
        if None not in (low, high) and low >= high:
            yield fault(
                f"{place}, upper_cutoff_volt", high, f"more than lower_cutoff_volt, {low:g}"
            )


def _groups(groups, cells):
    cell_names = {row["cell"] for row in cells.rows}
    of_cells, spelt = {_caseless(name) for name in cell_names}, {}
    for row, place in zip(groups.rows, groups.places, strict=True):
        name = _caseless(row["group"])
        if name in of_cells and name is not None:
            yield fault(f"{place}, group", row["group"], "a name that no cell of cells.tsv has")
        elif row["group"] != spelt.setdefault(name, row["group"]):
            yield fault(f"{place}, group", row["group"], f"one spelling of {spelt[name]!r}")
    names = {row["group"] for row in groups.rows} - {None} | cell_names
    for found in wiring_faults(groups.rows, cell_names):
        place, also = f"{groups.places[found.row]}, {found.column}", found.also
        same = "" if also is None else f" (also {groups.places[also].split(', ', 1)[1]})"
        near = names if found.column == "cell" and found.found not in names else ()
        yield fault(place, found.found, found.wanted + same, near)


def _tests(tests, cells, groups):
    yield from _repeated(tests, "cell", "test")
    cell_names = {row["cell"] for row in cells.rows}
    group_names = {row["group"] for row in groups.rows}
    for row, place in zip(tests.rows, tests.places, strict=True):
        group = row["kind"] == "group"
        owners, sheet_name = (group_names, "groups.tsv") if group else (cell_names, "cells.tsv")
        no_cells = not (group or cell_names)  # one fault, not one for each test
        if row["cell"] is not None and row["cell"] not in owners and not no_cells:
            wanted = f"a {'group' if group else 'cell'} of {sheet_name} (kind {row['kind']})"
            yield fault(f"{place}, cell", row["cell"], wanted, owners)
        yield from _files(row, place)
        if row["started"] is not None and _date(row["started"]) is None:
            yield fault(f"{place}, started", row["started"], "a day and a time that exist")
    yield from _validated_by_what_was_fitted(tests)


def _date(text):
    """A date as ISO 8601 has it, None where there is no such day or time."""
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None


def _with_dates_of_notes(rows):
    """Rows of tests.tsv; of those without `started`, the date that their note begins with.

    All notes are read in one way, for 3/11 and 4/11 are two days in November or two months.
    """
    noted = {k: STARTED_NOTE.match(row["note"] or "") for k, row in enumerate(rows)}
    noted = {k: said[1] for k, said in noted.items() if said and rows[k]["started"] is None}
    read = ({k: _in_format(text, form) for k, text in noted.items()} for form in DATES)
    dates = next((dates for dates in read if None not in dates.values()), {})
    return [
        row | {"started": dates[k].isoformat(" ")} if k in dates else row
        for k, row in enumerate(rows)
    ]


def _in_format(text, date):
    """A date that is written in this order, with any clock or none; None: it is not."""
    for clock in CLOCKS:
        try:
            return datetime.strptime(text, date + clock)
        except ValueError:
            continue
    return None


def _files(row, place):
    files, sums, simulated = row["file"] or [], row["sha256"], row["simulated_file"]
    named = [("file", file) for file in files] + [("simulated_file", simulated or "-")]
    for column, file in named:
        if re.match(r"[/\\~]|[A-Za-z]:[/\\]", file):
            yield fault(f"{place}, {column}", file, "a path relative to the campaign")
        elif ".." in re.split(r"[/\\]", file):
            yield fault(f"{place}, {column}", file, "a path inside the campaign, without ..")
        elif re.split(r"[/\\]", posixpath.normpath(file))[0].casefold() in MADE:
            wanted = "a file of the laboratory's, not one that a run makes"
            yield fault(f"{place}, {column}", file, f"{wanted}; copy it to another folder")
    for file in sorted({file for file in files if files.count(file) > 1}):
        yield fault(f"{place}, file", file, "each file of a test once")
    if files and sums is not None and len(sums) != len(files):
        wanted = f"one for each file, {len(files)}, joined with ;"
        yield fault(f"{place}, sha256", f"{len(sums)} checksums", wanted)


def _validated_by_what_was_fitted(tests):
    """A fault for each validation test whose file, or a copy of it, a model is fitted to."""
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
