"""Tables of a scored benchmark: power, controls, confusion."""

import numpy as np
import pandas as pd

from effect_benchmark import methods
from effect_benchmark.scoring import DYNAMIC, Share, is_outcome, right, share
from effect_benchmark.truth import first
from virtual_lab.score import verdicts

CONTROLS = (methods.RANDOM, methods.PERMUTED, methods.EXTRA)
CONTENT = ("right", "right, as one of a tie", "rightly silent")


def power(table: pd.DataFrame) -> list[dict]:
    """Rightly named cells of one effect, visible or not, by effect and strength.

    `visible` counts the cells whose effect shows beyond the noise; in the others silence is right,
    too, and is counted in `content`.
    """
    mine = table[(table["method"] == methods.SEARCH) & (table["kind"] == "single")]
    rows = []
    for (effect, strength), part in mine.groupby(["hidden", "strength_millivolt"]):
        rows.append(
            {
                "effect": effect,
                "strength_millivolt": strength,
                "dynamic": effect in DYNAMIC,
                "right": share("right", part, right),
                "visible": share("of the visible", part[part["visible"]], right),
                "content": share("content", part, is_outcome(*CONTENT)),
            }
        )
    return sorted(rows, key=_dynamic_first)


def _dynamic_first(row):
    return not row["dynamic"], row["effect"], row["strength_millivolt"]


def rankings(table: pd.DataFrame) -> list[dict]:
    """Each way of ranking on the same cells: right, false names, false alarms."""
    rows = []
    for method in (methods.SEARCH, methods.BIC, methods.VALIDATION):
        mine = table[(table["method"] == method) & (table["sort"] == "cell")]
        seen = mine[(mine["kind"] == "single") & mine["visible"] & mine["dynamic"]]
        wrong = is_outcome("false name")
        healthy = mine["kind"].isin(verdicts.HEALTHY)
        rows.append(
            {
                "method": method,
                "right": share("right", seen, right),
                "false_names": share("false names", mine[~healthy], wrong),
                "alarms": share("alarms", mine[healthy], is_outcome("false alarm")),
            }
        )
    return rows


def left_out(table: pd.DataFrame) -> list[Share]:
    """What is said where the library lacks the effect that is there."""
    mine = table[(table["method"] == methods.LEFT_OUT) & (table["sort"] == "cell")]
    strong = mine[mine["dynamic"] & (mine["strength_millivolt"] == 6.0)]
    return [
        share("called unknown", mine, right),
        share("another name", mine, is_outcome("false name")),
        share("said to lack nothing", mine, is_outcome("missed", "rightly silent")),
        share("dynamic effects at 6 mV: called unknown", strong, right),
        share("dynamic effects at 6 mV: another name", strong, is_outcome("false name")),
    ]


def groups(table: pd.DataFrame) -> list[dict]:
    """Parallel groups by what of them was logged: named right, in the right branch, alarms.

    `sensors`: answers that name the sensor of a branch; without branch currents nobody can know.
    """
    mine = table[table["sort"] == "group"]
    ways = (methods.SEARCH, methods.ONE_TEMPERATURE, methods.BLIND)
    return [_group_row(way, mine[mine["method"] == way]) for way in ways]


def _group_row(way, mine):
    found = mine[(mine["kind"] == "single") & mine["visible"]]
    healthy = mine[mine["kind"].isin(verdicts.HEALTHY)]
    answered = mine[mine["verdict"].notna()]
    return {
        "method": way,
        "first": share("first name right", found, first),
        "right": share("right, ties counted", found, right),
        "branch": share("right name and branch", found, lambda t: first(t) & t["branch_right"]),
        "extra": share("an extra name", found, lambda t: t["extra_names"] > 0),
        "alarms": share("alarms", healthy, is_outcome("false alarm")),
        "sensors": share("sensors", answered, lambda t: t["said"].str.contains("branch_current_")),
    }


def controls(table: pd.DataFrame) -> list[dict]:
    """Terms that must not help: how often they would be named, how much of the gap they close.

    Beside them, on the same cells, what the search named. Cells with one visible effect.
    """
    cells = table[table["sort"] == "cell"]
    seen = cells[(cells["kind"] == "single") & cells["visible"]]
    healthy = cells[cells["kind"].isin(verdicts.HEALTHY)]
    return [_control(method, seen, healthy) for method in (methods.SEARCH, *CONTROLS)]


def _control(method, seen, healthy):
    mine, well = seen[seen["method"] == method], healthy[healthy["method"] == method]
    closed = mine["gap_closed"].dropna().to_numpy(float)
    middle = float(np.median(closed)) if len(closed) else float("nan")
    return {
        "method": method,
        "named": share("named", mine, _named),
        "named_healthy": share("named", well, _named),
        "gap_closed": middle,
    }


def _named(table):
    return table["verdict"].isin(["named", "ambiguous"])


def confusion(table: pd.DataFrame) -> pd.DataFrame:
    """Numbers of cells and groups: what was hidden against the first answer."""
    mine = table[table["method"] == methods.SEARCH]
    counts = verdicts.answers(mine[mine["verdict"].notna()])
    rows = _order(counts.index, ["healthy", "unknown", "two effects"])
    columns = _order(counts.columns, ["none", "unknown"])
    return counts.reindex(index=rows, columns=columns)


def _order(names, last):
    """Dynamic effects as listed, other effects by name, then what is no effect."""
    first = [name for name in DYNAMIC if name in names]
    rest = sorted(set(names) - set(first) - set(last))
    return [*first, *rest, *(name for name in last if name in names)]


def misses(table: pd.DataFrame) -> list[dict]:
    """Cells and groups whose answer by the search is wrong, or that have none, with the reason."""
    mine = table[(table["method"] == methods.SEARCH) & table["sort"].isin(["cell", "group"])]
    bad = mine["outcome"].isin(["false name", "false alarm", "missed", "one of two", "no verdict"])
    bad |= mine["outcome"] == "called unknown"
    names = ["cell", "hidden", "strength_millivolt", "verdict", "said", "outcome", "reason"]
    ordered = mine[bad].sort_values(["outcome", "hidden", "cell"])
    return ordered[names].fillna("").to_dict("records")
