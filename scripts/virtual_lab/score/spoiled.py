"""Files and samples that were spoiled on purpose: refused, flagged, or taken for good."""

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, expected, files
from virtual_lab.score.comparison import errors

ROW_TOLERANCE = 1.0
COUNTED = "count"


def refused(place: files.Campaign) -> pd.DataFrame:
    """Files beyond use that the pipeline refused, took for good (missing), or refused as well.

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


def flagged(place: files.Campaign) -> pd.DataFrame:
    """Samples spoiled on purpose: flagged, not seen (missing), or good ones flagged (extra).

    Of a test that was refused nothing is taken for good.
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
    given_up = rows["found"].isna() & _refused(place, rows)
    rows["found"] = rows["found"].mask(given_up, 1.0)
    rows["reason"] = rows["reason"].mask(given_up, "the test was refused")
    rows["at"] = [f"row {row:.0f}" if np.isfinite(row) else "" for row in rows["row"]]
    kinds = rows.groupby("quantity", sort=True)
    return comparison.gathered(errors("faults", kind, COUNTED, part) for kind, part in kinds)


def _one_of_a_swapped_pair(true):
    """Of two rows in the wrong order one is out of place, whichever: the first stands for both."""
    order = true.sort_values(["cell", "test", "fault", "row"])
    follows = order.groupby(["cell", "test", "fault"])["row"].diff() == 1
    return order[~(follows & (order["fault"] == "swapped"))].reset_index(drop=True)


def _refused(place, rows):
    found = expected.refused(place)
    known = set(zip(found["cell"], found["test"], strict=True))
    who = zip(rows["cell"], rows["test"], strict=True)
    return np.array([one in known for one in who], dtype=bool)


def _flags(place):
    """Flags of every test, with their cell."""
    parts = [pd.DataFrame({"cell": [], "test": [], "row": [], "flag": []})]
    for path in sorted((place.results / "flags").glob("*/*.parquet")):
        flags = files.artefact(place, "flags", path.parent.name, path.stem)
        if flags is not None:
            parts.append(flags[["row", "flag"]].assign(cell=path.parent.name, test=path.stem))
    return pd.concat([part for part in parts if len(part)] or parts, ignore_index=True)
