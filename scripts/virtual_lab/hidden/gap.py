"""The visible gap: what an effect leaves in the voltage once the plain circuit has been refitted.

The plain circuit (exact OCV, ohmic resistance, two RC pairs) is driven by the current that the
instrument shows. Its resistances, time constants and the initial state of each file are refitted by
one step of least squares from the true values, for the whole gap is millivolts.
"""

from typing import NamedTuple

import numpy as np

from virtual_lab.hidden.replay import File, Shown, answer, shown, soc_of
from virtual_lab.hidden.setup import NOISE_VOLT, Setup

KNOTS = 16
OCV_TOLERANCE_VOLT = 1.5e-3
SMALL = 1e-3
FITTED = ("r0_ohm", "pair_r_ohm", "pair_tau_second")
NEARLY_EMPTY = 0.1  # a capacity test counts down to here


class Seen(NamedTuple):
    """A file's record and what the true circuit makes of it, all over the samples that count.

    `volt`: what it lacks [V]; `slopes`: by the logarithms of its parameters and by the initial
    state; `hats`: by the OCV, knot by knot.
    """

    file: File
    record: Shown
    counts: np.ndarray
    model: np.ndarray
    volt: np.ndarray
    slopes: np.ndarray
    hats: np.ndarray


class Gap(NamedTuple):
    """Root mean square [V] after the refit.

    `visible_volt`: with the exact OCV, files of the fit. `base_volt`: the OCV free within its
    tolerance. `validation_volt`: the latter on files that took no part.
    """

    visible_volt: float
    base_volt: float
    validation_volt: float


def seen(setup: Setup, plain: Setup, files: list[File]) -> list[Seen]:
    """All files, as shown by a setup and answered by the plain one that is behind it."""
    return [_seen(setup, plain, file) for file in files]


def gap(found: list[Seen]) -> Gap:
    """How large the gap is that an effect leaves."""
    fit = [one for one in found if not one.file.is_validation]
    volt, slopes, hats = _stacked(fit)
    exact = volt - slopes @ _solved(slopes, volt)
    shared = slopes.shape[1] - len(fit)
    rows, target = _with_prior(volt, slopes, hats)
    best = _solved(rows, target)
    change, moved = best[:-KNOTS], best[-KNOTS:] * OCV_TOLERANCE_VOLT
    left = volt - slopes @ change - hats @ moved
    beside = [_unseen(one, change[:shared], moved) for one in found if one.file.is_validation]
    return Gap(_rms(exact), _rms(left), _rms(np.concatenate(beside)) if beside else 0.0)


def unexplained(found: list[Seen], trials: list[Setup], *, one_way: bool) -> list[float]:
    """Share [1] of the gap's square that is left when another effect is added, at its best size.

    `one_way`: that size may not be negative. What a rest's current says is not looked at.
    """
    fit = [one for one in found if not one.file.is_validation]
    volt, slopes, hats = _stacked(fit)
    rows, target = _with_prior(volt, slopes, hats)
    onto = np.linalg.solve(rows.T @ rows, rows.T)
    left = target - rows @ (onto @ target)
    return [_share_left(left, rows, onto, _answers(fit, trial), one_way) for trial in trials]


def _answers(fit, trial):
    """What another setup would add to the model's voltage [V], over all files."""
    return np.concatenate(
        [answer(one.record, one.file, trial)[one.counts] - one.model for one in fit]
    )


def _share_left(left, rows, onto, other, one_way):
    """By how much a direction, as far as the refit leaves it, shortens what is left."""
    direction = np.append(other, np.zeros(len(left) - len(other))) / NOISE_VOLT
    direction = direction - rows @ (onto @ direction)
    power, along = direction @ direction, direction @ left
    if power == 0 or (one_way and along < 0):
        return 1.0
    return 1.0 - along**2 / (power * (left @ left))


def _seen(setup, plain, file):
    record = shown(file, setup)
    model = answer(record, file, plain)
    slopes = [
        answer(record, file, _scaled(plain, field, k)) - model
        for field in FITTED
        for k in range(np.size(getattr(plain.cell, field)))
    ]
    slopes.append(answer(record, file, plain, initial_soc=1 - SMALL) - model)
    soc = soc_of(record, file, plain)
    counts = record.sampled & (soc > NEARLY_EMPTY if file.kind == "capacity" else True)
    return Seen(
        file,
        record,
        counts,
        model[counts],
        (record.volt - model)[counts],
        np.column_stack(slopes)[counts] / SMALL,
        _hats(soc[counts]),
    )


def _scaled(plain, field, place):
    """One parameter larger by a thousandth."""
    value = getattr(plain.cell, field)
    if np.ndim(value) == 0:
        return plain.with_cell(**{field: value * (1 + SMALL)})
    changed = tuple(v * (1 + SMALL * (k == place)) for k, v in enumerate(value))
    return plain.with_cell(**{field: changed})


def _hats(soc):
    """Piecewise-linear functions over SoC, one row a sample: how a table of the OCV may move."""
    knots = np.linspace(0.0, 1.0, KNOTS)
    return np.clip(1 - np.abs(soc[:, None] - knots) / knots[1], 0.0, None)


def _stacked(found):
    """Files one below the other; every file has a column of its own for its initial state."""
    rows = np.cumsum([0, *[one.volt.size for one in found]])
    initial = np.zeros((rows[-1], len(found)))
    for k, one in enumerate(found):
        initial[rows[k] : rows[k + 1], k] = one.slopes[:, -1]
    shared = np.vstack([one.slopes[:, :-1] for one in found])
    volt, hats = np.concatenate([one.volt for one in found]), np.vstack([o.hats for o in found])
    return volt, np.hstack([shared, initial]), hats


def _with_prior(volt, slopes, hats):
    """Rows and targets of least squares in units of the noise, with the OCV's prior below."""
    wide = np.hstack([slopes, hats * OCV_TOLERANCE_VOLT]) / NOISE_VOLT
    prior = np.eye(wide.shape[1])[-KNOTS:]
    return np.vstack([wide, prior]), np.append(volt / NOISE_VOLT, np.zeros(KNOTS))


def _solved(rows, target):
    """Least squares by the normal equations: few columns, all volts, far from dependent."""
    return np.linalg.solve(rows.T @ rows, rows.T @ target)


def _unseen(one, change, moved):
    """What is left of a file that took no part, its initial state found from itself."""
    left = one.volt - one.slopes[:, :-1] @ change - one.hats @ moved
    initial = one.slopes[:, -1]
    return left - initial * (initial @ left) / (initial @ initial)


def _rms(volt):
    return float(np.sqrt(np.mean(volt**2)))
