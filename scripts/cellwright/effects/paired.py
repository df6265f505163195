"""Paired mode: a cell compared with healthy cells of its type in the same protocol.

A circuit errs by millivolts on any cell, and on healthy cells of one type in the same protocol it
errs alike. The mean of their residuals is a template that is part of the model from the start; only
the error beyond it is searched for an effect.

Two runs of one protocol differ in time where a voltage, not a clock, ended a step. Their times are
matched at the edges of long rests; between these, time runs in proportion.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.case import STEADY_C_RATE, extra_volt_of, filters_of, problem_of, state_of
from cellwright.effects.records import LOADED_C_RATE
from cellwright.numerics.least_squares import fit
from cellwright.numerics.noise import FIRST, read_volt
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

NEXT_ROWS = np.arange(-1, 3)
STEP_C_RATE = 0.02  # between two rows, from which the current steps
FITTED = (*base.LOGARITHMS, "soc0[")  # first letters of the parameters fitted to a reference
ROLES = ("fit", "validation")


class Sameness(NamedTuple):
    """Largest differences between two runs of one protocol.

    rest_second : least length of a rest whose edges are matched. duration : relative difference of
    a stretch between two matched edges, beyond `slack_second`. c_rate : root mean square difference
    of the
    currents over `window_second` [1/h]. celsius : difference of the mean temperatures.
    covered : least share of a record's rows to which the other has a counterpart.
    """

    rest_second: float = 120.0
    duration: float = 0.08
    slack_second: float = 30.0
    c_rate: float = 0.1
    window_second: float = 600.0
    celsius: float = 2.0
    covered: float = 0.9


class Part(NamedTuple):
    """One record of a stack: its rows, their time [s], current [A] and temperature [degC]."""

    test: str
    rows: np.ndarray
    second: np.ndarray
    current_ampere: np.ndarray
    celsius: np.ndarray
    capacity_ampere_hour: float


def part(stack, test, kind, capacity_ampere_hour):
    """The record of a test out of a stack, or a Refusal where no such test is there."""
    if (test, kind) not in zip(stack.tests, stack.kinds, strict=True):
        raise Refusal(f"{test}: no such {kind} test in this role, found {', '.join(stack.tests)}")
    rows = np.flatnonzero(stack.file == stack.tests.index(test))
    taken = (stack.second[rows], stack.current_ampere[rows], stack.celsius[rows])
    return Part(test, rows, *taken, capacity_ampere_hour)


def counterpart_second(record, reference, limits=None):
    """Time in the reference's record of each row of a record of the same protocol.

    Parameters
    ----------
    record, reference : Part. limits : Sameness.

    Returns
    -------
    second : (n,) time within the reference [s]; NaN after the end of the shorter of the two.

    Raises
    ------
    Refusal : other durations, currents or temperature; with test, row and difference.
    """
    limits = limits or Sameness()
    edges, others = (
        _rest_edges(record, limits.rest_second),
        _rest_edges(reference, limits.rest_second),
    )
    count = min(len(edges), len(others))
    at, at_reference = record.second[edges[:count]], reference.second[others[:count]]
    _same_durations(record, at, at_reference, edges, limits)
    second = np.interp(record.second, at, at_reference)
    after = record.second > at[-1]
    second[after] = record.second[after] - at[-1] + at_reference[-1]
    second[second > reference.second[-1]] = np.nan
    _covers(record, second, limits)
    matched = np.flatnonzero(np.isfinite(second))
    row, difference = _nearest(record, reference, second, matched)
    _same_currents(record, matched, difference, limits)
    _same_temperature(record, reference, limits)
    steps = _steps(reference, second[matched], record.capacity_ampere_hour)
    second[matched[steps]] = reference.second[row[steps]]
    return second


def _rest_edges(record, least_second):
    """First row, and the rows at which long rests begin and end."""
    rest = np.abs(record.current_ampere) <= LOADED_C_RATE * record.capacity_ampere_hour
    edges = np.flatnonzero(np.diff(np.r_[0, rest, 0])).reshape(-1, 2)
    last, second = len(record.second) - 1, record.second
    lasting = [e for e in edges if second[min(e[1], last)] - second[e[0]] >= least_second]
    inner = {int(row) for pair in lasting for row in pair if row <= last}
    return np.array(sorted({0} | inner))


def _same_durations(record, at, at_reference, edges, limits):
    long, other = np.diff(at), np.diff(at_reference)
    allowed = np.maximum(limits.slack_second, limits.duration * long)
    wrong = np.flatnonzero(np.abs(other - long) > allowed)
    if len(wrong):
        k = wrong[0]
        raise Refusal(
            f"{record.test}: after row {edges[k]} it goes on for {long[k]:.0f} s until a rest "
            f"begins or ends, the reference for {other[k]:.0f} s; wanted a difference of at most "
            f"{allowed[k]:.0f} s"
        )


def _covers(record, second, limits):
    share = np.isfinite(second).mean()
    if share < limits.covered:
        row = int(np.flatnonzero(~np.isfinite(second))[0])
        raise Refusal(
            f"{record.test}: the reference ends where this cell is in row {row}, after "
            f"{100 * share:.0f} % of the rows; wanted {100 * limits.covered:.0f} %"
        )


def _nearest(record, reference, second, matched):
    """Row of the reference nearest in current, of those next in time, and the difference [A].

    Where the current steps, a time that is off by part of a row would compare load with rest.
    """
    spot = np.searchsorted(reference.second, second[matched], side="right") - 1
    near = np.clip(spot[:, None] + NEXT_ROWS, 0, len(reference.second) - 1)
    difference = np.abs(reference.current_ampere[near] - record.current_ampere[matched][:, None])
    return near[np.arange(len(spot)), np.argmin(difference, axis=1)], difference.min(axis=1)


def _steps(reference, second, capacity):
    """Whether the reference's current steps within the rows next to a time: (n,) bool."""
    step = np.abs(np.diff(reference.current_ampere, prepend=reference.current_ampere[0]))
    near = np.convolve(step > STEP_C_RATE * capacity, np.ones(5), "same") > 0
    return near[np.clip(np.searchsorted(reference.second, second), 0, len(near) - 1)]


