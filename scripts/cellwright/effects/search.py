"""The search: a plain model, then round by round the one effect that explains most, with proof."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.case import Case, Gates, State, filters_of, problem_of, state_of, steep
from cellwright.effects.records import lacking
from cellwright.effects.screen import all_in, beside, candidates, screened
from cellwright.effects.ties import offset_or_leak, rest_current, tie_of, with_partners
from cellwright.numerics import noise
from cellwright.numerics.least_squares import Free, derivatives, fit, stds
from cellwright.protocols.ocv.gap import HYSTERESIS, shows_hysteresis

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


LOGGED = {"current_offset", "leakage"}  # told apart by the current logged at rest
SLOW = "slow_diffusion"
OUTDONE = 0.5  # of the best J: an explanation below it is not the one


def best_of(gates, first, before, trials, floor):
    """The best trial that passes the gates, and the ids of those as good."""
    if before.worst_volt <= max(gates.nothing_ratio * floor, gates.nothing_volt):
        return None, ()
    if before is not first and before.worst_volt <= gates.adequate_ratio * floor:
        return None, ()
    proven = [t for t in trials if significant(gates, before, t)]
    passed = [t for t in proven if matters(gates, first, before, t, floor)]
    # Where far better explanations are too small to matter, a worse one is none either.
    if not passed or passed[0].j < OUTDONE * proven[0].j:
        return None, ()
    best = passed[0]
    within = max(gates.tie_absolute, gates.tie_relative * best.j)
    near = [t.effect.id for t in passed[1:] if best.j - t.j <= within]
    return best, tuple(dict.fromkeys(name for name in near if name != best.effect.id))


def denied(case, trials):
    """Ids of trials that something measured beside the records speaks against.

    The current logged at rest tells an offset from a leak. A gap between the branches of the slow
    test that no resistance explains is hysteresis, which slow diffusion must not stand in for.
    """
    told = {t.effect.id: _told(case, t) for t in trials if t.effect.id in LOGGED}
    against = {name for name, word in told.items() if word not in (None, name)}
    slow = [t for t in trials if t.effect.id == SLOW and _in_place_of_hysteresis(case, t)]
    return against | {t.effect.id for t in slow}


def _in_place_of_hysteresis(case, trial):
    values = trial.state.solution.values
    own = sum(np.exp(values[name]) for name in ("log_r0", "log_r1", "log_r2"))
    there = HYSTERESIS & {effect.id for effect in trial.state.effects}
    return not there and shows_hysteresis(case.gap, own + values[f"{SLOW}.resistance_ohm"])


def with_ties(case, chosen, tied, against, library):
    """The ties of a choice with their structural partners, without those the log denies."""
    known = {effect.id: effect for effect in library}
    tied = with_partners(chosen.effect.id, tied, known, chosen.state.solution.values)
    if chosen.effect.id in LOGGED and _told(case, chosen) is not None:
        against = against | LOGGED
    return tuple(name for name in tied if name not in against)


def _told(case, trial):
    """Which of an offset and a leak the log at rest says it is; None where it cannot tell."""
    name = trial.effect.names[0]
    size, std = trial.state.solution.values[name], stds(trial.state.solution)[name]
    rest = rest_current(case.fit, capacity_ampere_hour=case.cell.capacity_ampere_hour)
    return offset_or_leak(rest, size_ampere=size, std_ampere=std)[0]


def significant(gates, before, trial):
    """Whether a trial is better than chance on the records fitted, and on those that judge."""
    was, now = before.validation_rmse_volt, trial.state.validation_rmse_volt
    return (
        trial.delta_bic > gates.bic
        and trial.delta_validation > gates.validation_chi_square
        and now <= (1.0 - gates.validation_fall) * was
    )


def matters(gates, first, before, trial, floor):
    """Whether what it takes off the error is large enough, in itself and beside the first gap."""
    was, now = before.validation_rmse_volt, trial.state.validation_rmse_volt
    whole = max(first.validation_rmse_volt**2 - floor**2, 1e-12)
    taken = was**2 - now**2
    return (
        trial.material and taken >= gates.material_volt**2 and taken / whole >= gates.material_share
    )


__all__ = ["Case", "Gates", "Round", "State", "Trial", "search"]

STEADY_C_RATE = 0.02


class Round(NamedTuple):
    """One round.

    before : State without the choice. noise : noise.Noise. floor_volt : what no model can explain.
    scores : list of candidates.Score, best first. trials : list of Trial, best first.
    chosen : Trial, or None. tied : ids as good as the choice. hidden : ids that these records
    cannot show (their screens left nothing once the nuisances had followed).
    """

    before: State
    noise: noise.Noise
    floor_volt: float
    scores: list
    trials: list
    chosen: Trial | None
    tied: tuple
    hidden: tuple


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
    extra = steep(case, values)
    filters = filters_of(case, noise.FIRST, extra)
    effects, found = (), []
    solution = fit(problem_of(case, effects, free, filters), values)
    testable = [e for e in library.values() if not not_excited(case, e) and tie_of(e.id) is None]
    for _ in range(case.gates.rounds + 1):
        left = [effect for effect in testable if effect not in effects]
        one, filters = _round(case, effects, free, solution, filters, extra, left, found)
        found.append(one)
        if one.chosen is None or len(found) > case.gates.rounds:
            return found
        effects = one.chosen.state.effects
        free = (*free, *frees_of(one.chosen.effect))
        problem = problem_of(case, effects, free, filters)
        solution = fit(problem, one.chosen.state.solution.values, steps=POLISH_STEPS)
    return found


def _round(case, effects, free, solution, filters, extra, library, earlier):
    """Estimate the noise, refit, screen, try the best, choose: (Round, Filters)."""

    def predict(values, effect):
        return base.voltage(case.cell, case.fit, values, (*effects, effect))

    lined_up = candidates(predict, solution.prediction, solution.values, library)
    everything_in = all_in(solution, lined_up, filters.fit)
    limits = {name: getattr(case.gates, name) for name in ("most_slow_volt", "most_slow_second")}
    spread = noise.estimated(everything_in, case.fit, extra_volt=extra[0], **limits)
    filters = filters_of(case, spread, extra)
    problem = problem_of(case, effects, free, filters)
    solution = fit(problem, solution.values, columns=solution.columns, steps=3)
    before = state_of(case, effects, solution, filters)
    scores, hidden = screened(case, lined_up, before, filters)
    trials = [tried(case, free, before, one, filters) for one in scores[: case.gates.refits]]
    trials = polished(case, free, before, trials, filters)
    floor = earlier[0].floor_volt if earlier else _floor(case, everything_in, spread)
    first = earlier[0].before if earlier else before
    against = denied(case, trials)
    possible = [t for t in trials if t.effect.id not in against]
    chosen, tied = best_of(case.gates, first, before, possible, floor)
    if chosen is not None:
        tied = with_ties(case, chosen, tied, against, library)
    return Round(before, spread, floor, scores, trials, chosen, tied, hidden), filters


def _floor(case, residual, spread):
    """Noise that no model can explain: white as neighbouring rows show it, and slow."""
    steady = STEADY_C_RATE * case.cell.capacity_ampere_hour
    white = min(noise.read_volt(residual, case.fit, steady_ampere=steady), spread.white_volt)
    return float(np.hypot(white, spread.slow_volt))


def not_excited(case, effect):
    """What the records of either role lack for this effect, in words; empty: nothing."""
    capacity = case.cell.capacity_ampere_hour
    return lacking(effect, case.fit, capacity) or lacking(effect, case.validation, capacity)
