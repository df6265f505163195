"""An effect as strong as was asked for, and the names that explain the same data."""

from typing import Any, NamedTuple

import numpy as np

from virtual_lab.hidden.gap import Gap, Seen, gap, seen, unexplained
from virtual_lab.hidden.outside import OUTSIDE
from virtual_lab.hidden.replay import File
from virtual_lab.hidden.setup import NOISE_VOLT, Setup
from virtual_lab.hidden.vocabulary import EFFECTS, INVISIBLE

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
    seen: list[Seen]
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
    found = seen(setup, _as_counted(plain, setup), files)
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
        found = gap(seen(made.act(plain, sign * size, drawn), plain, fitted)).visible_volt
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
        if min(unexplained(hidden.seen, trials, one_way=name in ONE_WAY)) < SAME_DATA:
            names.append(name)
    return names


def _short(value):
    return float(f"{value:.6g}")
