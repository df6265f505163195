"""How large a voltage gap an effect leaves, and effects made as strong as was asked for.

The gap is what an effect leaves in the voltage once the plain circuit (exact OCV, ohmic
resistance, two RC pairs) has been refitted, driven by the current that the instrument shows. Its
resistances, time constants and the initial state of each file are refitted by one step of least
squares from the true values, which is enough because the whole gap is millivolts.
"""

from typing import Any, NamedTuple

import numpy as np

from virtual_lab.hidden.setup import (
    NOISE_VOLT,
    File,
    Record,
    Setup,
    noise_free_record,
    replayed_volt,
    soc_of,
)
from virtual_lab.hidden.vocabulary import EFFECTS, INVISIBLE, OUTSIDE

KNOTS = 16
OCV_TOLERANCE_VOLT = 1.5e-3
SMALL = 1e-3
FITTED = ("r0_ohm", "pair_r_ohm", "pair_tau_second")
NEARLY_EMPTY = 0.1  # a capacity test counts down to here


class FileGap(NamedTuple):
    """A file's record and what the true circuit makes of it, all over the samples that count.

    `volt`: what it lacks [V]; `slopes`: by the logarithms of its parameters and by the initial
    state; `hats`: by the OCV, knot by knot.
    """

    file: File
    record: Record
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


def file_gaps(setup: Setup, plain: Setup, files: list[File]) -> list[FileGap]:
    """All files, as shown by a setup and answered by the plain one that is behind it."""
    return [_file_gap(setup, plain, file) for file in files]


def gap(found: list[FileGap]) -> Gap:
    """How large the gap is that an effect leaves."""
    fit = [one for one in found if not one.file.is_validation]
    volt, slopes, hats = _stacked(fit)
    exact = volt - slopes @ _solved(slopes, volt)
    shared = slopes.shape[1] - len(fit)
    rows, target = _with_prior(volt, slopes, hats)
    best = _solved(rows, target)
    change, moved = best[:-KNOTS], best[-KNOTS:] * OCV_TOLERANCE_VOLT
    left = volt - slopes @ change - hats @ moved
    beside = [
        _validation_residual(one, change[:shared], moved) for one in found if one.file.is_validation
    ]
    return Gap(_rms(exact), _rms(left), _rms(np.concatenate(beside)) if beside else 0.0)


def unexplained(found: list[FileGap], trials: list[Setup], *, one_way: bool) -> list[float]:
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
        [replayed_volt(one.record, one.file, trial)[one.counts] - one.model for one in fit]
    )


def _share_left(left, rows, onto, other, one_way):
    """By how much a direction, as far as the refit leaves it, shortens what is left."""
    direction = np.append(other, np.zeros(len(left) - len(other))) / NOISE_VOLT
    direction = direction - rows @ (onto @ direction)
    power, along = direction @ direction, direction @ left
    if power == 0 or (one_way and along < 0):
        return 1.0
    return 1.0 - along**2 / (power * (left @ left))


