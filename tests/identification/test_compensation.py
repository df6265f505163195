"""Temperatures left out: what is taken away, what is predicted, what the model says of it."""

import copy

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test

from cellwright.circuits.temperature import (
    fitted_law,
    laws_over_temperature,
    resistance_factor,
)
from cellwright.identification.cell import identify
from cellwright.identification.compensation import predicted, with_laws, without
from cellwright.refusal import Refusal

CELL = cell_facts()
KNOWN = np.array([-20.0, 0.0, 25.0, 45.0])
# Of R0 and both pairs, as cells usually have them: with others the law leans towards these.
ENERGIES = np.array([[12e3], [30e3], [30e3]])


def a_test(series, celsius, role="fit", name=None, soc=0.95):
    name = name or f"drive_{celsius:g}"
    return measured_test(series, name, celsius=celsius, soc=soc, role=role)


def record(celsius, seed=1, curved=0.0):
    """A drive of the true cell whose resistances follow an Arrhenius law, bent by `curved`."""
    rng = np.random.default_rng(seed)
    time, current = truth.drive(rng, seconds=4500)
    soc = truth.soc_of(time, current, 0.95)
    scale = resistance_factor(celsius, 25.0, ENERGIES) * np.exp(
        curved * ((celsius - 25.0) / 20.0) ** 2
    )
    volt = truth.voltage(time, current, soc, resistance_factor=scale) + 3e-4 * rng.standard_normal(
        len(time)
    )
    charge = (soc - soc[0]) * truth.CAPACITY_AMPERE_HOUR
    names = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")
    return dict(zip(names, (time, current, volt, charge), strict=True))


def basis(*celsius):
    curve = {"test": "ocv", "soc": truth.OCV_SOC.tolist(), "ocv_volt": truth.OCV_VOLT.tolist()}
    curves = [curve | {"branches": "both", "ambient_temperature_celsius": t} for t in celsius]
    return {"capacity_ampere_hour": 2.0, "borrowed_from": None, "ocv": curves}


def model_of(basis, tests):
    return identify(CELL, basis, tests, members=["2RC"], split_rest_second=120.0).content


@pytest.fixture(scope="module")
def arrhenius():
    """Tests at four temperatures, the model of all, and those without each."""
    tests = [a_test(record(t, seed=n), t) for n, t in enumerate(KNOWN)]
    whole = model_of(basis(25.0), tests)
    return tests, whole, {t: model_of(*without(basis(25.0), tests, celsius=t)) for t in KNOWN}


def test_tests_and_ocv_of_a_temperature_go_and_the_last_ocv_stays():
    tests = [a_test({}, t) for t in (0.0, 1.5, 25.0)]
    left_basis, left_tests = without(basis(0.0, 25.0), tests, celsius=0.0)
    assert [t.facts.ambient_temperature_celsius for t in left_tests] == [25.0]
    assert [c["ambient_temperature_celsius"] for c in left_basis["ocv"]] == [25.0]
    assert len(without(basis(0.0), tests, celsius=0.0)[0]["ocv"]) == 1
    with pytest.raises(Refusal, match="no test is left without those at 25 °C"):
        without(basis(25.0), tests[2:], celsius=25.0)


@pytest.mark.slow
def test_an_arrhenius_cell_is_predicted_where_it_was_left_out(arrhenius):
    tests, whole, reduced = arrhenius
    rows, notes = predicted(whole, reduced, CELL, tests, split_rest_second=120.0)
    assert not notes
    assert [row["left_out_celsius"] for row in rows] == KNOWN.tolist()
    assert [row["beyond"] for row in rows] == [True, False, False, True]
    assert all(row["ratio"] < 2.0 for row in rows), [row["ratio"] for row in rows]
    assert rows[0]["extrapolated"] == 1.0


def test_what_takes_no_part_in_fits_is_scored_only_as_proof(arrhenius):
    _, whole, reduced = arrhenius
    unseen = [a_test(record(0.0, seed=9), 0.0, "validation", "unseen")]
    settings = {"proof": True, "split_rest_second": 120.0}
    (row,), _ = predicted(whole, reduced, CELL, unseen, **settings)
    assert row["predicted_test"] == "unseen"
    assert row["own_rmse_volt"] < row["rmse_volt"] < 1e-3


def test_halves_of_a_split_record_are_scored_apart(arrhenius):
    _, whole, reduced = arrhenius
    spoiled = record(0.0, seed=1)
    spoiled["voltage_volt"][1600:2900] += 0.02  # the second block, which proves
    test = [a_test(spoiled, 0.0, "split")]
    settings = {"split_rest_second": 120.0}
    fit, proof = (
        predicted(whole, reduced, CELL, test, proof=proof, **settings)[0][0]["rmse_volt"]
        for proof in (False, True)
    )
    assert fit < 0.001
    assert proof > 0.01


def test_a_test_whose_soc_cannot_be_known_is_named(arrhenius):
    tests, whole, reduced = arrhenius
    series = copy.deepcopy(tests[1].series)
    series["current_ampere"][:] = -1.0
    series["charge_ampere_hour"][:] = np.nan
    unknown = a_test(series, 0.0, soc=None)
    rows, notes = predicted(whole, reduced, CELL, [unknown], split_rest_second=120.0)
    assert not rows
    assert "not predicted: drive_0" in notes[0]


def test_a_model_says_its_laws_and_how_it_errs_where_a_temperature_was_left_out(arrhenius):
    model = arrhenius[1]
    rows = [
        {"left_out_celsius": celsius, "beyond": celsius < 0.0, "model": "2RC"}
        | {"rmse_volt_soc_5_95": volt, "own_rmse_volt_soc_5_95": 1e-3}
        for celsius, volt in ((0.0, 3e-3), (0.0, 4e-3), (-20.0, 9e-3))
    ]
    # A test without rows at SoC 5 to 95 % tells nothing, and spoils nothing.
    empty = {"rmse_volt_soc_5_95": np.nan, "own_rmse_volt_soc_5_95": np.nan}
    stated = with_laws(model, [*rows, rows[0] | empty])
    assert "9 and 1 mV at -20 °C, 3.5 and 1 mV at 0 °C" in stated["notes"][-1]
    assert [one["ambient_temperature_celsius"] for one in stated["left_out_temperatures"]] == [
        -20,
        0,
    ]
    laws = laws_over_temperature(model["members"][0]["conditions"])
    (member,) = stated["members"]
    assert [one["cold_joule_per_mole"] for one in member["laws_over_temperature"]] == [
        law.cold_joule_per_mole for law in laws
    ]
    found = {law.kinds[0]: law.warm_joule_per_mole for law in laws}
    expected = {"relaxing": ENERGIES[1, 0], "ohmic": ENERGIES[0, 0]}
    assert found == pytest.approx(expected, abs=2e3)


def test_where_energies_are_unusual_the_law_leans_towards_usual_ones_and_its_deviation_says_so():
    celsius, energy = np.array([0.0, 25.0, 45.0]), 35e3  # of R0, which in most cells is flatter
    law = fitted_law(("ohmic",), celsius, np.log(resistance_factor(celsius, 25.0, energy)))
    ends = (
        (law.cold_joule_per_mole, law.cold_std_joule_per_mole),
        (
            law.warm_joule_per_mole,
            law.warm_std_joule_per_mole,
        ),
    )
    for found, std in ends:
        assert 0.7 * energy < found < energy
        assert energy - found < 2.0 * std


def test_a_model_that_left_nothing_out_says_nothing_of_it(arrhenius):
    model = arrhenius[1]
    assert not with_laws(model)["left_out_temperatures"]
