"""The search in a group: candidates in every branch screened, then one effect a round, with proof.

one branch's effect that explains most of what is left, with proof on records not fitted.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.groups.case import (
    beside,
    filters_of,
    first_free,
    floor_volt,
    noises_of,
    predicted,
    priors,
    problem_of,
    rows_of,
    settle,
    state_of,
    surveyed,
    within,
)
from cellwright.effects.groups.model import Placed
from cellwright.numerics import noise
from cellwright.numerics.least_squares import Free

# The part of a branch's declared tolerance whose place an effect takes.
TAKES = {
    "branch_wire_resistance": ("wire",),
    "branch_initial_soc": ("soc",),
    "branch_capacity": ("capacity",),
    "branch_cell_resistance": ("log_r0", "log_slow"),
    "branch_temperature": ("celsius",),
    "branch_current_offset": ("offset",),
    "branch_current_gain": ("gain",),
}


class GroupScore(NamedTuple):
    """A candidate at the minimum of the quadratic within all bounds.

    column : (m,) change of the prediction per unit, whitened. fall : of the cost. values : dict of
    all free parameters there. information : of its size, nuisances projected out, bounds aside.
    """

    placed: Placed
    column: np.ndarray
    fall: float
    values: dict
    information: float


def free_of(placed):
    """The free parameter of an effect in a branch."""
    p = placed.effect.parameters[0]
    return Free(placed.name, p.step, p.neutral, np.inf, p.lower, p.upper)


def with_effect(free, placed):
    """Free parameters with those of an effect, which takes the place of its branch's tolerance."""
    names = {f"{placed.branch}.{name}" for name in TAKES[placed.effect.id]}
    held = [f._replace(lower=0.0, upper=0.0) if f.name in names else f for f in free]
    return (*held, free_of(placed))


def group_columns(case, placed, solution, library):
    """Change of the prediction per unit of every effect in every branch: list of (Placed, (m,))."""
    wanted = [e for e in library.values() if case.sensors or e.stage != "current"]
    places = [Placed(effect, branch) for effect in wanted for branch in range(len(case.cells))]
    found = []
    for one in places:
        step = one.effect.parameters[0].step
        values = solution.values | {one.name: step}
        moved = predicted(case, case.fit, case.fit_soc, values, (*placed, one))
        column = (moved - solution.prediction) / step
        if one not in placed and np.any(column):
            found.append((one, column))
    return found


def all_in(case, solution, tried, filters):
    """Residual with every effect let in, by ridge regression, bounds aside."""
    residual = rows_of(case, case.fit) - solution.prediction
    many = np.stack([column for _, column in tried], axis=1)
    both = np.concatenate([solution.chart.columns, many], axis=1)
    white = filters.apply(both)
    precision = white.T @ white
    nuisances = len(solution.chart.precision)
    size = np.diag(1e-6 * np.diag(precision) + 1e-12)
    size[:nuisances, :nuisances] += solution.chart.precision - precision[:nuisances, :nuisances]
    return residual - both @ np.linalg.solve(precision + size, white.T @ filters.apply(residual))


def group_scores(problem, solution, tried):
    """Every candidate by the quadratic about the healthy optimum, all bounds held."""
    prior, pull = priors(problem)
    chart, names = solution.chart, [f.name for f in problem.free]
    at = np.array([solution.values[name] for name in names])
    residual = problem.whiten(problem.measured - solution.prediction)
    bent = chart.precision - prior
    moment = chart.white.T @ residual + pull + bent @ at
    rest = within(chart.precision, moment, *_limits(problem.free), at)
    without = 0.5 * rest @ chart.precision @ rest - moment @ rest
    found = []
    for placed, column in tried:
        own = problem.whiten(column)
        mixed = chart.white.T @ own
        precision = np.block([[chart.precision, mixed[:, None]], [mixed[None], own @ own]])
        everything = np.append(moment, own @ residual + mixed @ at)
        limits = _limits(with_effect(problem.free, placed))
        x = within(precision, everything, *limits, np.append(rest, 0.0))
        fall = 2 * (without - (0.5 * x @ precision @ x - everything @ x))
        values = dict(zip((*names, placed.name), x.tolist(), strict=True))
        left = own @ own - mixed @ np.linalg.solve(chart.precision, mixed)
        found.append(GroupScore(placed, own, float(fall), values, float(left)))
    return sorted(found, key=lambda s: -s.fall)


def _limits(free):
    return np.array([f.lower for f in free]), np.array([f.upper for f in free])


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
