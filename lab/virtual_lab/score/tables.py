"""Tables of the results contract that are compared row by row with a table of the truth."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, files
from virtual_lab.score.comparison import errors, side_by_side, snapped

RATE_TOLERANCE = 0.25  # of the logarithm of the rate
START_TOLERANCE_SECOND = 5.0
LATE_SECOND = 0.02
PEAK_TOLERANCE_VOLT = 0.05
PEAK_PROMINENCE = 0.05  # of the curve's maximum: the truth lists no smaller peaks
CYCLE_TOLERANCE = 2.0
NO_METHOD = "not made"


class Spec(NamedTuple):
    """How the rows of a table find each other, and which of its columns are scored.

    quantities : column → (unit, column of its standard deviation or "").
    at : says in words where in the test a row belongs.
    split : columns whose values make quantities of their own ("resistance_ohm, 10 s").
    near : column that partners share within `tolerance`, or of which the logarithm does.
    scope : columns of which the truth knows all or nothing: a row with others is not extra.
    snap : column of which the truth's nearest value is meant (a rate as asked, not as measured).
    beside : further columns of the results that `split` needs.
    once : quantities that do not depend on `split`: scored in the first part only.
    """

    keys: tuple
    quantities: dict
    at: Callable[[pd.DataFrame], pd.Series]
    split: tuple = ()
    near: str | None = None
    logarithm: bool = False
    tolerance: float = 0.0
    scope: tuple = ("cell", "test")
    snap: str | None = None
    beside: tuple = ()
    once: tuple = ()


def _text(pattern, *columns):
    """Words about each row, from some of its columns."""

    def at(rows):
        if not len(rows):
            return pd.Series(dtype=object)
        return rows.apply(lambda row: pattern.format(*(row[name] for name in columns)), axis=1)

    return at


EIS = ("r_ohmic_ohm", "r_charge_transfer_ohm", "cpe_t", "cpe_p", "warburg_y0")
EIS_UNITS = ("Ohm", "Ohm", "S s^P", "1", "S s^0.5")
SPECS = {
    "capacity": Spec(
        keys=("cell", "test", "direction"),
        near="c_rate",
        logarithm=True,
        tolerance=RATE_TOLERANCE,
        quantities={
            "capacity_ampere_hour": ("Ah", "capacity_std_ampere_hour"),
            "energy_watt_hour": ("Wh", ""),
            "coulombic_efficiency": ("1", ""),
        },
        at=_text("{} at {:.3g}C", "direction", "c_rate"),
    ),
    "resistance": Spec(
        keys=("cell", "test", "direction", "delay_second"),
        near="start_time_second",
        tolerance=START_TOLERANCE_SECOND,
        quantities={"resistance_ohm": ("Ohm", "resistance_std_ohm"), "soc": ("1", "")},
        at=_text("{}, {:.0f} s, {:g} s in", "direction", "start_time_second", "delay_second"),
        split=("delay_second", "late"),
        beside=("actual_delay_second",),
        once=("soc",),
    ),
    "eis": Spec(
        keys=("cell", "test"),
        quantities={name: (unit, f"{name}_std") for name, unit in zip(EIS, EIS_UNITS, strict=True)},
        at=lambda rows: pd.Series("", index=rows.index),
    ),
    "temperature": Spec(
        keys=("cell", "quantity", "law", "parameter", "unit"),
        quantities={"value": ("", "std")},
        at=_text("{}", "law"),
        split=("quantity", "parameter", "unit"),
        scope=("cell", "quantity", "law", "parameter"),
    ),
    "ica": Spec(
        keys=("cell", "test", "c_rate"),
        snap="c_rate",
        near="voltage_volt",
        tolerance=PEAK_TOLERANCE_VOLT,
        quantities={
            "voltage_volt": ("V", "voltage_std_volt"),
            "height_ampere_hour_per_volt": ("Ah/V", ""),
        },
        at=_text("{:.3g}C, peak at {:.3f} V", "c_rate", "voltage_volt"),
        beside=("prominence",),
    ),
    "health": Spec(
        keys=("cell", "method"),
        near="cycle",
        tolerance=CYCLE_TOLERANCE,
        quantities={
            "capacity_ampere_hour": ("Ah", ""),
            "soh": ("1", "soh_std"),
            "knee_cycle": ("1", ""),
        },
        at=_text("cycle {:.0f}", "cycle"),
        split=("method",),
        scope=("cell",),
    ),
}


def compare(place: files.Campaign, table: str) -> pd.DataFrame:
    """Comparisons of one table of the results with its truth; empty where there is no truth."""
    spec, true = SPECS[table], files.true(place, table)
    if true is None or not len(true):
        return comparison.nothing()
    stds = [std for _, std in spec.quantities.values() if std]
    names = [*spec.keys, *spec.quantities, *([spec.near] if spec.near else [])]
    found = files.with_columns(files.found(place, table), [*names, *stds])
    true = files.with_columns(true, names)
    if table == "health":
        # The truth once for each method that was used, or once where none was.
        methods = sorted(found["method"].dropna().unique()) or [NO_METHOD]
        found, true = _one_knee(found), _one_knee(true)
        true = pd.concat([true.assign(method=one) for one in methods], ignore_index=True)
    if spec.snap:
        options = {"keys": spec.scope, "near": spec.snap, "tolerance": RATE_TOLERANCE}
        found = found.assign(**{spec.snap: snapped(found, true, **options)})
    found, true = (one.assign(near=_near_values(spec, one)) for one in (found, true))
    wanted = [*spec.quantities, *stds, *spec.beside]
    found = files.with_columns(found, wanted)
    options = {"near": "near" if spec.near else None, "tolerance": spec.tolerance}
    rows = side_by_side(found, true, keys=list(spec.keys), columns=wanted, **options)
    rows = files.with_columns(rows, ["test"]).assign(word=_status_word(spec, rows, true))
    rows["at"] = spec.at(_with_place(rows, spec))
    if table == "ica":
        small = rows["prominence_found"].astype(float) < PEAK_PROMINENCE
        rows["word"] = rows["word"].mask(small, "no truth")
    if table == "resistance":
        # What a late first sample shows is not what the truth has after 10 ms.
        after = rows["actual_delay_second_found"].astype(float)
        rows["late"] = (rows["delay_second"] == 0) & (after > LATE_SECOND)
    return comparison.gathered(_quantities(table, spec, rows))


def _near_values(spec, table):
    """Numbers by which rows with equal keys are paired."""
    if spec.near is None:
        return 0.0
    values = pd.to_numeric(table[spec.near], errors="coerce").astype(float)
    return np.log(values.where(values > 0)) if spec.logarithm else values


def _status_word(spec, rows, true):
    """The words "no truth" for rows outside the scope of the truth, else None."""
    scope = list(spec.scope)
    covered = rows[scope].merge(true[scope].drop_duplicates().assign(word=1), on=scope, how="left")
    return np.where(covered["word"].notna(), None, "no truth")


def _with_place(rows, spec):
    """Rows with the column `near` filled for extra rows, which have no columns of the truth."""
    if spec.near is None:
        return rows
    place = np.exp(rows["near"]) if spec.logarithm else rows["near"]
    return rows.assign(**{spec.near: rows[spec.near].fillna(place)})


def _quantities(table, spec, rows):
    """Errors of each quantity of a table, by the parts of `split`."""
    for name, (unit, std) in spec.quantities.items():
        if rows[name].isna().all():
            continue
        mine = rows.rename(columns={name: "true", f"{name}_found": "found"})
        mine = mine.assign(std=rows[f"{std}_found"] if std else np.nan)
        for label, part in _parts(spec, name, mine):
            yield errors(table, label, unit or part["unit"].iloc[0], part)


def _parts(spec, name, rows):
    if not spec.split:
        return [(name, rows)]
    parts = rows.groupby(list(spec.split), dropna=False, sort=True)
    if name in spec.once:
        first = rows[spec.split[0]] == rows[spec.split[0]].min()
        return [(name, rows[first])]
    labelled = [(_label(spec, name, values), part) for values, part in parts]
    if "method" in spec.split and len(labelled) > 1:
        # A method that never tells a quantity was not asked for it; another one was.
        labelled = [pair for pair in labelled if pair[1]["found"].notna().any()]
    return labelled


def _label(spec, name, values) -> str:
    part = dict(zip(spec.split, values, strict=True))
    if "delay_second" in part:
        return f"{name}, {part['delay_second']:g} s{', late sample' if part['late'] else ''}"
    if "method" in part:
        return f"{name}, {part['method']}" if part["method"] != NO_METHOD else name
    return f"{part['quantity']}: {part['parameter']}"


def _one_knee(table):
    """A knee belongs to a cell, not to each of its rows: it is kept in the last row that has it."""
    with_knee = table[table["knee_cycle"].notna()]
    last = with_knee.sort_values("cycle").groupby(["cell", "method"], dropna=False).tail(1).index
    return table.assign(knee_cycle=table["knee_cycle"].where(table.index.isin(last)))
