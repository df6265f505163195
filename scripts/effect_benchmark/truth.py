"""What was hidden in a cell or group, in the terms of the scores; what a second search lacks."""

from virtual_lab.score import files

STRENGTHS = (1.0, 2.5, 6.0)


def strength(hidden: dict) -> float:
    """Strength asked for [mV], the larger of two; nearest to what came out where it is not told."""
    found = [one.get("target_gap_millivolt") or _near(one) for one in hidden["effects"]]
    return max(found, default=0.0)


def _near(one):
    return min(STRENGTHS, key=lambda v: abs(v - one.get("visible_gap_millivolt", 0.0)))


def branch_right(hidden: dict, said: dict | None) -> bool:
    """Whether the first effect said of a group is in the branch where it is hidden."""
    true = [one.get("parameters", {}).get("branch", 0) for one in hidden["effects"]]
    return bool(true and said and [one.get("branch") for one in said["effects"]][:1] == true)


def first(table):
    """The first name said is the one hidden, alternatives not counted."""
    return table["said"].str.split(" + ", regex=False).str[0] == table["hidden"]


def hidden_names(folder) -> dict[str, list[str]]:
    """Names that would be right, by cell, of cells with one visible effect. Nothing more is told.

    Parameters
    ----------
    folder : of the campaign with its truth.
    """
    known = files.read_json(files.campaign(folder).truth / "missing_effect.json")
    single = [row for row in known if row["kind"] == "single" and row["visible"]]
    return {row["cell"]: sorted(row["effects"][0]["accept"]) for row in single}
