"""Paired mode: what a cell's voltage has beyond that of healthy cells in the same protocol.

Clocks of two cells drift apart where a voltage, not a clock, ended a step. Both are tied at the
edges of their long rests; between these, time runs in proportion.

No circuit follows a cell to the millivolt. Healthy cells of its type that went through the same
protocol fail the circuit in the same way; the mean of what they leave is a template that is in the
model from the start, and only what is left beyond it is searched for an effect.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.case import STEADY_C_RATE, filters_of, problem_of, state_of, steep
from cellwright.effects.records import LOADED_C_RATE
from cellwright.numerics.least_squares import fit
from cellwright.numerics.noise import FIRST, read_volt
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

NEXT_ROWS = np.arange(-1, 3)
STEP_C_RATE = 0.02  # between two rows, from which the current steps


class Sameness(NamedTuple):
    """How far two runs of one protocol may differ.

    rest_second : least length of a rest that ties two clocks. duration : relative difference of a
    stretch between two ties, beyond `slack_second`. c_rate : root mean square difference of the
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
    """One record out of a stack: its rows, and what it says of them."""

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


def counterpart_second(mine, other, limits=None):
    """Time on the other's clock of each row of mine, where both ran the same protocol.

    Parameters
    ----------
    mine, other : Part. limits : Sameness.

    Returns
    -------
    second : (n,) on the other's clock [s]; NaN after the end of the shorter of the two.

    Raises
    ------
    Refusal : other durations, currents or temperature; with test, row and difference.
    """
    limits = limits or Sameness()
    ties, others = _ties(mine, limits.rest_second), _ties(other, limits.rest_second)
    count = min(len(ties), len(others))
    _same_durations(mine, mine.second[ties[:count]], other.second[others[:count]], ties, limits)
    own, its = mine.second[ties[:count]], other.second[others[:count]]
    found = np.interp(mine.second, own, its)
    after = mine.second > own[-1]
    found[after] = mine.second[after] - own[-1] + its[-1]
    found[found > other.second[-1]] = np.nan
    _covers(mine, found, limits)
    known = np.flatnonzero(np.isfinite(found))
    row, apart = _nearest(mine, other, found, known)
    _same_currents(mine, known, apart, limits)
    _same_temperature(mine, other, limits)
    steps = _steps(other, found[known], mine.capacity_ampere_hour)
    found[known[steps]] = other.second[row[steps]]
    return found


def _ties(one, least_second):
    """First row, and the rows at which long rests begin and end."""
    rest = np.abs(one.current_ampere) <= LOADED_C_RATE * one.capacity_ampere_hour
    edges = np.flatnonzero(np.diff(np.r_[0, rest, 0])).reshape(-1, 2)
    last = len(one.second) - 1
    lasting = [e for e in edges if one.second[min(e[1], last)] - one.second[e[0]] >= least_second]
    inner = {int(row) for pair in lasting for row in pair if row <= last}
    return np.array(sorted({0} | inner))


def _same_durations(mine, own, its, ties, limits):
    long, other = np.diff(own), np.diff(its)
    allowed = np.maximum(limits.slack_second, limits.duration * long)
    wrong = np.flatnonzero(np.abs(other - long) > allowed)
    if len(wrong):
        k = wrong[0]
        raise Refusal(
            f"{mine.test}: after row {ties[k]} it goes on for {long[k]:.0f} s until a rest begins "
            f"or ends, the reference for {other[k]:.0f} s; wanted a difference of at most "
            f"{allowed[k]:.0f} s"
        )


def _covers(mine, found, limits):
    share = np.isfinite(found).mean()
    if share < limits.covered:
        row = int(np.flatnonzero(~np.isfinite(found))[0])
        raise Refusal(
            f"{mine.test}: the reference ends where this cell is in row {row}, after "
            f"{100 * share:.0f} % of the rows; wanted {100 * limits.covered:.0f} %"
        )


def _nearest(mine, other, found, known):
    """Row of the other nearest in current, among those next to the counterpart in time.

    Where the current steps, a clock that is off by a part of a row would pair load with rest.
    """
    spot = np.searchsorted(other.second, found[known], side="right") - 1
    beside = np.clip(spot[:, None] + NEXT_ROWS, 0, len(other.second) - 1)
    apart = np.abs(other.current_ampere[beside] - mine.current_ampere[known][:, None])
    return beside[np.arange(len(spot)), np.argmin(apart, axis=1)], apart.min(axis=1)


def _steps(other, second, capacity):
    """Whether the other's current steps within the rows next to a time: (n,) bool."""
    step = np.abs(np.diff(other.current_ampere, prepend=other.current_ampere[0]))
    near = np.convolve(step > STEP_C_RATE * capacity, np.ones(5), "same") > 0
    return near[np.clip(np.searchsorted(other.second, second), 0, len(near) - 1)]


