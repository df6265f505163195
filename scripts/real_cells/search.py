"""Numbers of the search for what is missing: verdicts, and how much of the gap they close."""

import json
import math
from pathlib import Path

from real_cells import reading
from virtual_lab.score.verdicts import NAMED, outcome

MILLI, PERCENT = 1e3, 1e2
WRONG = ("false name", "false alarm")


def verdicts(campaign):
    """Verdict of each cell and group, what it names, and the errors [mV] on data for proof."""
    for name, verdict in reading.documents(campaign, "missing_effect/*/verdict.json").items():
        effects = " + ".join(sorted(map(_named, verdict["effects"])))
        errors = verdict.get("validation_rmse_volt") or {}
        yield name, "verdict", "", verdict["verdict"]
        yield name, "named effects", "", effects or "none"
        yield name, "error before the search", "", _times(MILLI, errors.get("before"))
        yield name, "error after the search", "", _times(MILLI, errors.get("after"))
        yield name, "gap closed", "", _times(PERCENT, verdict.get("gap_closed"))


def _named(effect: dict) -> str:
    """An effect, and in which branch where it is that of a group."""
    return f"{effect['effect']} in {effect['cell']}" if "cell" in effect else effect["effect"]


def _times(factor, value):
    """A number in another unit; NaN where it is not known."""
    return math.nan if value is None else factor * value


def answers(campaign):
    """How many verdicts are right where the campaign says what is hidden in its cells."""
    path = Path(campaign) / "truth.json"
    if not path.is_file():
        return
    hidden = json.loads(path.read_text(encoding="utf-8"))["cells"]
    hidden = {cell: one for cell, one in hidden.items() if one["kind"] != "reference"}
    given = reading.documents(campaign, "missing_effect/*/verdict.json")
    found = [outcome(one, given.get(cell)) for cell, one in hidden.items()]
    place = f"of {len(hidden)} cells"
    right = (*NAMED, "rightly silent")
    yield "all", "right verdicts", place, sum(one in right for one in found)
    yield "all", "false names and false alarms", place, sum(one in WRONG for one in found)
