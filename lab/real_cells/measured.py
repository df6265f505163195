"""Numbers of one finished campaign, from its tables, artefacts and sheets, and what each means.

The functions of `MEASUREMENTS` yield (cell, quantity, where, value) of `QUANTITIES`; `campaign` is
the folder with `results/` and `config/`.
"""

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from runtime.artefact import FAILED
from runtime.csv_cells import frame_as_written
from virtual_lab.score.verdicts import NAMED, outcome

# Columns of a table of numbers: what it is a number of, and what is to be known of it.
KEYS = ["campaign", "cell", "quantity", "where"]
COLUMNS = [*KEYS, "value", "unit", "better", "tolerance_absolute", "tolerance_relative"]
COLUMNS += ["published", "published_source"]

C_RATES = {
    **{f"C/{k}": 1 / k for k in (100, 50, 40, 30, 25, 20, 15, 10, 8, 5, 4, 3, 2)},
    **{f"{k:g}C": k for k in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20)},
}


class Quantity(NamedTuple):
    """Unit, better side, tolerance and topic of a measured quantity.

    unit : of the number; "word" for a word.
    better : "lower" and "higher" say which side is better; "near" means that it must stay, unless
        it comes nearer to the published one; "equal" is for words that must stay; "shown" is never
        checked.
    absolute : how much it may change [unit].
    relative : that much more, as a part of the recorded number.
    topic : heading of the page below which it stands.
    """

    unit: str
    better: str
    absolute: float
    relative: float
    topic: str


CELL, MODEL, SEARCH, RUN = "Cells", "Models and filters", "What is missing", "The run"
TRUTH = "Against the truth"
TOLERATED_ERROR = {"better": "lower", "absolute": 0.3, "relative": 0.05}  # mV or mA, and 5 % more
SOC = {"unit": "% of SoC", "better": "lower", "absolute": 0.3, "relative": 0.0}
COUNT = {"better": "lower", "absolute": 0.0, "relative": 0.0, "topic": RUN}
SHOWN = {"better": "shown", "absolute": 0.0, "relative": 0.0}

QUANTITIES = {
    "capacity": Quantity("Ah", "near", 0.0, 0.002, CELL),
    "open-circuit voltage": Quantity("V", "near", 0.002, 0.0, CELL),
    "pulse resistance": Quantity("mohm", "near", 0.0, 0.02, CELL),
    "spectrum: real part where it crosses the axis": Quantity("mohm", "near", 0.0, 0.02, CELL),
    "spectrum: ohmic resistance": Quantity("mohm", "near", 0.0, 0.02, CELL),
    "spectrum: charge-transfer resistance": Quantity("mohm", "near", 0.0, 0.05, CELL),
    "resistance of the model, mean over SoC": Quantity("mohm", "near", 0.0, 0.05, CELL),
    "lithium lost": Quantity("%", "near", 0.3, 0.0, CELL),
    "negative material lost": Quantity("%", "near", 0.3, 0.0, CELL),
    "positive material lost": Quantity("%", "near", 0.3, 0.0, CELL),
    "capacity inside the group": Quantity("Ah", "near", 0.0, 0.005, CELL),
    "chosen member": Quantity("word", topic=MODEL, **SHOWN),
    "best member": Quantity("word", topic=MODEL, **SHOWN),
    "error of the chosen member": Quantity("mV", topic=MODEL, **TOLERATED_ERROR),
    "error of the best member": Quantity("mV", topic=MODEL, **TOLERATED_ERROR),
    "error of the chosen member over the best member's": Quantity("1", "lower", 0.05, 0.05, MODEL),
    "error of a filter's SoC": Quantity(topic=MODEL, **SOC),
    "error of a filter's SoC, with a fault": Quantity(topic=MODEL, **SOC),
    "error of the dual filter's capacity": Quantity("%", "lower", 0.3, 0.05, MODEL),
    "error of the branch current": Quantity("mA", topic=MODEL, **TOLERATED_ERROR),
    "error of the group's voltage": Quantity("mV", topic=MODEL, **TOLERATED_ERROR),
    "verdict": Quantity("word", "equal", 0.0, 0.0, SEARCH),
    "named effects": Quantity("word", "equal", 0.0, 0.0, SEARCH),
    "error before the search": Quantity("mV", topic=SEARCH, **SHOWN),
    "error after the search": Quantity("mV", topic=SEARCH, **TOLERATED_ERROR),
    "gap closed": Quantity("%", "higher", 3.0, 0.0, SEARCH),
    "right verdicts": Quantity("count", "higher", 0.0, 0.0, SEARCH),
    "false names and false alarms": Quantity("count", "lower", 0.0, 0.0, SEARCH),
    "left out": Quantity("count", **COUNT),
    "internal errors": Quantity("count", **COUNT),
    "laws of physics broken": Quantity("count", **COUNT),
    "flagged samples": Quantity("count", **COUNT),
    "time of all jobs": Quantity("s", topic=RUN, **SHOWN),
    "error against the truth": Quantity("", "lower", 0.0, 0.1, TRUTH),
    "rows that the truth has and the results have not": Quantity("count", "lower", 0.0, 0.0, TRUTH),
    "share that is right": Quantity("%", "higher", 0.5, 0.0, TRUTH),
}


