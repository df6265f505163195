"""What a cell's voltage says of the reading of its current in rests."""

from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple

import numpy as np

SIGMAS = 4.0  # beyond which chance is ruled out, with some tens of rests to look at
AT_ONCE = 0.5  # of the resistance that a step of load shows: there without delay
LOAD_STEP = 0.2  # of the largest current: a step that shows the resistance
STEP_SECOND = 2.0  # after a step: later the cell has polarised, and the resistance is another
TWICE = 2  # rests that must say so: one may be disturbed
ENOUGH = 0.01  # of the charge that a record moves: a load that the cell relaxes from
# ASSUME: The open-circuit voltage changes with temperature by half a millivolt a kelvin at most.
ENTROPIC_VOLT_PER_KELVIN = 5e-4
FEWEST = 8  # rows in each half of a rest


class Evidence(StrEnum):
    """What a piece of evidence takes the reading for."""

    SENSOR = "sensor"
    CURRENT = "current"
    NONE = "none"


class Told(NamedTuple):
    """A verdict, why, and the share of the reading's changes that may be a current, at most."""

    verdict: Evidence
    why: str
    share: float = 1.0


def free(voltage: np.ndarray, first: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Rests in which the voltage moves by more than its scatter: no charger holds it.

    A small current at a held voltage is a current, though the voltage knows nothing of it.

    Parameters
    ----------
    voltage : (n,) array [V]
    first, stop : (k,) rows of each rest

    Returns
    -------
    (k,) array of bool
    """
    found = np.zeros(len(first), dtype=bool)
    for rest, (a, b) in enumerate(zip(first, stop, strict=True)):
        late = voltage[(a + b) // 2 : b]
        found[rest] = abs(voltage[a] - late.mean()) > SIGMAS * late.std()
    return found


def answered(columns: Mapping[str, np.ndarray], first: np.ndarray, stop: np.ndarray) -> Told:
    """Whether the voltage answers the changes of the reading in rests as it answers a load.

    From sample to sample a current moves the voltage by its ohmic resistance. Compared is the
    slope of the voltage's changes over the reading's, in the second halves of the rests, with the
    resistance that steps of load show within 2 s; also at a lag of one sample to either side.

    Parameters
    ----------
    columns : mapping of arrays, as in `rest_reading.rest_reading`
    first, stop : (k,) rows of each rest

    Returns
    -------
    Told
    """
    # ASSUME: Of the resistance two seconds after a step of load, at least half is there at once.
    current, voltage = columns["current_ampere"], columns["voltage_volt"]
    step, answer = np.diff(current), np.diff(voltage)
    prompt = np.diff(columns["test_time_second"]) <= STEP_SECOND
    large = prompt & (np.abs(step) > LOAD_STEP * np.abs(current).max())
    late = np.zeros(len(step), bool)
    for a, b in zip((first + stop) // 2, stop, strict=True):
        late[a + 1 : b - 2] = True
    power = float(np.sum(step[late] ** 2))
    at = np.flatnonzero(late)
    if not large.any() or not power > 0 or not np.any(answer[late]):
        return Told(Evidence.NONE, "the voltage answers no change that could be compared")
    load = float(np.median(answer[large] / step[large]))
    slopes = [float(step[at] @ answer[at + lag]) / power for lag in (-1, 0, 1)]
    std = float(answer[late].std()) / np.sqrt(power)
    slope, bound = max(slopes), max(slopes) + SIGMAS * std
    share = float(np.clip(bound / (AT_ONCE * load), 0.0, 1.0)) if load > 0 else 1.0
    seen = f"its changes move the voltage by {1e3 * slope:.2g} ± {1e3 * std:.1g} mOhm"
    why = f"{seen}, where steps of load show {1e3 * load:.3g} mOhm"
    if slope - SIGMAS * std > AT_ONCE * load:
        return Told(Evidence.CURRENT, why, share)
    return Told(Evidence.SENSOR if share < 1.0 else Evidence.NONE, why, share)


def drifted(columns: Mapping[str, np.ndarray], first: np.ndarray, stop: np.ndarray) -> Told:
    """Whether the voltage of rests moves as the charge of the reading would have moved it.

    Over the second half of a rest a real current moves the voltage by charge times the slope of
    the open-circuit voltage, taken from the ends of the rests beside, the flattest of them. What
    had not relaxed adds to that, after a discharge upwards and after a charge downwards, never the
    other way. So a reading whose charge should have moved the voltage further than it went, that
    way, is no current; a voltage that turns against its relaxation, where the reading asks for
    it, proves one. Only rests that follow a load of one sign that moved a hundredth of the
    record's charge are asked: after a brief pulse nobody knows which way the cell relaxes.

    Parameters
    ----------
    columns : mapping of arrays, as in `rest_reading.rest_reading`
    first, stop : (k,) rows of each rest

    Returns
    -------
    Told
    """
    voltage, charge = columns["voltage_volt"], columns["charge_ampere_hour"]
    before = np.r_[0, stop[:-1] - 1]
    pairs = list(zip(first, stop, strict=True))
    ends = np.array([np.median(voltage[max(a, b - FEWEST) : b]) for a, b in pairs])
    unmoved = turned = 0
    for rest, (a, b) in enumerate(pairs):
        slope = _flattest(charge[stop - 1], ends, rest, stop - first)
        relaxes = -_one_way(charge[before[rest] : a + 1], np.ptp(charge))
        if slope is None or relaxes == 0 or b - a < 4 * FEWEST:
            continue
        late = slice((a + b) // 2, b)
        asked = slope * _change(charge[late])[0]
        moved, std = _change(voltage[late])
        std = float(np.hypot(std, ENTROPIC_VOLT_PER_KELVIN * _warmed(columns, late)))
        asked, moved = relaxes * asked / std, relaxes * moved / std
        unmoved += asked > SIGMAS and moved < asked - SIGMAS
        turned += asked < -SIGMAS and moved < -SIGMAS
    if unmoved >= TWICE and not turned:
        why = f"in {unmoved} of them its charge would have moved the voltage further than it went"
        return Told(Evidence.SENSOR, why)
    if turned >= TWICE and not unmoved:
        why = f"in {turned} of them the voltage turns against its relaxation, as a load makes it"
        return Told(Evidence.CURRENT, why)
    return Told(Evidence.NONE, "the voltage of the rests tells neither")


def _one_way(charge: np.ndarray, span: float) -> float:
    """Sign of a load that moved charge one way only, and enough of it; else 0."""
    moved = charge[-1] - charge[0]
    there_and_back = np.abs(np.diff(charge)).sum() - abs(moved)
    enough = abs(moved) > ENOUGH * span and there_and_back < ENOUGH * abs(moved)
    return float(np.sign(moved)) if enough else 0.0


def _warmed(columns: Mapping, late: slice) -> float:
    """By how much the cell's temperature changes over a stretch [K], 0 where nobody measured it."""
    names = ("surface_temperature_celsius", "ambient_temperature_celsius")
    known = [columns[name][late] for name in names if name in columns]
    return max((float(np.nan_to_num(abs(_change(c)[0]))) for c in known), default=0.0)


def _flattest(charge: np.ndarray, volt: np.ndarray, rest: int, rows: np.ndarray) -> float | None:
    """Smallest slope [V/Ah] from the end of a rest to those beside it; None where it is not known.

    Rests that are half as long or more tell it, less than a hundredth of the charge away none; no
    slope is negative.
    """
    known = []
    far = np.abs(charge - charge[rest]) > ENOUGH * np.ptp(charge)
    for others in (np.arange(rest)[::-1], np.arange(rest + 1, len(charge))):
        told = others[far[others] & (rows[others] >= rows[rest] / 2)]
        if told.size:
            known.append((volt[told[0]] - volt[rest]) / (charge[told[0]] - charge[rest]))
    return max(min(known), 0.0) if known else None


def _change(values: np.ndarray) -> tuple[float, float]:
    """Change from the first to the last quarter of a stretch, and its standard deviation.

    The scatter about a parabola, widened by how far neighbours agree, with half a digit beside it.
    """
    quarter = max(len(values) // 4, 2)
    at = np.linspace(-1.0, 1.0, len(values))
    left = values - np.polyval(np.polyfit(at, values, 2), at)
    power = float(left @ left)
    lags = np.array([left[k:] @ left[:-k] for k in range(1, max(len(left) // 4, 2))])
    zero = int(np.argmax(lags <= 0)) if np.any(lags <= 0) else len(lags)
    widened = 1.0 + 2.0 * lags[:zero].sum() / power if power > 0 else 1.0
    digit = np.diff(np.unique(values)).min(initial=np.ptp(values) or 0.0)
    std = np.sqrt(left.var() * widened * 2.0 / quarter + digit**2 / 12.0)
    return float(values[-quarter:].mean() - values[:quarter].mean()), float(std)
