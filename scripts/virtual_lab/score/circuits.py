"""Parameters of the chosen circuits beside the truth, as resistances that both sides can give."""

import numpy as np
import pandas as pd

from virtual_lab.score import comparison, expected, files
from virtual_lab.score.comparison import errors

AFTER_SECOND = {"r0": 0.01, "r_10s": 10.0, "r_total": np.inf}
MODELLED = ("hppc", "pulse_resistance", "drive", "capacity")
LITTLE = 0.01
CONDITION = ["cell", "ambient_temperature_celsius"]
COLUMNS = ["cell", "model", "ambient_temperature_celsius", "soc", "parameter", "value", "std"]


def compare(place: files.Campaign) -> pd.DataFrame:
    """The resistance that the chosen model of a cell has 10 ms, 10 s and long after a step.

    R(t) = R0 + Σ R_k (1 − exp(−t/τ_k)) on the model's own knots, straight lines between them;
    diffusion in the particles is part of the voltage of rest there, and not of R. Where the truth
    has a column `current_ampere`, kinetics are taken at that current, else at a small one.
    """
    true = files.true(place, "models")
    if true is None or not len(true):
        return comparison.nothing()
    true = files.with_columns(true, ["current_ampere"]).fillna({"current_ampere": 0.0})
    found = _chosen(place, files.with_columns(files.found(place, "models"), COLUMNS))
    knots = {key: _matrix(part) for key, part in found.groupby(CONDITION, dropna=False)}
    tests = expected.temperatures(place, MODELLED)
    parts = [
        _read_off(_nearest(knots, cell, celsius), rows, celsius).assign(
            word=None if expected.is_near(celsius, tests.get(cell, [celsius])) else "untested"
        )
        for (cell, celsius), rows in true.groupby(CONDITION, dropna=False)
    ]
    quantities = pd.concat(parts).assign(test="").groupby("parameter", sort=False)
    return comparison.gathered(errors("models", name, "Ohm", rows) for name, rows in quantities)


def _chosen(place, models):
    """Rows of the model that the pipeline uses; of a cell with one model, of that."""
    summary = files.with_columns(
        files.read_table(place.results / "summary.csv"), ["cell", "best_model"]
    )
    best = summary.dropna(subset=["best_model"]).set_index("cell")["best_model"].to_dict()
    first = models.drop_duplicates("cell").set_index("cell")["model"].to_dict()
    return models[models["model"] == models["cell"].map(first | best)]


def _matrix(part):
    """Values and standard deviations, knots × parameters."""
    part = part.dropna(subset=["soc"])
    return [part.pivot_table(index="soc", columns="parameter", values=v) for v in ("value", "std")]


def _nearest(knots, cell, celsius):
    near = {abs(key[1] - celsius): key for key in knots if key[0] == cell}
    best = min(near, default=np.inf)
    return knots[near[best]] if best <= expected.TEMPERATURE_TOLERANCE_KELVIN else None


def _read_off(matrix, rows, celsius):
    at = [f"{celsius:g} °C, SoC {soc:.3g}" for soc in rows["soc"]]
    rows = rows.assign(true=rows["value"], at=at, found=np.nan, std=np.nan, reason=None)
    if matrix is None or "r0" not in matrix[0]:
        return rows.assign(reason="no model at this temperature")
    for (name, ampere), mine in rows.groupby(["parameter", "current_ampere"]):
        options = {"after_second": AFTER_SECOND[name], "current_ampere": ampere}
        for column, values in zip(("found", "std"), resistance(*matrix, **options), strict=True):
            read = np.interp(mine["soc"], matrix[0].index, values, left=np.nan, right=np.nan)
            rows.loc[mine.index, column] = read
    outside = rows["found"].isna()
    return rows.assign(reason=np.where(outside, "SoC outside what was identified", None))


def resistance(values, std, *, after_second, current_ampere=0.0):
    """Resistance [ohm] of a circuit that long after a step, and its deviation, (knots,).

    Parameters
    ----------
    values, std : knots × parameters [ohm, s, V]: r0, r1 and tau1, r2 and tau2, …, rct and tauct;
        scale1, … of those that follow the Butler–Volmer equation, V = scale asinh(R I / scale).
    after_second : time [s]; infinite for all of it.
    current_ampere : size of the step [A]; 0 for a small one.

    The deviation is not known where more than 1 % comes from the branches: theirs hang together.
    """
    r0 = values["r0"].to_numpy(float)
    names = [name[1:] for name in values if name[0] == "r" and f"tau{name[1:]}" in values]
    ohm = np.array([values[f"r{name}"].fillna(0.0) for name in names]).reshape(len(names), len(r0))
    tau = np.array([values[f"tau{name}"].fillna(1.0) for name in names]).reshape(
        len(names), len(r0)
    )
    kinetic = [f"scale{name}" in values for name in names]
    scales = values.filter(regex="^scale")
    if scales.shape[1] and current_ampere:
        # ASSUME: All kinetic branches of a cell follow one asinh with one scale.
        x = ohm[kinetic].sum(axis=0) * abs(current_ampere) / scales.mean(axis=1).to_numpy()
        ohm[kinetic] *= np.where(x > 0, np.arcsinh(x) / np.where(x > 0, x, 1.0), 1.0)
    branches = np.sum(ohm * -np.expm1(-after_second / tau), axis=0)
    alone = branches <= LITTLE * r0
    known = std["r0"].reindex(values.index).to_numpy(float) if "r0" in std else np.nan
    return r0 + branches, np.where(alone, known, np.nan)
