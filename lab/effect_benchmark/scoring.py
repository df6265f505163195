"""Answers beside what was hidden: one row a cell and method, the goals, and their tables."""

import json
from typing import NamedTuple

import numpy as np
import pandas as pd

from effect_benchmark.answers import (
    BIC,
    BLIND,
    EXTRA,
    LEFT_OUT,
    ONE_TEMPERATURE,
    PERMUTED,
    RANDOM,
    SEARCH,
    VALIDATION,
)
from virtual_lab.score import files, verdicts
from virtual_lab.score.summary import wilson

# Effects that show in how a cell moves, not only in where its voltage lies. The goals count these.
DYNAMIC = (
    "hysteresis_instant",
    "hysteresis_one_state",
    "resistance_asymmetry",
    "resistance_soc",
    "polarisation_soc",
    "slow_diffusion",
    "charge_transfer_nonlinearity",
    "resistance_temperature",
    "entropic_ocv",
    "self_heating",
    "capacity_temperature",
    "coulombic_inefficiency",
    "leakage",
    "current_offset",
    "time_skew",
)
ALL = ("at least", 1.0)
NUMBERS = ("extra_names", "gap_closed")
SORTS = {"h": "cell", "p": "physics", "g": "group"}  # by the first letter of the name
ANSWERED = ("rounds", "cpu_second", "floor_volt", "validation_before_volt", "validation_after_volt")


class Share(NamedTuple):
    """Hits of a number of cells, and the wanted share; `side` is "at least", "at most" or ""."""

    name: str
    hits: int
    of: int
    side: str = ""
    wanted: float = float("nan")

    @property
    def share(self) -> float:
        return self.hits / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        return wilson(self.hits, self.of)

    @property
    def reached(self) -> bool | None:
        """Whether the goal is reached; None without a goal or cells."""
        return reached(self.share, self.side, self.wanted) if self.of else None


class Level(NamedTuple):
    """A measured number and its goal; `of` is how many values it summarises."""

    name: str
    value: float
    of: int
    side: str
    wanted: float
    unit: str

    @property
    def reached(self) -> bool | None:
        return reached(self.value, self.side, self.wanted) if self.of else None


def reached(value, side, wanted) -> bool | None:
    """Whether a value is on the right side; None where nothing was wanted."""
    return {"at least": value >= wanted, "at most": value <= wanted}.get(side)


def judged(folder, answers: list[dict]) -> pd.DataFrame:
    """Answer of each method on each hidden cell or group, and whether it is right.

    A cell that a method left without an answer has a row without a verdict.

    Parameters
    ----------
    folder : of the campaign with its truth. answers : rows of `batch.answered`.
    """
    cells = files.read_json(files.campaign(folder).truth / "missing_effect.json")
    hidden = {row["cell"]: row for row in cells if row["kind"] != "reference"}
    answered = {(row["method"], row["cell"]): row for row in answers}
    methods = dict.fromkeys([SEARCH, *(row["method"] for row in answers)])
    rows = [
        _row(truth_of_cell, answered.get((method, cell)), method)
        for method in methods
        for cell, truth_of_cell in sorted(hidden.items())
        if method == SEARCH or (method, cell) in answered
    ]
    return pd.DataFrame(rows)


def _row(hidden, answer, method):
    verdict = json.loads(answer["document"]) if answer and answer["document"] else None
    expected = hidden | {"kind": "unknown"} if method == LEFT_OUT else hidden
    row = verdicts._judged(hidden["cell"], expected, verdict)
    names = {effect["effect"] for effect in hidden["effects"]}
    outside = "outside: " if hidden["kind"] == "unknown" else ""
    return row | {
        "hidden": outside + row["hidden"],
        "method": method,
        "sort": SORTS[hidden["cell"][0]],
        "strength_millivolt": strength(hidden),
        "dynamic": bool(names) and names <= set(DYNAMIC),
        "tie": any(len(effect["accept"]) > 1 for effect in hidden["effects"]),
        "branch_right": branch_right(hidden, verdict),
        "reason": answer["reason"] if answer else "",
        "gap_closed": answer["gap_closed"] if answer else np.nan,
        **{name: answer[name] if answer else np.nan for name in ANSWERED},
    }


