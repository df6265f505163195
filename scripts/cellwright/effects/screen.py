"""Candidates for what is missing, and the score test of each."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.library.vocabulary import in_order


class Candidate(NamedTuple):
    """An effect at one of its starts.

    sizes : names (id.parameter) of the parameters that are zero while it is absent.
    start : dict of first values of all its parameters; sizes are those of the secants.
    columns : (n, k) change of the prediction per unit of each size.
    """

    effect: object
    sizes: tuple
    start: dict
    columns: np.ndarray

    @property
    def form(self):
        """Values of the parameters that no fit moves: which form of the effect this is."""
        own = zip(self.effect.parameters, self.effect.names, strict=True)
        return tuple(self.start[name] for p, name in own if not p.step)


def candidates(predict, prediction, values, library):
    """Every effect at every one of its starts.

    Parameters
    ----------
    predict : function (values, effect) → (n,) prediction with one more effect.
    prediction : (n,) without it. values : dict of the model as it is.
    library : sequence of Effect.

    Returns
    -------
    found : list of Candidate.
    """
    return [
        _candidate(predict, prediction, values, effect, start)
        for effect in library
        for start in effect.starts
    ]


def neutral(effect):
    """Values of an effect that is absent: dict by key.parameter."""
    return dict(zip(effect.names, (p.neutral for p in effect.parameters), strict=True))


def _candidate(predict, prediction, values, effect, start):
    names = dict(zip((p.name for p in effect.parameters), effect.names, strict=True))
    first = neutral(effect) | {names[name]: value for name, value in start.items()}
    sizes = [p for p in effect.parameters if not p.shape]
    absent = first | {names[p.name]: p.neutral for p in sizes}
    columns = []
    for p in sizes:
        step = start.get(p.name, p.step)
        moved = predict(values | absent | {names[p.name]: p.neutral + step}, effect)
        columns.append((moved - prediction) / step)
    sized = tuple(names[p.name] for p in sizes)
    return Candidate(effect, sized, first, np.stack(columns, axis=1))


class Score(NamedTuple):
    """Result of the score test of a candidate.

    chi_square : fall of chi-square that the candidate promises once all nuisances have followed.
    estimate : (k,) sizes at which. information : (k, k) of the sizes, nuisances projected out.
    visible : chi-square that a plausible size would leave. values : those of a model from which a
    refit begins.
    """

    candidate: Candidate
    chi_square: float
    estimate: np.ndarray
    information: np.ndarray
    visible: float
    values: dict


def scored(candidates, white, residual, columns, precision, values):
    """Score (Lagrange multiplier) tests with the nuisances projected out.

    Parameters
    ----------
    candidates : list of Candidate. white : (n, m) columns of all of them, whitened.
    residual : (n,) whitened residual of the model at its optimum.
    columns : (n, k) whitened derivatives by the nuisances. precision : (k, k), priors included.
    values : dict of the model at its optimum.

    Returns
    -------
    scores : list of Score.

    Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50.
    """
    mixed = columns.T @ white
    whole = white.T @ white
    information = whole - mixed.T @ np.linalg.solve(precision, mixed)
    slope = white.T @ residual
    scores, first = [], 0
    for candidate in candidates:
        own = slice(first, first + len(candidate.sizes))
        first = own.stop
        blocks = information[own, own], whole[own, own], slope[own]
        scores.append(_score(candidate, *blocks, values))
    return scores


def _score(candidate, information, whole, slope, values):
    ridge = 1e-6 * np.diag(np.maximum(np.diag(whole), 1e-300))
    limits = np.array([(p.lower, p.upper) for p in candidate.effect.parameters if not p.shape])
    # One-sided effects cannot take the wrong sign.
    estimate = np.clip(np.linalg.solve(information + ridge, slope), *limits.T)
    gain = 2 * slope @ estimate - estimate @ information @ estimate
    likely = [p.plausible for p in candidate.effect.parameters if not p.shape]
    visible = float(np.max(np.square(likely) * np.diag(information)))
    sizes = dict(zip(candidate.sizes, estimate.tolist(), strict=True))
    first = values | candidate.start | sizes
    return Score(candidate, float(gain), estimate, information, visible, first)


BINS = 60


def evidence(step, candidate_columns, sizes, residual, whitening):
    """Residual beside the change that an effect makes, nuisances projected out of both, in bins.

    Parameters
    ----------
    step : State before the effect. candidate_columns : (n, k) [V per unit]. sizes : (k,).
    residual : (n,) [V]. whitening : noise.Whitening.

    Returns
    -------
    found : dict of lists sensitivity_volt, residual_volt, rows, one entry a bin of equal count.
    """
    solution = step.solution
    change = candidate_columns @ sizes
    both = np.stack([change, residual], axis=1)
    white = whitening.apply(both)
    follow = np.linalg.solve(solution.precision, solution.white.T @ white)
    left = both - solution.columns @ follow
    order = np.argsort(left[:, 0])
    parts = np.array_split(order, min(BINS, max(len(order) // 20, 1)))
    return {
        "sensitivity_volt": [float(left[p, 0].mean()) for p in parts],
        "residual_volt": [float(left[p, 1].mean()) for p in parts],
        "rows": [len(p) for p in parts],
    }


def residual_with_all(solution, candidates, whitening):
    """Residual with every effect let in, by ridge regression on what each would change.

    Parameters
    ----------
    solution : least_squares.Solution of the model without them. candidates : list of Candidate.
    whitening : that of the fit.

    Returns
    -------
    residual : (n,) not whitened.
    """
    if not candidates:
        return solution.residual
    many = np.concatenate([c.columns for c in candidates], axis=1)
    both = np.concatenate([solution.white, whitening.apply(many)], axis=1)
    gram = both.T @ both
    ridge = np.diag(1e-6 * np.diag(gram) + 1e-12)
    k = len(solution.precision)
    ridge[:k, :k] = solution.precision - gram[:k, :k]
    change = np.linalg.solve(gram + ridge, both.T @ whitening.apply(solution.residual))
    return solution.residual - np.concatenate([solution.columns, many], axis=1) @ change


def screened(case, candidates, before, possible, filters):
    """Scores of the effects of a cell, and the effects that its records cannot show.

    Parameters
    ----------
    case : case.Case. candidates : list of Candidate. before : search.State without them.
    possible : dict of Effect by key, in whose order effects act. filters : case.Filters.

    Returns
    -------
    scores : list of Score, best first, the best start of each form. hidden : tuple of keys.
    """
    if not candidates:
        return [], ()
    solution, best, hidden = before.solution, {}, {}
    residual = filters.fit.apply(solution.residual)
    many = filters.fit.apply(np.concatenate([c.columns for c in candidates], axis=1))
    regressed = base.regressed(case.cell, case.fit, solution.values, before.effects)
    without = chi_square_of(case, regressed, before.effects, filters)
    slopes = solution.white, solution.precision, solution.values
    for one in scored(candidates, many, residual, *slopes):
        candidate = one.candidate
        if candidate.effect.bends:
            one = _score_by_regression(case, before, possible, one, filters, without)
        seen = one.visible >= case.gates.visible_chi_square
        kept, name = best if seen else hidden, (candidate.effect.key, candidate.form)
        if name not in kept or one.chi_square > kept[name].chi_square:
            kept[name] = one
    shown = {name for name, _ in best}
    invisible = tuple(dict.fromkeys(name for name, _ in hidden if name not in shown))
    return sorted(best.values(), key=lambda s: -s.chi_square), invisible


def _score_by_regression(case, before, possible, score, filters, without):
    """The score of an effect whose lack bends a model, with resistances estimated again.

    Without it resistances and time constants have moved until no small step leads back. With the
    effect at each of its starts they are estimated again by linear regression; the chi-square of
    that is compared with the one without the effect.
    """
    candidate = score.candidate
    effects = in_order((*before.effects, candidate.effect), possible)
    given = candidate.effect.given(candidate.start)
    free = tuple(name for name in candidate.sizes if name not in given)
    first = before.solution.values | candidate.start
    values = base.regressed(case.cell, case.fit, first, effects, free)
    sizes = np.array([values[name] for name in candidate.sizes])
    fall = without - chi_square_of(case, values, effects, filters)
    return score._replace(chi_square=fall, estimate=sizes, values=values)


def chi_square_of(case, values, effects, filters):
    """Chi-square of the fitted records by a model [1]."""
    volt = base.voltage(case.cell, case.fit, values, effects)
    white = filters.fit.apply(case.fit.voltage_volt - volt)
    return float(white @ white)
