"""Draft sheets of a campaign from a folder of instruments' files, to be corrected by hand."""

import csv
import hashlib
import re
import shlex
from collections import Counter
from itertools import dropwhile, takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from cellwright.records.conditions import SAME_CELSIUS
from cellwright.records.kinds import FULL_SHARE, half_cycles, whole_charge
from cellwright.refusal import Refusal
from first_look.one_file import celsius, look
from runtime.campaign_check import files_below

CELLS = (
    "cell",
    "chemistry",
    "rated_capacity_ampere_hour",
    "lower_cutoff_volt",
    "upper_cutoff_volt",
    "note",
)
TESTS = ("cell", "test", "kind", "file", "ambient_temperature_celsius", "role", "sha256", "note")
# Temperatures in names. Without `deg` a rate looks the same: of these only those are taken that are
# signed, 0, or above the rates of full tests.
DEGREES = re.compile(r"(?<![A-Za-z\d.])(n|-|m)?(\d{1,2})(?:\.0)?[\s_]?(?:deg|°)[\s_]?C(?![A-Za-z])")
SIGNED = re.compile(r"(?<![A-Za-z\d.])(n|-|m)(\d{1,2})(?:\.0)?_?C(?![A-Za-z])")
BARE = re.compile(r"(?<![A-Za-z\d.])()(0|[1-9]\d)(?:\.0)?_?C(?![A-Za-z])")
BLANKS = re.compile(r"[_\s]+")
# Words that name no cell: temperatures, rates, numbers, dates, kinds of test, drives, folders.
NO_CELL = re.compile(
    r"([n+-]|(?-i:m))?\d*[.p]?\d+(deg|°)?c?|deg|degc|c\d+|[\d.:-]+|#?\d+|[nps]\d{1,2}|"
    r"(slow|full|quasi)?-?(dis)?ch(arge|g)?s?|cap(acity)?|cyc(le|ling)?s?\d*|(c-?)?rates?|"
    r"p?ocv|hppc|gitt|pitt|dcir|dyn(amic)?|pulses?|eis|peis|geis|ica|impedance|spectr(a|um)|"
    r"drives?|udds|us06|hwfet|hwcust|la92|wltp|wltc|nedc|fuds|dst|bjdst|nn|mixed\d*|random\d*|"
    r"profiles?|ag(e|ing|eing)|rests?|relax(ation)?|fast-?charge|check-?ups?\d*|rpt\d*|raw|data|"
    r"tests?\d*|files?|csv|txt|exports?|results?|temp(erature)?|start|end|validation|fit",
    re.IGNORECASE,
)
# Words of files' names that tell a kind, of those that the steps allow.
NAMED = {
    "hppc": r"hppc|gitt|pulses?",
    "ocv": r"p?ocv",
    "ageing": r"age?ing|cycling",
    "capacity": r"cap(acity)?",
    "ica": r"ica",
}
NUMBER = re.compile(r"#?\d+")
SUFFIXES = re.compile(r"(\.[A-Za-z]\w*|\.\d{3})+$")  # .bdf.csv.gz and Maccor's .001, not .5C
WHOLE = {"capacity", "ocv", "ica", "ageing"}  # kinds that go from one cut-off to the other
SEPARATOR = ";"  # of the files of one test
GUESSED = "cut-off is a guess: no load of a full test leads there"
STEP_VOLT = 0.05  # cut-offs are proposed to this
OVERSHOOT_VOLT = 0.015  # by which a reading may lie beyond the cut-off that stopped the tester
ALIKE = 0.95  # of the largest charge of a cell, from which another may be of its type
SHOWN = 5  # files or names that are named


class Full(NamedTuple):
    """A test of a cell from one cut-off to the other: ends of its voltage, its largest charge.

    An end that no load led to is infinite: a discharge alone does not tell the upper cut-off.
    """

    low_volt: float
    high_volt: float
    charge_ampere_hour: float
    test: str


class Found(NamedTuple):
    """What the files of a folder hold.

    tests : rows of tests.tsv. full : of each cell `Full` tests. span_volt : lowest and highest
    voltage of each cell in any. left_out : reason → files. read_celsius : rows of tests whose
    temperature no name says, and what their thermometers read [°C].
    """

    tests: list[dict]
    full: dict[str, list[Full]]
    span_volt: dict[str, tuple[float, float]]
    left_out: dict[str, list[str]]
    read_celsius: list[tuple[dict, float]]


