"""A member as tables over SoC: the same voltages as the simulator, for every kind of branch."""

import numpy as np
import pytest
import truth

from cellwright.models.bank import BEYOND, NODES, bank_of, drives
from cellwright.models.circuit import KINDS
from cellwright.models.simulate import overpotentials
from cellwright.refusal import Refusal

VALUES = {
    "r_ohm": 0.02,
    "tau_second": 40.0,
    "r_charge_ohm": 0.02,
    "r_discharge_ohm": 0.03,
    "scale_volt": 0.05,
    "m_volt": 0.01,
    "charge_ampere_hour": 0.1,
    "soc_per_ampere": 0.004,
}


def stated(**changes):
    """The true cell's model, which says how well it fits."""
    model = truth.model(**changes)
    for entry in model["members"][0]["conditions"]:
        entry["fit_rmse_volt"] = 0.01
    return model


def with_branch(kind):
    """The true cell with one further branch of a kind."""
    model = stated()
    knots = len(truth.KNOTS)
    more = {name: [VALUES[name]] * knots for name in KINDS[kind].parameters}
    model["members"][0]["conditions"][0]["branches"].append({"kind": kind} | more)
    return model


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
    assert [lag.constant[0] for lag in bank.lags] == pytest.approx(truth.TAU)
    assert [e.direct for e in bank.elements] == [1.0, 0.0, 0.0]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_branch_is_made_of_gains_or_drives(kind):
    """Shares add up, and what acts at once is what the simulator gives in a step of no length."""
    bank = bank_of(with_branch(kind), None, 25.0)
    last = len(bank.elements) - 1
    element = bank.elements[last]
    shares = sum(lag.share for lag in bank.lags if lag.element == last)
    assert element.direct + shares == pytest.approx(1.0)
    current = np.array([1.5, -2.0, 0.0, 3.0])
    kind_of = KINDS[kind]
    expected = kind_of.drive(current, **{name: VALUES[name] for name in kind_of.parameters})
    found = (
        element.gain[0] * current
        if element.gain is not None
        else drives(element, current)[:, len(NODES) // 2]
    )
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_error_lies_between_the_temperatures():
    model = stated()
    cold = model["members"][0]["conditions"][0] | {
        "ambient_temperature_celsius": 5.0,
        "fit_rmse_volt": 0.03,
    }
    model["members"][0]["conditions"].append(cold)
    assert bank_of(model, None, 15.0).error_volt[0] == pytest.approx(0.02)
    assert bank_of(model, None, -20.0).error_volt[0] == pytest.approx(0.03)


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
    from cellwright.models.circuit import rc_circuit

    return rc_circuit(at[0], at[1:], truth.TAU)


def test_a_model_that_hides_its_error_is_refused():
    with pytest.raises(Refusal, match="does not say how well it fits"):
        bank_of(truth.model(), None, 25.0)
