"""Resistance from pulses: the answer of the voltage to a step of the current."""

from collections import Counter
from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.numerics.noise import least_digit
from cellwright.numerics.statistics import robust_std
from cellwright.refusal import Refusal
from cellwright.series.steps import EDGE_C_RATE, EDGE_SHARE
from cellwright.settings import Resistance

RESISTANCE = Resistance()

ARRIVED = 0.9  # of the step of the current: from here on a sample belongs to the pulse
HELD = 0.1  # of the step of the current: how far a sample may stray from the pulse's level
MOVED = 0.2  # of the pulse's first voltage step: a rest sample this far on has moved already …
MOVED_SECOND = 1.0  # … by a skew of the channels, which is no longer than this
DELAY_SHARE = 0.02  # a pulse that ends so little before a delay still gives the value there


class ResistanceRows(NamedTuple):
    """One entry a pulse and delay, arrays of shape (rows,).

    direction is "discharge" or "charge", by the sign of the current in the pulse; "falling
    discharge" or "falling charge" where a running load only becomes smaller: the polarisation of
    that load goes on building up and hides part of the answer, so laws leave these out.
    delay_second is as asked (0: the first sample of the pulse), actual_delay_second as measured.
    current_ampere is the level of the pulse, + on charge; c_rate that of the step of the current.
    """

    soc: np.ndarray
    direction: np.ndarray
    delay_second: np.ndarray
    actual_delay_second: np.ndarray
    resistance_ohm: np.ndarray
    resistance_std_ohm: np.ndarray
    current_ampere: np.ndarray
    c_rate: np.ndarray
    voltage_before_volt: np.ndarray
    start_time_second: np.ndarray


class Resistances(NamedTuple):
    """Resistances, and a sentence with a count for each reason why values are missing."""

    rows: ResistanceRows
    left_out: tuple


class _Pulse(NamedTuple):
    """One pulse: row of the voltage before it, start [s], level and step of the current [A]; of
    each sample from arrival on the delay [s], the ratio [ohm] and whether the current is held."""

    before: int
    start: float
    level: float
    step: float
    delay: np.ndarray
    ratio: np.ndarray
    held: np.ndarray


# ASSUME: In a record without short pulses, longer loads that begin from rest serve as pulses.
def pulse_resistance(
    test_time_second,
    current_ampere,
    voltage_volt,
    soc,
    steps,
    *,
    rated_capacity_ampere_hour,
    delay_second=RESISTANCE.delay_second,
    elsewhere=None,
):
    """Resistance of every pulse of a record at the delays asked for.

    1. A pulse begins at the last sample before its edge, or one sampling step of the pulse before
    its first sample where that is later. The last sample's voltage and current are "before"; on a
    running load they are those of the load. Where its voltage has moved already while the current
    had not (channels not sampled together), the sample before it gives the voltage.
    2. Each sample k of the pulse gives R_k = (V_k − V_before) / (I_k − I_before).
    3. Delay 0, "instantaneous", is the first sample at which at least 90 % of the step of the
    current has arrived: how instantaneous that is depends on the sampling, and
    actual_delay_second says so. 4. Any other delay is interpolated linearly between the two
    samples around it; beyond the last sample by up to half a sampling step, or 2 %, it is the
    last sample's. 5. The standard deviation holds the noise of voltage and current (robust, from
    the differences between successive samples) and the resolution of the voltage, not the drift.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt : (n,) [s], [A], [V], positive on charge.
    soc : (n,) state of charge [1]; the value before the pulse is reported.
    steps : Steps of the record.
    rated_capacity_ampere_hour : [Ah] for the C-rate.
    delay_second : delays from the edge [s].
    elsewhere : (steps,) name of the test in which a step counts, being the same measurement; empty
        where it counts here. None: all do.

    Returns
    -------
    Resistances : with the reasons of the missing values, counted.

    Raises
    ------
    Refusal : the record has no pulse, or none gives a value at any delay; the reasons are named.
    """
    time, current = np.asarray(test_time_second, float), np.asarray(current_ampere, float)
    voltage, soc = np.asarray(voltage_volt, float), np.asarray(soc, float)
    chosen = _chosen(steps)
    if not len(chosen):
        raise Refusal("the record has no pulse, nor a constant-current load that begins from rest")
    noise = _noise(voltage, steps, resolution=True), _noise(current, steps, resolution=False)
    rows, reasons = [], Counter()
    if elsewhere is not None:
        reasons.update(
            f"pulse of the same measurement as in {of}" for of in elsewhere[chosen] if of
        )
        chosen = chosen[elsewhere[chosen] == ""]
    pulses = [_pulse(time, current, voltage, steps, step) for step in chosen]
    for pulse, asked in product(pulses, delay_second):
        try:
            _check_step(pulse, rated_capacity_ampere_hour)
            value = _at(pulse, float(asked))
        except Refusal as refusal:
            reasons[str(refusal)] += 1
            continue
        rows.append(_row(pulse, value, asked, soc, voltage, noise, rated_capacity_ampere_hour))
    left_out = tuple(f"{count} × {reason}" for reason, count in sorted(reasons.items()))
    if not rows:
        raise Refusal(f"no pulse gives a resistance: {'; '.join(left_out)}")
    return Resistances(ResistanceRows(*map(np.array, zip(*rows, strict=True))), left_out)