def draft(folder) -> tuple[list[dict], list[dict], dict[str, list[str]]]:
    """Rows of cells.tsv and tests.tsv for all files below a folder, and what was left out, why.

    A cell is named by the innermost folder whose name holds more than temperatures and kinds of
    test, where files lie in several; else by what its files' names begin with; else by a folder
    around all of them.
    """
    folder = Path(folder).resolve()
    paths = [folder / file for file in files_below(folder)]
    found, common = Found([], {}, {}, {}, []), _common_folder(folder, paths)
    numbered = _numbered_cells({part for path in paths for part in path.relative_to(folder).parts})
    for path in paths:
        place = path.relative_to(folder).as_posix()
        try:
            if SEPARATOR in place:
                raise Refusal(f"has a {SEPARATOR} in its name, which joins files; rename it")
            seen = look(place, within=folder)
        except (Refusal, OSError) as reason:
            said = str(reason).removeprefix(f"{place}: ").removeprefix(f"{path.name}: ")
            found.left_out.setdefault(said, []).append(place)
            continue
        _take(found, path, place, _cell_of(path, common, folder, numbered), seen)
    _propose_temperatures(found.read_celsius)
    _propose_roles(found.tests)
    cells = [_cell(name, found) for name in dict.fromkeys(row["cell"] for row in found.tests)]
    _propose_ratings(cells, {name: _largest(full) for name, full in found.full.items()})
    return cells, _unique(found.tests), found.left_out


def write(folder) -> list[str]:
    """Write the draft below `folder`/config; lines on what was written and left out.

    Raises
    ------
    Refusal
        There is a sheet already, which is not overwritten; or no file can be used.
    """
    config = Path(folder) / "config"
    for name in ("cells.tsv", "tests.tsv"):
        if (config / name).exists():
            raise Refusal(f"{config / name} is there already; it is not overwritten")
    cells, tests, left_out = draft(folder)
    unused = [f"left out: {_named(files)}: {reason}" for reason, files in left_out.items()]
    if not tests:
        raise Refusal("\n".join(["no file of the folder can be used", *unused]))
    config.mkdir(exist_ok=True)
    _write(config / "cells.tsv", CELLS, cells)
    _write(config / "tests.tsv", TESTS, tests)
    if not (config / "config.yaml").exists():
        title = yaml.safe_dump({"title": Path(folder).resolve().name}, allow_unicode=True)
        (config / "config.yaml").write_text(title, encoding="utf-8")
    cold = [f"{row['cell']} {row['test']}" for row in tests if _lacks_temperature(row)]
    unknown = {
        "to be filled in, cut-offs (no full test reaches them)": [
            row["cell"] for row in cells if "upper_cutoff_volt" not in row
        ],
        "to be filled in, ambient_temperature_celsius": cold,
        "to be checked, a guessed cut-off (note says which)": [
            row["cell"] for row in cells if GUESSED in row.get("note", "")
        ],
    }
    of_cell = Counter(row["cell"] for row in tests)
    return [
        *unused,
        f"{config}: {len(cells)} cells and {len(tests)} tests, as a draft",
        f"cells, with their tests: {_named([f'{name} ({n})' for name, n in of_cell.items()])}",
        "Look at cells, kinds, temperatures, roles, rating and cut-offs; write the chemistry.",
        *[f"{what}: {_named(names)}" for what, names in unknown.items() if names],
        f"next: ./run cellwright check {shlex.quote(str(folder))}",
    ]


def _lacks_temperature(row):
    return not row["ambient_temperature_celsius"] and row["kind"] != "eis"


