"""Curves and series of the results beside the truth: open-circuit voltage, SoC."""

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, expected, files
from virtual_lab.score.comparison import errors

INNER_SOC = (0.05, 0.95)
FILTERS = ("ekf", "aekf", "dual")
CONDITION = ["cell", "ambient_temperature_celsius"]
STATES = {"soc_begin": 0, "soc_end": -1}


def ocv(place: files.Campaign) -> pd.DataFrame:
    """Open-circuit voltage at each SoC of the truth: 5–95 %, and the two ends by themselves."""
    true = files.true(place, "ocv")
    if true is None or not len(true):
        return comparison.nothing()
    found = files.with_columns(files.found(place, "ocv"), ["cell", "test", CONDITION[1]])
    tests = dict(list(found.drop_duplicates(["cell", "test"]).groupby("cell")))
    slow = expected.temperatures(place, ("ocv",))
    parts = []
    for (cell, celsius), curve in true.groupby(CONDITION, dropna=False):
        rows = curve.assign(at=[f"SoC {soc:.3g}" for soc in curve["soc"]], true=curve["ocv_volt"])
        mine = tests.get(cell, found[:0])
        mine = mine[(mine[CONDITION[1]] - celsius).abs() <= expected.TEMPERATURE_TOLERANCE_KELVIN]
        word = None if expected.is_near(celsius, slow.get(cell, [])) else "untested"
        if not len(mine):
            parts.append(rows.assign(test="", found=np.nan, word=word))
        for test in mine["test"]:
            curve = files.artefact(place, "ocv", cell, test)
            parts.append(rows.assign(test=test, word=None, found=_read_off(curve, rows["soc"])))
    rows = pd.concat(parts, ignore_index=True)
    inner = rows["soc"].round(6).between(*INNER_SOC)
    return comparison.gathered(
        [
            errors("ocv", "ocv_volt, SoC 5–95 %", "V", rows[inner]),
            errors("ocv", "ocv_volt, the ends", "V", rows[~inner]),
        ]
    )


def _read_off(curve, soc):
    if curve is None:
        return np.nan
    return np.interp(soc, curve["soc"], curve["ocv_volt"], left=np.nan, right=np.nan)


def soc(place: files.Campaign) -> pd.DataFrame:
    """The counted and the filters' SoC at the ends of a test, and the filters' capacity."""
    true = files.true(place, "soc")
    if true is None or not len(true):
        return comparison.nothing()
    true = files.with_columns(true, ["soc_begin", "soc_end", "capacity_ampere_hour"])
    rows = [row for one in true.to_dict("records") for row in _states(place, one)]
    states = pd.DataFrame(rows).groupby("quantity", sort=False)
    return comparison.gathered(
        [*(errors("soc", name, "1", part) for name, part in states), _capacities(place, true)]
    )


def _states(place, one):
    series = files.artefact(place, "soc_series", one["cell"], one["test"])
    who = {"cell": one["cell"], "test": one["test"]}
    for state, row in STATES.items():
        found = np.nan if series is None else series["soc"].iloc[row]
        known = {"at": state.removeprefix("soc_"), "true": one[state], "found": found}
        yield {**who, **known, "quantity": f"{state}, counted", "std": np.nan}
    for name in FILTERS:
        known = {"at": "end", "true": one["soc_end"], "quantity": f"soc_end, {name}"}
        columns = [f"{word}_{name}_soc" for word in ("estimated", "std")]
        there = series is not None and columns[0] in series
        found = series[columns].iloc[-1] if there else (np.nan, np.nan)
        yield {**who, **known, **dict(zip(("found", "std"), found, strict=True))}


def _capacities(place, true):
    wanted = ["cell", "test", "filter", "scenario", "capacity_ampere_hour"]
    found = files.with_columns(files.found(place, "soc"), [*wanted, "capacity_std_ampere_hour"])
    # The first run without a fault starts with the smallest wrong SoC.
    found = found[(found["filter"] == "dual") & (found["scenario"] == "nominal")]
    found = found.drop_duplicates(["cell", "test"])
    rows = comparison.side_by_side(
        found,
        true,
        keys=["cell", "test"],
        columns=["capacity_ampere_hour", "capacity_std_ampere_hour"],
    )
    rows = rows.rename(
        columns={
            "capacity_ampere_hour": "true",
            "capacity_ampere_hour_found": "found",
            "capacity_std_ampere_hour_found": "std",
        }
    )
    rows = rows[rows["true"].notna()]
    return errors("soc", "capacity_ampere_hour, dual", "Ah", rows.assign(at="end"))
