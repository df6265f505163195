"""A campaign's sheets and files before anything runs: `cellwright check` and every run ask here."""

import os
from pathlib import Path

from cellwright import gate
from runtime import sheets
from runtime.plan import Plan

MOST_FILES = 10  # that a run names when it starts
MOST_PLACES = 3  # of files of one name that are named


def check(folder, schemas, overrides=None, *, alone=False) -> tuple[sheets.Campaign, list[str]]:
    """A campaign, and what its sheets name that cannot be read from the disk, a sentence a file.

    Parameters
    ----------
    folder, schemas, overrides, alone : as of `sheets.read`

    Raises
    ------
    CampaignError
        As `sheets.read`.
    """
    campaign = sheets.read(folder, schemas, overrides, alone=alone)
    largest = campaign.config["files"]["largest_megabyte"]
    named = {
        file: f"config/tests.tsv, row {number} ({row['cell']} {row['test']}), file"
        for number, row in enumerate(campaign.tests, 1)
        for file in row["file"] or ()
    }
    of_cells = dict.fromkeys(Plan(campaign).files_of_cells(), "config/cells.tsv or tests.tsv")
    obstacles = {
        file: reason
        for file in named | of_cells
        if (reason := gate.obstacle(file, folder, largest if file in named else None))
    }
    elsewhere = _places(folder, {Path(file).name for file in obstacles}) if obstacles else {}
    return campaign, [
        f"{(named | of_cells)[file]}: {file}: {reason}{_moved(file, elsewhere)}"
        for file, reason in obstacles.items()
    ]


def in_words(missing) -> list[str]:
    """The first of these sentences as lines, and how many more there are."""
    more = len(missing) - MOST_FILES
    return missing[:MOST_FILES] + [f"… {more} more files that cannot be read"] * (more > 0)


def files_below(folder) -> list[str]:
    """Files of a campaign that neither its sheets nor a run made, relative to it, sorted."""
    found = []
    for place, folders, names in os.walk(folder):
        inner = os.path.relpath(place, folder)
        made = (*sheets.MADE, "config", "benchmarks") if inner == "." else ()
        folders[:] = [name for name in folders if name not in made and not name.startswith(".")]
        found += [os.path.normpath(os.path.join(inner, n)) for n in names if not n.startswith(".")]
    return sorted(Path(file).as_posix() for file in found)


def _places(folder, names):
    """Where files of these names lie: name → paths."""
    places = {}
    for file in files_below(folder):
        if Path(file).name in names:
            places.setdefault(Path(file).name, []).append(file)
    return places


def _moved(file, elsewhere):
    """Where files of the same name lie, as what follows the reason; "" where none does."""
    others = [place for place in elsewhere.get(Path(file).name, ()) if place != file]
    if not others:
        return ""
    return f"; one of this name lies at {' and '.join(others[:MOST_PLACES])}: moved?"
