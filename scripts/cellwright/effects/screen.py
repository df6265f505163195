"""Candidates for what is missing, and the score test of each."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, plain


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
        fixed = [p.name for p in self.effect.parameters if not p.step]
        return tuple(self.start[f"{self.effect.id}.{name}"] for name in fixed)


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
    """Values of an effect that is absent: dict by id.parameter."""
    return {f"{effect.id}.{p.name}": p.neutral for p in effect.parameters}


def _candidate(predict, prediction, values, effect, start):
    absent = neutral(effect) | {f"{effect.id}.{k}": v for k, v in start.items()}
    sizes = [p for p in effect.parameters if not p.shape]
    for p in sizes:
        absent[f"{effect.id}.{p.name}"] = p.neutral
    columns = []
    for p in sizes:
        name = f"{effect.id}.{p.name}"
        step = start.get(p.name, p.step)
        moved = predict(values | absent | {name: p.neutral + step}, effect)
        columns.append((moved - prediction) / step)
    first = absent | {f"{effect.id}.{p.name}": start.get(p.name, p.neutral) for p in sizes}
    names = tuple(f"{effect.id}.{p.name}" for p in sizes)
    return Candidate(effect, names, first, np.stack(columns, axis=1))


class Score(NamedTuple):
    """Result of the score test of a candidate.

    chi_square : fall of chi-square that the candidate promises once all nuisances have followed.
    estimate : (k,) sizes at which. information : (k, k) of the sizes, nuisances projected out.
    visible : chi-square that a plausible size would leave.
    """

    candidate: Candidate
    chi_square: float
    estimate: np.ndarray
    information: np.ndarray
    visible: float


def scored(lined_up, white, residual, columns, precision):
    """Score (Lagrange multiplier) tests with the nuisances projected out.

    Parameters
    ----------
    lined_up : list of Candidate. white : (n, m) columns of all of them, whitened.
    residual : (n,) whitened residual of the model at its optimum.
    columns : (n, k) whitened derivatives by the nuisances. precision : (k, k), priors included.

    Returns
    -------
    scores : list of Score.

    Source: C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50.
    """
    mixed = columns.T @ white
    whole = white.T @ white
    information = whole - mixed.T @ np.linalg.solve(precision, mixed)
    slope = white.T @ residual
    found, first = [], 0
    for candidate in lined_up:
        own = slice(first, first + len(candidate.sizes))
        first = own.stop
        found.append(_score(candidate, information[own, own], whole[own, own], slope[own]))
    return found


def _score(candidate, information, whole, slope):
    ridge = 1e-6 * np.diag(np.maximum(np.diag(whole), 1e-300))
    estimate = _within(candidate, np.linalg.solve(information + ridge, slope))
    gain = 2 * slope @ estimate - estimate @ information @ estimate
    likely = [p.plausible for p in candidate.effect.parameters if not p.shape]
    visible = float(np.max(np.square(likely) * np.diag(information)))
    return Score(candidate, float(gain), estimate, information, visible)


def _within(candidate, estimate):
    """One-sided effects cannot take the wrong sign."""
    effect = candidate.effect
    bounds = {f"{effect.id}.{p.name}": (p.lower, p.upper) for p in effect.parameters}
    limits = [bounds[name] for name in candidate.sizes]
    return np.array([np.clip(e, *lim) for e, lim in zip(estimate, limits, strict=True)])


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
