"""Curves, series and circuits compared with the truth: OCV, SoC, resistances, parallel branches."""

import numpy as np
import pandas as pd

from virtual_lab.behaviour import running_integral
from virtual_lab.score import comparison, files, missing
from virtual_lab.score.comparison import errors

INNER_SOC = (0.05, 0.95)
FILTERS = ("ekf", "aekf", "dual")
CONDITION = ["cell", "ambient_temperature_celsius"]
STATES = {"soc_begin": 0, "soc_end": -1}


def ocv(place: files.Campaign) -> pd.DataFrame:
    """OCV at each SoC of the truth, 5–95 %, and the two ends as quantities of their own."""
    true = files.true(place, "ocv")
    if true is None or not len(true):
        return comparison.nothing()
    found = files.with_columns(files.found(place, "ocv"), ["cell", "test", CONDITION[1]])
    tests = dict(list(found.drop_duplicates(["cell", "test"]).groupby("cell")))
    slow = missing.temperatures(place, ("ocv",))
    parts = []
    for (cell, celsius), curve in true.groupby(CONDITION, dropna=False):
        rows = curve.assign(at=[f"SoC {soc:.3g}" for soc in curve["soc"]], true=curve["ocv_volt"])
        mine = tests.get(cell, found[:0])
        mine = mine[(mine[CONDITION[1]] - celsius).abs() <= missing.TEMPERATURE_TOLERANCE_KELVIN]
        word = None if missing.is_near(celsius, slow.get(cell, [])) else "untested"
        if not len(mine):
            parts.append(rows.assign(test="", found=np.nan, word=word))
        for test in mine["test"]:
            measured = files.artefact(place, "ocv", cell, test)
            parts.append(rows.assign(test=test, word=None, found=_ocv_at(measured, rows["soc"])))
    rows = pd.concat(parts, ignore_index=True)
    inner = rows["soc"].round(6).between(*INNER_SOC)
    return comparison.gathered(
        [
            errors("ocv", "ocv_volt, SoC 5–95 %", "V", rows[inner]),
            errors("ocv", "ocv_volt, the ends", "V", rows[~inner]),
        ]
    )


def _ocv_at(curve, soc):
    """OCV [V] of a measured curve at some SoC; NaN outside of it, or without a curve."""
    if curve is None:
        return np.nan
    return np.interp(soc, curve["soc"], curve["ocv_volt"], left=np.nan, right=np.nan)


def soc(place: files.Campaign) -> pd.DataFrame:
    """SoC at the ends of a test by counting and by the filters, and the filters' capacity."""
    true = files.true(place, "soc")
    if true is None or not len(true):
        return comparison.nothing()
    true = files.with_columns(true, ["soc_begin", "soc_end", "capacity_ampere_hour"])
    rows = [row for one in true.to_dict("records") for row in _state_rows(place, one)]
    states = pd.DataFrame(rows).groupby("quantity", sort=False)
    return comparison.gathered(
        [
            *(errors("soc", name, "1", part) for name, part in states),
            _filter_capacities(place, true),
        ]
    )


def _state_rows(place, true):
    """Rows of `errors`: the SoC of one test by counting and by each filter."""
    series = files.artefact(place, "soc_series", true["cell"], true["test"])
    who = {"cell": true["cell"], "test": true["test"]}
    for state, row in STATES.items():
        found = np.nan if series is None else series["soc"].iloc[row]
        about = {"at": state.removeprefix("soc_"), "true": true[state], "found": found}
        yield {**who, **about, "quantity": f"{state}, counted", "std": np.nan}
    for name in FILTERS:
        about = {"at": "end", "true": true["soc_end"], "quantity": f"soc_end, {name}"}
        columns = [f"{word}_{name}_soc" for word in ("estimated", "std")]
        there = series is not None and columns[0] in series
        found = series[columns].iloc[-1] if there else (np.nan, np.nan)
        yield {**who, **about, **dict(zip(("found", "std"), found, strict=True))}


def _filter_capacities(place, true):
    """Capacity [Ah] that the dual filter estimates, beside the true one."""
    wanted = ["cell", "test", "filter", "scenario", "capacity_ampere_hour"]
    found = files.with_columns(files.found(place, "soc"), [*wanted, "capacity_std_ampere_hour"])
    # The first run without a fault starts with the smallest wrong SoC.
    found = found[(found["filter"] == "dual") & (found["scenario"] == "nominal")]
    found = found.drop_duplicates(["cell", "test"])
    columns = ["capacity_ampere_hour", "capacity_std_ampere_hour"]
    rows = comparison.side_by_side(found, true, keys=["cell", "test"], columns=columns)
    names = {f"{columns[0]}_found": "found", f"{columns[1]}_found": "std", columns[0]: "true"}
    rows = rows.rename(columns=names)
    rows = rows[rows["true"].notna()]
    return errors("soc", "capacity_ampere_hour, dual", "Ah", rows.assign(at="end"))


