"""Circuits in lmfit: same optimum and errors as our own fit; fix, tie, add; bounds flagged."""

import re
from pathlib import Path

import numpy as np
import pytest
from pulse_train import CURRENT, TIME, fitted, noisy

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import Branch, rc_circuit
from cellwright.refusal import Refusal
from pulse_methods.with_lmfit import (
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


def test_the_block_of_the_page_runs_as_printed():
    page = (Path(__file__).resolve().parents[2] / "methods.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```python\n(.*?)^```", page, re.M | re.S)
    names = {"time_second": TIME, "current_ampere": CURRENT, "voltage_volt": noisy(1)}
    exec(compile(block, "lab/methods.md", "exec"), names)
    assert names["fit"].rmse_volt == pytest.approx(fitted(noisy(1)).rmse_volt, rel=1e-3)


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
