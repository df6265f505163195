"""Degradation modes of the pipeline beside the truth, with their intervals."""

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, files
from virtual_lab.score.comparison import errors

MODES = ("lli", "lam_negative", "lam_positive")
CYCLE_TOLERANCE = 2.0
LABEL = "half cells aligned"


def compare(place: files.Campaign) -> pd.DataFrame:
    """Lithium and material lost at each check-up; the fresh state itself is not scored."""
    true = files.true(place, "health")
    if true is None or "lli" not in true:
        return comparison.nothing()
    folder = place.results / "stages" / "degradation_modes"
    found = [_found(path) for path in sorted(folder.glob("*"))]
    found = [rows for rows in found if len(rows)]
    if not found:
        return comparison.nothing()
    together = [_with_truth(rows, true[true["cell"] == rows["cell"].iloc[0]]) for rows in found]
    rows = pd.concat(together, ignore_index=True)
    rows["at"] = [f"cycle {cycle:.0f}" for cycle in rows["cycle"]]
    return comparison.gathered(
        errors("health", f"{mode}, {LABEL}", "1", _of_mode(rows, mode)) for mode in MODES
    )


def _found(path):
    """Rows of an artefact without the fresh state, whose losses are zero by definition."""
    rows = pd.read_parquet(path)
    if not len(rows):
        return rows
    return rows[rows["fresh_state"] != rows["cell"] + "/" + rows["test"]]


def _with_truth(rows, true):
    """Rows with the truth of the nearest cycle; a truth without cycles is of the only check-up."""
    cycles = pd.to_numeric(true["cycle"], errors="coerce").to_numpy(float)
    matched = []
    for cycle in rows["cycle"]:
        gap = np.where(np.isnan(cycles), 0.0, np.abs(cycles - cycle))
        near = len(gap) and gap.min() <= CYCLE_TOLERANCE
        matched.append(true.iloc[int(gap.argmin())] if near else pd.Series(dtype=float))
    beside = pd.DataFrame(matched).reindex(columns=list(MODES)).add_suffix("_true")
    return pd.concat([rows.reset_index(drop=True), beside.reset_index(drop=True)], axis=1)


def _of_mode(rows, mode):
    found, true = rows[mode], rows[f"{mode}_true"]
    return rows.assign(found=found, true=true, std=rows[f"{mode}_std"])
