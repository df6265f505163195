"""Candidates for what is missing: what each effect would change, as columns beside the residual."""

from typing import NamedTuple

import numpy as np


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
