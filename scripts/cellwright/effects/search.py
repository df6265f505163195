"""The search: a plain model, then round by round the one effect that explains most, with proof."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, noise, plain
from cellwright.effects.candidates import candidates
from cellwright.effects.case import Case, Gates, State, filters_of, problem_of, state_of, steep
from cellwright.effects.choose import best_of, denied, with_ties
from cellwright.effects.excitation import lacking
from cellwright.effects.problem import fit
from cellwright.effects.screen import all_in, screened
from cellwright.effects.structural import tie_of
from cellwright.effects.trial import POLISH_STEPS, Trial, frees_of, polished, tried

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