def _chosen(steps):
    """Numbers of the steps that are pulses without a gap before them, else of loads from rest."""
    follows = np.append(False, steps.start_time_second[1:] == steps.end_time_second[:-1])
    pulses = np.flatnonzero((steps.kind == "pulse") & follows)
    if len(pulses):
        return pulses
    from_rest = np.roll(steps.kind, 1) == "rest"
    return np.flatnonzero(np.isin(steps.kind, ("CC", "CCCV")) & from_rest & follows)


def _pulse(time, current, voltage, steps, step):
    """One pulse from its step: delay [s] and ratio [ohm] of its samples from arrival on."""
    first, last = int(steps.first_row[step]), int(steps.last_row[step])
    end = int(steps.cv_first_row[step]) if steps.cv_first_row[step] > first else last + 1
    level = float(np.median(current[first:end]))
    rise = level - current[first - 1]
    gone = (current[first : last + 1] - current[first - 1]) / rise
    arrival = first + int(np.argmax(gone >= ARRIVED))
    before = _before(time, voltage, steps, step, first, voltage[arrival])
    rows = np.arange(arrival, last + 1)
    pace = np.median(np.diff(time[first : last + 1])) if last > first else np.inf
    start = max(time[first - 1], time[first] - pace) if before == first - 1 else time[before]
    ratio = (voltage[rows] - voltage[before]) / (current[rows] - current[first - 1])
    held = np.abs(gone[rows - first] - 1) <= HELD
    return _Pulse(before, start, level, rise, time[rows] - start, ratio, held)


def _before(time, voltage, steps, step, first, arrived):
    """Row of the voltage before the pulse: the last one that the pulse has not moved."""
    earliest = max(int(steps.first_row[step - 1]), first - 5)
    rows = np.arange(earliest, first)
    rows = rows[time[rows] >= time[first - 1] - MOVED_SECOND]
    total = arrived - voltage[rows]
    share = np.divide(voltage[first - 1] - voltage[rows], total, out=0 * total, where=total != 0)
    unmoved = rows[share >= MOVED]
    return int(unmoved[-1]) if len(unmoved) else first - 1


def _check_step(pulse, rated):
    """Refuses a pulse whose current differs from that before it by less than any edge does."""
    before = pulse.level - pulse.step
    least = max(EDGE_C_RATE[0] * rated, EDGE_SHARE * max(abs(before), abs(pulse.level)))
    if abs(pulse.step) < least:
        raise Refusal("current does not step into the pulse")


def _at(pulse, asked):
    """Actual delay [s] and resistance [ohm] at a delay; 0 asks for the first sample."""
    delay, ratio, held = pulse.delay, pulse.ratio, pulse.held
    if asked == 0:
        return _positive(delay[0], ratio[0])
    if delay[0] > asked:
        raise Refusal(f"first sample of the pulse later than {asked:g} s")
    half_step = (delay[-1] - delay[0]) / (len(delay) - 1) / 2 if len(delay) > 1 else 0.0
    if delay[-1] + max(half_step, DELAY_SHARE * asked) < asked:
        raise Refusal(f"pulse ends before {asked:g} s")
    after = min(int(np.searchsorted(delay, asked)), len(delay) - 1)
    around = [max(after - (delay[after] > asked), 0), after]
    if delay[around[1]] - delay[around[0]] > 1.5 * asked:
        raise Refusal(f"no sample of the pulse near {asked:g} s")
    if not held[around].all():
        raise Refusal(f"current of the pulse not held until {asked:g} s")
    actual = min(asked, delay[-1])
    return _positive(actual, np.interp(actual, delay[around], ratio[around]))


def _positive(delay, resistance):
    """Delay [s] and resistance [ohm]; refuses a resistance that is not positive."""
    if not (np.isfinite(resistance) and resistance > 0):
        raise Refusal("voltage does not move with the current")
    return float(delay), float(resistance)


def _noise(values, steps, *, resolution):
    """Standard deviation of one sample, from differences within rests and pulses."""
    kept = np.isin(steps.kind, ("rest", "pulse"))
    spans = zip(steps.first_row[kept], steps.last_row[kept] + 1, strict=True)
    change = np.concatenate([np.diff(values[first:last]) for first, last in spans] or [[0.0]])
    if not len(change):
        return 0.0
    spread = robust_std(change - np.median(change)) / np.sqrt(2)
    grain = least_digit(values) / np.sqrt(12) if resolution else 0.0
    return float(np.hypot(spread, grain))


def _direction(pulse):
    """What flows in a pulse, by its sign; "falling" where its edge runs against it."""
    name = "charge" if pulse.level > 0 else "discharge"
    return name if pulse.level * pulse.step > 0 else f"falling {name}"


def _row(pulse, value, asked, soc, voltage, noise, rated):
    """One row of ResistanceRows; its deviation is that of two voltage and two current samples."""
    actual, resistance = value
    error = np.sqrt(2) * np.hypot(noise[0], resistance * noise[1]) / abs(pulse.step)
    return (
        soc[pulse.before],
        _direction(pulse),
        asked,
        actual,
        resistance,
        error,
        pulse.level,
        abs(pulse.step) / rated,
        voltage[pulse.before],
        pulse.start,
    )
