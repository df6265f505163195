"""Candidates for the missing effect, and the score test of each."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.library.vocabulary import in_order

BINS = 60


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
        """The form of the effect: see `form_of`."""
        return form_of(self.effect, self.start)


def form_of(effect, values):
    """Values of the parameters of an effect without a step, which no fit moves: its form."""
    pairs = zip(effect.parameters, effect.names, strict=True)
    return tuple(values[name] for p, name in pairs if not p.step)


def candidates(predict, prediction, values, library):
    """Candidates: every effect at every one of its starts.

    Parameters
    ----------
    predict : function (values, effect) → (n,) prediction with one more effect.
    prediction : (n,) without it. values : dict of the model as it is.
    library : sequence of Effect.

    Returns
    -------
    candidates : list of Candidate.
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

    chi_square : expected fall of chi-square by the candidate, the nuisances having followed.
    estimate : (k,) its sizes there. information : (k, k) of the sizes, nuisances projected out.
    visible : chi-square of a plausible size. values : first values of a refit.
    """

    candidate: Candidate
    chi_square: float
    estimate: np.ndarray
    information: np.ndarray
    visible: float
    values: dict


def scored(candidates, white, residual, columns, precision, values):
    """Score (Lagrange multiplier) test of each candidate, the nuisances projected out.

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
        part = slice(first, first + len(candidate.sizes))
        first = part.stop
        blocks = information[part, part], whole[part, part], slope[part]
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


def evidence(step, candidate_columns, sizes, residual, whitening):
    """Residual over the change that an effect makes, nuisances projected out of both, in bins.

    Parameters
    ----------
    step : State before the effect. candidate_columns : (n, k) [V per unit]. sizes : (k,).
    residual : (n,) [V]. whitening : noise.Whitening.

    Returns
    -------
    bins : dict of lists sensitivity_volt, residual_volt, rows, one entry a bin of equal count.
    """
    solution = step.solution.inside
    change = candidate_columns @ sizes
    both = np.stack([change, residual], axis=1)
    white = whitening.apply(both)
    follow = np.linalg.solve(solution.precision, solution.white.T @ white)
    projected = both - solution.columns @ follow
    order = np.argsort(projected[:, 0])
    parts = np.array_split(order, min(BINS, max(len(order) // 20, 1)))
    return {
        "sensitivity_volt": [float(projected[p, 0].mean()) for p in parts],
        "residual_volt": [float(projected[p, 1].mean()) for p in parts],
        "rows": [len(p) for p in parts],
    }


def residual_with_all(solution, candidates, whitening):
    """Residual with all candidates in the model, by ridge regression on what each would change.

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
    solution = solution.inside
    many = np.concatenate([c.columns for c in candidates], axis=1)
    both = np.concatenate([solution.white, whitening.apply(many)], axis=1)
    gram = both.T @ both
    ridge = np.diag(1e-6 * np.diag(gram) + 1e-12)
    k = len(solution.precision)
    ridge[:k, :k] = solution.precision - gram[:k, :k]
    # Scaled to one on the diagonal: columns of a millivolt beside some of hundreds of volts (a leak
    # that an iron-phosphate cell's steep end turns into voltage) are else singular to rounding.
    size = np.sqrt(np.maximum(np.diag(gram + ridge), 1e-300))
    moment = both.T @ whitening.apply(solution.residual)
    change = np.linalg.solve((gram + ridge) / np.outer(size, size), moment / size) / size
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
    inside = solution.inside
    slopes = inside.white, inside.precision, solution.values
    for score in scored(candidates, many, residual, *slopes):
        candidate = score.candidate
        if candidate.effect.bends:
            score = _score_by_regression(case, before, possible, score, filters, without)
        visible = score.visible >= case.gates.visible_chi_square
        kept, name = best if visible else hidden, (candidate.effect.key, candidate.form)
        if name not in kept or score.chi_square > kept[name].chi_square:
            kept[name] = score
    shown = {name for name, _ in best}
    invisible = tuple(dict.fromkeys(name for name, _ in hidden if name not in shown))
    return sorted(best.values(), key=lambda s: -s.chi_square), invisible


def _score_by_regression(case, before, possible, score, filters, without):
    """Score of an effect without which resistances and time constants are fitted far off.

    Where they are, no derivative shows the effect. With the effect at each of its starts they are
    estimated again by linear regression; its chi-square is compared with that without the effect.
    What is smaller than every start has bent nothing, and its derivative stands.
    """
    candidate = score.candidate
    effects = in_order((*before.effects, candidate.effect), possible)
    given = candidate.effect.given(candidate.start)
    sizes = dict(zip(candidate.sizes, score.estimate, strict=True))
    if given & sizes.keys() and all(abs(sizes[n]) < abs(candidate.start[n]) for n in given):
        return score
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
