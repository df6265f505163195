"""Circuits in lmfit: same optimum and errors as our own fit; fix, tie, add; bounds flagged."""

import numpy as np
import pytest
from pulse_train import CURRENT, TIME, fitted, noisy

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import Branch, rc_circuit
from cellwright.refusal import Refusal
from pulse_methods.with_lmfit import (
    circuit_with,
    fit_by_lmfit,
    lmfit_parameters,
)

START = rc_circuit(0.03, [0.005, 0.03], [1.0, 80.0])
HOLD = {"hold": "zero_order"}
RECORD = TIME, CURRENT, noisy(1), 3.7
# Order of the parameters of fit.py in lmfit's.
ORDER = ["r_ohm_0", "r_ohm_1", "r_ohm_2", "tau_second_1", "tau_second_2"]


def by_name(fit, what):
    return np.array([dict(zip(fit.names, what, strict=True))[name] for name in ORDER])


def test_same_optimum_and_errors_as_our_own_fit():
    by_lmfit, own = fit_by_lmfit(START, lmfit_parameters(START), RECORD, **HOLD), fitted(RECORD[2])
    assert (np.abs(by_name(by_lmfit, by_lmfit.values) - own.values) < 0.01 * own.std).all()
    np.testing.assert_allclose(by_name(by_lmfit, by_lmfit.std), own.std, rtol=1e-3)
    errors = [by_lmfit.result.params[name].stderr for name in ORDER]
    np.testing.assert_allclose(errors, own.std, rtol=1e-3)
    assert by_lmfit.rmse_volt == pytest.approx(own.rmse_volt, rel=1e-9)
    run = simulate(by_lmfit.circuit, TIME, CURRENT, 3.7, **HOLD)
    assert np.sqrt(np.mean((run - RECORD[2]) ** 2)) == pytest.approx(by_lmfit.rmse_volt)


def test_a_fixed_parameter_stays():
    parameters = lmfit_parameters(START)
    parameters["tau_second_1"].set(value=3.0, vary=False)
    by_lmfit = fit_by_lmfit(START, parameters, RECORD, **HOLD)
    assert "tau_second_1" not in by_lmfit.names
    assert by_lmfit.circuit[1].parameters["tau_second"] == 3.0


def test_a_tied_parameter_follows_its_expression_and_one_may_be_added():
    """tau1 = r1·c1: the thesis' own parameters, with the error of c1."""
    parameters = lmfit_parameters(START)
    parameters.add("c_farad_1", value=500.0, min=0)
    parameters["tau_second_1"].expr = "r_ohm_1*c_farad_1"
    parameters["ocv_offset_volt"].vary = True
    by_lmfit = fit_by_lmfit(START, parameters, RECORD, **HOLD)
    values = dict(zip(by_lmfit.names, by_lmfit.values, strict=True))
    own = fitted(RECORD[2])
    tau = pytest.approx(own.values[3], abs=own.std[3])
    assert values["c_farad_1"] * values["r_ohm_1"] == tau
    assert values["ocv_offset_volt"] == pytest.approx(0.0, abs=1e-4)
    assert by_lmfit.result.nfev < 40


def test_a_parameter_at_a_bound_has_no_error():
    parameters = lmfit_parameters(START)
    parameters["r_ohm_1"].max = 0.008
    by_lmfit = fit_by_lmfit(START, parameters, RECORD, **HOLD)
    assert by_lmfit.at_bound == ("r_ohm_1",)
    assert np.isnan(by_name(by_lmfit, by_lmfit.std)[1])
    assert np.isfinite(np.delete(by_name(by_lmfit, by_lmfit.std), 1)).all()
    own = fitted(RECORD[2], bounds={"r1_ohm": (0, 0.008)})
    np.testing.assert_allclose(by_name(by_lmfit, by_lmfit.values), own.values, rtol=1e-3)


def test_a_circuit_that_is_not_of_rc_pairs():
    """Kinetics and hysteresis, which our own fit does not know."""
    true = (
        Branch("R", {"r_ohm": 0.02}),
        Branch("kinetic", {"r_ohm": 0.05, "tau_second": 3.0, "scale_volt": 0.05}),
        Branch("hysteresis", {"m_volt": 0.01, "charge_ampere_hour": 0.05}),
    )
    volt = simulate(true, TIME, CURRENT, 3.7, **HOLD)
    parameters = lmfit_parameters(true)
    for name in ("r_ohm_0", "r_ohm_1", "tau_second_1", "m_volt_2"):
        parameters[name].value *= 1.4
    parameters["scale_volt_1"].vary = False
    by_lmfit = fit_by_lmfit(true, parameters, (TIME, CURRENT, volt, 3.7), **HOLD)
    assert by_lmfit.rmse_volt < 1e-7
    for one, other in zip(by_lmfit.circuit, true, strict=True):
        assert one.parameters == pytest.approx(other.parameters, rel=1e-3)


def test_circuit_with_puts_values_back():
    assert circuit_with(START, lmfit_parameters(START)) == START


def test_refusals():
    with pytest.raises(Refusal, match="varies by sample"):
        lmfit_parameters((Branch("R", {"r_ohm": np.ones(3)}),))
    with pytest.raises(Refusal, match="voltage has shape"):
        fit_by_lmfit(START, lmfit_parameters(START), (TIME, CURRENT, TIME[1:], 3.7), **HOLD)
    parameters = lmfit_parameters(START)
    for parameter in parameters.values():
        parameter.vary = False
    with pytest.raises(Refusal, match="no parameter varies"):
        fit_by_lmfit(START, parameters, RECORD, **HOLD)
