"""The search: a model without effects, then round by round the effect that explains most.

What is searched is a case: a cell (`case.Case`) or a parallel group (`groups.case.GroupCase`).
Both have these methods and values:

`possible(library)` : dict of Effect by key that its records excite.
`begun()` : free parameters of the healthy model, its first values, and filters of a first noise.
`with_effect(free, effect)` : free parameters beside those of an effect.
`problem(effects, free, filters)` : the fit of a model with effects, `least_squares.Problem`.
`candidates(effects, solution, possible, further)` : what each further effect would change,
    list of `screen.Candidate`.
`filters_for(residual, filters, earlier)` : whitening by the noise of a residual (`.noise`, `.fit`).
`sharper(trial, filters)` : the same where the best trial shows a smaller noise, else None.
`screened(candidates, before, free, possible, filters)` : scores, best first; keys of effects that
    the records cannot show.
`state(effects, solution, filters)` : a fit and its errors on the records that judge, `State`.
`floor_volt(residual, filters, earlier)` : noise that no model can explain.
`denied(trials)`, `ties(chosen, tied, denied, possible)` : by measurements outside the fit.
`gates`, `polish_share`, `misled(before, trial)` : when an effect counts; which trials go on.
`settled` : fall of the cost that ends a fit. `keeps_derivatives` : whether those of the model
    serve its refit to another noise.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.screen import residual_with_all
from cellwright.numerics.least_squares import Free, fit

CHORD_STEPS, POLISH_STEPS, ANEW_STEPS, NOISE_STEPS = 6, 4, 4, 3
POLISHED = 3  # how many trials at most
SHARPENED = 2  # how often at most a round is repeated with a smaller noise
OUTDONE = 0.5  # of the best J: no effect below it is chosen, where the better ones are immaterial


class State(NamedTuple):
    """A fitted model: its effects, and its errors on the records fitted and those that judge.

    values : of the validation records, with their own starts. validation : residual (m,).
    validation_chi_square : of it, whitened by the same noise. rmse_volt, validation_rmse_volt :
    of a cell's voltage, of a group's branch currents times their cells' ohmic resistance [V].
    """

    effects: tuple
    solution: object
    values: dict
    validation: np.ndarray
    validation_chi_square: float
    rmse_volt: float
    validation_rmse_volt: float

    @property
    def worst_volt(self):
        """The larger of both rms errors [V]."""
        return max(self.rmse_volt, self.validation_rmse_volt)


class Trial(NamedTuple):
    """A candidate refitted, compared with the model without it.

    score : fall of chi-square that the screen expected. delta_bic, delta_validation : fall of the
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


class Round(NamedTuple):
    """One round of the search: the model before it, the trials, and the choice.

    before : State without the choice. noise : noise.Noise, of a group a tuple of them, one a
    channel. floor_volt : what no model can explain. scores : list of screen.Score, best first.
    trials : list of Trial, best first. chosen : Trial, or None. tied : keys that explain as
    much.
    hidden : keys of effects that these records cannot show.
    """

    before: State
    noise: object
    floor_volt: float
    scores: list
    trials: list
    chosen: Trial | None
    tied: tuple
    hidden: tuple


def search(case, library):
    """Rounds of the search, until no effect of the library is proven to explain more.

    Parameters
    ----------
    case : of a cell or of a group, see above. library : dict of Effect by id.

    Returns
    -------
    rounds : list of Round; the last one chose nothing, or was the last allowed.
    """
    possible = case.possible(library)
    free, values, filters = case.begun()
    effects, rounds = (), []
    solution = fit(case.problem(effects, free, filters), values, settled=case.settled)
    for _ in range(case.gates.rounds + 1):
        step, filters = _round(case, possible, effects, free, solution, filters, rounds)
        rounds.append(step)
        if step.chosen is None or len(rounds) > case.gates.rounds:
            return rounds
        effects = step.chosen.state.effects
        free = case.with_effect(free, step.chosen.effect)
        problem = case.problem(effects, free, filters)
        values = step.chosen.state.solution.values
        solution = fit(problem, values, steps=POLISH_STEPS, settled=case.settled)
    return rounds


def _round(case, possible, effects, free, solution, filters, earlier):
    """The next Round and its filters; repeated while its best trial shows a smaller noise."""
    further = {key: effect for key, effect in possible.items() if effect not in effects}
    candidates = case.candidates(effects, solution, possible, tuple(further.values()))
    residual = residual_with_all(solution, candidates, filters.fit)
    filters = case.filters_for(residual, filters, earlier)
    for _ in range(SHARPENED):
        step = _tested(case, possible, effects, free, solution, filters, candidates)
        sharper = case.sharper(step.trials[0], filters) if step.trials else None
        if sharper is None:
            break
        solution, filters = step.before.solution, sharper
    else:
        step = _tested(case, possible, effects, free, solution, filters, candidates)
    step = step._replace(floor_volt=case.floor_volt(residual, filters, earlier))
    first = earlier[0].before if earlier else step.before
    denied = case.denied(step.trials)
    allowed = [t for t in step.trials if t.effect.key not in denied]
    chosen, tied = best_of(case.gates, first, step.before, allowed, step.floor_volt)
    if chosen is not None:
        tied = case.ties(chosen, tied, denied, possible)
    return step._replace(chosen=chosen, tied=tied), filters