def topics() -> list[str]:
    """Headings below which the quantities stand, in the order of the list."""
    return list(dict.fromkeys(quantity.topic for quantity in QUANTITIES.values()))


def rate_in_words(c_rate: float) -> str:
    """The customary rate next to this one: C/20, 1C.

    Parameters
    ----------
    c_rate : float [1/h]
        Current over rated capacity, of either sign.
    """
    if not c_rate or math.isnan(c_rate):
        return "rate not known"
    return min(C_RATES, key=lambda name: abs(math.log(abs(c_rate) / C_RATES[name])))


def celsius_in_words(temperature: float) -> str:
    """A chamber temperature [°C] with its unit, or that it is not known."""
    return "temperature not known" if math.isnan(temperature) else f"{temperature:g} °C"


def place(*parts: str) -> str:
    """Where a number was measured, out of several parts; empty parts are left out."""
    return ", ".join(part for part in parts if part)


MILLI, PERCENT = 1e3, 1e2
TEXT_COLUMNS = (
    *("cell", "test", "group", "model", "filter"),
    *("scenario", "direction", "stage", "reason", "doubt"),
)
TEMPERATURE = "ambient_temperature_celsius"
OFF_SOC = 0.05  # how far from the wanted one a measured one may lie
LATE_SECOND = 1.0  # a sample that is later than this says nothing about the wanted moment
RESISTANCE_DELAYS_SECOND = (0, 0.1, 1, 10)
SPECTRA_SOC = (0.2, 0.5, 1.0)
SPECTRUM = {
    "r_zero_crossing_ohm": "spectrum: real part where it crosses the axis",
    "r_ohmic_ohm": "spectrum: ohmic resistance",
    "r_charge_transfer_ohm": "spectrum: charge-transfer resistance",
}
ERROR = "rmse_volt_soc_5_95"
COUNTING = "coulomb"  # keeps the error of its start: says nothing about the pipeline
WRONG_VERDICTS = ("false name", "false alarm")


def read_table(campaign, name: str) -> pd.DataFrame:
    """A table of the results, `results/tables/<name>.csv`; blank cells are NaN.

    Raises
    ------
    FileNotFoundError
        Where the campaign has none: it has not been run to its end.
    """
    path = Path(campaign) / "results" / "tables" / f"{name}.csv"
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such table; run the campaign to its end")
    texts = dict.fromkeys(TEXT_COLUMNS, str)
    return frame_as_written(pd.read_csv(path, dtype=texts, keep_default_na=False, na_values=[""]))


def read_documents(campaign, pattern: str) -> dict[str, dict]:
    """JSON artefacts below `results/` that have content, by the cell or group they are about."""
    documents = {}
    for path in sorted((Path(campaign) / "results").glob(pattern)):
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["provenance"]["reason"] is None:
            documents[path.parent.name if path.stem == "verdict" else path.stem] = document
    return documents


def read_artefacts(campaign, stage: str) -> dict[tuple, pd.DataFrame]:
    """Parquet artefacts of a stage that have rows, by (cell, test)."""
    paths = sorted((Path(campaign) / "results" / "stages" / stage).glob("*/*.parquet"))
    content = {(path.parent.name, path.stem): pd.read_parquet(path) for path in paths}
    return {key: rows for key, rows in content.items() if len(rows)}


def read_tests(campaign) -> pd.DataFrame:
    """The sheet of tests, with cell, test, cycle and temperature."""
    path = Path(campaign) / "config" / "tests.tsv"
    texts = {"cell": str, "test": str}
    sheet = pd.read_csv(path, sep="\t", dtype=texts, keep_default_na=False, na_values=[""])
    absent = [name for name in ("cycle", TEMPERATURE) if name not in sheet]
    return sheet.assign(**dict.fromkeys(absent, float("nan")))