def _file_gap(setup, plain, file):
    record = noise_free_record(file, setup)
    model = replayed_volt(record, file, plain)
    slopes = [
        replayed_volt(record, file, _scaled(plain, field, k)) - model
        for field in FITTED
        for k in range(np.size(getattr(plain.cell, field)))
    ]
    slopes.append(replayed_volt(record, file, plain, initial_soc=1 - SMALL) - model)
    soc = soc_of(record, file, plain)
    counts = record.sampled & (soc > NEARLY_EMPTY if file.kind == "capacity" else True)
    return FileGap(
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


def _validation_residual(one, change, moved):
    """What is left of a file that took no part, its initial state found from itself."""
    left = one.volt - one.slopes[:, :-1] @ change - one.hats @ moved
    initial = one.slopes[:, -1]
    return left - initial * (initial @ left) / (initial @ initial)


def _rms(volt):
    return float(np.sqrt(np.mean(volt**2)))


TOLERANCE = 0.02
TRIES = 8
# A gap shows when a fit leaves this much more than noise (missing-effect.md).
FIT_FACTOR, VALIDATION_FACTOR = 1.15, 1.3
SAME_DATA = 0.03
DRAWS = 4
# Effects of one sign only: a leak never charges, a loss is none that gives.
ONE_WAY = {
    *("hysteresis_instant", "hysteresis_one_state", "slow_diffusion", "leakage"),
    *("charge_transfer_nonlinearity", "resistance_temperature", "self_heating"),
    *("coulombic_inefficiency", "lead_resistance"),
}


class Hidden(NamedTuple):
    """An effect in a cell: its setup, its true parameters, and how much of it shows."""

    setup: Setup
    effect: str
    parameters: dict[str, Any]
    file_gaps: list[FileGap]
    gap: Gap

    @property
    def visible(self) -> bool:
        """Whether a plain fit leaves noticeably more than the noise, on either kind of files."""
        return (
            np.hypot(self.gap.base_volt, NOISE_VOLT) > FIT_FACTOR * NOISE_VOLT
            or np.hypot(self.gap.validation_volt, NOISE_VOLT) > VALIDATION_FACTOR * NOISE_VOLT
        )


def with_effect(
    plain: Setup, effect: str, strength_volt: float, files: list[File], random: np.random.Generator
) -> Hidden:
    """Put an effect into a healthy setup so that it leaves a gap of a given size.

    Parameters
    ----------
    plain : without it (it may have another effect already, which then counts as known).
    effect : id of the vocabulary or of what is outside it.
    strength_volt : wanted gap [V], see `gap`. Where an effect saturates, its size ends at what is
        still plausible; where nothing can show, a fixed size is taken.
    files : tests on which the gap is measured.
    random : draws the further parameters.
    """
    made = (EFFECTS | OUTSIDE)[effect]
    files = [file for file in files if file.kind == "drive" or not made.on_drives]
    drawn = made.draw(random)
    sign = float(random.choice([-1.0, 1.0])) if made.either_sign else 1.0
    size = INVISIBLE.get(effect) or _size(made, drawn, sign, plain, strength_volt, files)
    setup = made.act(plain, sign * size, drawn)
    shown = {
        name: _short(value) if isinstance(value, float) else value for name, value in drawn.items()
    }
    parameters = {made.parameter: _short(sign * size), **shown}
    found = file_gaps(setup, _as_counted(plain, setup), files)
    return Hidden(setup, effect, parameters, found, gap(found))


def _as_counted(plain, setup):
    """The plain circuit with the capacity that the setup's own ammeter counts."""
    counted = (1 + setup.chain.current_gain) / (1 + plain.chain.current_gain)
    return plain.with_cell(capacity_ampere_hour=plain.cell.capacity_ampere_hour * counted)


def _size(made, drawn, sign, plain, wanted, files):
    """Step by step along log gap over log size, whose slope is near one for small effects."""
    fitted = [file for file in files if not file.is_validation]
    size, slope, before = made.first, 1.0, None
    for _ in range(TRIES):
        found = gap(file_gaps(made.act(plain, sign * size, drawn), plain, fitted)).visible_volt
        ratio = wanted / max(found, 1e-7)
        if abs(ratio - 1) < TOLERANCE or (size >= made.most and ratio > 1):
            break
        if before and before[0] != size:
            slope = np.clip(np.log(found / before[1]) / np.log(size / before[0]), 0.3, 3.0)
        before = (size, found)
        size = min(size * np.clip(ratio ** (1 / slope), 0.05, 20.0), made.most)
    return size


def accepted(hidden: Hidden, plain: Setup, seed: int) -> list[str]:
    """Effects that explain the same data: what they leave of the gap's square is below 3 %."""
    random = np.random.default_rng(seed)
    names = [hidden.effect]
    for name, made in EFFECTS.items():
        if name in names or name in INVISIBLE:
            continue
        draws = [made.draw(random) for _ in range(DRAWS if made.draw(random) else 1)]
        trials = [made.act(plain, made.first, drawn) for drawn in draws]
        if min(unexplained(hidden.file_gaps, trials, one_way=name in ONE_WAY)) < SAME_DATA:
            names.append(name)
    return names


def _short(value):
    return float(f"{value:.6g}")