def share(name, table, hit, side="", wanted=float("nan")) -> Share:
    """Rows of a table that hit; `hit` is a function table → boolean series."""
    table = table[table["verdict"].notna()] if side == "at most" and len(table) else table
    hits = int(hit(table).sum()) if len(table) else 0
    return Share(name, hits, len(table), side, wanted)


def right(table):
    """Rightly named, ties included."""
    return table["outcome"].isin(verdicts.NAMED)


def is_outcome(*names):
    """Hit function for `share`."""
    return lambda table: table["outcome"].isin(names)


def goals(table: pd.DataFrame) -> list:
    """The goals of the design beside what was measured: Share and Level, in the design's order.

    A cell without an answer counts as not right, and among the false ones not at all.
    """
    searched = table[table["method"] == SEARCH]
    cells = searched[searched["sort"] == "cell"]
    healthy = cells["kind"].isin(verdicts.HEALTHY)
    dynamic = cells[(cells["kind"] == "single") & cells["visible"] & cells["dynamic"]]
    two, unknown = cells[cells["kind"] == "two"], cells[cells["kind"] == "unknown"]
    alarm, false_name = is_outcome("false alarm"), is_outcome("false name")
    strong = dynamic[dynamic["strength_millivolt"] == 6.0]
    hidden = cells[~healthy]
    return [
        share("right class of visible dynamic effects", dynamic, right, "at least", 0.92),
        share("the same at 6 mV", strong, right, "at least", 0.97),
        share("false names of hidden effects", hidden, false_name, "at most", 0.02),
        share("false alarms on healthy cells", cells[healthy], alarm, "at most", 0.01),
        share("unknown effects called unknown", unknown, right, "at least", 0.9),
        *_gaps(cells),
        share(
            "offset or leak: as a tie, or by the log at rest",
            cells[right(cells) & cells["tie"]],
            _tie_handled,
            *ALL,
        ),
        share("both of two effects", two, right, "at least", 0.8),
        share("an extra name beside two effects", two, _extra, "at most", 0.08),
        *_beyond(searched),
        *_cost(cells),
    ]


def _tie_handled(table):
    """Rows whose tie of two effects is stated, or resolved by the log at rest."""
    said, hidden = (
        table[column].str.split(" + ", regex=False).map(set) for column in ("said", "hidden")
    )
    return (table["verdict"] == "ambiguous") | (said == hidden)


def _extra(table):
    """Rows that name more effects than are hidden."""
    return table["extra_names"] > 0


def _gaps(cells):
    named = cells[right(cells) & cells["kind"].isin(["single", "two"])]
    closed = named["gap_closed"].dropna().to_numpy(float)
    middle, low = np.percentile(closed, [50, 10]) if len(closed) else (np.nan, np.nan)
    count = len(closed)
    return [
        Level("gap closed on validation data, median", middle, count, "at least", 0.95, "share"),
        Level("gap closed, lowest tenth", low, count, "at least", 0.8, "share"),
    ]


def _beyond(searched):
    """Goals of cells simulated by physics and of groups."""
    physics, groups = searched[searched["sort"] == "physics"], searched[searched["sort"] == "group"]
    named = physics[physics["kind"] == "single"]
    visible = groups[(groups["kind"] == "single") & groups["visible"]]
    alarm = is_outcome("false alarm")
    return [
        share("cells by physics, paired: right class", named, right, "at least", 0.8),
        share(
            "cells by physics, paired: alarms",
            _healthy(physics),
            alarm,
            "at most",
            0.15,
        ),
        share("groups, branch currents logged: right class first", visible, first_right),
        share(
            "groups, branch currents logged: alarms",
            _healthy(groups),
            alarm,
        ),
    ]


def _healthy(table):
    return table[table["kind"].isin(verdicts.HEALTHY)]