def first_and_last_age(rows: pd.DataFrame):
    """(word for the age, its rows): first and last by `cycle`, one part where all are alike."""
    cycle = rows["cycle"].astype(float).fillna(0.0)
    if cycle.nunique() < 2:
        return [("", rows)]
    return [("first", rows[cycle == cycle.min()]), ("last", rows[cycle == cycle.max()])]


def capacities(campaign):
    """Capacity [Ah] per cell, temperature, direction and rate: median of the tests.

    Where a cell was tested at several ages: that of the first and of the last.
    """
    rows = read_table(campaign, "capacity")
    rows = rows[rows["capacity_ampere_hour"].notna()]
    rows = rows.assign(rate=rows["c_rate"].map(rate_in_words))
    keys = ["cell", TEMPERATURE, "direction", "rate"]
    for (cell, celsius, direction, rate), same in rows.groupby(keys, dropna=False):
        for age, part in first_and_last_age(same):
            where = place(celsius_in_words(celsius), direction, rate, age)
            yield cell, "capacity", where, part["capacity_ampere_hour"].median()


def pulse_resistances(campaign):
    """Pulse resistance [mohm] at half charge per cell, temperature and delay.

    Of the first check-up, of the pulses next to 1C, those of a discharge where there are any.
    """
    rows = read_table(campaign, "resistance")
    in_time = rows["actual_delay_second"] <= rows["delay_second"] + LATE_SECOND
    wanted = rows["delay_second"].isin(RESISTANCE_DELAYS_SECOND) & in_time
    rows = rows[wanted & rows["resistance_ohm"].notna()]
    rows = rows.assign(rate=rows["c_rate"].map(rate_in_words))
    keys = ["cell", TEMPERATURE, "delay_second"]
    for (cell, celsius, delay), same in rows.groupby(keys, dropna=False):
        _, pulses = first_and_last_age(same)[0]
        discharge = pulses[pulses["direction"] == "discharge"]
        pulses = discharge if len(discharge) else pulses
        next_to_1c = pulses["c_rate"].abs().map(np.log).abs().idxmin()
        pulses = pulses[pulses["rate"] == pulses["rate"][next_to_1c]]
        ohm = _at_half_charge(pulses["soc"], pulses["resistance_ohm"])
        after = f"after {delay:g} s" if delay else "first sample"
        where = place(celsius_in_words(celsius), "50 % SoC", after)
        yield cell, "pulse resistance", where, MILLI * ohm


def _at_half_charge(soc, value) -> float:
    """Value at 50 % SoC between the measured points, NaN where none lies near on one side."""
    points = pd.DataFrame({"soc": soc, "value": value}).dropna().groupby("soc").median()
    below, above = points[points.index <= 0.5 + OFF_SOC], points[points.index >= 0.5 - OFF_SOC]
    if not len(below) or not len(above):
        return np.nan
    return float(np.interp(0.5, points.index, points["value"]))


def open_circuit_voltages(campaign):
    """Open-circuit voltage [V] at 10 to 90 % SoC of the slow test nearest to 25 °C, per cell."""
    sheet = read_tests(campaign).set_index(["cell", "test"])
    curves = read_artefacts(campaign, "ocv")
    tests = sheet.loc[sheet.index.intersection(list(curves))].reset_index()
    tests = tests.assign(
        off=(tests[TEMPERATURE].astype(float) - 25).abs(),
        age=tests["cycle"].astype(float).fillna(0.0),
    )
    for cell, slow_tests in tests.groupby("cell"):
        first = slow_tests.sort_values(["age", "off"]).iloc[0]
        curve = curves[cell, first["test"]]
        celsius = celsius_in_words(float(first[TEMPERATURE]))
        for soc in np.arange(0.1, 0.95, 0.1):
            volt = np.interp(soc, curve["soc"], curve["ocv_volt"], left=np.nan, right=np.nan)
            yield (
                cell,
                "open-circuit voltage",
                place(celsius, f"{soc * 100:.0f} % SoC"),
                float(volt),
            )


MODES = {
    "lli": "lithium lost",
    "lam_negative": "negative material lost",
    "lam_positive": "positive material lost",
}


def degradation_modes(campaign):
    """Lithium and material lost [%] at each later check-up, by the degradation modes, per cell."""
    rows = read_table(campaign, "health")
    rows = rows[rows["method"].astype(str).eq("degradation modes") & rows["cycle"].gt(0)]
    for cell, cycle, *shares in rows[["cell", "cycle", *MODES]].itertuples(index=False):
        for quantity, share in zip(MODES.values(), shares, strict=True):
            yield cell, quantity, f"cycle {cycle:g}", PERCENT * share


