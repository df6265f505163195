"""Draft sheets of a campaign from a folder of instruments' files, to be corrected by hand."""

import csv
import hashlib
import re
from pathlib import Path

import numpy as np

from cellwright.refusal import Refusal
from first_look.one_file import celsius, look

CELLS = (
    "cell",
    "chemistry",
    "rated_capacity_ampere_hour",
    "lower_cutoff_volt",
    "upper_cutoff_volt",
)
TESTS = ("cell", "test", "kind", "file", "ambient_temperature_celsius", "sha256", "note")
CELSIUS = re.compile(r"(?<![A-Za-z\d])(n|-|m)?(\d{1,2})(?:\.0)?\s?_?(?:deg)?C(?![A-Za-z])")
WHOLE = {"capacity", "ocv", "ica", "ageing"}  # kinds that go from one cut-off to the other
SEPARATOR = ";"  # of the files of one test
STEP_VOLT = 0.05  # cut-offs are proposed to this


def draft(folder) -> tuple[list[dict], list[dict], list[str]]:
    """Rows of cells.tsv and tests.tsv for all files below a folder, and what was left out, why.

    A cell is named by the folder in which its files lie, where there are several such folders, else
    by what its files' names begin with.
    """
    folder = Path(folder)
    found = [path for path in sorted(folder.rglob("*")) if not path.is_dir()]
    paths = [path for path in found if _is_raw(path.relative_to(folder))]
    tests, ends, left_out = [], {}, []
    many = len({path.parent for path in paths}) > 1
    for path in paths:
        place = path.relative_to(folder).as_posix()
        try:
            if SEPARATOR in place:
                raise Refusal(f"has a {SEPARATOR} in its name, which joins files; rename it")
            seen = look(place, within=folder)
        except (Refusal, OSError) as reason:
            said = str(reason).removeprefix(f"{place}: ").removeprefix(f"{path.name}: ")
            left_out.append(f"{place}: {said}")
            continue
        cell = _plain(path.parent.name if many else re.split(r"[_\s.]", path.name)[0])
        kind = seen.kinds[0][0] if seen.kinds else ""
        if WHOLE & {name for name, _ in seen.kinds}:  # others do not reach the cut-offs
            volt = seen.series["voltage_volt"]
            ends.setdefault(cell, []).append((np.nanmin(volt), np.nanmax(volt)))
        if not kind:
            why = seen.refused or "its kind of test is not known from its steps"
            left_out.append(f"{place}: {why}")
            continue
        tests.append(_row(cell, path, place, kind, seen))
    return [_cell(name, ends.get(name, [])) for name in _names(tests)], _unique(tests), left_out


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
    if not tests:
        raise Refusal("no file of the folder can be used: " + "; ".join(left_out[:5]))
    config.mkdir(exist_ok=True)
    _write(config / "cells.tsv", CELLS, cells)
    _write(config / "tests.tsv", TESTS, tests)
    if not (config / "config.yaml").exists():
        (config / "config.yaml").write_text("", encoding="utf-8")
    lines = [
        f"{config}: {len(cells)} cells and {len(tests)} tests, as a draft. Look at the names of",
        "cells, kinds, temperatures and cut-offs; add chemistry and rating where you know them.",
    ]
    unknown = [row["cell"] for row in cells if "lower_cutoff_volt" not in row]
    if unknown:
        lines.append(f"cut-offs to be filled in, no test reaches them: {', '.join(unknown)}")
    return lines + [f"left out: {what}" for what in left_out]


def _is_raw(place):
    hidden = any(part.startswith(".") for part in place.parts)
    return not hidden and place.parts[0] not in ("config", "results", "logs", "benchmarks")


def _row(cell, path, place, kind, seen):
    named = CELSIUS.search(path.stem)
    warm = float(named[2]) * (-1 if named[1] else 1) if named else celsius(seen.series)
    others = ", ".join(name for name, _ in seen.kinds[1:])
    return {
        "cell": cell,
        "test": _plain(path.name.split(".")[0]),
        "kind": kind,
        "file": place,
        "ambient_temperature_celsius": "" if warm is None else f"{warm:.0f}",
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "note": f"could also be {others}" if others else "",
    }


def _cell(name, ends):
    """A row of cells.tsv; the cut-offs are the ends of the voltages seen, to 0.05 V."""
    low = min((e[0] for e in ends), default=np.nan)
    high = max((e[1] for e in ends), default=np.nan)
    shown = {"lower_cutoff_volt": low, "upper_cutoff_volt": high}
    rounded = {k: round(v / STEP_VOLT) * STEP_VOLT for k, v in shown.items() if np.isfinite(v)}
    return {"cell": name} | {k: f"{v:.2f}" for k, v in rounded.items()}


def _names(tests):
    return list(dict.fromkeys(row["cell"] for row in tests))


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