def _cost(cells):
    each = (cells["cpu_second"] / cells["rounds"]).dropna().to_numpy(float)
    middle, high = np.percentile(each, [50, 95]) if len(each) else (np.nan, np.nan)
    count = len(each)
    return [
        Level("CPU time a cell and round, median", middle, count, "at most", 1.0, "s"),
        Level("CPU time a cell and round, 95th percentile", high, count, "at most", 1.0, "s"),
    ]


def flat(table: pd.DataFrame) -> dict:
    """The table of `judged` as columns without gaps: "" and NaN for what is not known."""
    kinds = table.dtypes.map(pd.api.types.is_numeric_dtype)
    texts = [name for name in table if not kinds[name] and name not in NUMBERS]
    numbers = {name: pd.to_numeric(table[name], errors="coerce") for name in NUMBERS}
    full = table.assign(**numbers, **{name: table[name].fillna("") for name in texts})
    return {name: full[name].to_numpy() for name in full}


def goal_rows(table: pd.DataFrame) -> list[dict]:
    """The goals as rows: measured, with its interval, beside what is wanted."""
    rows = []
    for goal in goals(table):
        shared = isinstance(goal, Share)
        low, high = goal.interval if shared else (np.nan, np.nan)
        measured = {"measured": goal.share if shared else goal.value, "low": low, "high": high}
        wanted = {"of": goal.of, "side": goal.side, "wanted": goal.wanted}
        rows.append({"goal": goal.name, **measured, **wanted, "reached": bool(goal.reached)})
    return rows


CONTROLS = (RANDOM, PERMUTED, EXTRA)
CONTENT = ("right", "right, as one of a tie", "rightly silent")


def power(table: pd.DataFrame) -> list[dict]:
    """Rightly named cells of one effect, visible or not, by effect and strength.

    `visible` counts the cells whose effect shows beyond the noise; in the others silence is right,
    too, and is counted in `content`.
    """
    single = table[(table["method"] == SEARCH) & (table["kind"] == "single")]
    rows = []
    for (effect, strength), part in single.groupby(["hidden", "strength_millivolt"]):
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
    return sorted(
        rows, key=lambda row: (not row["dynamic"], row["effect"], row["strength_millivolt"])
    )


def rankings(table: pd.DataFrame) -> list[dict]:
    """Each way of ranking on the same cells: right, false names, false alarms."""
    rows = []
    for method in (SEARCH, BIC, VALIDATION):
        cells = table[(table["method"] == method) & (table["sort"] == "cell")]
        seen = cells[(cells["kind"] == "single") & cells["visible"] & cells["dynamic"]]
        wrong = is_outcome("false name")
        healthy = cells["kind"].isin(verdicts.HEALTHY)
        rows.append(
            {
                "method": method,
                "right": share("right", seen, right),
                "false_names": share("false names", cells[~healthy], wrong),
                "alarms": share("alarms", cells[healthy], is_outcome("false alarm")),
            }
        )
    return rows


def left_out(table: pd.DataFrame) -> list[Share]:
    """Answers where the hidden effect was removed from the library."""
    cells = table[(table["method"] == LEFT_OUT) & (table["sort"] == "cell")]
    strong = cells[cells["dynamic"] & (cells["strength_millivolt"] == 6.0)]
    return [
        share("called unknown", cells, right),
        share("another name", cells, is_outcome("false name")),
        share("said to lack nothing", cells, is_outcome("missed", "rightly silent")),
        share("dynamic effects at 6 mV: called unknown", strong, right),
        share("dynamic effects at 6 mV: another name", strong, is_outcome("false name")),
    ]


def groups(table: pd.DataFrame) -> list[dict]:
    """Parallel groups by what of them was logged: named right, in the right branch, alarms.

    `sensors`: answers that name the sensor of a branch; without branch currents nobody can know.
    """
    answered = table[table["sort"] == "group"]
    ways = (SEARCH, ONE_TEMPERATURE, BLIND)
    return [_group_row(way, answered[answered["method"] == way]) for way in ways]