AFTER_SECOND = {"r0": 0.01, "r_10s": 10.0, "r_total": np.inf}
FIRST_SAMPLE = "r0_delay"  # row of a model: how long after a step its first fitted samples lie
MODELLED_KINDS = ("hppc", "pulse_resistance", "drive", "capacity")
LITTLE_OF_BRANCHES = 0.01
MODEL_COLUMNS = ["cell", "model", "ambient_temperature_celsius", "soc", "parameter", "value", "std"]


def circuits(place: files.Campaign) -> pd.DataFrame:
    """Resistance of a cell's chosen model at its first samples, 10 s and long after a step.

    Where a model says when its first samples lie, r0 is its resistance then; else after 10 ms. The
    truth at that time is straight over its logarithm between those that are known.

    R(t) = R0 + Σ R_k (1 − exp(−t/τ_k)) on the model's own SoC knots, straight lines between them;
    diffusion in the particles belongs to the voltage of rest there, and not to R. Where the truth
    has a column `current_ampere`, kinetics are taken at that current, else at a small one.
    """
    true = files.true(place, "models")
    if true is None or not len(true):
        return comparison.nothing()
    true = files.with_columns(true, ["current_ampere"]).fillna({"current_ampere": 0.0})
    found = _chosen(place, files.with_columns(files.found(place, "models"), MODEL_COLUMNS))
    knots = {key: _parameter_tables(part) for key, part in found.groupby(CONDITION, dropna=False)}
    firsts = found[found["parameter"] == FIRST_SAMPLE].set_index(CONDITION)["value"].to_dict()
    tests = missing.temperatures(place, MODELLED_KINDS)
    parts = [
        _model_resistances(
            _nearest(knots, cell, celsius), rows, celsius, _nearest(firsts, cell, celsius)
        ).assign(word=None if missing.is_near(celsius, tests.get(cell, [celsius])) else "untested")
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


def _parameter_tables(part):
    """Values and standard deviations, knots × parameters."""
    part = part.dropna(subset=["soc"])
    return [part.pivot_table(index="soc", columns="parameter", values=v) for v in ("value", "std")]


def _nearest(knots, cell, celsius):
    """What is known of a cell at the nearest temperature [°C]; None if none is near enough."""
    near = {abs(key[1] - celsius): key for key in knots if key[0] == cell}
    best = min(near, default=np.inf)
    return knots[near[best]] if best <= missing.TEMPERATURE_TOLERANCE_KELVIN else None


def _model_resistances(matrix, rows, celsius, first_second):
    """The truth's rows with the model's resistance at the same SoC, or why there is none.

    first_second : time after a step [s] for which r0 is meant, or None.
    """
    after = AFTER_SECOND | ({} if first_second is None else {"r0": first_second})
    rows = _with_first(rows, first_second)
    at = [f"{celsius:g} °C, SoC {soc:.3g}" for soc in rows["soc"]]
    rows = rows.assign(true=rows["value"], at=at, found=np.nan, std=np.nan, reason=None)
    if matrix is None or "r0" not in matrix[0]:
        return rows.assign(reason="no model at this temperature")
    for (name, ampere), mine in rows.groupby(["parameter", "current_ampere"]):
        options = {"after_second": after[name], "current_ampere": ampere}
        options |= {"first_second": first_second or 0.0}
        for column, values in zip(("found", "std"), resistance(*matrix, **options), strict=True):
            read = np.interp(mine["soc"], matrix[0].index, values, left=np.nan, right=np.nan)
            rows.loc[mine.index, column] = read
    outside = rows["found"].isna()
    return rows.assign(reason=np.where(outside, "SoC outside what was identified", None))


def _with_first(rows, first_second):
    """The truth's rows of scored quantities, r0 as it is so long after a step [s], where known."""
    known = rows["parameter"].str.extract(r"^r_([\d.]+)s$")[0].astype(float)
    wanted = rows[rows["parameter"].isin(AFTER_SECOND)].copy()
    at = ["soc", "current_ampere"]
    later = rows.assign(second=known)[known.notna()].sort_values("second").groupby(at)
    for index, row in wanted[wanted["parameter"] == "r0"].iterrows():
        key = tuple(row[at])
        curve = later.get_group(key) if first_second and key in later.groups else rows[:0]
        if len(curve) and curve["second"].iloc[0] <= first_second:
            seconds = np.log(curve["second"].to_numpy(float))
            wanted.loc[index, "value"] = np.interp(np.log(first_second), seconds, curve["value"])
    return wanted


def resistance(values, std, *, after_second, current_ampere=0.0, first_second=0.0):
    """Resistance [ohm] of a circuit at a time after a step, and its standard deviation, (knots,).

    Parameters
    ----------
    values, std : knots × parameters [ohm, s, V]: r0, r1 and tau1, r2 and tau2, …, rct and tauct;
        scale1, … of those that follow the Butler–Volmer equation, V = scale asinh(R I / scale).
    after_second : time [s]; infinite for the whole resistance.
    current_ampere : size of the step [A]; 0 for a small one.
    first_second : when the model's first samples lie [s]: until then its deviation is that of r0.

    Later the deviation is not known where more than 1 % comes from the branches, whose deviations
    are correlated.
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
    alone = (branches <= LITTLE_OF_BRANCHES * r0) | (after_second <= first_second)
    r0_std = std["r0"].reindex(values.index).to_numpy(float) if "r0" in std else np.nan
    return r0 + branches, np.where(alone, r0_std, np.nan)


BRANCH_KEYS = ["group", "test", "branch"]
BRANCH_UNITS = {
    "group_capacity_ampere_hour": "Ah",
    "charge_ampere_hour": "Ah",
    "current_max_ampere": "A",
}
LEAST_DISCHARGE = 0.02


def packs(place: files.Campaign) -> pd.DataFrame:
    """Charge and largest current of each branch as simulated by the pipeline.

    The charge is that of all discharges together. Beside them the group's capacity, its largest
    discharge, as counted in the record and as simulated, and the errors of its branch currents and
    its voltage against what was logged, whose truth is none.
    """
    true = files.true(place, "packs")
    if true is None or not len(true):
        return comparison.nothing()
    tests = true[["group", "test"]].drop_duplicates().itertuples(index=False)
    shares = pd.concat([_branch_shares(place, *test) for test in tests], ignore_index=True)
    columns = list(BRANCH_UNITS)
    rows = comparison.side_by_side(shares, true, keys=BRANCH_KEYS, columns=columns)
    rows = rows.assign(cell=rows["group"], at=[f"branch {number}" for number in rows["branch"]])
    wanted = [name for name in BRANCH_UNITS if name in true and true[name].notna().any()]
    own = [_branch_quantity(rows, name) for name in wanted]
    return comparison.gathered([*own, *_of_table(place, true)])


AGAINST_RECORD = {
    "relative_current_rmse_above_15_soc": "1",
    "relative_current_rmse_below_15_soc": "1",
    "voltage_rmse_volt": "V",
}


def _of_table(place, true):
    """Comparisons of the table `packs`: simulated capacity, and errors against the record."""
    found, name = files.found(place, "packs"), "group_capacity_ampere_hour"
    if found is None or name not in found or name not in true:
        return []
    groups = true.drop_duplicates(["group", "test"])[["group", "test", name]]
    rows = found.merge(groups, on=["group", "test"], suffixes=("", "_true"))
    rows = rows.assign(cell=rows["group"], at=[f"branch {number}" for number in rows["branch"]])
    whole = rows.drop_duplicates(["group", "test"]).assign(at="the group")
    simulated = whole.assign(
        found=whole[name], true=whole[f"{name}_true"].where(whole[name].notna())
    )
    parts = [errors("packs", f"{name}, simulated", "Ah", simulated)]
    for quantity, unit in AGAINST_RECORD.items():
        of = whole if unit == "V" else rows
        parts.append(errors("packs", quantity, unit, of.assign(found=of[quantity], true=0.0)))
    return [part[part["status"] == "compared"] for part in parts]


def _branch_quantity(rows, name):
    rows = rows.rename(columns={name: "true", f"{name}_found": "found"})
    if name == "group_capacity_ampere_hour":  # the group has one, whatever its branch
        rows = rows.drop_duplicates(["group", "test"]).assign(at="the group")
    return errors("packs", name, BRANCH_UNITS[name], rows)


def _branch_shares(place, group, test) -> pd.DataFrame:
    """Charge and largest current of each branch in a test's simulation; no rows without one."""
    series = files.artefact(place, "pack_series", group, test)
    if series is None:
        return pd.DataFrame(columns=[*BRANCH_KEYS, *BRANCH_UNITS])
    hour = series["test_time_second"].to_numpy(float) / 3600
    total = running_integral(hour, series["current_ampere"].to_numpy(float))
    runs = discharges(total, least=LEAST_DISCHARGE * np.ptp(total))
    given = [total[first] - total[last] for first, last in runs]
    rows, branch = [], 1
    while (name := f"simulated_branch_{branch}_current_ampere") in series:
        ampere = series[name].to_numpy(float)
        flowed = running_integral(hour, ampere)
        row = {"group": group, "test": test, "branch": branch}
        row |= {"group_capacity_ampere_hour": max(given, default=np.nan)}
        row |= {"charge_ampere_hour": sum(flowed[first] - flowed[last] for first, last in runs)}
        rows.append(row | {"current_max_ampere": np.nanmax(np.abs(ampere))})
        branch += 1
    return pd.DataFrame(rows)


def discharges(charge, *, least) -> list[tuple[int, int]]:
    """First and last sample of each stretch in which the charge falls.

    Parameters
    ----------
    charge : flowed in since the first sample [Ah], shape (n,).
    least : a rise or fall [Ah] that is smaller belongs to the stretch around it (recuperation).
    """
    runs, high, low, falls = [], 0, 0, False
    for now, flowed in enumerate(charge):
        if falls and flowed < charge[low]:
            low = now
        elif falls and flowed > charge[low] + least:
            runs, high, falls = [*runs, (high, low)], now, False
        elif not falls and flowed >= charge[high]:
            high = now
        elif not falls and flowed < charge[high] - least:
            low, falls = now, True
    return [*runs, (high, low)] if falls else runs
