"""`compare BEFORE AFTER`: which numbers of two runs differ, beside their intervals, and why.

The runs may be two states of one campaign's folder (a copy kept of the first) or two campaigns
that share cells. The reasons are read from what the results carry of their making: raw files,
settings and code. Nothing is computed anew.
"""

import csv
import math
from contextlib import chdir
from pathlib import Path
from typing import NamedTuple

from cellwright.refusal import Refusal
from runtime import artefact, lineage
from runtime.page_tables import Cell, plain_table, std_name

# Tables whose rows stand for the same in two runs, and what says which row is which.
TABLES = ("summary", "capacity", "resistance", "health", "validation", "soc", "eis", "packs")
KEYS = ("cell", "group", "test", "cycle", "direction", "ambient_temperature_celsius", "soc")
KEYS += ("delay_second", "model", "filter", "scenario", "initial_soc_error", "branch", "circuit")
STATED = ("cycle", "ambient_temperature_celsius", "soc")  # which a sheet may say otherwise
SHOWN = 5  # settings that differ, by name
OTHERS = "other cells or tests that it is compared with"
BEYOND = 1.96  # standard deviations of a difference: what 1 in 20 exceeds by chance
READ = (
    f"Red: differences beyond {BEYOND} of the standard deviations that both runs state; blank: "
    "none stated. The largest first."
)
# Two runs of the same numbers on other machines differ in the last digits.
SAME = 1e-6


class Change(NamedTuple):
    """A number of two runs: blank where one of them has none; deviations are those stated."""

    table: str
    row: str
    quantity: str
    before: str
    after: str
    deviations: float
    why: str


def compare(before, after) -> list[Change]:
    """What the tables of two runs say differently, the largest first.

    Parameters
    ----------
    before, after : folders of campaigns with `results/`

    Raises
    ------
    Refusal : a folder without results, or two without a row in common.
    """
    folders = [Path(before), Path(after)]
    for folder in folders:
        if not (folder / "results/summary.csv").is_file():
            raise Refusal(f"{folder}: found no results/summary.csv, wanted a campaign that was run")
    changes, shared, reasons = [], 0, {}
    for name in TABLES:
        old, new = (_rows(folder, name) for folder in folders)
        edits = _edits(folders, name)
        shared += len(set(old) & set(new))
        for key, *rows in _pairs(old, new):
            for quantity, values in _differing(*rows):
                cell = dict(key).get("cell")
                if cell not in reasons:
                    reasons[cell] = why(*folders, cell)
                row = " ".join(value for _, value in key)
                reason = "; ".join(filter(None, (*edits, reasons[cell]))) or OTHERS
                changes.append(Change(name, row, quantity, *values, reason))
    if not shared:
        raise Refusal(f"{before}, {after}: found no row of a table in common, wanted shared cells")
    return sorted(changes, key=lambda change: -_size(change.deviations))


def _pairs(old, new):
    """Name of each row and the row in both runs, None where it is not.

    Rows that differ in what a sheet states alone are the same, in their order.
    """
    alone = {}
    for side, (rows, others) in enumerate(((old, new), (new, old))):
        for key in [key for key in rows if key not in others]:
            same = tuple(pair for pair in key if pair[0] not in STATED)
            alone.setdefault(same, ([], []))[side].append(key)
    mates = {}
    for gone, come in alone.values():
        mates |= dict(zip(gone, come, strict=True)) if len(gone) == len(come) else {}
    for key, row in old.items():
        yield key, row, new.get(mates.get(key, key))
    for key in [key for key in new if key not in old and key not in mates.values()]:
        yield key, None, new[key]


def why(before, after, cell) -> str:
    """Which raw files, settings and code of a cell's results differ, in words; "" where none do."""
    old, new = (_origins(folder, cell) for folder in (before, after))
    differ = [key for key in dict.fromkeys([*old, *new]) if old.get(key) != new.get(key)]
    found = []
    for what in ("file", "setting", "code of"):
        names = sorted({name for kind, name, *_ in differ if kind == what})
        more = [f"{len(names) - SHOWN} more"] if len(names) > SHOWN else []
        found += [f"{what} {', '.join(names[:SHOWN] + more)}"] * bool(names)
    return "; ".join(found)


def _edits(folders, name) -> list[str]:
    """That a table is not as its run wrote it, in words, for each run of which it is so."""
    path, found = _path_of(name), []
    for folder in folders:
        with chdir(folder):
            found += [f"{path} of {folder} {lineage.EDITED}"] * lineage.is_edited(path)
    return found


def _path_of(name) -> Path:
    return Path("results", *([] if name == "summary" else ["tables"]), f"{name}.csv")


