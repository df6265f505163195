"""Numbers of a finished campaign: which there are, and where they were measured."""

import json

import numpy as np
import pandas as pd
import pytest

from real_cells import measured, record
from real_cells.measured import KEYS

CONTENT = {
    "capacity": {
        "cell": ["A", "A", "A"],
        "cycle": [None, None, None],
        "ambient_temperature_celsius": [25, 25, -10],
        "direction": "discharge",
        "c_rate": [0.98, 1.02, 0.0502],
        "capacity_ampere_hour": [2.0, 2.2, 1.8],
    },
    "resistance": {
        "cell": "A",
        "cycle": None,
        "ambient_temperature_celsius": 25,
        "soc": [0.4, 0.6, 0.5],
        "direction": ["discharge", "discharge", "charge"],
        "delay_second": [10, 10, 10],
        "actual_delay_second": [10, 10, 10],
        "resistance_ohm": [0.020, 0.024, 0.5],
        "c_rate": [-1.0, -1.0, 1.0],
    },
    "eis": {
        "cell": ["A"],
        "test": "spectrum",
        "ambient_temperature_celsius": 25,
        "soc": 0.5,
        "r_zero_crossing_ohm": 0.015,
        "r_ohmic_ohm": 0.016,
        "r_charge_transfer_ohm": np.nan,
    },
    "validation": {
        "cell": "A",
        "test": ["us06", "udds", "us06", "udds", "us06"],
        "ambient_temperature_celsius": 25,
        "model": ["2RC", "2RC", "DRT", "DRT", "1RC"],
        "rmse_volt_soc_5_95": [0.006, 0.008, 0.003, 0.004, 0.001],
        "chosen": [True, True, False, False, False],
    },
    "soc": {
        "cell": "A",
        "ambient_temperature_celsius": 25,
        "filter": ["coulomb", "ekf", "ekf", "ekf", "dual"],
        "scenario": ["nominal", "nominal", "nominal", "voltage_bias", "nominal"],
        "rmse_soc": [0.5, 0.01, 0.03, 0.09, 0.02],
        "capacity_ampere_hour": [None, None, None, None, 2.02],
    },
    "packs": {
        "group": "pair",
        "test": "drive",
        "branch": [1, 2],
        "cell": ["A", "B"],
        "current_rmse_ampere": [0.02, 0.03],
        "voltage_rmse_volt": 0.004,
        "capacity_ampere_hour": [2.0, 1.9],
    },
    "models": {
        "cell": "A",
        "model": ["1RC", "1RC", "1RC", "1RC", "2RC"],
        "ambient_temperature_celsius": 25,
        "soc": [0.2, 0.2, 0.8, 0.8, 0.2],
        "parameter": ["r0", "r1", "r0", "tau1", "r2"],
        "value": [0.02, 0.01, 0.05, 40.0, 7.0],
    },
    "health": {
        "cell": "A",
        "cycle": [0, 300, 300],
        "method": ["degradation modes", "check-up", "degradation modes"],
        "lli": [0.0, None, 0.05],
        "lam_negative": [0.0, None, 0.012],
        "lam_positive": [0.0, None, None],
    },
    "excluded": {
        "stage": ["ingest", "soc"],
        "reason": [
            "the file is empty (0 bytes)",
            "Cellwright itself failed at this step (KeyError: 'a')",
        ],
    },
    "checks": {"check": ["one", "two"], "outcome": ["passed", "failed"]},
}


@pytest.fixture
def campaign(tmp_path):
    """A made-up campaign that has been run: every table, a curve, a verdict, flags."""
    folder = tmp_path / "made_up"
    results = folder / "results"
    (results / "tables").mkdir(parents=True)
    for name, columns in CONTENT.items():
        pd.DataFrame(columns).to_csv(results / "tables" / f"{name}.csv", index=False)
    (results / "summary.csv").write_text("cell\nA\n")
    (folder / "config").mkdir()
    tests = "cell\ttest\tcycle\tambient_temperature_celsius\nA\tslow\t\t25\nA\tspectrum\t\t25\n"
    (folder / "config/tests.tsv").write_text(tests)
    grid = np.linspace(0, 1, 11)
    _parquet(results / "stages/ocv/A/slow.parquet", {"soc": grid, "ocv_volt": 3 + grid})
    _parquet(results / "stages/flags/A/slow.parquet", {"flag": ["gap", "gap", "spike"]})
    _json(results / "stages/basis/A.json", {"capacity_ampere_hour": 2.0})
    errors = {"before": 0.010, "after": 0.004}
    verdict = {"verdict": "named", "effects": [{"effect": "leakage"}], "gap_closed": 0.8}
    _json(results / "missing_effect/A/verdict.json", verdict | {"validation_rmse_volt": errors})
    return folder


def _parquet(path, columns):
    path.parent.mkdir(parents=True)
    pd.DataFrame(columns).to_parquet(path)


def _json(path, content, reason=None):
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(content | {"provenance": {"reason": reason}}))


def numbers_of(campaign):
    rows = record.of_campaign(campaign)
    keys = rows[["cell", "quantity", "where"]].itertuples(index=False, name=None)
    return dict(zip(keys, rows["value"], strict=True))