def _named(names):
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def _take(found, path, place, cell, seen):
    """Add what one file holds."""
    kind, named = _kind_of(path.name, [name for name, _ in seen.kinds])
    if seen.series:
        volt = seen.series["voltage_volt"]
        low, high = float(np.nanmin(volt)), float(np.nanmax(volt))
        least, most = found.span_volt.get(cell, (low, high))
        found.span_volt[cell] = min(least, low), max(most, high)
        if WHOLE & {name for name, _ in seen.kinds}:  # others do not reach the cut-offs
            found.full.setdefault(cell, []).append(_full(seen.steps, path.name))
    if kind:
        row = _row(cell, path, place, kind, seen)
        found.tests.append(row)
        warm = celsius(seen.series)
        if not row["ambient_temperature_celsius"] and warm is not None:
            found.read_celsius.append((row, warm))
        if named:
            row["note"] = f"its name says {named}, its steps do not"
    else:
        why = seen.refused or "its kind of test is not known from its steps"
        found.left_out.setdefault(why, []).append(place)


def _full(steps, name) -> Full:
    """Where whole half cycles of a record end, in the middle of them: one may run beyond."""
    moved, _, volt = half_cycles(steps)
    whole = whole_charge(moved)
    down, up = (side * moved >= FULL_SHARE * whole for side in (-1, 1))
    low = float(np.median(volt[down])) if np.any(down) else np.inf
    return Full(low, float(np.median(volt[up])) if np.any(up) else -np.inf, whole, name)


def _kind_of(name, kinds):
    """The kind that a file's name says, where its steps allow that, or else the likeliest; and what
    the name says in vain. Few pulses over SoC are no less HPPC where the name says so."""
    words = re.split(r"[\W_]+", name.lower())
    named = [kind for kind, word in NAMED.items() if any(re.fullmatch(word, w) for w in words)]
    allowed = {*kinds, "hppc"} if "pulse_resistance" in kinds[:1] else {*kinds}
    agreed = [kind for kind in named if kind in allowed]
    return next(iter((*agreed, *kinds)), ""), "" if agreed else " or ".join(named)


def _common_folder(folder, paths):
    """The innermost folder in which all files lie: its name tells no cell from another."""
    levels = zip(*(path.parent.parts for path in paths), strict=False)
    same = [level[0] for level in levels if len(set(level)) == 1]
    return Path(*same) if same else folder


def _numbered_cells(folders):
    """Folders C1, C2, C3 …, which are cells and no rates: those go C/20, C/10, C/5."""
    numbers = {int(name[1:]): name for name in folders if re.fullmatch(r"[Cc][1-9]\d*", name)}
    return set(numbers.values()) if sorted(numbers) == [*range(1, max(2, len(numbers)) + 1)] else ()


def _cell_of(path, common, folder, numbered):
    """Name of the cell of a file, see `draft`. numbered : from `_numbered_cells`."""
    parts = reversed(path.relative_to(common).parent.parts)
    inner = [part if part in numbered else _cell_words(part) for part in parts]
    outer = [_cell_words(part) for part in reversed(common.relative_to(folder.parent).parts)]
    begins = _cell_begins(BLANKS.split(SUFFIXES.sub("", path.name)))
    return _plain(next(filter(None, (*inner, begins, *outer)), "cell"))


def _cell_begins(words):
    """What of a file's name names its cell: words before the first kind; a `#3` before it, too."""
    if NO_CELL.fullmatch(words[0]):
        return ""
    numbers = list(takewhile(NUMBER.fullmatch, dropwhile(_names_cell, words)))
    named = list(takewhile(_names_cell, words))
    last = max((k for k, word in enumerate(numbers, 1) if word.startswith("#")), default=0)
    begins = (named if len(named) < len(words) else words[:1]) + numbers[:last]
    return "_".join(word.strip("#") for word in begins)


def _names_cell(word):
    return not NO_CELL.fullmatch(word)


def _cell_words(name):
    """What of a folder's name may name a cell; a number belongs to the word before it."""
    words = BLANKS.split(name)
    names = [bool(word) and not NO_CELL.fullmatch(word) for word in words]
    numbered = [k > 0 and names[k - 1] and NUMBER.fullmatch(w) for k, w in enumerate(words)]
    return "_".join(
        w.strip("#")
        for w, name, number in zip(words, names, numbered, strict=True)
        if name or number
    )


def _propose_roles(tests):
    """Drives validate; where a cell has no pulses to be fitted, one at each temperature is."""
    pulsed, drives = {row["cell"] for row in tests if row["kind"] == "hppc"}, {}
    for row in tests:
        row["role"] = "validation" if row["kind"] == "drive" else "fit"
        if row["kind"] == "drive" and row["cell"] not in pulsed:
            at = row["cell"], row["ambient_temperature_celsius"]
            drives.setdefault(at, []).append(row)
    for rows in drives.values():
        rows[0]["role"] = "fit" if len(rows) > 1 else "split"