def _group_row(way, answers):
    visible = answers[(answers["kind"] == "single") & answers["visible"]]
    healthy = answers[answers["kind"].isin(verdicts.HEALTHY)]
    answered = answers[answers["verdict"].notna()]
    return {
        "method": way,
        "first": share("first name right", visible, first_right),
        "right": share("right, ties counted", visible, right),
        "branch": share("right name and branch", visible, _right_in_branch),
        "extra": share("an extra name", visible, _extra),
        "alarms": share("alarms", healthy, is_outcome("false alarm")),
        "sensors": share("sensors", answered, lambda t: t["said"].str.contains("branch_current_")),
    }


def _right_in_branch(table):
    return first_right(table) & table["branch_right"]


def controls(table: pd.DataFrame) -> list[dict]:
    """Control terms: how often they would be named, and which share of the gap they close.

    Beside them, on the same cells, what the search named. Cells with one visible effect.
    """
    cells = table[table["sort"] == "cell"]
    seen = cells[(cells["kind"] == "single") & cells["visible"]]
    healthy = cells[cells["kind"].isin(verdicts.HEALTHY)]
    return [_control(method, seen, healthy) for method in (SEARCH, *CONTROLS)]


def _control(method, seen, healthy):
    hidden, well = seen[seen["method"] == method], healthy[healthy["method"] == method]
    closed = hidden["gap_closed"].dropna().to_numpy(float)
    middle = float(np.median(closed)) if len(closed) else float("nan")
    return {
        "method": method,
        "named": share("named", hidden, _named),
        "named_healthy": share("named", well, _named),
        "gap_closed": middle,
    }


def _named(table):
    return table["verdict"].isin(["named", "ambiguous"])


def confusion(table: pd.DataFrame) -> pd.DataFrame:
    """Numbers of cells and groups: what was hidden against the first answer."""
    searched = table[table["method"] == SEARCH]
    counts = verdicts.answers(searched[searched["verdict"].notna()])
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
    searched = table[(table["method"] == SEARCH) & table["sort"].isin(["cell", "group"])]
    bad = searched["outcome"].isin(
        ["false name", "false alarm", "missed", "one of two", "no verdict"]
    )
    bad |= searched["outcome"] == "called unknown"
    names = ["cell", "hidden", "strength_millivolt", "verdict", "said", "outcome", "reason"]
    ordered = searched[bad].sort_values(["outcome", "hidden", "cell"])
    return ordered[names].fillna("").to_dict("records")


STRENGTHS = (1.0, 2.5, 6.0)


def strength(hidden: dict) -> float:
    """Largest strength of the hidden effects [mV]: as asked for, else the nearest to that seen."""
    sizes = []
    for effect in hidden["effects"]:
        visible = effect.get("visible_gap_millivolt", 0.0)
        nearest = min(STRENGTHS, key=lambda strength: abs(strength - visible))
        sizes.append(effect.get("target_gap_millivolt") or nearest)
    return max(sizes, default=0.0)


def branch_right(hidden: dict, verdict: dict | None) -> bool:
    """Whether the first effect named in a group is in the branch where it is hidden."""
    true = [effect.get("parameters", {}).get("branch", 0) for effect in hidden["effects"]]
    return bool(
        true and verdict and [effect.get("branch") for effect in verdict["effects"]][:1] == true
    )


def first_right(table):
    """Rows whose first name is the hidden effect, alternatives not counted."""
    return table["said"].str.split(" + ", regex=False).str[0] == table["hidden"]


def hidden_names(folder) -> dict[str, list[str]]:
    """Right names by cell, of cells with one visible effect; nothing else of the truth.

    Parameters
    ----------
    folder : of the campaign with its truth.
    """
    cells = files.read_json(files.campaign(folder).truth / "missing_effect.json")
    single = [row for row in cells if row["kind"] == "single" and row["visible"]]
    return {row["cell"]: sorted(row["effects"][0]["accept"]) for row in single}
