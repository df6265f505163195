"""The search: a plain model, then round by round the one effect that explains most, with proof."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, noise, plain
from cellwright.effects.candidates import candidates, scored
from cellwright.effects.case import Case, Gates, State, filters_of, problem_of, state_of, steep
from cellwright.effects.excitation import lacking
from cellwright.effects.problem import Free, derivatives, fit

__all__ = ["Case", "Gates", "Round", "State", "Trial", "search"]

FIRST_NOISE = noise.Noise(2e-3, 1e-3, 200.0)
CHORD_STEPS, POLISH_STEPS = 6, 4
STEADY_C_RATE = 0.02


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
    values |= {one.name: one.prior for one in case.known.free}
    free = (*plain.frees(case.fit, values, case.tolerance), *case.known.free)
    extra = steep(case, values)
    filters = filters_of(case, FIRST_NOISE, extra)
    effects, found = case.known.effects, []
    solution = fit(problem_of(case, effects, free, filters), values)
    testable = [effect for effect in library.values() if not not_excited(case, effect)]
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

    tried = candidates(predict, solution.prediction, solution.values, library)
    everything_in = _all_in(solution, tried, filters.fit)
    limits = {name: getattr(case.gates, name) for name in ("most_slow_volt", "most_slow_second")}
    spread = noise.estimated(everything_in, case.fit, extra_volt=extra[0], **limits)
    filters = filters_of(case, spread, extra)
    problem = problem_of(case, effects, free, filters)
    solution = fit(problem, solution.values, columns=solution.columns, steps=3)
    before = state_of(case, effects, solution, filters)
    scores, hidden = _screened(case, tried, before, filters)
    trials = [_tried(case, free, before, one, filters) for one in scores[: case.gates.refits]]
    trials.sort(key=lambda t: -t.j)
    floor = earlier[0].floor_volt if earlier else _floor(case, everything_in, spread)
    first = earlier[0].before if earlier else before
    chosen, tied = _chosen(case.gates, first, before, trials, floor)
    return Round(before, spread, floor, scores, trials, chosen, tied, hidden), filters


def _floor(case, residual, spread):
    """Noise that no model can explain: the white part as neighbouring rows show it, the slow part."""
    steady = STEADY_C_RATE * case.cell.capacity_ampere_hour
    white = min(noise.read_volt(residual, case.fit, steady_ampere=steady), spread.white_volt)
    return float(np.hypot(white, spread.slow_volt))


def _all_in(solution, tried, whitening):
    """Residual with every effect let in, by ridge regression on what each would change."""
    many = np.concatenate([c.columns for c in tried], axis=1)
    both = np.concatenate([solution.white, whitening.apply(many)], axis=1)
    gram = both.T @ both
    ridge = np.diag(1e-6 * np.diag(gram) + 1e-12)
    k = len(solution.precision)
    ridge[:k, :k] = solution.precision - gram[:k, :k]
    change = np.linalg.solve(gram + ridge, both.T @ whitening.apply(solution.residual))
    return solution.residual - np.concatenate([solution.columns, many], axis=1) @ change


def _screened(case, tried, before, filters):
    """Scores of what the records can show, the best start of each form; ids of what they cannot."""
    solution = before.solution
    residual = filters.fit.apply(solution.residual)
    best, hidden = {}, {}
    for candidate in tried:
        own = filters.fit.apply(candidate.columns)
        one = scored(candidate, own, residual, solution.white, solution.precision)
        seen = one.visible >= case.gates.visible_chi_square
        kept, name = best if seen else hidden, (candidate.effect.id, candidate.form)
        if name not in kept or one.chi_square > kept[name].chi_square:
            kept[name] = one
    shown = {name for name, _ in best}
    invisible = tuple(dict.fromkeys(name for name, _ in hidden if name not in shown))
    return sorted(best.values(), key=lambda s: -s.chi_square), invisible


def _tried(case, free, before, score, filters):
    """Refit of a candidate from where its score test points."""
    candidate, effect = score.candidate, score.candidate.effect
    own, plainly = frees_of(effect), before.solution
    sizes = dict(zip(candidate.sizes, score.estimate, strict=True))
    values = plainly.values | candidate.start | sizes
    effects = (*before.effects, effect)
    problem = problem_of(case, effects, (*free, *own), filters)
    columns = derivatives(problem._replace(free=own), values, problem.predict(values))
    columns = np.concatenate([plainly.columns, columns], axis=1)
    renew = tuple(f.name for f in own)
    solution = fit(problem, values, columns=columns, renew=renew, steps=CHORD_STEPS)
    state = state_of(case, effects, solution, filters)
    return Trial(
        effect,
        score.chi_square,
        plainly.cost - solution.cost - len(own) * np.log(len(case.fit.file)),
        before.validation_chi_square - state.validation_chi_square,
        _material(effect, solution.values),
        state,
    )


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


def _chosen(gates, first, before, trials, floor):
    """The best trial that passes the gates, and the ids of those as good."""
    if before.worst_volt <= gates.nothing_ratio * floor:
        return None, ()
    if before is not first and before.worst_volt <= gates.adequate_ratio * floor:
        return None, ()
    passed = [t for t in trials if passes(gates, first, before, t, floor)]
    if not passed:
        return None, ()
    best = passed[0]
    within = max(gates.tie_absolute, gates.tie_relative * best.j)
    near = [t.effect.id for t in passed[1:] if best.j - t.j <= within]
    return best, tuple(dict.fromkeys(name for name in near if name != best.effect.id))


def passes(gates, first, before, trial, floor):
    """Whether a trial is significant, proven on validation data, and large enough to matter."""
    was, now = before.validation_rmse_volt, trial.state.validation_rmse_volt
    whole = max(first.validation_rmse_volt**2 - floor**2, 1e-12)
    return (
        trial.delta_bic > gates.bic
        and trial.delta_validation > gates.validation_chi_square
        and now <= (1.0 - gates.validation_fall) * was
        and was - now >= gates.material_volt / 2
        and (was**2 - now**2) / whole >= gates.material_share
        and trial.material
    )


def not_excited(case, effect):
    """What the records of either role lack for this effect, in words; empty: nothing."""
    capacity = case.cell.capacity_ampere_hour
    return lacking(effect, case.fit, capacity) or lacking(effect, case.validation, capacity)
