"""Why rows of the truth are missing from the results: spoiled on purpose, refused, untested."""

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, files
from virtual_lab.score.comparison import errors

# Kinds of tests that the pipeline makes a table from.
KINDS = {
    "capacity": ("capacity", "ocv"),
    "resistance": ("hppc", "pulse_resistance"),
    "eis": ("eis",),
    "ica": ("ica",),
    "packs": ("group",),
}
TEMPERATURE_TOLERANCE_KELVIN = 2.5
VALIDATION_ROLES = ("validation", "split")
NOT_MARKED = ("excluded", "faults")


def mark(place: files.Campaign, compared: pd.DataFrame) -> pd.DataFrame:
    """The comparisons with the reason of missing rows: `spoiled`, `untested`, or the one stated.

    A table that was not made at all stays missing where a test of the right kind is there.
    """
    lost = (compared["status"] == "missing") & ~compared["table"].isin(NOT_MARKED)
    tests_of_rows = pd.Series(
        list(zip(compared["cell"], compared["test"], strict=True)), dtype=object
    )
    tests_of_rows.index = compared.index
    unasked = _unasked(place)
    unasked_rows = [
        (table, *one) in unasked
        for table, one in zip(compared["table"], tests_of_rows, strict=True)
    ]
    spoiled_rows = tests_of_rows.isin(_spoiled(place)).to_numpy(bool)
    status = np.select(
        [lost & spoiled_rows, lost & np.array(unasked_rows, bool)], ["spoiled", "untested"], ""
    )
    reason = compared["reason"].where(
        compared["reason"].notna() | ~lost, tests_of_rows.map(refusals(place))
    )
    return compared.assign(status=compared["status"].where(status == "", status), reason=reason)


def temperatures(place: files.Campaign, kinds) -> dict[str, np.ndarray]:
    """Chamber temperatures [°C] of each cell's tests of these kinds; empty without a sheet."""
    names = ["cell", "kind", "ambient_temperature_celsius"]
    tests = files.with_columns(files.read_table(place.config / "tests.tsv"), names)
    mine = tests[tests["kind"].isin(kinds)]
    return {cell: rows[names[2]].to_numpy(float) for cell, rows in mine.groupby("cell")}


def is_near(celsius, others) -> bool:
    """Whether one of the other temperatures [°C] is the same within the chamber's accuracy."""
    gap = np.abs(np.asarray(others, dtype=float) - celsius)
    return bool((gap <= TEMPERATURE_TOLERANCE_KELVIN).any())


def _unasked(place) -> set:
    """(table, cell, test) of tests whose kind or role does not give such a table."""
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
    return others | {("soc", *row[:2]) for row in rows if row[3] not in VALIDATION_ROLES}


def _spoiled(place) -> set:
    true = files.with_columns(files.true(place, "excluded"), ["cell", "test"])
    return set(zip(true["cell"], true["test"], strict=True))


def refusals(place: files.Campaign) -> dict[tuple[str, str], str]:
    """First reason for which the pipeline refused a test, by cell and test."""
    found = files.with_columns(files.found(place, "excluded"), ["cell", "test", "reason"])
    found = found.drop_duplicates(["cell", "test"])
    tests = zip(found["cell"], found["test"], strict=True)
    return dict(zip(tests, found["reason"], strict=True))


ROW_TOLERANCE = 1.0
COUNTED = "count"


def refused_files(place: files.Campaign) -> pd.DataFrame:
    """Files spoiled beyond use: refused by the pipeline, or accepted (missing); other refusals.

    What is refused of a cell as a whole, because a file of it could not be used, is not counted.
    """
    true = files.true(place, "excluded")
    if true is None:
        return comparison.nothing()
    keys = ["cell", "test"]
    found = files.with_columns(files.found(place, "excluded"), [*keys, "stage", "reason"])
    found = found[~(found["test"].isna() & found["cell"].isin(true["cell"]))]
    said = [
        f"{stage}: {reason}" for stage, reason in zip(found["stage"], found["reason"], strict=True)
    ]
    found = found.assign(found=1.0, said=said).drop_duplicates(keys)
    true = true.drop_duplicates(keys).rename(columns={"reason": "spoiled"}).assign(true=1.0)
    rows = comparison.side_by_side(found, true, keys=keys, columns=["found", "said"])
    rows = rows.assign(at=rows["spoiled"], found=rows["found_found"], reason=rows["said_found"])
    return errors("excluded", "file refused", COUNTED, rows)


def flagged_samples(place: files.Campaign) -> pd.DataFrame:
    """Samples spoiled on purpose: flagged, not flagged (missing), or good ones flagged (extra).

    Samples of a test that was refused count as flagged.
    """
    true = files.true(place, "faults")
    if true is None:
        return comparison.nothing()
    true = _one_of_a_swapped_pair(true.assign(row=pd.to_numeric(true["row"]), true=1.0))
    found = _flags(place).assign(found=1.0)
    rows = comparison.side_by_side(
        found,
        true,
        keys=["cell", "test"],
        columns=["found", "flag"],
        near="row",
        tolerance=ROW_TOLERANCE,
    )
    name = rows["fault"].where(rows["fault"].notna(), [f"flag {f}" for f in rows["flag_found"]])
    rows = rows.assign(quantity=name, found=rows["found_found"], reason=rows["flag_found"])
    refused, tests = refusals(place), zip(rows["cell"], rows["test"], strict=True)
    given_up = rows["found"].isna() & np.array([one in refused for one in tests], dtype=bool)
    rows["found"] = rows["found"].mask(given_up, 1.0)
    rows["reason"] = rows["reason"].mask(given_up, "the test was refused")
    rows["at"] = [f"row {row:.0f}" if np.isfinite(row) else "" for row in rows["row"]]
    kinds = rows.groupby("quantity", sort=True)
    return comparison.gathered(errors("faults", kind, COUNTED, part) for kind, part in kinds)


def _one_of_a_swapped_pair(true):
    """The first of two swapped rows stands for both, since either may be called out of place."""
    order = true.sort_values(["cell", "test", "fault", "row"])
    follows = order.groupby(["cell", "test", "fault"])["row"].diff() == 1
    return order[~(follows & (order["fault"] == "swapped"))].reset_index(drop=True)


def _flags(place):
    """Flags of every test, with their cell."""
    parts = [pd.DataFrame({"cell": [], "test": [], "row": [], "flag": []})]
    for path in sorted((place.results / "stages" / "flags").glob("*/*.parquet")):
        flags = files.artefact(place, "flags", path.parent.name, path.stem)
        if flags is not None:
            parts.append(flags[["row", "flag"]].assign(cell=path.parent.name, test=path.stem))
    return pd.concat([part for part in parts if len(part)] or parts, ignore_index=True)
