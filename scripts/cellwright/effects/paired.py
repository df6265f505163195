"""Paired mode: what a cell's voltage has beyond that of healthy cells in the same protocol.

No circuit follows a cell to the millivolt. Healthy cells of its type that went through the same
protocol fail the circuit in the same way; the mean of what they leave is a template that is in the
model from the start, and only what is left beyond it is searched for an effect.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain, search
from cellwright.effects.case import filters_of, problem_of, state_of, steep
from cellwright.effects.judge import rms
from cellwright.effects.noise import FIRST, read_volt
from cellwright.effects.problem import fit
from cellwright.effects.protocol_match import Sameness, counterpart_second, part
from cellwright.refusal import Refusal

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
    steady = search.STEADY_C_RATE * case.cell.capacity_ampere_hour
    return rms([read_volt(np.nan_to_num(o), case.fit, steady_ampere=steady) for o in left.T])


def _at(stack, left, test, second):
    rows = stack.file == stack.tests.index(test)
    found = np.interp(np.nan_to_num(second), stack.second[rows], left[rows])
    return np.where(np.isfinite(second), found, np.nan)
