"""A particle predicts where it is better beyond chance; a circuit serves what takes tables."""

import numpy as np
import pytest
from one_particle import CAPACITY, GRID, OCV, a_particle
from sheets_facts import cell_facts, measured_test

import cellwright as cw
from cellwright.circuits.model_file import in_use, member_of
from cellwright.circuits.particle import run
from cellwright.identification.planning import knowledge_from_model
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

CELL = cell_facts(lower=2.0, upper=4.5)
# Weak loads of a cold cell: its charge transfer has a time constant that no circuit has.
SLOW = {"transfer_ohm": np.log(0.08), "double_layer_farad": np.log(200.0)}
TRUTH = a_particle((25.0,), **SLOW)
# In the cold far slower than the prior of its energy has it.
COLD_TRUTH = a_particle((25.0,), **SLOW, transfer_joule_per_mole=80e3)
BASIS = {
    "capacity_ampere_hour": CAPACITY,
    "borrowed_from": None,
    "ocv": [
        {
            **{"test": "ocv", "ambient_temperature_celsius": 25.0, "branches": "both"},
            **{"soc": GRID.tolist(), "ocv_volt": OCV.tolist()},
        }
    ],
}


def measured(name, kind, time, current, role, celsius=25.0):
    truth = TRUTH if celsius == 25.0 else COLD_TRUTH
    passed = np.append(0.0, np.cumsum((current[1:] + current[:-1]) / 2 * np.diff(time)))
    soc = 1.0 + passed / 3600.0 / CAPACITY
    volt = run(truth, time, current, soc, celsius, capacity_ampere_hour=CAPACITY).voltage_volt
    volt = volt + np.random.default_rng(5).normal(0.0, 2e-4, len(time))
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
    series |= {
        "charge_ampere_hour": passed / 3600.0,
        "surface_temperature_celsius": time * 0 + celsius,
    }
    return measured_test(series, name, kind, celsius=celsius, soc=1.0, role=role)


def pulses():
    cycle = np.zeros(2000)
    cycle[:300], cycle[1200:1230], cycle[1500:1530], cycle[1800:1830] = -3.0, -6.0, 3.0, -1.0
    current = np.concatenate([np.zeros(60), np.tile(cycle, 9)])
    return measured("hppc", "hppc", np.arange(0.0, len(current)), current, "fit")


def drive():
    random = np.random.default_rng(3)
    current = np.repeat(np.clip(random.normal(-1.5, 2.5, 500), -8.0, 4.0), 6)
    return measured("drive", "drive", np.arange(0.0, len(current)), current, "validation")


def cold_load(name="cold_1C", ampere=-3.0):
    current = np.append(np.zeros(10), np.full(320, ampere))
    return measured(name, "capacity", np.arange(330) * 10.0, current, "fit", celsius=0.0)


@pytest.fixture(scope="module")
def model():
    found = cw.identify(CELL, BASIS, [pulses()], members=("1RC", "2RC", "P"))
    return cw.finish_model(CELL, found, BASIS, [pulses()])


def test_it_is_in_use_and_a_circuit_is_chosen_for_tables(model):
    content = model.content
    assert in_use(content) == "P"
    assert member_of(content)["model"] == content["chosen"] == "2RC"
    by_model = {row["model"]: row for row in model.choice}
    assert by_model["P"]["chosen"]
    assert not by_model["2RC"]["chosen"]
    assert by_model["2RC"]["code"] == "serves_tables"
    assert {row["parameter"] for row in model.parameters if row["model"] == "P"} >= {"transfer_ohm"}


def test_an_unseen_drive_is_scored_and_simulated_with_it(model):
    test = drive()
    record = cw.held_out(model, test.series, test.facts, CELL)
    scored = {row["model"]: row for row in cw.validate(*record).rows}
    assert scored["P"]["chosen"]
    assert scored["P"]["rmse_volt"] < 0.5 * scored["2RC"]["rmse_volt"]
    # What predicts and what serves tables state how far they may be off, each against the other.
    std = {name: scored[name]["voltage_std_volt"] for name in ("P", "2RC")}
    assert 0.5 * scored["P"]["rmse_volt"] < std["P"] < 0.5 * std["2RC"]
    assert 0.5 < std["2RC"] / scored["2RC"]["rmse_volt"] < 2.0
    assert 0.82 < scored["P"]["share_within_90_fitted"] < 0.97
    assert np.isnan(scored["1RC"]["share_within_90"])
    columns = {name: test.series[name] for name in ("test_time_second", "current_ampere")}
    simulated = cw.simulate(model, columns, initial_soc=1.0)
    assert simulated.member == "P"
    off = simulated.columns["voltage_volt"] - test.series["voltage_volt"]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(scored["P"]["rmse_volt"], rel=0.2)


def test_a_load_at_a_temperature_without_pulses_is_fitted_by_the_particle_alone(model):
    """It tells energies that pulses at one temperature do not, and no table over SoC."""
    found = cw.identify(CELL, BASIS, [pulses(), cold_load()], members=("1RC", "2RC", "P"))
    assert found.content["particle"]["beside"] == ["cold_1C"]
    assert found.content["particle"]["celsius"] == [0.0, 25.0]
    assert [entry["ambient_temperature_celsius"] for entry in found.content["ocv"]] == [25.0]
    (note,) = [note for note in found.notes if "cold_1C" in note and "fitted to" in note]
    assert "loads at temperatures without pulses" in note
    cold = cold_load("cold_C2", -1.5)
    columns = {name: cold.series[name] for name in ("test_time_second", "current_ampere")}
    settings = {"member": "P", "initial_soc": 1.0, "temperature_celsius": 0.0}
    both = (cw.simulate(one, columns, **settings) for one in (model, found))
    without, beside = (
        rms(one.columns["voltage_volt"] - cold.series["voltage_volt"]) for one in both
    )
    assert beside < 0.5 * without
    # A plan of the next tests starts from what it told as well.
    tests = [pulses(), cold_load()]
    known = knowledge_from_model(found.content, BASIS, CELL, tests, split_rest_second=120.0)
    assert known.precision.shape == (len(known.particle.vector),) * 2


def test_its_export_says_what_holds_it_and_what_does_not(model):
    found = cw.export_model(model)
    assert found.pybamm["exported"] == "P"
    assert "the table over temperature holds 2RC: P is no circuit" in " ".join(found.notes)


def test_a_particle_alone_is_refused():
    with pytest.raises(Refusal, match="members P: wanted a circuit too, for filters and packs"):
        cw.identify(CELL, BASIS, [pulses()], members=("P",))


def test_loads_unlike_all_that_were_fitted_are_held_by_the_posterior(model):
    test, content = drive(), model.content
    record = cw.held_out(model, test.series, test.facts, CELL)
    without = content | {"particle": content["particle"] | {"posterior": None}}
    narrow = {row["model"]: row for row in cw.validate(without, record[1]).rows}["P"]
    wide = {row["model"]: row for row in cw.validate(*record).rows}["P"]
    # Pulses of one pattern do not tell what steps of six seconds ask for.
    assert narrow["share_within_90_fitted"] < 0.7 < wide["share_within_90_fitted"]
    broken = content["particle"]["posterior"][:-1]
    of_another = content | {"particle": content["particle"] | {"posterior": broken}}
    with pytest.raises(Refusal, match=f"posterior has {len(broken)} rows; wanted"):
        cw.validate(of_another, record[1])
