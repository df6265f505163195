"""The search: a plain model, then round by round the one effect that explains most, with proof."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, noise, plain
from cellwright.effects.candidates import candidates, neutral, scored
from cellwright.effects.excitation import lacking
from cellwright.effects.judge import rms, started
from cellwright.effects.problem import Free, Problem, derivatives, fit

FIRST_NOISE = noise.Noise(2e-3, 1e-3, 200.0)
CHORD_STEPS = 6


class Gates(NamedTuple):
    """When an effect counts; meaning and source in config/README.md (missing_effect)."""

    refits: int = 8
    bic: float = 10.0
    validation_chi_square: float = 25.0
    validation_fall: float = 0.03
    nothing_ratio: float = 1.15
    adequate_ratio: float = 1.3
    adequate_closed: float = 0.85
    tie_absolute: float = 6.0
    tie_relative: float = 0.03
    rounds: int = 4
    most_slow_volt: float = 1.2e-3
    most_slow_second: float = 300.0


class Case(NamedTuple):
    """What a search is about: a cell, the records fitted and those that judge, and tolerances."""

    cell: base.Cell
    fit: object
    validation: object
    tolerance: plain.Tolerance = plain.Tolerance()
    gates: Gates = Gates()


class State(NamedTuple):
    """A model fitted: its effects, and how it does on both kinds of records.

    validation : residual (m,) [V]. validation_chi_square : of it, whitened by the same noise.
    """

    effects: tuple
    solution: object
    validation: np.ndarray
    validation_chi_square: float

    @property
    def rmse_volt(self):
        return rms(self.solution.residual)

    @property
    def validation_rmse_volt(self):
        return rms(self.validation)


class Trial(NamedTuple):
    """A candidate refitted, beside the model without it."""

    effect: object
    score: float
    delta_bic: float
    delta_validation: float
    state: State

    @property
    def j(self):
        return self.delta_bic + self.delta_validation


class Round(NamedTuple):
    """One round: the model before, what was screened and tried, the noise, the choice (or None)."""

    before: State
    noise: noise.Noise
    scores: list
    trials: list
    chosen: Trial | None
    tied: tuple


class Filters(NamedTuple):
    """Whitening of both stacks by one noise."""

    fit: noise.Whitening
    validation: noise.Whitening


def search(case, library):
    """All rounds, until nothing material is left or nothing that is known explains it.

    Parameters
    ----------
    case : Case. library : dict of Effect by id.

    Returns
    -------
    rounds : list of Round; the last one chose nothing, or was the last allowed.
    """
    values = plain.first_values(case.cell, case.fit)
    free = plain.frees(case.fit, values, case.tolerance)
    extra = _steep(case, values)
    filters = _filters(case, FIRST_NOISE, extra)
    solution = fit(_problem(case, (), free, filters), values)
    effects, found = (), []
    testable = [e for e in library.values() if not _untestable(case, e)]
    for _ in range(case.gates.rounds + 1):
        one, filters = _round(case, effects, free, solution, filters, extra, testable)
        found.append(one)
        if one.chosen is None or len(found) > case.gates.rounds:
            return found
        effects = one.chosen.state.effects
        free = (*free, *frees_of(one.chosen.effect))
        problem = _problem(case, effects, free, filters)
        solution = fit(problem, one.chosen.state.solution.values, steps=4)
    return found


def _round(case, effects, free, solution, filters, extra, testable):
    """Estimate the noise, refit, screen, try the best, choose."""

    def predict(values, effect):
        return base.voltage(case.cell, case.fit, values, (*effects, effect))

    left = [e for e in testable if e not in effects]
    tried = candidates(predict, solution.prediction, solution.values, left)
    spread = noise.estimated(
        _all_in(solution, tried, filters.fit),
        case.fit,
        most_slow_volt=case.gates.most_slow_volt,
        most_slow_second=case.gates.most_slow_second,
        extra_volt=extra[0],
    )
    filters = _filters(case, spread, extra)
    problem = _problem(case, effects, free, filters)
    solution = fit(problem, solution.values, columns=solution.columns, steps=3)
    before = _state(case, effects, solution, filters)
    residual = filters.fit.apply(solution.residual)
    scores = [
        scored(c, filters.fit.apply(c.columns), residual, solution.white, solution.precision)
        for c in tried
    ]
    best = _best_of_each(scores)
    trials = [_tried(case, free, before, score, filters) for score in best[: case.gates.refits]]
    trials.sort(key=lambda t: -t.j)
    chosen, tied = _chosen(case.gates, before, trials, spread.volt)
    return Round(before, spread, best, trials, chosen, tied), filters


def _all_in(solution, tried, whitening):
    """Residual with every effect let in, by ridge regression on what each would change."""
    many = np.concatenate([c.columns for c in tried], axis=1)
    white = whitening.apply(many)
    both = np.concatenate([solution.white, white], axis=1)
    size = np.zeros((both.shape[1],) * 2)
    nuisances = len(solution.precision)
    gram = both.T @ both
    size[:nuisances, :nuisances] = solution.precision - gram[:nuisances, :nuisances]
    size[nuisances:, nuisances:] = np.diag(1e-6 * np.diag(gram)[nuisances:] + 1e-12)
    change = np.linalg.solve(gram + size, both.T @ whitening.apply(solution.residual))
    return solution.residual - np.concatenate([solution.columns, many], axis=1) @ change


def _best_of_each(scores):
    best = {}
    for one in scores:
        name = one.candidate.effect.id
        if name not in best or one.chi_square > best[name].chi_square:
            best[name] = one
    return sorted(best.values(), key=lambda s: -s.chi_square)


def _tried(case, free, before, score, filters):
    """Refit of a candidate from where its score test points."""
    candidate, effect = score.candidate, score.candidate.effect
    own = frees_of(effect)
    nuisance = before.solution
    names = dict(zip(candidate.sizes, score.estimate, strict=True))
    values = nuisance.values | candidate.start | names
    effects = (*before.effects, effect)
    problem = _problem(case, effects, (*free, *own), filters)
    first = Problem(problem.predict, problem.measured, problem.whiten, own)
    columns = derivatives(first, values, problem.predict(values))
    columns = np.concatenate([nuisance.columns, columns], axis=1)
    renew = tuple(f.name for f in own)
    solution = fit(problem, values, columns=columns, renew=renew, steps=CHORD_STEPS)
    state = _state(case, effects, solution, filters)
    cost = len(own) * np.log(len(case.fit.file))
    return Trial(
        effect,
        score.chi_square,
        before.solution.cost - solution.cost - cost,
        before.validation_chi_square - state.validation_chi_square,
        state,
    )


def frees_of(effect):
    """Free parameters of an effect, for a fit."""
    return tuple(
        Free(f"{effect.id}.{p.name}", p.step, p.neutral, np.inf, p.lower, p.upper)
        for p in effect.parameters
    )


def _chosen(gates, before, trials, floor):
    """The best trial that passes the gates, and the ids of those as good."""
    worst = max(before.rmse_volt, before.validation_rmse_volt)
    if worst <= gates.nothing_ratio * floor:
        return None, ()
    passed = [t for t in trials if _passes(gates, before, t)]
    if not passed:
        return None, ()
    best = passed[0]
    within = max(gates.tie_absolute, gates.tie_relative * best.j)
    return best, tuple(t.effect.id for t in passed[1:] if best.j - t.j <= within)


def _passes(gates, before, trial):
    fall = 1.0 - trial.state.validation_rmse_volt / before.validation_rmse_volt
    return (
        trial.delta_bic > gates.bic
        and trial.delta_validation > gates.validation_chi_square
        and fall >= gates.validation_fall
    )


def _problem(case, effects, free, filters):
    return Problem(
        lambda values: base.voltage(case.cell, case.fit, values, effects),
        case.fit.voltage_volt,
        filters.fit.apply,
        free,
        plain.coupling(free, case.tolerance),
    )


def _state(case, effects, solution, filters):
    stack = case.validation
    values = started(case.cell, stack, solution.values, effects, case.tolerance)
    residual = stack.voltage_volt - base.voltage(case.cell, stack, values, effects)
    white = filters.validation.apply(residual)
    return State(effects, solution, residual, float(white @ white))


def _steep(case, values):
    """What an unfollowed error of the SoC does to each row of both stacks [V]."""
    found = []
    for stack in (case.fit, case.validation):
        socs = {f"soc0[{k}]": float(soc) for k, soc in enumerate(stack.soc_at_start)}
        soc = base.fields_of(case.cell, stack, values | socs).soc
        found.append(plain.steep_volt(case.cell, stack, soc, case.tolerance))
    return tuple(found)


def _filters(case, spread, extra):
    return Filters(
        noise.whitening(spread, case.fit, extra[0]),
        noise.whitening(spread, case.validation, extra[1]),
    )


def _untestable(case, effect):
    """What is lacking on either side, in words."""
    capacity = case.cell.capacity_ampere_hour
    return lacking(effect, case.fit, capacity) or lacking(effect, case.validation, capacity)
