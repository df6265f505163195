"""The command `plan`: from a campaign that was run, or from a rating alone."""

import csv
import json

import numpy as np
import pytest
from one_particle import CAPACITY, GRID, OCV, a_particle
from sheets_facts import cell_facts, measured_test

import cellwright as cw
from cellwright.circuits.particle import layout, run
from cellwright.identification.planning import knowledge_from_model
from first_look.__main__ import main
from runtime import artefact

CELL = cell_facts(lower=2.0, upper=4.5)
CURVE = {"test": "ocv", "ambient_temperature_celsius": 25.0, "branches": "both"}
CURVE |= {"soc": GRID.tolist(), "ocv_volt": OCV.tolist()}
BASIS = {"capacity_ampere_hour": CAPACITY, "borrowed_from": None, "ocv": [CURVE]}
USE = ["--celsius", "-10", "25", "--c-rates", "0.5", "1.5", "--hours", "6"]
RATING = ["--rating", "2.9", "--cutoffs", "2.5", "4.2"]


def pulses():
    cycle = np.zeros(2000)
    cycle[:300], cycle[1200:1230], cycle[1500:1530], cycle[1800:1830] = -3.0, -6.0, 3.0, -1.0
    current = np.concatenate([np.zeros(60), np.tile(cycle, 9)])
    time = np.arange(0.0, len(current))
    passed = np.append(0.0, np.cumsum((current[1:] + current[:-1]) / 2)) / 3600.0
    columns = time, current, 1.0 + passed / CAPACITY, 25.0
    volt = run(a_particle((25.0,)), *columns, capacity_ampere_hour=CAPACITY).voltage_volt
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
    series["voltage_volt"] = volt + np.random.default_rng(5).normal(0.0, 2e-4, len(time))
    series["charge_ampere_hour"] = passed
    return measured_test(series, "hppc", "hppc", celsius=25.0, soc=1.0)


@pytest.fixture(scope="module")
def model():
    found = cw.identify(CELL, BASIS, [pulses()], members=("1RC", "2RC", "P"))
    return cw.finish_model(CELL, found, BASIS, [pulses()]).content


@pytest.fixture
def campaign(tmp_path, model):
    """Results of a campaign, as far as the command reads them."""
    facts, series = pulses()
    wildcards = {"cell": "A", "test": facts.test}
    sheet = facts._asdict()
    del sheet["test"]
    plain = {"reason": None, "params": {}, "wildcards": {"cell": "A"}}
    results = tmp_path / "results"
    about = plain | {"wildcards": wildcards, "params": {"test": sheet}}
    artefact.write(results / "stages/clean/A/hppc.parquet", series, about)
    artefact.write(results / "stages/basis/A.json", BASIS, plain)
    inputs = ["results/stages/clean/A/hppc.parquet", "results/stages/basis/A.json"]
    about = plain | {"params": {"cell": CELL._asdict(), "split_rest_second": 120}}
    about["inputs"] = dict.fromkeys(inputs, "aa")
    artefact.write(results / "models/A.json", model, about)
    return tmp_path


def test_what_is_known_of_a_campaign_is_what_its_model_states(model):
    known = knowledge_from_model(model, BASIS, CELL, [pulses()], split_rest_second=120)
    std = np.sqrt(np.diag(np.linalg.inv(known.precision)))
    place, document = layout(1)["double_layer_farad"], model["particle"]
    stated = np.divide(document["double_layer_farad_std"], document["double_layer_farad"])
    assert std[place] == pytest.approx(stated, rel=0.3)


def test_a_plan_is_printed_and_written_only_where_it_is_asked(campaign, capsys):
    before = set(campaign.rglob("*"))
    assert main(["plan", str(campaign), *USE]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "A: what is known from hppc"
    assert "discharge at 1C" in said[2]
    assert said[2].split()[3] == "-10"
    assert "The model's structure misses blocks" in said[-1]
    assert set(campaign.rglob("*")) == before
    table = campaign / "plan.csv"
    assert main(["plan", str(campaign), *USE, "--csv", str(table)]) == 0
    (row,) = csv.DictReader(table.read_text().splitlines())
    assert (row["kind"], row["ambient_temperature_celsius"]) == ("capacity", "-10.0")
    assert 0 < float(row["after_volt"]) < float(row["before_volt"])


def test_a_rating_alone_makes_a_plan(capsys):
    assert main(["plan", *RATING, *USE]) == 0
    assert capsys.readouterr().out.startswith("a cell of 2.9 Ah by its rating and cut-offs alone")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "wanted a campaign's folder, or --rating AH and --cutoffs LOW HIGH"),
        (RATING[:2], "wanted a campaign's folder, or --rating AH and --cutoffs LOW HIGH"),
        ([".", *RATING], "a campaign's folder and --rating or --cutoffs were given; wanted one"),
        (["."], "found no results/models/*.json, wanted a campaign that was run"),
    ],
)
def test_refused_is_what_says_no_cell(tmp_path, monkeypatch, capsys, given, said):
    monkeypatch.chdir(tmp_path)
    assert main(["plan", *given, *USE]) == 1
    assert said in capsys.readouterr().err


def test_refused_is_a_cell_that_is_not_named_or_has_no_particle(campaign, capsys):
    assert main(["plan", str(campaign), "--cell", "B", *USE]) == 1
    assert "found no model of B; there are A" in capsys.readouterr().err
    path = campaign / "results/models/A.json"
    document = json.loads(path.read_text())
    (campaign / "results/models/B.json").write_text(json.dumps(document))
    assert main(["plan", str(campaign), *USE]) == 1
    assert "found models of A, B; wanted one with --cell" in capsys.readouterr().err
    path.write_text(json.dumps(document | {"particle": None}))
    assert main(["plan", str(campaign), "--cell", "A", *USE]) == 1
    assert "the model of A has no particle; wanted one" in capsys.readouterr().err
