"""Identified conditions as entries of a model file, and the OCV that a slow branch stands for."""

import numpy as np


def condition_entry(condition, *, ambient_temperature_celsius, tests):
    """Entry of one condition in a model file.

    Parameters
    ----------
    condition : identify.Condition.
    ambient_temperature_celsius : chamber temperature [degC], NaN or None where unknown.
    tests : ids of the tests that were fitted.

    Returns
    -------
    entry : dict of lists and numbers; NaN is written as None.
    """
    return {
        "ambient_temperature_celsius": _plain(ambient_temperature_celsius),
        "soc": _plain(condition.soc),
        "r0_ohm": _plain(condition.r0_ohm),
        "r0_std_ohm": _plain(condition.r0_std_ohm),
        "branches": [_branch(element) for element in condition.branches],
        "ocv_shift_volt": _plain(condition.ocv_shift_volt),
        "ocv_scale": {"missing": condition.missing, "stretch": condition.stretch},
        "at_bound": list(condition.at_bound),
        "fit_rmse_volt": condition.fit_rmse_volt,
        "samples": condition.samples,
        "tests": list(tests),
    }


def std_name(name):
    """Name of a parameter's standard deviation: r_ohm → r_std_ohm."""
    quantity, unit = name.split("_", 1)
    return f"{quantity}_std_{unit}"


def _branch(element):
    entry = {"kind": element.kind}
    for name, values in element.values.items():
        entry |= {name: _plain(values), std_name(name): _plain(element.stds[name])}
    return entry


def ocv_from_slow_branch(soc, slow_volt, current_ampere, condition):
    """Open-circuit voltage from one slow branch, its resistive drop put back.

    At a slow steady current every relaxation has settled, so in the linear model the drop is
    exactly I·(R0 + ΣR). Identify with the branch itself first, correct, identify again.

    Parameters
    ----------
    soc, slow_volt : (p,) the slow branch [1], [V].
    current_ampere : its current, negative on discharge [A].
    condition : identify.Condition of a first pass.

    Returns
    -------
    ocv_volt : (p,) [V].
    """
    # ASSUME: Where only one slow branch was measured, its distance from OCV is the current times
    # the sum of the model's resistances; hysteresis stays in it.
    branches = [
        element.values["r_ohm"] for element in condition.branches if "r_ohm" in element.values
    ]
    total = sum(branches, condition.r0_ohm)
    return slow_volt - current_ampere * np.interp(soc, condition.soc, total)


def _plain(values):
    if values is None or np.ndim(values) == 0:
        return None if values is None or np.isnan(values) else float(values)
    return [_plain(value) for value in values]
