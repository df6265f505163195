"""Identified conditions as entries of a model file, the choice between members, OCV correction."""

import numpy as np

from cellwright.refusal import Refusal


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
    knots = len(condition.soc)
    branches = zip(
        condition.r_ohm,
        condition.r_std_ohm,
        condition.tau_second,
        condition.tau_std_second,
        strict=True,
    )
    return {
        "ambient_temperature_celsius": _plain(ambient_temperature_celsius),
        "soc": _plain(condition.soc),
        "r0_ohm": _plain(condition.r0_ohm),
        "r0_std_ohm": _plain(condition.r0_std_ohm),
        "branches": [
            {
                "r_ohm": _plain(r),
                "r_std_ohm": _plain(r_std),
                "tau_second": _plain(np.full(knots, tau)),
                "tau_std_second": _plain(np.full(knots, tau_std)),
            }
            for r, r_std, tau, tau_std in branches
        ],
        "ocv_shift_volt": _plain(condition.ocv_shift_volt),
        "at_bound": list(condition.at_bound),
        "fit_rmse_volt": condition.fit_rmse_volt,
        "samples": condition.samples,
        "bic": condition.bic,
        "tests": list(tests),
    }


def select(members):
    """Name of the member with the smallest sum of BIC over its conditions.

    Parameters
    ----------
    members : sequence of {"model": name, "conditions": [entry, …]} fitted to the same data.

    Returns
    -------
    name : str.

    Raises
    ------
    Refusal : members that were not fitted to the same conditions cannot be compared.
    """
    sizes = {tuple(c["samples"] for c in member["conditions"]) for member in members}
    if len(sizes) != 1:
        raise Refusal("members of the model were not fitted to the same samples")
    scores = {m["model"]: sum(c["bic"] for c in m["conditions"]) for m in members}
    return min(scores, key=scores.get)


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
    total = condition.r0_ohm + condition.r_ohm.sum(axis=0)
    return slow_volt - current_ampere * np.interp(soc, condition.soc, total)


def _plain(values):
    if values is None or np.ndim(values) == 0:
        return None if values is None or np.isnan(values) else float(values)
    return [_plain(value) for value in values]
