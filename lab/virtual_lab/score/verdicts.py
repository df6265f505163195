"""Missing-effect verdicts compared with what was hidden in the cells."""

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, files
from virtual_lab.score.comparison import errors

HEALTHY = ("none", "reference")
NAMED = ("right", "right, as one of a tie")
COLUMNS = [
    *("cell", "kind", "visible", "hidden", "strength_millivolt", "verdict", "said", "outcome"),
    *("extra_names", "branch_right", "gap_closed"),
]


def compare(place: files.Campaign) -> pd.DataFrame:
    """One row a cell: what was hidden, the verdict, and the outcome; empty without truth."""
    hidden_by_cell = sorted(hidden_effects(place).items())
    rows = [
        _judged(cell, hidden, _new_names(place, hidden, _verdict(place, cell)))
        for cell, hidden in hidden_by_cell
        if hidden["kind"] != "unplanted"
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def _new_names(place, hidden, verdict):
    """The verdict on a planted copy of a real cell, without what is named in the unplanted one."""
    control = _verdict(place, hidden["control"]) if "control" in hidden else None
    known = {one["effect"] for one in control["effects"]} if control else set()
    if not verdict or not known or known & set(hidden["effects"][0]["accept"]):
        return None if known else verdict
    new = [one for one in verdict["effects"] if one["effect"] not in known]
    return verdict | {"effects": new, "verdict": verdict["verdict"] if new else "none"}


def hidden_effects(place) -> dict:
    """What was hidden, by cell.

    The truth is such a document, or its entry "cells", or a list of rows; in sets simulated by
    others it is `truth.json`.
    """
    names = (place.truth / "missing_effect.json", place.truth / "truth.json")
    document = next(filter(None, map(files.read_json, names)), {})
    if isinstance(document, list):
        return {row["cell"]: row for row in document}
    return document.get("cells", document)


def _verdict(place, cell):
    return files.read_json(place.results / "missing_effect" / cell / "verdict.json")


def _judged(cell, hidden, verdict) -> dict:
    accepts = [set(one.get("accept") or [one["effect"]]) for one in hidden["effects"]]
    said = verdict["effects"] if verdict else []
    return {
        "cell": cell,
        "kind": hidden["kind"],
        "visible": bool(hidden["visible"]),
        "hidden": " + ".join(one["effect"] for one in hidden["effects"]) or hidden["kind"],
        "strength_millivolt": _strength(hidden),
        "verdict": verdict["verdict"] if verdict else None,
        "said": " + ".join(one["effect"] for one in said),
        "outcome": outcome(hidden, verdict),
        "extra_names": len(said) - len(_partners(accepts, said)) if verdict else None,
        "branch_right": _branch_right(hidden, said),
        "gap_closed": said[-1].get("gap_closed") if said else None,
    }


def _strength(hidden) -> float | None:
    """Gap that the strongest hidden effect leaves after the fit [mV]."""
    names = ("target_gap_millivolt", "visible_gap_millivolt")
    gaps = [next((one[n] for n in names if one.get(n)), None) for one in hidden["effects"]]
    return max(filter(None, gaps), default=None)


def _branch_right(hidden, said) -> bool | None:
    """Whether the first effect named in a group is in the right branch; None without branches."""
    true = [one.get("parameters", {}).get("branch") for one in hidden["effects"]]
    return said[0].get("branch") == true[0] if said and any(true) else None


def outcome(hidden: dict, verdict: dict | None) -> str:
    """Outcome of a verdict, in words.

    Parameters
    ----------
    hidden : kind, none_acceptable and effects, each with the names that count as right (`accept`).
    verdict : the document of a verdict; None where none was given.
    """
    if verdict is None:
        return "no verdict"
    said, healthy = verdict["verdict"], hidden["kind"] in HEALTHY
    if said == "none":
        silent = "rightly silent" if hidden.get("none_acceptable") else "missed"
        return "right" if healthy else silent
    if healthy:
        return "false alarm"
    if said == "unknown":
        return "right" if hidden["kind"] == "unknown" else "called unknown"
    return "false name" if hidden["kind"] == "unknown" else _named(hidden, verdict)


def _named(hidden, verdict) -> str:
    accepts = [set(one.get("accept") or [one["effect"]]) for one in hidden["effects"]]
    partners = _partners(accepts, verdict["effects"])
    if not partners:
        return "false name"
    if len(partners) < len(accepts):
        return "one of two"
    return "right, as one of a tie" if verdict["verdict"] == "ambiguous" else "right"


def _partners(accepts, said) -> dict:
    """Which hidden effect each named effect means: number named → number hidden, each once."""
    taken = {}
    for number, one in enumerate(said):
        names = {one["effect"], *one.get("alternatives", [])}
        free = (k for k, accept in enumerate(accepts) if k not in taken.values() and names & accept)
        mine = next(free, None)
        if mine is not None:
            taken[number] = mine
    return taken


def confusion(judged: pd.DataFrame) -> pd.DataFrame:
    """Numbers of cells: what was hidden (rows) against the outcome (columns)."""
    return pd.crosstab(_classes(judged), judged["outcome"])


def answers(judged: pd.DataFrame) -> pd.DataFrame:
    """Numbers of cells: what was hidden (rows) against the first effect named (columns)."""
    first = judged["said"].str.split(" + ", regex=False).str[0]
    first = first.where(first != "", judged["verdict"].fillna("no verdict"))
    return pd.crosstab(_classes(judged), first.rename("said"))


def _classes(judged):
    """The hidden effect of each cell; several are one class, and so are all healthy cells."""
    kind = judged["kind"]
    hidden = judged["hidden"].mask(kind == "two", "two effects")
    return hidden.mask(kind.isin(HEALTHY), "healthy")


def power(judged: pd.DataFrame) -> pd.DataFrame:
    """Numbers of cells with one hidden effect, by effect and strength [mV, two digits].

    Columns: cells, those that were named right, those that are visible, and those with an answer
    that is right or, where nothing shows, rightly silent.
    """
    single = judged[judged["kind"] == "single"]
    strengths = pd.to_numeric(single["strength_millivolt"])
    names = [f"{name}, {mv:.2g} mV" for name, mv in zip(single["hidden"], strengths, strict=True)]
    right, silent = single["outcome"].isin(NAMED), single["outcome"] == "rightly silent"
    counts = pd.DataFrame(
        {
            "cells": np.ones(len(single), int),
            "visible": single["visible"].astype(int),
            "named right": right.astype(int),
            "right or rightly silent": (right | silent).astype(int),
        }
    )
    return counts.groupby(pd.Series(names, single.index, dtype=object)).sum()


def rates(judged: pd.DataFrame) -> list[tuple[str, int, int]]:
    """Name, hits, number of cases: the shares by which a search for missing effects is judged."""
    given = judged[judged["verdict"].notna()]
    kind, right = given["kind"], given["outcome"].isin(NAMED)
    content = right | (given["outcome"] == "rightly silent")
    seen = given["visible"].astype(bool)
    healthy = kind.isin(HEALTHY)
    wrong = given["outcome"] == "false name"
    in_branch = right & given["branch_right"].notna()
    shares = [
        ("right name of one visible effect", right & seen, (kind == "single") & seen),
        ("right branch of a rightly named effect", given["branch_right"].eq(True), in_branch),
        ("both names of two visible effects", right & seen, (kind == "two") & seen),
        ("right, or rightly silent, of one hidden effect", content, kind == "single"),
        ("unknown effect called unknown", right, kind == "unknown"),
        ("false name of a hidden effect", wrong, ~healthy),
        ("extra names of a hidden effect", given["extra_names"] > 0, ~healthy),
        ("false alarm on a healthy cell", given["outcome"] == "false alarm", healthy),
    ]
    return [(name, int((hit & of).sum()), int(of.sum())) for name, hit, of in shares]


def gaps(judged: pd.DataFrame) -> list[tuple[str, float, int]]:
    """Median and lowest tenth of the closed gap on validation data, of rightly named effects."""
    mine = judged[judged["outcome"].isin(NAMED) & judged["kind"].isin(["single", "two"])]
    closed = pd.to_numeric(mine["gap_closed"], errors="coerce").dropna().to_numpy()
    levels = {"gap closed, median": 50, "gap closed, lowest tenth": 10} if len(closed) else {}
    return [(k, float(np.percentile(closed, level)), len(closed)) for k, level in levels.items()]


def parameters(place: files.Campaign) -> pd.DataFrame:
    """Errors of the parameters of rightly named effects, where both sides have the parameter."""
    rows = [row for named in _rightly_named(place) for row in _beside(*named)]
    parts = pd.DataFrame(rows).groupby(["quantity", "unit"]) if rows else []
    return comparison.gathered(
        errors("missing_effect", name, unit, part) for (name, unit), part in parts
    )


def _rightly_named(place):
    """Cell, hidden effect and named effect, where the two are the same."""
    for cell, hidden in sorted(hidden_effects(place).items()):
        said = (_verdict(place, cell) or {"effects": []})["effects"]
        partners = _partners([{one["effect"]} for one in hidden["effects"]], said)
        pairs = [(hidden["effects"][mine], said[number]) for number, mine in partners.items()]
        yield from ((cell, *pair) for pair in pairs if pair[0]["effect"] == pair[1]["effect"])


def _beside(cell, hidden, said):
    """Rows of `errors`: parameters of one effect, hidden and estimated."""
    for name, true in hidden.get("parameters", {}).items():
        found = said.get("parameters", {}).get(name)
        if found is None or not isinstance(true, int | float):
            continue
        yield {
            "cell": cell,
            "test": "",
            "at": "",
            "true": true,
            "found": found["value"],
            "std": found.get("std"),
            "quantity": f"{hidden['effect']}: {name}",
            "unit": found.get("unit") or "",
        }
