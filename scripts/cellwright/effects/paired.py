"""Paired mode: what a cell's voltage has beyond that of healthy cells in the same protocol.

No circuit follows a cell to the millivolt. Healthy cells of its type that went through the same
protocol fail the circuit in the same way, and what they leave is known beforehand: their mean as a
template, their differences as further shapes that healthy cells may show. Only what is left beyond
these is searched for an effect.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cellwright.effects import plain, search
from cellwright.effects.case import Known, filters_of, problem_of, state_of, steep
from cellwright.effects.effect import Effect, Parameter
from cellwright.effects.problem import Free, fit
from cellwright.effects.protocol_match import Sameness, counterpart_second, part
from cellwright.refusal import Refusal

TEMPLATE = "healthy_cells"
ROLES = ("fit", "validation")


class Pairing(NamedTuple):
    """How references enter. references : least number. scale_std : of the template's factor.

    shapes : whether differences between the references are shapes that a healthy cell may have.
    """

    references: int = 3
    scale_std: float = 0.2
    shapes: bool = True
    sameness: Sameness = Sameness()


class Paired(NamedTuple):
    """A case beside healthy cells.

    case : search.Case, its stacks cut to what all references cover. references : names used.
    left_out : reasons, by name. mean_volt, scatter_volt : root mean square of the template, and of
    single references about it, by role.
    """

    case: object
    references: tuple
    left_out: dict
    mean_volt: dict
    scatter_volt: dict


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
    kept = {role: np.isfinite(rows[role]).all(axis=1) for role in ROLES}
    stacks = {role: cut(getattr(case, role), kept[role]) for role in ROLES}
    rows = {role: rows[role][kept[role]] for role in ROLES}
    known = _known(stacks, rows, pairing)
    mean = {role: _rms(rows[role].mean(axis=1)) for role in ROLES}
    scatter = {role: _scatter(rows[role]) for role in ROLES}
    return Paired(case._replace(**stacks, known=known), tuple(seconds), left_out, mean, scatter)


def cut(stack, keep):
    """A stack without some of its rows: the ends of records, or whole records.

    Parameters
    ----------
    stack : records.Stack. keep : (n,) bool, true for the first row of each record that stays.

    Returns
    -------
    stack : records.Stack.
    """
    shorter = {
        name: value[keep]
        for name, value in stack._asdict().items()
        if isinstance(value, np.ndarray) and value.shape == keep.shape
    }
    stays, file = np.unique(shorter["file"], return_inverse=True)
    return stack._replace(**shorter)._replace(
        tests=tuple(stack.tests[k] for k in stays),
        kinds=tuple(stack.kinds[k] for k in stays),
        first=np.flatnonzero(shorter["fresh"]),
        file=file,
        soc_at_start=stack.soc_at_start[stays],
    )


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
        reference = reference._replace(**{role: cut(stack, shared)})
    state = plain_state(reference)
    left = {"fit": state.solution.residual, "validation": state.validation}
    return {
        role: np.concatenate(
            [_at(getattr(reference, role), left[role], *one) for one in clocks[role].items()]
        )
        for role in ROLES
    }


def plain_state(case):
    """The plain model fitted to a case: case.State."""
    values = plain.first_values(case.cell, case.fit)
    free = plain.frees(case.fit, values, case.tolerance)
    filters = filters_of(case, search.FIRST_NOISE, steep(case, values))
    return state_of(case, (), fit(problem_of(case, (), free, filters), values), filters)


def _at(stack, left, test, second):
    rows = stack.file == stack.tests.index(test)
    found = np.interp(np.nan_to_num(second), stack.second[rows], left[rows])
    return np.where(np.isfinite(second), found, np.nan)


def _known(stacks, rows, pairing):
    """The template, and the shapes, as an effect that is there from the start."""
    count = rows["fit"].shape[1]
    mean = {role: rows[role].mean(axis=1) for role in ROLES}
    shapes = {role: rows[role] - mean[role][:, None] for role in ROLES}
    if pairing.shapes:
        # The differences of K cells span K − 1 shapes; a further cell lies about the mean with
        # the covariance of the K, widened for the mean being theirs.
        turn = np.linalg.svd(shapes["fit"], full_matrices=False)[2][: count - 1].T
        size = np.sqrt((1 + 1 / count) / (count - 1))
        columns = {r: np.column_stack([mean[r], size * shapes[r] @ turn]) for r in ROLES}
    else:
        columns = {r: mean[r][:, None] for r in ROLES}
    volts = {
        test: columns[role][stacks[role].file == k]
        for role in ROLES
        for k, test in enumerate(stacks[role].tests)
    }
    return _as_effect(volts, columns["fit"].shape[1], pairing)


def _as_effect(volts, count, pairing):
    names = ["scale", *(f"shape_{k}" for k in range(1, count))]
    effect = Effect(
        id=TEMPLATE,
        sentence="what healthy cells leave",
        parameters=tuple(Parameter(n, "1", n == "scale", -9.0, 9.0, step=0.05) for n in names),
        stage="reading",
        act=partial(_added, volts),
    )
    priors = [(1.0, pairing.scale_std), *[(0.0, 1.0)] * (count - 1)]
    free = [Free(name, 0.05, *prior) for name, prior in zip(effect.names, priors, strict=True)]
    return Known((effect,), tuple(free))


def _added(volts, fields, stack, p):
    shapes = np.concatenate([volts[test] for test in stack.tests])
    return fields._replace(volt=fields.volt + shapes @ np.array(list(p.values())))


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def _scatter(rows):
    """Standard deviation of a reference about the mean of all [V]."""
    return float(np.sqrt(np.mean(np.var(rows, axis=1, ddof=1))))
