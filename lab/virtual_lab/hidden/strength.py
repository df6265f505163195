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
    """A file's record, and what the true plain circuit lacks of it, over the samples that count.

    `volt`: measured minus modelled [V]; `slopes`: derivatives of the model by the logarithms of
    its parameters and by the initial state; `hats`: by the OCV, knot by knot.
    """

    file: File
    record: Record
    counts: np.ndarray
    model: np.ndarray
    volt: np.ndarray
    slopes: np.ndarray
    hats: np.ndarray


class Gap(NamedTuple):
    """Root mean square gaps [V] after the refit.

    `visible_volt`: with the exact OCV, files of the fit. `base_volt`: the OCV free within its
    tolerance. `validation_volt`: the latter on files that were not fitted.
    """

    visible_volt: float
    base_volt: float
    validation_volt: float


def file_gaps(setup: Setup, plain: Setup, files: list[File]) -> list[FileGap]:
    """Gaps of all files: recorded with a setup, modelled with the plain one behind it."""
    return [_file_gap(setup, plain, file) for file in files]


def gap(files: list[FileGap]) -> Gap:
    """Size of the gap that an effect leaves after the refit."""
    fit = [one for one in files if not one.file.is_validation]
    volt, slopes, hats = _stacked(fit)
    exact = volt - slopes @ _solved(slopes, volt)
    shared = slopes.shape[1] - len(fit)
    rows, target = _with_prior(volt, slopes, hats)
    best = _solved(rows, target)
    change, moved = best[:-KNOTS], best[-KNOTS:] * OCV_TOLERANCE_VOLT
    fitted = volt - slopes @ change - hats @ moved
    unseen = [
        _validation_residual(one, change[:shared], moved) for one in files if one.file.is_validation
    ]
    return Gap(_rms(exact), _rms(fitted), _rms(np.concatenate(unseen)) if unseen else 0.0)


def unexplained(files: list[FileGap], trials: list[Setup], *, one_way: bool) -> list[float]:
    """Share [1] of the gap's square that remains with another effect of its best size added.

    `one_way`: that size may not be negative. The current shown at rest is not compared.
    """
    fit = [one for one in files if not one.file.is_validation]
    volt, slopes, hats = _stacked(fit)
    rows, target = _with_prior(volt, slopes, hats)
    onto = np.linalg.solve(rows.T @ rows, rows.T)
    residual = target - rows @ (onto @ target)
    shares = []
    for trial in trials:
        changes = [
            replayed_volt(one.record, one.file, trial)[one.counts] - one.model for one in fit
        ]
        shares.append(_remaining_share(residual, rows, onto, np.concatenate(changes), one_way))
    return shares


def _remaining_share(residual, rows, onto, change, one_way):
    """Share [1] of the residual's square that remains when a change of voltage is fitted too."""
    direction = np.append(change, np.zeros(len(residual) - len(change))) / NOISE_VOLT
    direction = direction - rows @ (onto @ direction)
    power, along = direction @ direction, direction @ residual
    if power == 0 or (one_way and along < 0):
        return 1.0
    return 1.0 - along**2 / (power * (residual @ residual))


def _file_gap(setup, plain, file):
    record = noise_free_record(file, setup)
    model = replayed_volt(record, file, plain)
    slopes = [
        replayed_volt(record, file, _scaled(plain, field, k)) - model
        for field in FITTED
        for k in range(np.size(getattr(plain.cell, field)))
    ]
    slopes.append(replayed_volt(record, file, plain, lower_soc=SMALL) - model)
    soc = soc_of(record, file, plain)
    to_the_end = file.kind == "capacity" or file.measured
    counts = record.sampled & (soc > NEARLY_EMPTY if to_the_end else True)
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
    """The plain setup with one parameter larger by a thousandth."""
    value = getattr(plain.cell, field)
    if np.ndim(value) == 0:
        return plain.with_cell(**{field: value * (1 + SMALL)})
    changed = tuple(v * (1 + SMALL * (k == place)) for k, v in enumerate(value))
    return plain.with_cell(**{field: changed})


def _hats(soc):
    """Hat functions over SoC, one row a sample: how a table of the OCV may move."""
    knots = np.linspace(0.0, 1.0, KNOTS)
    return np.clip(1 - np.abs(soc[:, None] - knots) / knots[1], 0.0, None)


def _stacked(files):
    """Arrays of all files, one below the other, each file with a column for its initial state."""
    rows = np.cumsum([0, *[one.volt.size for one in files]])
    initial = np.zeros((rows[-1], len(files)))
    for k, one in enumerate(files):
        initial[rows[k] : rows[k + 1], k] = one.slopes[:, -1]
    shared = np.vstack([one.slopes[:, :-1] for one in files])
    volt, hats = np.concatenate([one.volt for one in files]), np.vstack([one.hats for one in files])
    return volt, np.hstack([shared, initial]), hats


def _with_prior(volt, slopes, hats):
    """Rows and targets of least squares in units of the noise, with the prior of the OCV below."""
    wide = np.hstack([slopes, hats * OCV_TOLERANCE_VOLT]) / NOISE_VOLT
    prior = np.eye(wide.shape[1])[-KNOTS:]
    return np.vstack([wide, prior]), np.append(volt / NOISE_VOLT, np.zeros(KNOTS))