def _same_currents(record, matched, difference, limits):
    window = (record.second[matched] // limits.window_second).astype(int)
    window -= window[0]
    count = np.maximum(np.bincount(window), 1)
    size = np.sqrt(np.bincount(window, difference**2) / count) / record.capacity_ampere_hour
    worst = int(np.argmax(size))
    if size[worst] > limits.c_rate:
        row = int(matched[np.argmax(window == worst)])
        raise Refusal(
            f"{record.test}: from row {row} on the current differs from the reference's by "
            f"{size[worst]:.3f} C (root mean square over {limits.window_second:g} s); wanted at "
            f"most {limits.c_rate:g} C"
        )


def _same_temperature(record, reference, limits):
    celsius = float(np.mean(record.celsius))
    at_reference = float(np.mean(reference.celsius))
    if abs(celsius - at_reference) > limits.celsius:
        raise Refusal(
            f"{record.test}: from row 0 on at {celsius:.1f} degC in the mean, the reference at "
            f"{at_reference:.1f} degC; wanted a difference of at most {limits.celsius:g} K"
        )


class Pairing(NamedTuple):
    """When and how healthy reference cells are used.

    references : least number. scale_std : of the template's factor. material_volt : an effect that
    takes less than its square off the mean square error is within what healthy cells differ by.
    needed_ratio : times the noise of a single reading, which the template must exceed. Below it
    the circuit follows healthy cells well, and the template would add no more than its own noise.
    """

    references: int = 3
    scale_std: float = 0.2
    material_volt: float = 1e-3
    needed_ratio: float = 2.0
    sameness: Sameness = Sameness()


class Paired(NamedTuple):
    """A case with the template of healthy cells.

    case : case.Case, its stacks with the template, its gates with the material voltage.
    references : names used. left_out : reasons why others were not, by name.
    template_volt, scatter_volt : by role, root mean square of the template, and of single
    references about it (most of which other resistances explain).
    read_volt : noise of a single reading of the references. needed : whether the template exceeds
    it by `Pairing.needed_ratio`; where it does not, the case is better searched alone.
    """

    case: object
    references: tuple
    left_out: dict
    template_volt: dict
    scatter_volt: dict
    read_volt: float
    needed: bool


def paired(case, references, pairing=None):
    """A case with the template of healthy cells that went through the same protocol.

    Parameters
    ----------
    case : case.Case. references : dict name → case.Case of healthy cells, same settings.
    pairing : Pairing.

    Returns
    -------
    paired : Paired; search its case as any other.

    Raises
    ------
    Refusal : too few references ran the same protocol; with test, row and difference of each other.
    """
    pairing = pairing or Pairing()
    seconds, left_out = _same(case, references, pairing)
    if len(seconds) < pairing.references:
        reasons = "".join(f"; {name}: {why}" for name, why in left_out.items())
        raise Refusal(
            f"{len(seconds)} healthy reference cells ran the same protocol, "
            f"wanted {pairing.references}{reasons}"
        )
    misfits = [_misfit_volt(references[name], times) for name, times in seconds.items()]
    rows = {role: np.stack([misfit[role] for misfit in misfits], axis=1) for role in ROLES}
    stacks = {role: _with_template(getattr(case, role), rows[role]) for role in ROLES}
    gates = case.gates._replace(material_volt=max(case.gates.material_volt, pairing.material_volt))
    with_template = case._replace(
        **stacks, gates=gates, tolerance=case.tolerance._replace(known=pairing.scale_std)
    )
    sizes = {role: rms(stacks[role].template_volt) for role in ROLES}
    spread = {role: rms(np.nan_to_num(np.std(rows[role], axis=1, ddof=1))) for role in ROLES}
    read = _read_volt(case, rows["fit"])
    needed = max(sizes.values()) >= pairing.needed_ratio * read
    return Paired(with_template, tuple(seconds), left_out, sizes, spread, read, needed)


def _with_template(stack, rows):
    """A stack with the references' mean residual; rows that one of them lacks are not compared."""
    complete = np.isfinite(rows).all(axis=1)
    template = np.where(complete, rows.mean(axis=1), 0.0)
    return stack._replace(template_volt=template, used=stack.used & complete)


def _same(case, references, pairing):
    """Times in the references that ran the same protocol, by name; reasons of the others."""
    seconds, left_out = {}, {}
    for name, reference in references.items():
        try:
            seconds[name] = _counterparts(case, reference, pairing.sameness)
        except Refusal as reason:
            left_out[name] = str(reason)
    return seconds, left_out


def _counterparts(case, reference, sameness):
    """Time of each row within the reference's record (n,) [s], by role and test."""
    capacity = case.cell.capacity_ampere_hour
    seconds = {role: {} for role in ROLES}
    for role in ROLES:
        stacks = getattr(case, role), getattr(reference, role)
        for test, kind in zip(stacks[0].tests, stacks[0].kinds, strict=True):
            parts = (part(stack, test, kind, capacity) for stack in stacks)
            seconds[role][test] = counterpart_second(*parts, sameness)
    return seconds


def _misfit_volt(reference, seconds):
    """Residual of the plain model of a reference at the times of the case's rows [V], by role."""
    for role in ROLES:  # tests that the case has not are not fitted either
        stack = getattr(reference, role)
        shared = np.isin(np.array(stack.tests)[stack.file], list(seconds[role]))
        reference = reference._replace(**{role: stack._replace(used=stack.used & shared)})
    state = plain_state(reference)
    residual = {"fit": state.solution.residual, "validation": state.validation}
    return {
        role: np.concatenate(
            [
                _at_times(getattr(reference, role), residual[role], test, second)
                for test, second in seconds[role].items()
            ]
        )
        for role in ROLES
    }


def plain_state(case):
    """The plain model fitted to a healthy reference: case.State.

    OCV and capacity stay as they were measured: fitted, they would take up part of the circuit's
    error, and the template would lack that part.
    """
    values = base.first_values(case.cell, case.fit)
    free = base.frees(case.fit, values, case.tolerance)
    filters = filters_of(case, FIRST, extra_volt_of(case, values))
    problem = problem_of(case, (), free, filters)
    fitted = tuple(parameter for parameter in free if parameter.name.startswith(FITTED))
    solution = fit(problem._replace(free=fitted, coupling=None), values)
    return state_of(case, (), solution, filters)


def _read_volt(case, residuals):
    """Noise of a single reading of the references, root mean square over them [V]."""
    steady = STEADY_C_RATE * case.cell.capacity_ampere_hour
    return rms([read_volt(np.nan_to_num(r), case.fit, steady_ampere=steady) for r in residuals.T])


def _at_times(stack, residual, test, second):
    """Residual of a test at other times, straight between rows; NaN where the time is NaN."""
    rows = stack.file == stack.tests.index(test)
    volt = np.interp(np.nan_to_num(second), stack.second[rows], residual[rows])
    return np.where(np.isfinite(second), volt, np.nan)
