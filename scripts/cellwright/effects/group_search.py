"""The search in a group: a healthy group within its declared spread, then, round by round, the
one branch's effect that explains most of what is left, with proof on records not fitted."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import noise
from cellwright.effects.group_case import (
    filters_of,
    first_free,
    floor_volt,
    noises_of,
    problem_of,
    state_of,
)
from cellwright.effects.group_fit import beside, settle, surveyed
from cellwright.effects.group_model import Placed
from cellwright.effects.group_screen import all_in, group_columns, group_scores, with_effect

FIRST_NOISE_VOLT = 2e-3
FIRST_NOISE_SHARE = 2e-3  # of the largest branch current
STEPS_OF_BASE, STEPS_OF_TRIALS = 6, 6
RIVAL, MOST_RIVALS = 0.2, 4  # share of the best J within which a candidate is settled anew
SHARPER, AGAIN = 0.8, 2  # fall of the slow noise for which a round is done once more


class GroupTrial(NamedTuple):
    """A candidate refitted, beside the model without it; fall: what its score promised."""

    placed: Placed
    fall: float
    delta_bic: float
    delta_validation: float
    state: object

    @property
    def j(self):
        return self.delta_bic + self.delta_validation


class GroupRound(NamedTuple):
    """One round: the model before, noise of the channels, candidates screened and tried, choice.

    tied : tuple of Placed as good as the chosen one.
    """

    before: object
    noises: tuple
    floor_volt: float
    scores: list
    trials: list
    chosen: GroupTrial | None
    tied: tuple


def group_search(case, library):
    """All rounds, until nothing material is left or nothing known explains it.

    Parameters
    ----------
    case : GroupCase. library : dict of Effect by id, `library.groups.GROUP_LIBRARY`.

    Returns
    -------
    rounds : list of GroupRound; the last one chose nothing, or was the last allowed.
    """
    free, values = first_free(case)
    noises = _first_noises(case)
    solution = settle(
        problem_of(case, (), free, filters_of(case.fit, noises)), values, steps=STEPS_OF_BASE
    )
    placed, found = (), []
    for _ in range(case.gates.rounds + 1):
        one = _sharpest(case, placed, free, solution, noises, library)
        found.append(one)
        if one.chosen is None:
            return found
        placed, noises = one.chosen.state.placed, one.noises
        free = with_effect(free, one.chosen.placed)
        values = one.chosen.state.solution.values
        problem = problem_of(case, placed, free, filters_of(case.fit, noises))
        solution = settle(problem, values, steps=STEPS_OF_BASE)
    return found


def _first_noises(case):
    volt = noise.Noise(FIRST_NOISE_VOLT, FIRST_NOISE_VOLT, 300.0)
    if not case.sensors:
        return (volt,)
    size = FIRST_NOISE_SHARE * np.abs(case.fit.branch_current_ampere).max() / 4
    return (volt, *[noise.Noise(size, size, 200.0)] * len(case.cells))


def _sharpest(case, placed, free, solution, noises, library):
    """A round, done again where its best model shows that the noise was put too high.

    The noise is first taken from a linear extrapolation, which a strong effect outruns.
    """
    tried = group_columns(case, placed, solution, library)
    left = all_in(case, solution, tried, filters_of(case.fit, noises))
    noises = noises_of(case, left, noises if placed else None)
    columns = None
    for _ in range(AGAIN):
        one = _round(case, placed, free, solution, noises, tried, columns)
        solution = one.before.solution
        columns = solution.chart.columns
        if not one.trials:
            return one
        noises = noises_of(case, one.trials[0].state.residual, one.noises)
        if all(
            n.slow_volt > SHARPER * o.slow_volt for n, o in zip(noises, one.noises, strict=True)
        ):
            return one
    return _round(case, placed, free, solution, noises, tried, columns)


def _round(case, placed, free, solution, noises, tried, columns=None):
    """Refit, screen, try the best, choose; columns: derivatives at the solution, where known."""
    filters = filters_of(case.fit, noises)
    problem = problem_of(case, placed, free, filters)
    solution = settle(problem, solution.values, columns=columns, steps=STEPS_OF_BASE)
    chart = surveyed(problem, solution.values, solution.prediction)
    solution = solution._replace(chart=chart)
    before = state_of(case, placed, free, solution, noises)
    scores = group_scores(problem, solution, tried)
    trials = [
        _tried(case, before, free, score, filters, noises) for score in scores[: case.gates.refits]
    ]
    trials = _polished(case, before, free, trials, filters, noises)
    floor = floor_volt(case, noises)
    chosen, tied = _chosen(case.gates, before, trials, floor)
    return GroupRound(before, noises, floor, scores, trials, chosen, tied)


def _tried(case, before, free, score, filters, noises):
    """Refit of a candidate from where its score points."""
    placed = (*before.placed, score.placed)
    free = with_effect(free, score.placed)
    problem = problem_of(case, placed, free, filters)
    values = before.solution.values | score.values
    chart = beside(before.solution.chart, score.column)
    name = score.placed.name
    solution = settle(problem, values, chart=chart, renew=name, steps=STEPS_OF_TRIALS)
    return _trial(case, before, free, solution, noises, score)


def _polished(case, before, free, trials, filters, noises):
    """Best first, rivals of the best settled anew: far from the start the first chart misleads."""
    trials = sorted(trials, key=lambda t: -t.j)
    rivals = [t for t in trials if t.j > (1.0 - RIVAL) * trials[0].j and t.j > 0][:MOST_RIVALS]
    done = [_again(case, before, free, t, filters, noises) for t in rivals if len(rivals) > 1]
    return sorted([*done, *trials[len(done) :]], key=lambda t: -t.j)


def _again(case, before, free, trial, filters, noises):
    free = with_effect(free, trial.placed)
    problem = problem_of(case, trial.state.placed, free, filters)
    old = trial.state.solution
    chart = surveyed(problem, old.values, old.prediction)
    solution = settle(problem, old.values, chart=chart, steps=STEPS_OF_TRIALS)
    return _trial(case, before, free, solution, noises, trial)


def _trial(case, before, free, solution, noises, origin):
    """GroupTrial of a solution; origin: the score or the trial that it comes from."""
    state = state_of(case, (*before.placed, origin.placed), free, solution, noises)
    rows = len(solution.prediction)
    return GroupTrial(
        origin.placed,
        origin.fall,
        before.solution.cost - solution.cost - float(np.log(rows)),
        before.validation_chi_square - state.validation_chi_square,
        state,
    )


def _chosen(gates, before, trials, floor):
    """The best trial that passes the gates, and those as good."""
    worst = max(before.gap_volt, before.validation_gap_volt)
    passed = [t for t in trials if passes(gates, before, t)]
    # A gap that may be left behind needs no explanation to begin with.
    if worst <= max(gates.nothing_ratio * floor, gates.adequate_volt) or not passed:
        return None, ()
    best = passed[0]
    near = max(gates.tie_absolute, gates.tie_relative * best.j)
    return best, tuple(t.placed for t in passed[1:] if best.j - t.j <= near)


def passes(gates, before, trial):
    """Whether a GroupTrial holds against all gates, beside the GroupState before it."""
    was, now = before.validation_gap_volt, trial.state.validation_gap_volt
    size = abs(trial.state.solution.values[trial.placed.name])
    return (
        trial.delta_bic > gates.bic
        and trial.delta_validation > gates.validation_chi_square
        and now <= (1.0 - gates.validation_fall) * was
        and was**2 - now**2 >= gates.material_volt**2
        and size >= trial.placed.effect.parameters[0].material
    )
