"""Settings of a measuring instrument: noise, resolution, gain, lag, and when it takes samples.

Three clocks. "late": where 0.5 s was asked, samples lie 0.51 to 0.58 s apart (thesis 4.4), and a
step is sampled densely where it begins. "jittery": a sample lies up to 80 ms beside its place on a
regular grid, the first one 60 ms after the step began. "steady": on the grid to 4 ms, with no
sample where the step begins (as the Digatron's of the LG HG2 data).
"""

from typing import NamedTuple

import numpy as np


class Chain(NamedTuple):
    """Settings of an instrument's channels; by default only resolution and white noise.

    Noise: standard deviations; slow noise is an Ornstein–Uhlenbeck process with its correlation
    time [s]. A gain is relative: shown = (1 + gain) × true + offset, in the charge counters too. A
    lag is the time constant [s] of a first-order low-pass. The voltage shown at t is that at t −
    `voltage_delay_second`. `branch_*`: of the branches' own sensors, in their order.
    `rest_is_open`: the relay opens at rest and the current shown is exactly zero. `clock`: see
    `sample_times`.
    """

    voltage_resolution_volt: float = 0.0003
    voltage_noise_volt: float = 0.0003
    current_resolution_ampere: float = 0.001
    current_noise_ampere: float = 0.0005
    temperature_resolution_celsius: float = 0.1
    temperature_noise_celsius: float = 0.05
    voltage_slow_noise_volt: float = 0.0
    voltage_slow_noise_second: float = 250.0
    current_slow_noise_ampere: float = 0.0
    current_slow_noise_second: float = 250.0
    voltage_offset_volt: float = 0.0
    voltage_gain: float = 0.0
    current_offset_ampere: float = 0.0
    current_gain: float = 0.0
    branch_offset_ampere: tuple[float, ...] = ()
    branch_gain: tuple[float, ...] = ()
    surface_offset_celsius: float = 0.0
    chamber_offset_celsius: float = 0.0
    voltage_delay_second: float = 0.0
    voltage_lag_second: float = 0.0
    current_lag_second: float = 0.0
    surface_lag_second: float = 0.0
    rest_is_open: bool = True
    clock: str = "late"


CHAIN = Chain()
# What makers state of their ammeters, as a share of the current.
STATED_CURRENT_GAIN = 0.0005
# What public records of real instruments show, by differences of neighbouring samples at steady
# current: LG HG2 (Digatron), Nissan Leaf (Bitrode), A123 in the form of Plett's toolbox. The
# Arbin is the thesis' own.
TYPICAL = {
    "arbin": CHAIN,
    "digatron": Chain(
        voltage_resolution_volt=0.00017,
        voltage_noise_volt=0.0001,
        current_resolution_ampere=0.00255,
        current_noise_ampere=0.0012,
        temperature_resolution_celsius=0.10515,
        clock="steady",
    ),
    "bitrode": Chain(
        voltage_resolution_volt=0.001,
        voltage_noise_volt=0.0002,
        current_resolution_ampere=0.01,
        current_noise_ampere=0.003,
        current_offset_ampere=0.006,
        rest_is_open=False,
        clock="steady",
    ),
    "plett": Chain(
        voltage_resolution_volt=0.0001,
        voltage_noise_volt=0.00006,
        current_resolution_ampere=0.0001,
        current_noise_ampere=0.0009,
        current_offset_ampere=-0.001,
        rest_is_open=False,
        clock="steady",
    ),
}


def with_drawn_gain(chain: Chain, random: np.random.Generator) -> Chain:
    """The chain of one channel, whose ammeter errs by a gain within what its maker states."""
    gain = float(random.uniform(-STATED_CURRENT_GAIN, STATED_CURRENT_GAIN))
    return chain._replace(current_gain=gain)


EARLY_SECOND = np.array([0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0])
LATE_SECOND = (0.01, 0.08)
JITTER_SECOND = 0.08
STEADY_SECOND = 0.004
FIRST_SECOND = 0.06
MOST_OF_A_PERIOD = 0.2


def sample_times(
    duration_second: float,
    *,
    period_second: float,
    random: np.random.Generator,
    clock: str = "late",
) -> np.ndarray:
    """Instants [s] from the start of a step at which the instrument takes a sample.

    The last one is the end of the step. `period_second` [s] is the sampling period asked for;
    `clock` is "late", "jittery" or "steady".
    """
    times = {"late": _late, "jittery": _jittery, "steady": _steady}[clock]
    inside = times(duration_second, period_second, random)
    return np.round(np.concatenate([inside, [duration_second]]), 3)


def _late(duration, period, random):
    """Dense right after the step began, then each sample late by 10 to 80 ms."""
    early = np.array([s for s in EARLY_SECOND if s < 0.99 * min(period, duration)])
    most = int(duration / period) + 1
    waits = period + random.uniform(*LATE_SECOND, most)
    regular = early[-1] + np.cumsum(waits) if early.size else np.cumsum(waits)
    return np.concatenate([early, regular[regular < duration - 0.5 * min(period, 1.0)]])


def _jittery(duration, period, random):
    """Beside a regular grid by up to 80 ms, and one soon after the step began."""
    first = min(FIRST_SECOND, MOST_OF_A_PERIOD * min(period, duration))
    return np.append(first, _steady(duration, period, random, JITTER_SECOND))


def _steady(duration, period, random, most=STEADY_SECOND):
    """Beside a regular grid by at most so much [s]."""
    place = np.arange(1, int(duration / period) + 1) * period
    most = min(most, MOST_OF_A_PERIOD * period)
    regular = place + random.uniform(-most, most, place.size)
    return regular[regular < duration - most]
