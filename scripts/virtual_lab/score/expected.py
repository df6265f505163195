"""Why something of the truth is missing: spoiled on purpose, refused, or not asked of a test."""

import numpy as np
import pandas as pd

from virtual_lab.score import files

# Kinds of tests that the pipeline makes a table from.
KINDS = {
    "capacity": ("capacity", "ocv"),
    "resistance": ("hppc", "pulse_resistance"),
    "eis": ("eis",),
    "ica": ("ica",),
    "packs": ("group",),
}
TEMPERATURE_TOLERANCE_KELVIN = 2.5
VALIDATION = ("validation", "split")
COUNTED = ("excluded", "faults")


def mark(place: files.Campaign, compared: pd.DataFrame) -> pd.DataFrame:
    """The same comparisons; what is missing is `spoiled`, `untested`, or has the stated reason.

    A table that was not made at all stays missing where a test of the right kind is there.
    """
    lost = (compared["status"] == "missing") & ~compared["table"].isin(COUNTED)
    who = pd.Series(list(zip(compared["cell"], compared["test"], strict=True)), dtype=object)
    who.index = compared.index
    unasked = _unasked(place)
    wrong = [(table, *one) in unasked for table, one in zip(compared["table"], who, strict=True)]
    meant = who.isin(_spoiled(place)).to_numpy(bool)
    status = np.select([lost & meant, lost & np.array(wrong, bool)], ["spoiled", "untested"], "")
    reason = compared["reason"].where(compared["reason"].notna() | ~lost, who.map(_reasons(place)))
    return compared.assign(status=compared["status"].where(status == "", status), reason=reason)


def temperatures(place: files.Campaign, kinds) -> dict[str, np.ndarray]:
    """Chamber temperatures [°C] of each cell's tests of these kinds; empty without a sheet."""
    names = ["cell", "kind", "ambient_temperature_celsius"]
    tests = files.with_columns(files.read_table(place.config / "tests.tsv"), names)
    mine = tests[tests["kind"].isin(kinds)]
    return {cell: rows[names[2]].to_numpy(float) for cell, rows in mine.groupby("cell")}


def is_near(celsius, others) -> bool:
    """Whether one of the other temperatures [°C] is the same within the chamber's trueness."""
    gap = np.abs(np.asarray(others, dtype=float) - celsius)
    return bool((gap <= TEMPERATURE_TOLERANCE_KELVIN).any())


def _unasked(place) -> set:
    """(table, cell, test) of tests whose kind or role gives no such table."""
    tests = files.with_columns(
        files.read_table(place.config / "tests.tsv"), ["cell", "test", "kind", "role"]
    )
    usual = np.where(tests["kind"] == "drive", "validation", "fit")
    role = tests["role"].where(tests["role"].notna(), usual)
    rows = list(zip(tests["cell"], tests["test"], tests["kind"], role, strict=True))
    others = {
        (table, cell, test)
        for table, kinds in KINDS.items()
        for cell, test, kind, _ in rows
        if kind not in kinds
    }
    return others | {("soc", *row[:2]) for row in rows if row[3] not in VALIDATION}


def _spoiled(place) -> set:
    true = files.with_columns(files.true(place, "excluded"), ["cell", "test"])
    return set(zip(true["cell"], true["test"], strict=True))


def refused(place: files.Campaign) -> pd.DataFrame:
    """Cell, test and reason of what the pipeline refused, each test once."""
    found = files.with_columns(files.found(place, "excluded"), ["cell", "test", "reason"])
    return found.drop_duplicates(["cell", "test"])


def _reasons(place) -> dict:
    found = refused(place)
    who = zip(found["cell"], found["test"], strict=True)
    return dict(zip(who, found["reason"], strict=True))
