"""Which effects a second search of a cell does without: those that were hidden in it."""

from virtual_lab.score import files


def hidden_names(folder) -> dict[str, list[str]]:
    """Names that would be right, by cell, of cells with one visible effect. Nothing more is told.

    Parameters
    ----------
    folder : of the campaign with its truth.
    """
    known = files.read_json(files.campaign(folder).truth / "missing_effect.json")
    single = [row for row in known if row["kind"] == "single" and row["visible"]]
    return {row["cell"]: sorted(row["effects"][0]["accept"]) for row in single}