def _propose_temperatures(read):
    """One temperature for tests whose thermometers read it within 5 K: that of a room drifts."""
    read = sorted(read, key=lambda one: one[1])
    while read:
        alike = [one for one in read if one[1] <= read[0][1] + 2 * SAME_CELSIUS]
        middle = np.median([degree for _, degree in alike])
        for row, _ in alike:
            row["ambient_temperature_celsius"] = f"{middle:.0f}"
        read = read[len(alike) :]


def _row(cell, path, place, kind, seen):
    named = _celsius_in([path.name, *reversed(Path(place).parent.parts)])
    others = ", ".join(name for name, _ in seen.kinds if name != kind)
    return {
        "cell": cell,
        "test": _plain(SUFFIXES.sub("", path.name)),
        "kind": kind,
        "file": place,
        "ambient_temperature_celsius": "" if named is None else f"{named:.0f}",
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "note": f"could also be {others}" if others else "",
    }


def _celsius_in(names):
    """Temperature in the first of some names that has one [°C]; None where none has."""
    for name in names:
        for pattern in (DEGREES, SIGNED, BARE):
            if found := pattern.search(name):
                return float(found[2]) * (-1 if found[1] else 1)
    return None


def _cell(name, found):
    """A row of cells.tsv: cut-offs are the ends of full tests to 0.05 V, none that others pass.

    An end that no load of them led to is guessed: the next 0.05 V beyond all voltages of the cell.
    """
    row, full = {"cell": name}, found.full.get(name)
    if not full:
        return row
    least, most = found.span_volt[name]
    low, high = min(test.low_volt for test in full), max(test.high_volt for test in full)
    ends = (("lower", low), ("upper", high))
    guessed = [f"{side} {GUESSED}" for side, end in ends if not np.isfinite(end)]
    row |= {"note": "; ".join(guessed)} if guessed else {}
    low = np.round(low / STEP_VOLT) if np.isfinite(low) else np.floor(least / STEP_VOLT)
    high = np.ceil((high - OVERSHOOT_VOLT if np.isfinite(high) else most) / STEP_VOLT)
    # Where another test goes beyond, no full one went to the end.
    if most < (high + 1) * STEP_VOLT:
        row["lower_cutoff_volt"] = f"{max(low * STEP_VOLT, 0.0):.2f}"
        row["upper_cutoff_volt"] = f"{high * STEP_VOLT:.2f}"
    return row


def _largest(full):
    """The test that moved the largest charge in a half cycle."""
    return max(full, key=lambda test: test.charge_ampere_hour)


def _propose_ratings(cells, largest):
    """The largest charge of a half cycle to two digits, of cells that are alike one rating."""
    told = [row for row in cells if row["cell"] in largest]
    first = np.inf
    for row in sorted(told, key=lambda row: -largest[row["cell"]].charge_ampere_hour):
        test = largest[row["cell"]]
        charge = test.charge_ampere_hour
        first = first if charge >= ALIKE * first else charge
        if charge > 0:
            row["rated_capacity_ampere_hour"] = f"{float(f'{first:.2g}'):g}"
            of_rating = f"rating is a draft: {charge:.4g} Ah moved in {test.test}"
            row["note"] = "; ".join(filter(None, (of_rating, row.get("note"))))


def _unique(tests):
    """Tests of one cell with names of their own: a number behind those that are taken."""
    taken = {}
    for row in tests:
        key = row["cell"], row["test"].lower()
        taken[key] = taken.get(key, 0) + 1
        row["test"] += f"_{taken[key]}" if taken[key] > 1 else ""
    return tests


def _plain(name):
    """Letters, digits, `_` and `-` alone, at most 64."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_-")[:64] or "cell"


def _write(path, columns, rows):
    with open(path, "w", encoding="utf-8", newline="") as file:
        sheet = csv.DictWriter(file, columns, delimiter="\t", lineterminator="\n")
        sheet.writeheader()
        sheet.writerows(rows)