def _same_currents(mine, known, apart, limits):
    window = (mine.second[known] // limits.window_second).astype(int)
    window -= window[0]
    count = np.maximum(np.bincount(window), 1)
    size = np.sqrt(np.bincount(window, apart**2) / count) / mine.capacity_ampere_hour
    worst = int(np.argmax(size))
    if size[worst] > limits.c_rate:
        row = int(known[np.argmax(window == worst)])
        raise Refusal(
            f"{mine.test}: from row {row} on the current differs from the reference's by "
            f"{size[worst]:.3f} C (root mean square over {limits.window_second:g} s); wanted at "
            f"most {limits.c_rate:g} C"
        )


def _same_temperature(mine, other, limits):
    own, its = float(np.mean(mine.celsius)), float(np.mean(other.celsius))
    if abs(own - its) > limits.celsius:
        raise Refusal(
            f"{mine.test}: from row 0 on at {own:.1f} degC in the mean, the reference at "
            f"{its:.1f} degC; wanted a difference of at most {limits.celsius:g} K"
        )


MOVED = (*base.LOGARITHMS, "soc0[")
ROLES = ("fit", "validation")


class Pairing(NamedTuple):
    """How references enter.

    references : least number. scale_std : of the template's factor. material_volt : an effect that
    takes less than its square off the mean square error is within what healthy cells differ by.
    needed_ratio : times a single reading's noise, which a template must exceed to be worth its own
    noise: where the circuit follows healthy cells, a cell is better judged alone.
    """

    references: int = 3
    scale_std: float = 0.2
    material_volt: float = 1e-3
    needed_ratio: float = 2.0
    sameness: Sameness = Sameness()


class Paired(NamedTuple):
    """A case beside healthy cells.

    case : case.Case, its stacks with the template, its gates with the material voltage.
    references : names used. left_out : reasons, by name.
    template_volt, scatter_volt : by role, root mean square of the template, and of single
    references about it (most of which other resistances explain).
    read_volt : noise of a single reading of the references. needed : whether the template is much
    more than that; where it is not, the case is better searched alone.
    """

    case: object
    references: tuple
    left_out: dict
    template_volt: dict
    scatter_volt: dict
    read_volt: float
    needed: bool


def paired(case, references, pairing=None):
    """Put a case beside healthy cells that went through the same protocol.

    Parameters
    ----------
    case : search.Case. references : dict name → search.Case of healthy cells, same settings.
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
    left = [_left(references[name], clocks) for name, clocks in seconds.items()]
    rows = {role: np.stack([one[role] for one in left], axis=1) for role in ROLES}
    stacks = {role: _beside(getattr(case, role), rows[role]) for role in ROLES}
    gates = case.gates._replace(material_volt=max(case.gates.material_volt, pairing.material_volt))
    beside = case._replace(
        **stacks, gates=gates, tolerance=case.tolerance._replace(known=pairing.scale_std)
    )
    sizes = {role: rms(stacks[role].known_volt) for role in ROLES}
    spread = {role: rms(np.nan_to_num(np.std(rows[role], axis=1, ddof=1))) for role in ROLES}
    read = _read_volt(case, rows["fit"])
    needed = max(sizes.values()) >= pairing.needed_ratio * read
    return Paired(beside, tuple(seconds), left_out, sizes, spread, read, needed)


def _beside(stack, rows):
    """A stack with the mean of the references; rows that one of them has not are not compared."""
    known = np.isfinite(rows).all(axis=1)
    template = np.where(known, rows.mean(axis=1), 0.0)
    return stack._replace(known_volt=template, used=stack.used & known)


def _same(case, references, pairing):
    """Times on the clocks of the references that ran the same protocol; reasons of the others."""
    seconds, left_out = {}, {}
    for name, reference in references.items():
        try:
            seconds[name] = _clocks(case, reference, pairing.sameness)
        except Refusal as reason:
            left_out[name] = str(reason)
    return seconds, left_out


def _clocks(case, reference, sameness):
    """By role: (n,) time of each row on the clock of the reference, test by test."""
    capacity = case.cell.capacity_ampere_hour
    found = {role: {} for role in ROLES}
    for role in ROLES:
        mine, other = getattr(case, role), getattr(reference, role)
        for test, kind in zip(mine.tests, mine.kinds, strict=True):
            parts = (part(stack, test, kind, capacity) for stack in (mine, other))
            found[role][test] = counterpart_second(*parts, sameness)
    return found


def _left(reference, clocks):
    """What the plain model leaves of a reference, at the times of the case's rows [V], by role."""
    for role in ROLES:  # of other tests, which the case has not, it must know as little
        stack = getattr(reference, role)
        shared = np.isin(np.array(stack.tests)[stack.file], list(clocks[role]))
        reference = reference._replace(**{role: stack._replace(used=stack.used & shared)})
    state = plain_state(reference)
    left = {"fit": state.solution.residual, "validation": state.validation}
    return {
        role: np.concatenate(
            [_at(getattr(reference, role), left[role], *one) for one in clocks[role].items()]
        )
        for role in ROLES
    }


def plain_state(case):
    """The plain model fitted to a healthy reference: case.State.

    OCV and capacity stay as they were measured: bent until they hide some of the circuit's failure,
    as far as their tolerance costs less, they would have to be bent again in every other cell.
    """
    values = plain.first_values(case.cell, case.fit)
    free = plain.frees(case.fit, values, case.tolerance)
    filters = filters_of(case, FIRST, steep(case, values))
    problem = problem_of(case, (), free, filters)
    moved = tuple(one for one in free if one.name.startswith(MOVED))
    solution = fit(problem._replace(free=moved, coupling=None), values)
    return state_of(case, (), solution, filters)


def _read_volt(case, left):
    """Noise of a single reading of the references, root mean square over them [V]."""
    steady = STEADY_C_RATE * case.cell.capacity_ampere_hour
    return rms([read_volt(np.nan_to_num(o), case.fit, steady_ampere=steady) for o in left.T])


def _at(stack, left, test, second):
    rows = stack.file == stack.tests.index(test)
    found = np.interp(np.nan_to_num(second), stack.second[rows], left[rows])
    return np.where(np.isfinite(second), found, np.nan)