def spectra(campaign):
    """Resistances [mohm] of the spectra at 20, 50 and 100 % SoC, per cell and temperature."""
    rows = read_table(campaign, "eis")
    sheet = read_tests(campaign)[["cell", "test", "cycle"]]
    rows = rows.merge(sheet, on=["cell", "test"], how="left")
    for soc in SPECTRA_SOC:
        rows = rows.assign(off=(rows["soc"] - soc).abs())
        near = rows[rows["off"] <= OFF_SOC]
        for (cell, celsius), same in near.groupby(["cell", TEMPERATURE], dropna=False):
            where = place(celsius_in_words(celsius), f"{soc * 100:.0f} % SoC")
            yield from _resistances_of_spectra(cell, where, same)


def _resistances_of_spectra(cell, where, rows):
    for age, part in first_and_last_age(rows):
        nearest = part[part["off"] == part["off"].min()]
        for column, quantity in SPECTRUM.items():
            yield cell, quantity, place(where, age), MILLI * nearest[column].median()


def model_resistances(campaign):
    """Direct-current resistance [mohm] of the 1RC models of cells in groups, mean over SoC.

    Every cell with a model has that member, at the temperatures that were tested.
    """
    members = set(read_table(campaign, "packs")["cell"])
    rows = read_table(campaign, "models")
    rows = rows[rows["cell"].isin(members) & (rows["model"] == "1RC")]
    rows = rows[rows["parameter"].str.fullmatch(r"r\d+")]
    for (cell, celsius), same in rows.groupby(["cell", TEMPERATURE], dropna=False):
        total = same.groupby("soc")["value"].sum()
        where = celsius_in_words(celsius)
        yield cell, "resistance of the model, mean over SoC", where, MILLI * float(total.mean())


def model_errors(campaign):
    """Error [mV] of the chosen member and of the best in the table, per cell and temperature.

    Between 5 and 95 % SoC: root mean square over the tests, and the worst test. The best member is
    the one with the lowest root mean square at this temperature, of those that have all tests.
    """
    rows = read_table(campaign, "validation")
    rows = rows[rows[ERROR].notna()]
    for (cell, celsius), same in rows.groupby(["cell", TEMPERATURE], dropna=False):
        where, members = celsius_in_words(celsius), same.groupby("model")[ERROR]
        complete = members.count() == members.count().max()
        over_tests = members.agg(lambda error: np.sqrt(np.mean(error**2)))[complete]
        best, least = over_tests.idxmin(), over_tests.min()
        chosen = same[same["chosen"].astype(str) == "True"]
        if len(chosen):
            error = np.sqrt(np.mean(chosen[ERROR] ** 2))
            worst = place(where, "worst test")
            yield cell, "chosen member", where, chosen["model"].iloc[0]
            yield cell, "error of the chosen member", where, MILLI * error
            yield cell, "error of the chosen member", worst, MILLI * chosen[ERROR].max()
            yield cell, "error of the chosen member over the best member's", where, error / least
        yield cell, "best member", where, best
        yield cell, "error of the best member", where, MILLI * least


def filter_errors(campaign):
    """Error [% of SoC] of each filter from wrong starts, per cell and temperature: median, worst.

    And the median over the runs with a fault in a sensor or in the capacity.
    """
    rows = read_table(campaign, "soc")
    rows = rows[rows["rmse_soc"].notna() & (rows["filter"] != COUNTING)]
    nominal = rows["scenario"] == "nominal"
    keys = ["cell", TEMPERATURE, "filter"]
    for (cell, celsius, name), same in rows[nominal].groupby(keys, dropna=False):
        error, where = same["rmse_soc"], place(celsius_in_words(celsius), name)
        yield cell, "error of a filter's SoC", place(where, "median"), PERCENT * error.median()
        yield cell, "error of a filter's SoC", place(where, "worst"), PERCENT * error.max()
    for (cell, name), same in rows[~nominal].groupby(["cell", "filter"]):
        value = PERCENT * same["rmse_soc"].median()
        yield cell, "error of a filter's SoC, with a fault", place(name, "median"), value


def filter_capacities(campaign):
    """Error [%] of the capacity that the dual filter estimates, against the basis, per cell."""
    rows = read_table(campaign, "soc")
    rows = rows[(rows["filter"] == "dual") & (rows["scenario"] == "nominal")]
    basis = read_documents(campaign, "stages/basis/*.json")
    by_cell = {cell: document["capacity_ampere_hour"] for cell, document in basis.items()}
    rows = rows.assign(basis=rows["cell"].map(by_cell).astype(float))
    error = (rows["capacity_ampere_hour"] / rows["basis"] - 1).abs()
    for cell, part in error.dropna().groupby(rows["cell"]):
        yield cell, "error of the dual filter's capacity", "median", PERCENT * part.median()
        yield cell, "error of the dual filter's capacity", "worst", PERCENT * part.max()


