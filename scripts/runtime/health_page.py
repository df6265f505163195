"""The health of a campaign's cells as its figure and the report's overview show it."""

import numpy as np

from cellwright.health.summary import surest_late
from cellwright.health.table import CHECK_UP, CYCLES, MODES, PEAKS
from runtime import artefact
from runtime.page_tables import link, plain_table

# Of each method the column of the overview.
METHODS = {CHECK_UP: "check_up", CYCLES: "cycles", PEAKS: "peaks"}
SHARES = ("lli", "lam_negative", "lam_positive")


def lives(health, fade, courses, protocols) -> list[dict]:
    """What `figures.degradation.draw_lives` draws, of the cells that were seen at two cycles.

    `health` and `fade` are frames of the tables so named, `courses` paths of stage `fade_course`,
    `protocols` the ageing protocol by cell.
    """
    knees = dict(zip(fade["cell"], fade["knee_cycle"], strict=True))
    starts = dict(zip(fade["cell"], fade["start_ampere_hour"], strict=True))
    found = _cycled(courses, starts)
    for cell, rows in health.groupby("cell", sort=False):
        seen = rows[(rows["method"] == CHECK_UP) & rows["soh"].notna()]
        # Every discharge of a life tells more than its check-ups, which then only repeat it.
        if cell not in found and seen["cycle"].nunique() > 1:
            found[cell] = seen["cycle"].to_numpy(float), seen["soh"].to_numpy(float)
    told = health[(health["method"] == PEAKS) & health["soh"].notna()]
    return [
        {
            "cell": cell,
            "protocol": protocols.get(cell) or "",
            "cycle": cycle,
            "soh": soh,
            "knee_cycle": float(knees.get(cell, np.nan)),
            "peaks": told[told["cell"] == cell][["cycle", "soh"]].to_numpy(float),
        }
        for cell, (cycle, soh) in found.items()
    ]


def _cycled(courses, starts):
    """Cycle and state of health of every discharge used of the lives that have a law, by cell."""
    found = {}
    for columns, about in artefact.load_all(courses):
        cell, used = about["wildcards"]["cell"], columns["used"].astype(bool)
        if cell in starts and used.sum() > 1:
            soh = columns["capacity_ampere_hour"][used] / starts[cell]
            found[cell] = columns["cycle"][used], soh
    return found


def section(tables) -> dict:
    """Rows and sentences of the report's overview of health; empty without an aged cell.

    `tables` are frames of text by name: health, fade, and those of comparisons where there are any.
    """
    aged = tables["health"]
    seen = aged.groupby("cell", sort=False)["cycle"].nunique()
    lives_of = {row["cell"]: row for row in tables["fade"].to_dict("records")}
    # A life without check-ups has one row here, that of its last cycle.
    cells = [cell for cell, count in seen.items() if count > 1 or cell in lives_of]
    rows = [_row(cell, aged[aged["cell"] == cell], lives_of.get(cell)) for cell in cells]
    names = {"protocols": "verdict", "fleet_health_lines": "verdict"}
    words = [
        f"{row['type']}: {row[column]}"
        for name, column in names.items()
        if name in tables
        for row in tables[name].to_dict("records")
        if row[column]
    ]
    return {"rows": rows, "sentences": list(dict.fromkeys(words))} if rows else {}


def table_of_section(found):
    """The rows of `section` as the report's table."""
    read = (
        "The latest state of health by each method, over the first check-up or discharge; knee and "
        "remaining cycles to the end of life with their 95 % intervals; lithium and material lost "
        "at the latest check-up. ± is a standard deviation; blank: not known from these data."
    )
    columns = ["cell", "check-up", "cycles of the life", "dQ/dV peaks", "knee [cycle]"]
    columns += ["remaining cycles", "lithium lost", "negative lost", "positive lost"]
    lines = [
        [
            link(row["cell"]),
            *(_at_cycle(row[name]) for name in METHODS.values()),
            *(row[name] for name in ("knee", "remaining", *SHARES)),
        ]
        for row in found["rows"]
    ]
    made = "results/tables/health.csv"
    return plain_table("health", "Health by each method", read, columns, lines, made=made)


def _at_cycle(last):
    at = f" at cycle {float(last['cycle']):.0f}" if last and last["cycle"] else ""
    return f"{last['soh']}{at}" if last else ""


def _row(cell, rows, life):
    """The last state of one cell by each method, its knee and remaining cycles, as text."""
    row = {"cell": cell}
    for method, name in METHODS.items():
        told = rows[(rows["method"] == method) & (rows["soh"] != "")]
        row[name] = _last(told) if len(told) else {}
    modes = rows[rows["method"] == MODES]
    last = _latest(modes) if len(modes) else {}
    row |= {name: _percent(last, name) for name in SHARES}
    life = life or {}
    row["knee"] = _with_limits(life, "knee_cycle", "knee_lower_cycle", "knee_upper_cycle")
    ends = ("remaining_cycles", "remaining_lower_cycles", "remaining_upper_cycles")
    row["remaining"] = _with_limits(life, *ends)
    return row


def _latest(rows):
    """The surest row of the last cycles, as text."""
    found = rows.to_dict("records")
    numbers = [
        {name: float(row[name]) if row[name] else None for name in ("cycle", "soh_std")}
        for row in found
    ]
    return found[numbers.index(surest_late(numbers))]


def _last(rows):
    row = _latest(rows)
    return {"soh": _percent(row, "soh"), "cycle": row["cycle"]}


def _percent(row, name):
    """A share in percent with its standard deviation, where they are known."""
    if not row.get(name):
        return ""
    std = row.get(f"{name}_std")
    return f"{100 * float(row[name]):.1f}{f' ± {100 * float(std):.1f}' if std else ''} %"


def _with_limits(row, name, lower, upper):
    """A number of cycles with its limits; nothing where it is not told."""
    if not row.get(name):
        return ""
    ends = [f"{float(row[end]):.0f}" if row.get(end) else "?" for end in (lower, upper)]
    return f"{float(row[name]):.0f} ({ends[0]} to {ends[1]})"