def _origins(folder, cell) -> dict[tuple, object]:
    """What a cell's results were made from: checksums of files, settings and code of rules."""

    def is_of(source):
        return source.endswith(".csv") or cell in Path(source).with_suffix("").parts

    found = {}
    with chdir(folder):
        for link in lineage.links_to("results/summary.csv", is_of if cell else lambda source: True):
            about = link.about
            if about is None:
                found["file", link.path] = link.sha256
            elif Path(link.path).suffix != ".csv":
                found["code of", about["rule"]] = about["code"]
                test = about["wildcards"].get("test")
                for path, value in _leaves(about["params"]):
                    name = f"{path[-1]} of {test}" if test else path[-1]
                    found["setting", name, about["rule"], path] = value
    return found


def _leaves(params, path=()):
    """Each setting in nested ones, with the names that lead to it."""
    for name, value in params.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*path, name))
        else:
            yield (*path, name), value


def _rows(folder, name) -> dict[tuple, dict]:
    path = Path(folder, _path_of(name))
    if not path.is_file():
        return {}
    rows, seen = {}, {}
    for row in artefact.load_table(path):
        key = tuple((column, row[column]) for column in KEYS if row.get(column))
        seen[key] = seen.get(key, 0) + 1
        rows[key if seen[key] == 1 else (*key, ("number", f"no. {seen[key]}"))] = row
    return rows


def _differing(old, new):
    """Quantities of a row whose values differ: (before, after, standard deviations of each)."""
    old, new = old or {}, new or {}
    for column in dict.fromkeys([*old, *new]):
        values = old.get(column) or "", new.get(column) or ""
        known = KEYS if not (old and new) else [key for key in KEYS if key not in STATED]
        if values[0] == values[1] or column in known or "_std" in column or column == "notes":
            continue
        numbers = [_number(value) for value in values]
        change = abs(numbers[1] - numbers[0])
        if change <= SAME * max(map(abs, numbers)):
            continue
        spread = math.hypot(*(_number(row.get(std_name(column, row))) for row in (old, new)))
        yield column, (*values, change / spread if spread > 0 else math.nan)


def _number(text) -> float:
    try:
        return float(text)
    except (TypeError, ValueError):
        return math.nan


def _size(deviations) -> float:
    return -1.0 if math.isnan(deviations) else deviations


def in_words(changes) -> list[str]:
    """The comparison in a few lines."""
    if not changes:
        return ["no number of the tables differs"]
    beyond = [change for change in changes if change.deviations > BEYOND]
    unknown = sum(math.isnan(change.deviations) for change in changes)
    rows = len({(change.table, change.row) for change in changes})
    return [
        f"{len(changes)} values of {rows} rows differ; {len(beyond)} by more than their stated "
        f"intervals, {unknown} have none",
        *(
            f"  {c.table}: {c.row}: {c.quantity} {c.before or 'none'} → {c.after or 'none'}"
            + ("" if math.isnan(c.deviations) else f" ({c.deviations:.1f} standard deviations)")
            for c in changes[:10]
        ),
        *[f"because of {reason}" for reason in dict.fromkeys(change.why for change in changes)][:5],
    ]


def write(changes, folder) -> list[Path]:
    """`comparison.csv` and `comparison.html` in a folder, which is made; their paths."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    table, page = Path(folder, "comparison.csv"), Path(folder, "comparison.html")
    with open(table, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Change._fields)
        writer.writerows(change._replace(deviations=_shown(change)) for change in changes)
    page.write_text(_page(changes), encoding="utf-8")
    return [table, page]


def _shown(change) -> str:
    return "" if math.isnan(change.deviations) else f"{change.deviations:.3g}"


def _page(changes) -> str:
    """The comparison as the report writes its tables, one for each table that differs."""
    from runtime import page

    tables = [
        _table(name, [change for change in changes if change.table == name])
        for name in dict.fromkeys(change.table for change in changes)
    ]
    template = page.environment_of(page.TEMPLATES).get_template("compare.html.j2")
    sentences = in_words(changes)[:1]
    return template.render(tables=tables, sentences=sentences, number_of=page.Numbers())


def _table(name, changes):
    rows = [
        [
            change.row,
            change.quantity.replace("_", " "),
            Cell(change.before, mark="n"),
            Cell(change.after, mark="n"),
            Cell(_shown(change), mark="worst" if change.deviations > BEYOND else ""),
            change.why,
        ]
        for change in changes
    ]
    columns = ["row", "quantity", "before", "after", "standard deviations", "because of"]
    return plain_table(name, name.replace("_", " "), READ, columns, rows)
