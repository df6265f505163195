"""Base of the search whose voltage a model gives, row by row, and its companion.

`own` : the cell's model in use, a member or the particle; what does it still lack? A companion
circuit, fitted to the given voltage, tells how that would change with an effect:

    voltage = given + companion(parameters, effects) − companion(as fitted to the given voltage)

so that without an effect, and with the parameters where they were, it is the given model. The
companion has a resistance and two RC pairs, with the courses of the chosen member over SoC and
temperature.
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.model_file import circuit_at, in_use, member_of, std_name
from cellwright.effects import base, beginning
from cellwright.effects.state import SIDES
from cellwright.identification.intervals import simulated
from cellwright.numerics.least_squares import fit
from cellwright.numerics.noise import FIRST
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

LEAST_LOG_STD, MOST_LOG_STD = 0.02, 0.3
TAU_LOG_STD = 0.1
LEAST_OHM = 1e-9
GIVEN_STD = 1e-3  # prior of the factor on (given − companion) voltage


class Given(NamedTuple):
    """Voltage that a model gives over the rows of a stack, and the courses of its resistances.

    volt : (n,) [V]. ohmic_course, slow_course : (n,) resistance at each row over its geometric mean
    of the records fitted, of what follows the current at once and of what relaxes; None: constant.
    """

    volt: np.ndarray
    ohmic_course: np.ndarray | None = None
    slow_course: np.ndarray | None = None


def own_case(prepared, model):
    """Case of what a cell's model in use lacks.

    Parameters
    ----------
    prepared : preparing.Prepared of the plain circuit. model : dict of schema cellwright-model/2.

    Returns
    -------
    case : case.Case, its stacks with the model's voltage.

    Raises
    ------
    Refusal : a model whose voltage is not finite over a record.
    """
    member = member_of(model)
    sides = [_given_by(model, member, records) for records in prepared.records]
    # One scale for both sides: the companion that is fitted on one is to hold on the other.
    means = [float(np.exp(np.log(course).mean())) for course in sides[0][1:]]
    sides = [
        Given(side.volt, *(course / mean for course, mean in zip(side[1:], means, strict=True)))
        for side in sides
    ]
    return given_case(prepared.case, *sides, log_std=_log_stds(member))


def given_case(case, fitted, judging, *, log_std=None):
    """Case of what a model lacks whose voltage is given.

    Parameters
    ----------
    case : case.Case of the plain circuit. fitted, judging : Given, over the rows of its stacks.
    log_std : standard deviations of the companion's logarithms about the given model, by name;
        None: those of a plain circuit, nothing is known of the given model's parameters.

    Returns
    -------
    case : case.Case.
    """
    stacks = [
        stack.with_courses(given.ohmic_course, given.slow_course)
        for stack, given in ((case.fit, fitted), (case.validation, judging))
    ]
    bare = case._replace(fit=stacks[0]._replace(voltage_volt=fitted.volt), validation=stacks[1])
    # The companion: resistances and time constants fitted to the given voltage. Everything else
    # stays as it was stated, so that the difference is a part of the given model.
    values = beginning.first_values(bare.cell, bare.fit)
    free = base.frees(bare.fit, values, bare.tolerance)
    problem = bare.problem((), free, bare.filters(FIRST, values))
    logs = tuple(parameter for parameter in free if parameter.name in base.LOGARITHMS)
    values = fit(problem._replace(free=logs, coupling=None), values).values
    sides = {}
    for side, stack, given in zip(SIDES, stacks, (fitted, judging), strict=True):
        starting = values | base.stated_starts(stack)
        fields = base.fields_of(case.cell, stack, starting)
        # On a steep end of the OCV a given model may err by a volt through a little charge. Rows
        # that no error of the search counts would then decide its fit.
        steep = base.steep_volt(case.cell, fields.soc, case.tolerance)
        stack = stack._replace(used=stack.used & (steep <= case.gates.steep_volt))
        sides[side] = stack._replace(template_volt=given.volt - fields.volt)
    tolerance = case.tolerance._replace(known=GIVEN_STD)
    start = values | {"known": 1.0}
    # The hold is that of the plain circuit: the given voltage was computed under its own.
    known = {"tolerance": tolerance, "start": start, "log_std": log_std, "otherwise": None}
    return case._replace(**sides, **known)


def _given_by(model, member, records):
    """Voltage of the model in use over records one after the other, and resistances of its chosen
    member [ohm]: Given."""
    volts, ohmic, slow = [], [], []
    for record in records:
        volt = simulated(model, in_use(model), record).voltage_volt
        if not np.isfinite(volt).all():
            raise Refusal(f"{record.test}: {in_use(model)} gives no finite voltage there")
        volts.append(volt)
        circuit = circuit_at(member["conditions"], record.soc, record.celsius).circuit
        ohmic.append(_summed(circuit, len(record.soc), at_once=True))
        slow.append(_summed(circuit, len(record.soc), at_once=False))
    return Given(*(np.concatenate(parts) for parts in (volts, ohmic, slow)))


def _summed(circuit, rows, *, at_once):
    """Sum of the resistances of the branches that follow the current at once, or of the others."""
    parts = [
        branch.parameters["r_ohm"]
        for branch in circuit
        if "r_ohm" in branch.parameters and ("tau_second" not in branch.parameters) == at_once
    ]
    return np.maximum(np.sum(parts, axis=0), LEAST_OHM) if parts else np.ones(rows)


def _log_stds(member):
    """Standard deviations of the logarithms of a member's resistances and time constants."""
    ohmic, slow = [], []
    for condition in member["conditions"]:
        ohmic.append(_relative(condition["r0_std_ohm"], condition["r0_ohm"]))
        slow += [
            _relative(branch.get(std_name("r_ohm")), branch["r_ohm"])
            for branch in condition["branches"]
            if "r_ohm" in branch
        ]
    stds = {"log_r0": _middle(ohmic), "log_r1": _middle(slow), "log_r2": _middle(slow)}
    return stds | {"log_tau1": TAU_LOG_STD, "log_tau2": TAU_LOG_STD}


def _relative(std, value):
    """Median of standard deviations over their values, NaN where none was stated."""
    pairs = zip(np.atleast_1d(std), np.atleast_1d(value), strict=False)
    stated = [s / v for s, v in pairs if s is not None and v]
    return float(np.median(stated)) if stated else np.nan


def _middle(relative):
    """Median of relative deviations within limits; the upper one where nothing was stated."""
    stated = [value for value in relative if np.isfinite(value)]
    middle = float(np.median(stated)) if stated else MOST_LOG_STD
    return float(np.clip(middle, LEAST_LOG_STD, MOST_LOG_STD))


def as_given(case, filters):
    """Error of a given model with none of its parameters freed: dict fit, validation [V].

    Over the rows that an rms error of the search counts, from the SoC as stated or counted; of
    records for proof as of those fitted.

    Parameters
    ----------
    case : case.Case of a given model. filters : case.Filters.
    """
    errors = {}
    for side in SIDES:
        stack = case.stack(side)
        volt = base.voltage(case.cell, stack, case.start | base.stated_starts(stack))
        errors[side] = rms((stack.voltage_volt - volt)[filters.rows_on(side)])
    return errors