EXPECTED = [
    ("A", "capacity", "25 °C, discharge, 1C", "2.1"),
    ("A", "capacity", "-10 °C, discharge, C/20", "1.8"),
    ("A", "open-circuit voltage", "25 °C, 30 % SoC", "3.3"),
    ("A", "pulse resistance", "25 °C, 50 % SoC, after 10 s", "22"),
    ("A", "spectrum: ohmic resistance", "25 °C, 50 % SoC", "16"),
    ("A", "lithium lost", "cycle 300", "5"),
    ("A", "negative material lost", "cycle 300", "1.2"),
    ("A", "resistance of the model, mean over SoC", "25 °C", "40"),
    ("A", "chosen member", "25 °C", "2RC"),
    ("A", "best member", "25 °C", "DRT"),  # 1RC is better, and has not seen every test
    ("A", "error of the chosen member", "25 °C", "7.07107"),
    ("A", "error of the chosen member", "25 °C, worst test", "8"),
    ("A", "error of the best member", "25 °C", "3.53553"),
    ("A", "error of the chosen member over the best member's", "25 °C", "2"),
    ("A", "error of a filter's SoC", "25 °C, ekf, median", "2"),
    ("A", "error of a filter's SoC", "25 °C, ekf, worst", "3"),
    ("A", "error of a filter's SoC, with a fault", "ekf, median", "9"),
    ("A", "error of the dual filter's capacity", "worst", "1"),
    ("B", "error of the branch current", "drive, branch 2", "30"),
    ("pair", "error of the group's voltage", "drive", "4"),
    ("A", "verdict", "", "named"),
    ("A", "named effects", "", "leakage"),
    ("A", "error after the search", "", "4"),
    ("A", "gap closed", "", "80"),
    ("all", "internal errors", "", "1"),
    ("all", "left out", "", "2"),
    ("all", "laws of physics broken", "", "1"),
    ("all", "flagged samples", "gap", "2"),
]


def test_a_number_stands_with_its_place(campaign):
    found = numbers_of(campaign)
    wanted = {tuple(key): value for *key, value in EXPECTED}
    assert {key: found.get(key) for key in wanted} == wanted


def test_every_number_stands_once_and_what_is_not_known_not_at_all(campaign):
    rows = record.of_campaign(campaign)
    assert not rows.duplicated(KEYS).any()
    assert "spectrum: charge-transfer resistance" not in set(rows["quantity"])
    assert not [key for key in numbers_of(campaign) if "coulomb" in key[2]]


def test_a_sheet_of_tests_need_not_state_temperature_or_cycle(campaign):
    (campaign / "config/tests.tsv").write_text("cell\ttest\nA\tslow\nA\tspectrum\n")
    assert ("A", "open-circuit voltage", "temperature not known, 30 % SoC") in numbers_of(campaign)


def test_of_many_cells_models_are_given_as_median_and_worst(campaign):
    path = campaign / "results/tables/validation.csv"
    one = pd.read_csv(path).iloc[:1]
    cells = [one.assign(cell=f"h{k}", rmse_volt_soc_5_95=k / 1e3) for k in range(1, 10)]
    pd.concat(cells).to_csv(path, index=False)
    found = numbers_of(campaign)
    assert found["median of 9 cells", "error of the chosen member", "25 °C"] == "5"
    assert found["worst of 9 cells", "error of the chosen member", "25 °C"] == "9"
    assert found["all", "chosen member", "25 °C"] == "2RC: 9"
    assert found["A", "capacity", "25 °C, discharge, 1C"] == "2.1"


def test_right_verdicts_are_counted_where_the_campaign_says_what_is_hidden(campaign):
    hidden = {
        "kind": "single",
        "none_acceptable": False,
        "effects": [{"effect": "current_offset", "accept": ["current_offset", "leakage"]}],
    }
    (campaign / "truth.json").write_text(json.dumps({"cells": {"A": hidden, "Z": hidden}}))
    found = numbers_of(campaign)
    assert found["all", "right verdicts", "of 2 cells"] == "1"
    assert found["all", "false names and false alarms", "of 2 cells"] == "0"


def test_a_campaign_without_a_table_is_named(campaign):
    (campaign / "results/tables/soc.csv").unlink()
    with pytest.raises(FileNotFoundError, match=r"soc\.csv: there is no such table"):
        record.of_campaign(campaign)


def test_a_published_number_stands_beside_its_own_and_alone_where_there_is_none(campaign):
    columns = [*KEYS, "value", "source"]
    published = pd.DataFrame(
        [
            ["made_up", "A", "capacity", "25 °C, discharge, 1C", "2.15", "a paper"],
            ["made_up", "A", "capacity", "45 °C, discharge, 1C", "2.3", "a paper"],
            ["other", "A", "capacity", "25 °C, discharge, 1C", "9", "a paper"],
        ],
        columns=columns,
    )
    rows = record.with_published(record.of_campaign(campaign), published)
    rows = rows[rows["published"] != ""]
    assert rows["value"].tolist() == ["2.1", ""]
    assert rows["published"].tolist() == ["2.15", "2.3"]
    assert set(rows["unit"]) == {"Ah"}


def test_an_artefact_with_a_reason_is_no_document(campaign):
    _json(campaign / "results/missing_effect/B/verdict.json", {}, reason="no test for proof")
    assert list(measured.read_documents(campaign, "missing_effect/*/verdict.json")) == ["A"]
