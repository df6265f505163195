"""Resistance and open-circuit voltage of a model over SoC, in terms that compare between cells."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import (
    SMALLEST_RESISTANCE_OHM,
    circuit_at,
    member_of,
    open_circuit_volt,
)
from cellwright.records.conditions import REFERENCE_CELSIUS

KNOTS = np.append(0.02, np.round(np.arange(0.05, 1.001, 0.05), 2))
# ASSUME: What a step of current causes within 10 s is fast, what comes within ten minutes is slow.
FAST_SECOND, SLOW_SECOND = 10.0, 600.0


class Courses(NamedTuple):
    """Over `KNOTS`, at 25 °C and small currents: (k,) each.

    fast_ohm : resistance 10 s into a step of current. slow_ohm : what it grows from there to ten
    minutes. ocv_volt : open-circuit voltage.
    """

    fast_ohm: np.ndarray
    slow_ohm: np.ndarray
    ocv_volt: np.ndarray


def courses_of(model, member):
    """Courses of one member of a model.

    How a resistance is shared between R0 and the time constants depends on the sampling and on the
    fit; the response to a step of current after stated times compares between cells.

    Parameters
    ----------
    model : dict of schema cellwright-model/2. member : its name.

    Returns
    -------
    courses : Courses.

    Raises
    ------
    Refusal : the model has no such member.
    """
    sampled = circuit_at(member_of(model, member)["conditions"], KNOTS, REFERENCE_CELSIUS)
    parameters = [branch.parameters for branch in sampled.circuit]
    fast, slow = (step_ohm(parameters, second) for second in (FAST_SECOND, SLOW_SECOND))
    ocv = open_circuit_volt(model, sampled, REFERENCE_CELSIUS)
    return Courses(fast, np.maximum(slow - fast, SMALLEST_RESISTANCE_OHM), ocv)


def step_ohm(branches, second):
    """Resistance of a circuit some time into a step of current (k,) [ohm].

    Parameters
    ----------
    branches : dicts of parameters over SoC; those without r_ohm count nothing, one without
        tau_second acts at once.
    second : time since the step [s].
    """
    return sum(
        np.asarray(branch["r_ohm"], float) * risen(branch, second)
        for branch in branches
        if "r_ohm" in branch
    )


def risen(branch, second):
    """Share of a branch's final voltage some time into a step of current [1].

    Parameters
    ----------
    branch : dict of parameters; without tau_second it acts at once. second : [s].
    """
    if "tau_second" not in branch:
        return 1.0
    return 1.0 - np.exp(-second / np.asarray(branch["tau_second"], float))


def fast_share(branch):
    """Share of a branch's response within ten minutes that comes within ten seconds [1].

    Parameters
    ----------
    branch : dict of parameters, as of `risen`.
    """
    return risen(branch, FAST_SECOND) / risen(branch, SLOW_SECOND)


def full_ohm(model, second):
    """Resistance of the chosen member of a model at full, some time into a step of current [ohm].

    Parameters
    ----------
    model : dict of schema cellwright-model/2. second : time since the step [s].
    """
    sampled = circuit_at(member_of(model)["conditions"], np.ones(1), REFERENCE_CELSIUS)
    return float(step_ohm([branch.parameters for branch in sampled.circuit], second)[0])