def _tested(case, possible, effects, free, solution, filters, candidates):
    """A Round without a choice: refit to the noise, screen, try the best."""
    problem = case.problem(effects, free, filters)
    columns = solution.columns if case.keeps_derivatives else None
    steps = {"steps": NOISE_STEPS, "settled": case.settled}
    solution = fit(problem, solution.values, columns=columns, **steps)
    before = case.state(effects, solution, filters)
    scores, hidden = case.screened(candidates, before, free, possible, filters)
    trials = [
        tried(case, possible, free, before, score, filters) for score in scores[: case.gates.refits]
    ]
    trials = _polished(case, free, before, trials, filters)
    return Round(before, filters.noise, np.nan, scores, trials, None, (), hidden)


def tried(case, possible, free, before, score, filters):
    """Trial of a candidate: refitted from the values that its score test estimates.

    Parameters
    ----------
    case : as in `search`. possible : dict of Effect by key, in whose order effects act.
    free : tuple of Free without the effect. before : State without it. score : screen.Score.
    filters : of the round.

    Returns
    -------
    trial : Trial.
    """
    effect = score.candidate.effect
    effects = in_order((*before.effects, effect), possible | {effect.key: effect})
    problem = case.problem(effects, case.with_effect(free, effect), filters)
    if effect.bends:
        solution = fit(problem, score.values, steps=ANEW_STEPS)
    else:
        kept = {"columns": before.solution.columns, "white": before.solution.white}
        solution = fit(problem, score.values, **kept, steps=CHORD_STEPS)
    return _trial(case, before, effect, effects, score.chi_square, solution, filters)


def _trial(case, before, effect, effects, promised, solution, filters):
    state = case.state(effects, solution, filters)
    counted = len(frees_of(effect)) * np.log(len(solution.prediction))
    return Trial(
        effect,
        promised,
        before.solution.cost - solution.cost - counted,
        before.validation_chi_square - state.validation_chi_square,
        _material(effect, solution.values),
        state,
    )


def _polished(case, free, before, trials, filters):
    """Trials, best first; the best refitted with new derivatives where kept ones do not hold."""
    trials = sorted(trials, key=lambda t: -t.j)
    best = max(trials[0].j, 0.0) if trials else 0.0
    for n, trial in enumerate(trials[:POLISHED]):
        if trial.j >= case.polish_share * best and case.misled(before, trial):
            trials[n] = _refitted(case, free, before, trial, filters)
    return sorted(trials, key=lambda t: -t.j)


def _refitted(case, free, before, trial, filters):
    effect, effects = trial.effect, trial.state.effects
    problem = case.problem(effects, case.with_effect(free, effect), filters)
    solution = fit(problem, trial.state.solution.values, steps=POLISH_STEPS)
    return _trial(case, before, effect, effects, trial.score, solution, filters)


def frees_of(effect):
    """Free parameters of an effect; those without a step are set by its starts, not fitted."""
    pairs = zip(effect.parameters, effect.names, strict=True)
    return tuple(
        Free(name, p.step, p.neutral, np.inf, p.lower, p.upper) for p, name in pairs if p.step
    )


def _material(effect, values):
    """Whether one of the sizes of an effect is large enough for anyone to act on."""
    sizes = effect.sizes_of(values)
    return any(
        abs(sizes[p.name] - p.neutral) >= p.material for p in effect.parameters if not p.shape
    )


def best_of(gates, first, before, trials, floor):
    """The best trial that passes the gates, and the keys of those that explain as much.

    Parameters
    ----------
    gates : case.Gates. first, before : State of the healthy model, and of the model so far.
    trials : list of Trial, best first. floor : noise that no model can explain [V].
    """
    if before.worst_volt <= max(gates.nothing_ratio * floor, gates.nothing_volt):
        return None, ()
    if before is not first and before.worst_volt <= gates.adequate_ratio * floor:
        return None, ()
    proven = [t for t in trials if significant(gates, before, t)]
    passed = [t for t in proven if matters(gates, first, before, t, floor)]
    if not passed or passed[0].j < OUTDONE * proven[0].j:
        return None, ()
    best = passed[0]
    within = max(gates.tie_absolute, gates.tie_relative * best.j)
    near = [t.effect.key for t in passed[1:] if best.j - t.j <= within]
    return best, tuple(dict.fromkeys(key for key in near if key != best.effect.key))


def significant(gates, before, trial):
    """Whether a trial improves the fit by more than chance, on both kinds of records."""
    was, now = before.validation_rmse_volt, trial.state.validation_rmse_volt
    return (
        trial.delta_bic > gates.bic
        and trial.delta_validation > gates.validation_chi_square
        and now <= (1.0 - gates.validation_fall) * was
    )


def matters(gates, first, before, trial, floor):
    """Whether an effect takes enough off the error [V], also as a share of the first gap."""
    was, now = before.validation_rmse_volt, trial.state.validation_rmse_volt
    whole = max(first.validation_rmse_volt**2 - floor**2, 1e-12)
    taken = was**2 - now**2
    return (
        trial.material and taken >= gates.material_volt**2 and taken / whole >= gates.material_share
    )
