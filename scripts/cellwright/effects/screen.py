"""The screen: a score test of every effect, and a fresh start for those a straight line misses."""

import numpy as np

from cellwright.effects import base, plain
from cellwright.effects.candidates import scored


def all_in(solution, lined_up, whitening):
    """Residual with every effect let in, by ridge regression on what each would change."""
    if not lined_up:
        return solution.residual
    many = np.concatenate([c.columns for c in lined_up], axis=1)
    both = np.concatenate([solution.white, whitening.apply(many)], axis=1)
    gram = both.T @ both
    ridge = np.diag(1e-6 * np.diag(gram) + 1e-12)
    k = len(solution.precision)
    ridge[:k, :k] = solution.precision - gram[:k, :k]
    change = np.linalg.solve(gram + ridge, both.T @ whitening.apply(solution.residual))
    return solution.residual - np.concatenate([solution.columns, many], axis=1) @ change


def screened(case, lined_up, before, filters):
    """Scores of what the records can show, the best start of each form; ids of what they cannot."""
    solution = before.solution
    residual = filters.fit.apply(solution.residual)
    best, hidden = {}, {}
    if not lined_up:
        return [], ()
    many = filters.fit.apply(np.concatenate([c.columns for c in lined_up], axis=1))
    plainly = plain.regressed(case.cell, case.fit, solution.values, before.effects)
    without = left(case, plainly, before.effects, filters)
    for one in scored(lined_up, many, residual, solution.white, solution.precision):
        candidate = one.candidate
        if candidate.effect.bends:
            one = anew(case, before.effects, solution.values, one, filters, without)
        seen = one.visible >= case.gates.visible_chi_square
        kept, name = best if seen else hidden, (candidate.effect.id, candidate.form)
        if name not in kept or one.chi_square > kept[name].chi_square:
            kept[name] = one
    shown = {name for name, _ in best}
    invisible = tuple(dict.fromkeys(name for name, _ in hidden if name not in shown))
    return sorted(best.values(), key=lambda s: -s.chi_square), invisible


def anew(case, effects, values, score, filters, without):
    """A score for an effect whose lack bends a model: from resistances found anew.

    Without it resistances and time constants have moved until no small step leads back. Beside the
    effect at each of its starts they are found again by linear regression; what that leaves is
    compared with what it leaves without the effect.
    """
    candidate = score.candidate
    effects = (*effects, candidate.effect)
    found = beside(case, values | candidate.start, effects, candidate)
    sizes = np.array([found[name] for name in candidate.sizes])
    return score._replace(chi_square=without - left(case, found, effects, filters), estimate=sizes)


def beside(case, values, effects, candidate):
    """Values with the resistances found anew beside a candidate, and its sizes where not given."""
    given = candidate.effect.given(candidate.start)
    free = tuple(name for name in candidate.sizes if name not in given)
    return plain.regressed(case.cell, case.fit, values, effects, free)


def left(case, values, effects, filters):
    """Chi-square that is left of the fitted records."""
    volt = base.voltage(case.cell, case.fit, values, effects)
    white = filters.fit.apply(case.fit.voltage_volt - volt)
    return float(white @ white)
