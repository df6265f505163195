"""Measured numbers held against the recorded ones: what is worse, missing, new or better."""

import pandas as pd

from real_cells.gather import KEYS

WORSE, MISSING, NEW, BETTER, SAME = "worse", "missing", "new", "better", "same"
FAILING = (WORSE, MISSING)
REMEDY = "./run python scripts/tools/real_record.py --why '...' records them"
OLD = {"value": "recorded", "better": "old_better", "published": "old_published"}


def compared(recorded: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """One row a number of the campaigns that were measured: recorded, found, outcome.

    Parameters
    ----------
    recorded, measured : tables of numbers as `gather.numbers` gives them.
    """
    recorded = recorded[recorded["campaign"].isin(measured["campaign"])]
    recorded = recorded.rename(columns={"value": "recorded"})
    found = measured[[*KEYS, "value", "unit", "better"]]
    found = found.rename(columns={"value": "found", "unit": "new_unit", "better": "new_better"})
    rows = recorded.merge(found, on=KEYS, how="outer", sort=False)
    for old, new in (("unit", "new_unit"), ("better", "new_better")):
        rows[old] = rows[old].fillna(rows[new])
    rows = rows.fillna("").drop(columns=["new_unit", "new_better"])
    rows["tolerance"] = [_tolerance(row) for row in rows.to_dict("records")]
    return rows.assign(outcome=[outcome(row) for row in rows.to_dict("records")])


def without_record(recorded: pd.DataFrame, measured: pd.DataFrame) -> list[str]:
    """One line for each measured campaign of which nothing is recorded."""
    names = [
        name for name in measured["campaign"].unique() if name not in set(recorded["campaign"])
    ]
    return [f"{name}: measured, and nothing is recorded of it; {REMEDY}" for name in names]


def _tolerance(row) -> float:
    """How much a number may change [its unit]; 0 for words."""
    if row["recorded"] == "" or row["better"] in ("equal", "shown"):
        return 0.0
    absolute, relative = float(row["tolerance_absolute"]), float(row["tolerance_relative"])
    return absolute + relative * abs(float(row["recorded"]))


def outcome(row: dict) -> str:
    """What became of one number, in a word.

    Parameters
    ----------
    row : recorded, found and published (text, blank where there is none), better, tolerance.
    """
    if row["better"] == "shown" or row["recorded"] == row["found"]:
        return SAME
    if row["recorded"] == "":
        return NEW
    if row["found"] == "" and row["unit"] == "count":
        row = row | {"found": "0"}  # of what is not there any more there are none
    if row["found"] == "":
        return MISSING
    if row["better"] == "equal":
        return SAME if row["found"] == row["recorded"] else WORSE
    found, recorded = float(row["found"]), float(row["recorded"])
    if abs(found - recorded) <= row["tolerance"]:
        return SAME
    return BETTER if _is_better(row["better"], found, recorded, row["published"]) else WORSE


def _is_better(side, found, recorded, published) -> bool:
    if side == "near":
        known = published != ""
        return known and abs(found - float(published)) < abs(recorded - float(published))
    return found < recorded if side == "lower" else found > recorded


def told(rows: pd.DataFrame) -> list[str]:
    """Lines for people: every number that is not as recorded, the worst kind first."""
    lines = []
    for word in (WORSE, MISSING, BETTER, NEW):
        part = rows[rows["outcome"] == word]
        if len(part):
            lines.append(f"{HEADS[word]} ({len(part)}):")
        lines += [f"  {_line(row)}" for row in part.to_dict("records")]
    count = rows["outcome"].isin([SAME]).sum()
    return [*lines, f"{count} of {len(rows)} numbers as recorded, within their tolerances."]


HEADS = {
    WORSE: "Worse than recorded, beyond the tolerance",
    MISSING: "Recorded, and not found any more",
    BETTER: "Better than recorded: renew the record",
    NEW: "New, not recorded yet",
}


def _line(row) -> str:
    place = ", ".join(row[key] for key in KEYS if row[key])
    unit = "" if row["unit"] in ("word", "1", "count") else f" {row['unit']}"
    values = f"recorded {row['recorded'] or 'nothing'}, found {row['found'] or 'nothing'}{unit}"
    return f"{place}: {values}, tolerance {row['tolerance']:.3g}"