def _solved(rows, target):
    """Least squares by the normal equations: few columns, all volts, far from dependent."""
    return np.linalg.solve(rows.T @ rows, rows.T @ target)


def _validation_residual(one, change, moved):
    """Residual [V] of a file that was not fitted, with its initial state fitted alone."""
    residual = one.volt - one.slopes[:, :-1] @ change - one.hats @ moved
    initial = one.slopes[:, -1]
    return residual - initial * (initial @ residual) / (initial @ initial)


def _rms(volt):
    return float(np.sqrt(np.mean(volt**2)))


TOLERANCE = 0.02
TRIES = 8
# A gap is visible when a fit leaves this much more than noise (missing-effect.md).
FIT_FACTOR, VALIDATION_FACTOR = 1.15, 1.3
SAME_DATA = 0.03
DRAWS = 4
# Effects of one sign only: a leak never charges, a loss is never negative.
ONE_WAY = {
    *("hysteresis_instant", "hysteresis_one_state", "slow_diffusion", "leakage"),
    *("charge_transfer_nonlinearity", "resistance_temperature", "self_heating"),
    *("coulombic_inefficiency", "lead_resistance"),
}


class Hidden(NamedTuple):
    """An effect in a cell: its setup, its true parameters, and the gap that it leaves."""

    setup: Setup
    effect: str
    parameters: dict[str, Any]
    file_gaps: list[FileGap]
    gap: Gap

    @property
    def visible(self) -> bool:
        """Whether a plain fit leaves clearly more than the noise, on either kind of files."""
        return (
            np.hypot(self.gap.base_volt, NOISE_VOLT) > FIT_FACTOR * NOISE_VOLT
            or np.hypot(self.gap.validation_volt, NOISE_VOLT) > VALIDATION_FACTOR * NOISE_VOLT
        )


def with_effect(
    plain: Setup, effect: str, strength_volt: float, files: list[File], random: np.random.Generator
) -> Hidden:
    """A setup with an effect that leaves a gap of a given size.

    Parameters
    ----------
    plain : without it (it may have another effect already, which then counts as known).
    effect : id of the vocabulary or of OUTSIDE.
    strength_volt : wanted gap [V], see `gap`. Where an effect saturates, its size ends at what is
        still plausible; where no gap can show, a fixed size is taken.
    files : tests on which the gap is measured.
    random : draws the further parameters.
    """
    chosen = (EFFECTS | OUTSIDE)[effect]
    files = [file for file in files if file.kind == "drive" or not chosen.on_drives]
    drawn = chosen.draw(random)
    sign = float(random.choice([-1.0, 1.0])) if chosen.either_sign else 1.0
    size = INVISIBLE.get(effect) or _size(chosen, drawn, sign, plain, strength_volt, files)
    setup = chosen.act(plain, sign * size, drawn)
    shown = {
        name: _short(value) if isinstance(value, float) else value for name, value in drawn.items()
    }
    parameters = {chosen.parameter: _short(sign * size), **shown}
    # The plain circuit has the capacity that the setup's own ammeter counts.
    counted = (1 + setup.chain.current_gain) / (1 + plain.chain.current_gain)
    capacity = plain.cell.capacity_ampere_hour * counted
    gaps = file_gaps(setup, plain.with_cell(capacity_ampere_hour=capacity), files)
    return Hidden(setup, effect, parameters, gaps, gap(gaps))


def _size(effect, drawn, sign, plain, wanted, files):
    """Size of an effect for a wanted gap, step by step along log gap over log size."""
    fitted = [file for file in files if not file.is_validation]
    # The slope of log gap over log size is near one for small effects.
    size, slope, before = effect.first, 1.0, None
    for _ in range(TRIES):
        volt = gap(file_gaps(effect.act(plain, sign * size, drawn), plain, fitted)).visible_volt
        ratio = wanted / max(volt, 1e-7)
        if abs(ratio - 1) < TOLERANCE or (size >= effect.most and ratio > 1):
            break
        if before and before[0] != size:
            slope = np.clip(np.log(volt / before[1]) / np.log(size / before[0]), 0.3, 3.0)
        before = (size, volt)
        size = min(size * np.clip(ratio ** (1 / slope), 0.05, 20.0), effect.most)
    return size


def accepted(hidden: Hidden, plain: Setup, seed: int) -> list[str]:
    """Effects that explain the same data: less than 3 % of the gap's square remains with them."""
    random = np.random.default_rng(seed)
    names = [hidden.effect]
    for name, effect in EFFECTS.items():
        if name in names or name in INVISIBLE:
            continue
        draws = [effect.draw(random) for _ in range(DRAWS if effect.draw(random) else 1)]
        trials = [effect.act(plain, effect.first, drawn) for drawn in draws]
        if min(unexplained(hidden.file_gaps, trials, one_way=name in ONE_WAY)) < SAME_DATA:
            names.append(name)
    return names


def _short(value):
    """A number with six digits."""
    return float(f"{value:.6g}")
