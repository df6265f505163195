"""A member as tables over SoC: the same voltages as the simulator, for every kind of branch."""

import numpy as np
import pytest
import truth
from truth import VALUES, stated, with_branch

from cellwright.circuits.cell import overpotentials
from cellwright.circuits.circuit import KINDS
from cellwright.filters.bank import (
    BEYOND,
    NODES,
    UNSEEN,
    _model_errors,
    bank_of,
    drives,
    hysteresis_of,
    resistance_factor_of,
)
from cellwright.filters.plant import Noise, levels_of_plant, plant_of
from cellwright.refusal import Refusal


def test_tables_are_the_models_own_values():
    bank = bank_of(stated(), None, 25.0)
    inside = (bank.soc > -1e-9) & (bank.soc < 1 + 1e-9)
    assert bank.soc[[0, -1]] == pytest.approx([-BEYOND, 1 + BEYOND])
    np.testing.assert_allclose(bank.ocv_volt[inside][::2], truth.OCV_VOLT, atol=1e-12)
    np.testing.assert_allclose(
        [np.interp(truth.KNOTS, bank.soc, e.gain) for e in bank.elements],
        [truth.R0, *truth.R],
        rtol=1e-9,
    )
    assert [lag.constant[0] for _, lag in bank.lags] == pytest.approx(truth.TAU)
    assert [e.direct for e in bank.elements] == [1.0, 0.0, 0.0]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_branch_is_made_of_gains_or_drives(kind):
    """Shares add up, and what acts at once is what the simulator gives in a step of no length."""
    bank = bank_of(with_branch(kind), None, 25.0)
    last = len(bank.elements) - 1
    element = bank.elements[last]
    shares = sum(lag.share for element, lag in bank.lags if element == last)
    assert element.direct + shares == pytest.approx(1.0)
    current = np.array([1.5, -2.0, 0.0, 3.0])
    kind_of = KINDS[kind]
    expected = kind_of.drive(current, **{name: VALUES[name] for name in kind_of.parameters})
    result = (
        element.gain[0] * current
        if element.gain is not None
        else drives(element, current)[len(NODES) // 2]
    )
    np.testing.assert_allclose(result, expected, atol=1e-15)


def test_error_lies_between_the_temperatures():
    model = stated()
    cold = model["members"][0]["conditions"][0] | {
        "ambient_temperature_celsius": 5.0,
        "fit_rmse_volt": 0.03,
    }
    model["members"][0]["conditions"].append(cold)
    assert level(bank_of(model, None, 15.0)) == pytest.approx(UNSEEN * 0.02)
    assert level(bank_of(model, None, -20.0)) == pytest.approx(UNSEEN * 0.03)
    model["members"][0]["left_out_rmse_volt"] = 3.0 * np.sqrt((0.01**2 + 0.03**2) / 2)
    assert level(bank_of(model, None, 15.0)) == pytest.approx(3.0 * 0.02)


def test_a_condition_without_a_temperature_holds_at_25_degrees():
    """Between one of 0 °C and it the error is interpolated; a blank is not 0 °C."""
    model = stated()
    (warm,) = model["members"][0]["conditions"]
    cold = warm | {"ambient_temperature_celsius": 0.0, "fit_rmse_volt": 0.03}
    blank = warm | {"ambient_temperature_celsius": None}
    levels = []
    for known in (warm, blank):
        model["members"][0]["conditions"] = [cold, known]
        errors = _model_errors(model, model["members"][0], 20.0, np.ones(1), 1.0)
        levels.append((errors["error_volt"][0], errors["load_error_volt"]))
    assert levels[0] == pytest.approx(levels[1])


def test_errors_are_those_of_the_interval_and_grow_with_the_load():
    model = stated() | {"intervals": [interval("2RC", [2e-3, 0.2, 0.3, 0.02])]}
    bank = bank_of(model, None, 25.0)
    inner = np.abs(bank.soc - 0.5) < 0.3
    slope = np.gradient(bank.ocv_volt, bank.soc)[inner]
    # Beside the interval, no SoC is better than the 0.3 % that a row's is stated with.
    expected = np.hypot((2e-3 + 0.02 * slope) / 1.645, 0.003 * slope)
    np.testing.assert_allclose(bank.error_volt[inner], expected, rtol=0.02)
    time, current = np.arange(200.0), 3.0 * np.sin(np.arange(200.0))
    slow = []
    for times in (1.0, 2.0):
        plant = plant_of(bank, time, times * current, 3.6 + 0.0 * time, UNLEARNT, hold="zero_order")
        levels = levels_of_plant(bank, plant)
        at_once = levels[0]
        expected = (0.2 * at_once + 0.3 * (levels.sum() - at_once)) / 1.645
        slow.append(np.sqrt(plant.slow_variance))
        assert slow[-1] == pytest.approx(expected, rel=1e-3)
    assert slow[1] == pytest.approx(2.0 * slow[0])
    # Of another member nothing is stated: as without.
    other = stated() | {"intervals": [interval("DRT", [2e-3, 0.2, 0.3, 0.02])]}
    assert level(bank_of(other, None, 25.0)) == level(bank_of(stated(), None, 25.0))
    # A model file of before has an interval, but no shares of a circuit alone: as without.
    before = stated() | {"intervals": [{"model": "2RC", "start_soc_std": 0.0}]}
    assert level(bank_of(before, None, 25.0)) == level(bank_of(stated(), None, 25.0))


def interval(name, alone):
    return {"model": name, "alone": alone, "start_soc_std": 0.0}


UNLEARNT = Noise(steady_error=0.0)


def level(bank):
    """RMS of the stated error where the model was identified, at rest and under load."""
    return np.hypot(np.sqrt(np.mean(bank.error_volt[~bank.outside] ** 2)), bank.load_error_volt)


def test_error_goes_with_the_slope_of_the_ocv():
    bank = bank_of(stated(), None, 25.0)
    inner = np.abs(bank.soc - 0.5) < 0.3
    slope = np.gradient(bank.ocv_volt, bank.soc)[inner]
    np.testing.assert_allclose(
        bank.error_volt[inner] / slope, bank.error_volt[inner][0] / slope[0], rtol=0.02
    )


@pytest.mark.parametrize("kind", ["kinetic", "RC", "diffusion", "hysteresis"])
def test_a_branch_that_was_not_found_costs_no_state(kind):
    model = with_branch(kind)
    lost = model["members"][0]["conditions"][0]["branches"][-1]
    size = (
        "m_volt" if kind == "hysteresis" else "soc_per_ampere" if kind == "diffusion" else "r_ohm"
    )
    lost[size] = [0.0] * len(truth.KNOTS)
    assert len(bank_of(model, None, 25.0).elements) == len(bank_of(stated(), None, 25.0).elements)


def test_hysteresis_is_what_all_branches_hold_a_rest_off_the_ocv_by():
    with_hysteresis, without = (bank_of(with_branch(k), None, 25.0) for k in ("hysteresis", "RC"))
    np.testing.assert_allclose(hysteresis_of(with_hysteresis), VALUES["m_volt"])
    np.testing.assert_array_equal(hysteresis_of(without), 0.0)


def test_kinetics_out_of_reach_are_a_resistance():
    model = with_branch("kinetic")
    model["members"][0]["conditions"][0]["branches"][-1]["scale_volt"] = [1e3] * len(truth.KNOTS)
    assert bank_of(model, None, 25.0).elements[-1].gain == pytest.approx(VALUES["r_ohm"])


def test_a_stretched_table_is_read_as_the_simulator_reads_it():
    """A diffusion's offset is one on the table: its slope over SoC is taken into the gain."""
    model = with_branch("diffusion")
    model["members"][0]["conditions"][0]["ocv_scale"] = {"missing": 0.01, "stretch": 0.08}
    bank, plain = bank_of(model, None, 25.0), bank_of(with_branch("diffusion"), None, 25.0)
    inner = np.abs(bank.soc - 0.5) < 0.3
    on_table = np.interp(0.99 - (1 - bank.soc[inner]) * 1.08, truth.OCV_SOC, truth.OCV_VOLT)
    np.testing.assert_allclose(bank.ocv_volt[inner], on_table, atol=1e-5)
    np.testing.assert_allclose(1.08 * bank.elements[-1].gain, plain.elements[-1].gain)


def test_the_factor_is_of_the_models_own_resistance_along_the_course():
    model = stated()
    cold = truth.model(celsius=0.0, scale=2.0)["members"][0]["conditions"][0]
    model["members"][0]["conditions"].append(cold | {"fit_rmse_volt": 0.01})
    factor = resistance_factor_of(model, None, np.array([0.0, 25.0, 12.0]), 25.0)
    assert factor[:2] == pytest.approx([2.0, 1.0])
    assert 1.3 < factor[2] < 1.6
    # Tested at one temperature: as cells usually are, unless the model states how.
    one = stated()
    usual = resistance_factor_of(one, None, np.array([0.0, 40.0]), 25.0)
    assert usual[0] > 1.5 > 1.0 > usual[1]
    one["members"][0]["conditions"][0]["activation_energy_joule_per_mole"] = 0.0
    np.testing.assert_allclose(resistance_factor_of(one, None, np.array([0.0, 40.0]), 25.0), 1.0)


def test_overpotential_of_the_bank_is_that_of_the_simulator():
    time, current = truth.drive(np.random.default_rng(1), 3000)
    soc = truth.soc_of(time, current, 0.9)
    bank = bank_of(stated(), None, 25.0)
    at = [np.interp(soc, bank.soc, e.gain) for e in bank.elements]
    expected = [np.interp(soc, truth.KNOTS, values) for values in (truth.R0, *truth.R)]
    circuit = truth_circuit(at), truth_circuit(expected)
    runs = [overpotentials(c, time, current, hold="first_order") for c in circuit]
    np.testing.assert_allclose(*runs, atol=1e-5)


def truth_circuit(at):
    from cellwright.circuits.circuit import rc_circuit

    return rc_circuit(at[0], at[1:], truth.TAU)


def test_a_model_that_hides_its_error_is_refused():
    with pytest.raises(Refusal, match="does not say how well it fits"):
        bank_of(truth.model(), None, 25.0)