def packs(campaign):
    """Errors of branch currents [mA] and voltage [mV] of each group's tests; capacities [Ah]."""
    rows = read_table(campaign, "packs")
    for row in rows.to_dict("records"):
        where = place(row["test"], f"branch {row['branch']:g}")
        yield row["cell"], "error of the branch current", where, MILLI * row["current_rmse_ampere"]
        yield row["cell"], "capacity inside the group", where, row["capacity_ampere_hour"]
    for (group, test), same in rows.groupby(["group", "test"]):
        yield group, "error of the group's voltage", test, MILLI * same["voltage_rmse_volt"].max()


def verdicts(campaign):
    """Verdict of each cell and group, what it names, and the errors [mV] on data for proof."""
    for name, verdict in read_documents(campaign, "missing_effect/*/verdict.json").items():
        effects = " + ".join(sorted(map(_effect_in_words, verdict["effects"])))
        errors = verdict.get("validation_rmse_volt") or {}
        yield name, "verdict", "", verdict["verdict"]
        yield name, "named effects", "", effects or "none"
        yield name, "error before the search", "", _times(MILLI, errors.get("before"))
        yield name, "error after the search", "", _times(MILLI, errors.get("after"))
        yield name, "gap closed", "", _times(PERCENT, verdict.get("gap_closed"))


def _effect_in_words(effect: dict) -> str:
    """An effect, and in which branch where it is that of a group."""
    return f"{effect['effect']} in {effect['cell']}" if "cell" in effect else effect["effect"]


def _times(factor, value):
    """A number in another unit; NaN where it is not known."""
    return math.nan if value is None else factor * value


def right_verdicts(campaign):
    """How many verdicts are right where the campaign says what is hidden in its cells."""
    path = Path(campaign) / "truth.json"
    if not path.is_file():
        return
    hidden = json.loads(path.read_text(encoding="utf-8"))["cells"]
    hidden = {cell: truth for cell, truth in hidden.items() if truth["kind"] != "reference"}
    documents = read_documents(campaign, "missing_effect/*/verdict.json")
    words = [outcome(truth, documents.get(cell)) for cell, truth in hidden.items()]
    where, right = f"of {len(hidden)} cells", (*NAMED, "rightly silent")
    yield "all", "right verdicts", where, sum(word in right for word in words)
    wrong = sum(word in WRONG_VERDICTS for word in words)
    yield "all", "false names and false alarms", where, wrong


def left_out(campaign):
    """How many files and analyses were left out, per stage, how many by faults of the program."""
    rows = read_table(campaign, "excluded")
    internal = rows["reason"].str.startswith(FAILED).fillna(False)
    yield "all", "internal errors", "", int(internal.sum())
    yield "all", "left out", "", len(rows)
    for stage, part in rows.groupby("stage"):
        yield "all", "left out", f"stage {stage}", len(part)


def broken_laws(campaign):
    """How many laws of physics the results break."""
    rows = read_table(campaign, "checks")
    yield "all", "laws of physics broken", "", int((rows["outcome"] == "failed").sum())


def flagged_samples(campaign):
    """How many samples carry each flag."""
    counts = {}
    for rows in read_artefacts(campaign, "flags").values():
        for flag, count in rows["flag"].value_counts().items():
            counts[flag] = counts.get(flag, 0) + int(count)
    yield "all", "flagged samples", "", sum(counts.values())
    for flag, count in sorted(counts.items()):
        yield "all", "flagged samples", str(flag), count


def job_seconds(campaign):
    """Time [s] of all jobs, one after the other, from Snakemake's records of them."""
    folder = Path(campaign) / ".snakemake" / "metadata"
    records = [json.loads(path.read_text()) for path in folder.rglob("*") if path.is_file()]
    jobs = {(job["rule"], *job["log"]): job["endtime"] - job["starttime"] for job in records}
    if jobs:
        yield "all", "time of all jobs", "", sum(jobs.values())


MEASUREMENTS = (
    *(capacities, open_circuit_voltages, pulse_resistances, spectra, degradation_modes),
    *(model_resistances, model_errors, filter_errors, filter_capacities, packs),
    *(verdicts, right_verdicts),
    *(left_out, broken_laws, flagged_samples, job_seconds),
)
