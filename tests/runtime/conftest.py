"""The inputs of the report for one cell with a good and a bad test, and one group."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cellwright.refusal import Refusal
from runtime import artefact

ROOT = Path(__file__).resolve().parents[2]
TABLES = ["capacity", "ica", "eis", "temperature", "choice", "validation", "soc", "packs"]
TABLES += ["pack_findings", "pack_checks", "series_packs", "nested_packs"]
TABLES += ["missing_effect", "fleet", "health", "fade", "excluded", "resistance_definitions"]
TABLES += ["activation_energies", "capacity_between_rests", "ica_discharge", "checkups"]
CELL = {"cell": "A", "chemistry": "NMC", "note": None}
TEST = {
    "cell": "A",
    "test": "bad",
    "kind": "capacity",
    "ambient_temperature_celsius": 0.0,
    "cycle": None,
    "soc": None,
    "role": "fit",
    "note": "<b>odd</b>",
}


VERDICT = {
    "cell": "A",
    "verdict": "ambiguous",
    "effect": "slow_diffusion",
    "alternatives": "leakage;current_offset",
    "validation_before_volt": 0.004214,
    "validation_after_volt": 0.000987,
    "gap_closed": 0.973,
    "floor_volt": 0.0008,
    "sure": False,
    "doubts": "another explains it as well",
    "in_one_line": "shows slow diffusion",
}
WITNESS = {"name": "relaxations", "effect": "slow_diffusion", "named": True, "says": "silent"}
WITNESS |= {
    "measured": 0.0,
    "implied": 0.0,
    "unit": "Ohm",
    "std": 0.0,
    "shown": False,
    "text": "no long rest",
}
HEARD = WITNESS | {"name": "pulses", "effect": "resistance_soc", "named": False}
HEARD |= {"says": "contradicts", "text": "not named, although < 3"}


SOC = np.linspace(0.0, 1.0, 21)
SLOW = {"soc": SOC, "ocv_volt": 3.0 + SOC}
SLOW |= dict.fromkeys(("discharge_volt", "charge_volt", "half_gap_volt"), 0.0 * SOC)

# As the drawing of a figure writes it: a head, provenance, and the drawing.
PICTURE = """<?xml version="1.0"?>
<svg xmlns="http://www.w3.org/2000/svg"><metadata>%s</metadata>
<path fill="#0b6fb8" d="M0 0l5 5"/><text>97 %% &amp; more</text></svg>
""" % ("ab" * 32)


@pytest.fixture
def job(snakemake, saved):
    """The inputs of rule `report` for one cell with a good and a bad test, and one group."""
    contents = dict.fromkeys(TABLES, ())
    capacity = {
        "cell": "A",
        "test": "good",
        "direction": "discharge",
        "capacity_ampere_hour": 1.987654321,
    }
    contents["capacity"] = [capacity] * 70
    contents["excluded"] = [
        {
            "cell": "A",
            "test": "bad",
            "file": "raw/bad.csv",
            "stage": "ingest",
            "reason": "time & <i>space</i>",
        }
    ]
    contents["packs"] = [
        {"group": "pair", "test": "c10", "branch": 1, "cell": "A", "current_rmse_ampere": 0.0123456}
    ]
    contents["pack_checks"] = [
        {"group": "pair", "test": "c10", "found": True, "sentence": "branch 2 < branch 1 & turned"}
    ]
    contents["checks"] = [
        {"check": "No charge from nothing.", "outcome": "failed"}
        | {"cell": "A", "test": "bad", "found": "<3 Ah"}
    ]
    contents["missing_effect"] = [VERDICT]
    kind = {"type": "NMC, 5 Ah", "sentence": "A alone shows self-discharge"}
    shown = {"A": ("sure", 0.00312), "B": ("not testable", None)}
    contents["fleet"] = [
        kind | {"cell": cell, "effect": "leakage", "shown": word, "size_volt": volt}
        for cell, (word, volt) in shown.items()
    ]
    contents["fleet"].append(
        {"type": "LFP, 2 Ah", "sentence": "none of 2 cells shows an effect", "shown": "no"}
        | dict.fromkeys(("cell", "effect", "size_volt"))
    )
    contents["validation"] = [
        {"cell": "A", "test": "udds", "model": "2RC", "chosen": True, "rmse_volt": 0.002}
    ]
    contents["resistance_definitions"] = [
        {"cell": "A", "name": "R0", "resistance_ohm": 0.0396612, "resistance_std_ohm": 0.00009}
        | {"over_r0": 1.0, "current_ampere": -5.0, "delay_second": 0.01, "soc": 0.4999}
        | {"ambient_temperature_celsius": 25.0, "test": "hppc", "definition": "the first sample"}
    ]
    known = {"cell": "A", "quantity": "R0", "definition": "of the first sample"}
    known |= {"energy_joule_per_mole": 22034.0, "energy_std_joule_per_mole": 1610.0}
    known |= {"tested_from_celsius": -10.0, "tested_to_celsius": 25.0}
    contents["activation_energies"] = [
        known | {"name": "reconciled", "sources": 3, "doubt": "surface: 30 kJ/mol contradicts 22"},
        known | {"name": "surface", "sources": 1, "doubt": None},
    ]
    at = {"ambient_temperature_celsius": 25.0, "blocks": 9, "typical_volt": 0.001}
    at |= {"cell": "A", "worst_volt": 0.03, "fit_rmse_volt": 0.00234}
    contents["choice"] = [
        at | {"model": "2RC", "left_out_rmse_volt": 0.0123, "chosen": True, "reason": "2RC chosen"},
        at | {"model": "1RC", "left_out_rmse_volt": 0.0456, "chosen": False, "reason": "far & off"},
    ]
    paths = {}
    for name, rows in contents.items():
        paths[name] = f"results/tables/{name}.csv"
        with artefact.Job(snakemake(paths[name])) as writing:
            writing.save(list(rows))
    with artefact.Job(snakemake("results/summary.csv")) as writing:
        writing.save([{"cell": "A", "soh": 0.987654321, "notes": "as new"}])
    for test in ("good", "bad"):
        path = f"results/stages/ingest/A/{test}.parquet"
        with artefact.Job(snakemake(path, wildcards={"cell": "A", "test": test})) as writing:
            writing.note("sign found from the data")
            if test == "bad":
                raise Refusal("time & <i>space</i>")
            writing.save(
                {"test_time_second": [0.0], "current_ampere": [0.0], "voltage_volt": [3.7]}
            )
    # Of cell B there is the reason why it has none of these.
    search, no_test = "results/missing_effect/{}/", "no validation test"
    verdict = {"cell": "A", "paragraph": "What was missing: time & patience."}
    limit = {"paragraph": "Limited by charge transfer & age."}
    verdicts, heard, cold = (
        [saved(path.format("A"), content), saved(path.format("B"), reason)]
        for path, content, reason in (
            (f"{search}verdict.json", verdict, no_test),
            (f"{search}witnesses.parquet", [WITNESS, HEARD], no_test),
            ("results/stages/cold_limit/{}.json", limit, "neither spectra nor pulses"),
        )
    )
    Path("results/figures/A").mkdir(parents=True)
    Path("results/figures/A/validation_udds.svg").write_text(PICTURE)
    time = np.arange(0.0, 3000.0)
    lines = {"test_time_second": time, "current_ampere": np.sin(time / 300)}
    lines |= {"voltage_volt": 3.7 + 0.1 * np.sin(time / 300), "soc": 0.5 + 0 * time}
    lines |= {"scored": np.full(3000, True), "simulated_2RC_volt": lines["voltage_volt"] + 0.002}
    simulated = [saved("results/stages/simulation/A/udds.parquet", lines)]
    inputs = SimpleNamespace(
        tables=[paths[name] for name in TABLES],
        checks=paths["checks"],
        summary="results/summary.csv",
        artefacts=["results/stages/ingest/A/good.parquet", "results/stages/ingest/A/bad.parquet"],
        verdicts=verdicts,
        witnesses=heard,
        maps=[],
        cold=cold,
        lookups=[],
        pybamm=[],
        truth=[],
        simulated=simulated,
        series=[],
        curves=[saved("results/stages/ocv/A/slow.parquet", SLOW)],
    )
    params = SimpleNamespace(
        cells=[CELL],
        tests=[TEST, TEST | {"test": "good", "note": None}],
        groups=[{"group": "pair", "position": k, "cell": c} for k, c in ((1, "A"), (2, "B"))],
        figures={"the campaign": [], "A": ["results/figures/A/validation_udds.svg"]},
        title="Tiny & small",
        laboratory={},
        settings={"resistance": {"delay_second": [0, 10]}},
        run={
            "version": "1",
            "command": "./run",
            "again": "./run snakemake --cores 2",
            "sheets": {"config/cells.tsv": "cd" * 32},
        },
        choices={"strict": True},
        assumptions=[{"module": "m.py", "text": "Cells are round."}],
    )
    return SimpleNamespace(input=inputs, params=params)
