"""A candidate refitted beside the model without it, and how far it is proven."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.case import State, problem_of, state_of
from cellwright.effects.problem import Free, derivatives, fit
from cellwright.effects.screen import beside

CHORD_STEPS, POLISH_STEPS, ANEW_STEPS = 6, 4, 4
POLISHED, POLISH_SHARE = 3, 0.3  # how many trials at most, and from which part of the best J on
FAR_LOG = 0.2  # of a resistance or time constant: beyond it derivatives are made anew


class Trial(NamedTuple):
    """A candidate refitted, beside the model without it.

    score : fall of chi-square that the screen promised. delta_bic, delta_validation : fall of the
    criterion on the records fitted, of chi-square on those that judge. material : its size matters.
    """

    effect: object
    score: float
    delta_bic: float
    delta_validation: float
    material: bool
    state: State

    @property
    def j(self):
        return self.delta_bic + self.delta_validation


def tried(case, free, before, score, filters):
    """Refit of a candidate from where its score test points."""
    candidate, effect = score.candidate, score.candidate.effect
    own, plainly = frees_of(effect), before.solution
    effects = (*before.effects, effect)
    problem = problem_of(case, effects, (*free, *own), filters)
    if effect.bends:
        values = beside(case, plainly.values | candidate.start, effects, candidate)
        solution = fit(problem, values, steps=ANEW_STEPS)
        return _trial(case, before, effect, score.chi_square, solution, filters)
    sizes = dict(zip(candidate.sizes, score.estimate, strict=True))
    values = plainly.values | candidate.start | sizes
    alone = problem._replace(free=own, apart=None)
    columns = derivatives(alone, values, problem.predict(values))
    columns = np.concatenate([plainly.columns, columns], axis=1)
    renew = tuple(f.name for f in own)
    solution = fit(problem, values, columns=columns, renew=renew, steps=CHORD_STEPS)
    return _trial(case, before, effect, score.chi_square, solution, filters)


def _trial(case, before, effect, promised, solution, filters):
    state = state_of(case, (*before.effects, effect), solution, filters)
    counted = len(frees_of(effect)) * np.log(len(case.fit.file))
    return Trial(
        effect,
        promised,
        before.solution.cost - solution.cost - counted,
        before.validation_chi_square - state.validation_chi_square,
        _material(effect, solution.values),
        state,
    )


def polished(case, free, before, trials, filters):
    """The best trials walked on with fresh derivatives, where the chord has led them far."""
    trials = sorted(trials, key=lambda t: -t.j)
    best = max(trials[0].j, 0.0) if trials else 0.0
    found = [
        _walked_on(case, free, before, trial, filters)
        if n < POLISHED and trial.j >= POLISH_SHARE * best and _far(before, trial)
        else trial
        for n, trial in enumerate(trials)
    ]
    return sorted(found, key=lambda t: -t.j)


def _far(before, trial):
    then, now = before.solution.values, trial.state.solution.values
    return max(abs(now[name] - then[name]) for name in base.LOGARITHMS) > FAR_LOG


def _walked_on(case, free, before, trial, filters):
    problem = problem_of(case, trial.state.effects, (*free, *frees_of(trial.effect)), filters)
    solution = fit(problem, trial.state.solution.values, steps=POLISH_STEPS)
    return _trial(case, before, trial.effect, trial.score, solution, filters)


def frees_of(effect):
    """Free parameters of an effect, for a fit; one without a step is tried, not fitted."""
    return tuple(
        Free(f"{effect.id}.{p.name}", p.step, p.neutral, np.inf, p.lower, p.upper)
        for p in effect.parameters
        if p.step
    )


def _material(effect, values):
    sizes = [p for p in effect.parameters if not p.shape]
    return any(abs(values[f"{effect.id}.{p.name}"] - p.neutral) >= p.material for p in sizes)
