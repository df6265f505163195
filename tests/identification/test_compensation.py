"""Temperatures left out: laws in 1/T, what is taken away, what is predicted, which law is kept."""

import copy

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test

from cellwright.circuits.model_file import circuit_at
from cellwright.circuits.temperature import LAWS, Laws, law_weights, resistance_factor
from cellwright.identification.cell import identify
from cellwright.identification.compensation import (
    choose_laws,
    laws_kept,
    predicted,
    with_laws,
    without,
)
from cellwright.refusal import Refusal

CELL = cell_facts()
KNOWN = np.array([-20.0, 0.0, 25.0, 45.0])
ENERGY = 35e3


def a_test(series, celsius, role="fit", name=None, soc=0.95):
    name = name or f"drive_{celsius:g}"
    return measured_test(series, name, celsius=celsius, soc=soc, role=role)


def record(celsius, seed=1, curved=0.0):
    """A drive of the true cell whose resistances follow an Arrhenius law, bent by `curved`."""
    rng = np.random.default_rng(seed)
    time, current = truth.drive(rng, seconds=4500)
    soc = truth.soc_of(time, current, 0.95)
    scale = resistance_factor(celsius, 25.0, ENERGY) * np.exp(
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


@pytest.mark.parametrize("law", LAWS)
def test_a_law_meets_what_was_measured_and_its_weights_add_up(law):
    at = np.array(law_weights(KNOWN, KNOWN, Laws(law, law)))
    np.testing.assert_allclose(at, np.eye(4), atol=1e-12)
    here = np.linspace(-30.0, 60.0, 19)
    np.testing.assert_allclose(sum(law_weights(KNOWN, here, Laws(law, law))), 1.0, atol=1e-12)


@pytest.mark.parametrize(("law", "power"), [("arrhenius", 1), ("quadratic", 2)])
def test_a_law_goes_on_beyond_the_measured_range(law, power):
    value = lambda celsius: 3.0 + (2e3 / (celsius + 273.15)) ** power  # noqa: E731
    here = np.array([-35.0, -7.0, 60.0])
    mixed = sum(
        w * v for w, v in zip(law_weights(KNOWN, here, Laws(law, law)), value(KNOWN), strict=True)
    )
    np.testing.assert_allclose(mixed, value(here), rtol=1e-9)


def test_between_the_temperatures_a_line_is_the_same_as_no_law():
    here = np.array([-10.0, 12.0, 30.0])
    for one, other in zip(
        *(law_weights(KNOWN, here, Laws(law, law)) for law in LAWS[:2]), strict=True
    ):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_an_unknown_law_is_named():
    with pytest.raises(Refusal, match="'cubic' is unknown; allowed are between"):
        law_weights(KNOWN, KNOWN, Laws("cubic"))


def entry(celsius, ohmic, kinetic):
    branch = {"kind": "kinetic", "r_ohm": [kinetic], "tau_second": [0.1], "scale_volt": [0.05]}
    about = {"ambient_temperature_celsius": celsius, "soc": [0.5], "r0_ohm": [ohmic]}
    return about | {"branches": [branch]}


def test_each_kind_of_resistance_keeps_its_own_activation_energy():
    def of(celsius):
        ohms = [0.02 * resistance_factor(celsius, 25.0, energy) for energy in (12e3, 60e3)]
        return entry(celsius, *ohms)

    circuit = circuit_at([of(0.0), of(40.0)], np.array([0.5]), 20.0).circuit
    assert circuit[0].parameters["r_ohm"][0] == pytest.approx(of(20.0)["r0_ohm"][0], rel=1e-9)
    kinetic = of(20.0)["branches"][0]["r_ohm"][0]
    assert circuit[1].parameters["r_ohm"][0] == pytest.approx(kinetic, rel=1e-9)


def test_a_kind_that_is_nothing_somewhere_joins_the_others():
    sampled = circuit_at([entry(0.0, 0.04, 0.0), entry(40.0, 0.01, 0.01)], np.array([0.5]), 20.0)
    total = sum(branch.parameters["r_ohm"][0] for branch in sampled.circuit)
    assert 0.02 < total < 0.04


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
    assert len(rows) == len(KNOWN) * len(LAWS)
    by = {(row["left_out_celsius"], row["law"]): row for row in rows}
    assert [by[t, "between"]["beyond"] for t in KNOWN] == [True, False, False, True]
    assert all(by[t, "arrhenius"]["ratio"] < 1.3 for t in KNOWN[1:])
    assert by[-20.0, "arrhenius"]["extrapolated"] == 1.0
    laws, _ = choose_laws(rows)
    marked = [row | {"chosen": row["law"] == laws[row["beyond"]]} for row in rows]
    assert laws_kept(marked) == laws
    assert laws.inside != "arrhenius"  # inside it is the same as "between", which is simpler


def row(law, volt, beyond):
    return {"law": law, "rmse_volt": volt, "beyond": beyond}


def test_inner_and_outer_temperatures_choose_a_law_each():
    volts = {"between": (3e-3, 2e-3), "arrhenius": (3e-3, 5e-3), "quadratic": (1e-3, 9e-3)}
    rows = [row(name, v, out) for name, both in volts.items() for out, v in enumerate(both)]
    rows = [one | {"beyond": bool(one["beyond"])} for one in rows]
    assert choose_laws(rows)[0] == Laws("quadratic", "between")
    assert choose_laws([one for one in rows if one["beyond"]])[0] == Laws("between", "between")
    assert choose_laws(rows, beyond=("arrhenius",))[0] == Laws("quadratic", "arrhenius")


def test_beyond_the_range_another_law_may_go_on_and_meets_the_edge():
    here = np.array([-20.0, -20.001, -35.0])
    mixed = np.array(law_weights(KNOWN, here, Laws("quadratic", "arrhenius"))).T
    np.testing.assert_allclose(mixed[0], [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(mixed[1], mixed[0], atol=1e-4)
    line = law_weights(KNOWN, here[2:], Laws("arrhenius", "arrhenius"))
    np.testing.assert_allclose(mixed[2], np.ravel(line), atol=1e-12)


def test_what_takes_no_part_in_fits_is_scored_only_as_proof(arrhenius):
    _, whole, reduced = arrhenius
    unseen = [a_test(record(0.0, seed=9), 0.0, "validation", "unseen")]
    settings = {"laws": Laws(), "proof": True, "split_rest_second": 120.0}
    (row,), _ = predicted(whole, reduced, CELL, unseen, **settings)
    assert row["predicted_test"] == "unseen"
    assert row["own_rmse_volt"] < row["rmse_volt"] < 1e-3


def test_halves_of_a_split_record_are_scored_apart(arrhenius):
    _, whole, reduced = arrhenius
    spoiled = record(0.0, seed=1)
    spoiled["voltage_volt"][1600:2900] += 0.02  # the second block, which proves
    test = [a_test(spoiled, 0.0, "split")]
    settings = {"laws": Laws(), "split_rest_second": 120.0}
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
    with pytest.raises(Refusal, match="no temperature could be left out"):
        choose_laws(rows)


def test_the_law_stands_in_every_condition(arrhenius):
    model = with_laws(arrhenius[1], Laws("quadratic", "between"))
    laws = [c["resistance_laws"] for m in model["members"] for c in m["conditions"]]
    assert laws == [{"inside": "quadratic", "beyond": "between"}] * len(KNOWN)
