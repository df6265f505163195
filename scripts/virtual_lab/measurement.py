"""The measurement chain: when samples are taken, what the instrument shows, what goes wrong.

Clock as in the thesis (4.4): where 0.5 s was asked, samples lie 0.51 to 0.58 s apart.
"""

from typing import NamedTuple

import numpy as np

from virtual_lab.behaviour import Behaviour

EARLY_SECOND = np.array([0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0])
LATE_SECOND = (0.01, 0.08)
STEADY_GRID_SECOND = 0.25

Columns = dict[str, np.ndarray]


class Chain(NamedTuple):
    """Resolutions and standard deviations of the channels."""

    voltage_resolution_volt: float = 0.0003
    voltage_noise_volt: float = 0.0003
    current_resolution_ampere: float = 0.001
    current_noise_ampere: float = 0.0005
    temperature_resolution_celsius: float = 0.1
    temperature_noise_celsius: float = 0.05


CHAIN = Chain()


def sample_times(
    duration_second: float, *, period_second: float, random: np.random.Generator
) -> np.ndarray:
    """Instants [s] from the start of a step at which the instrument takes a sample.

    Dense right after the step began, then late by 10 to 80 ms each time, and at the very end.
    """
    early = np.array([s for s in EARLY_SECOND if s < 0.99 * min(period_second, duration_second)])
    most = int(duration_second / period_second) + 1
    waits = period_second + random.uniform(*LATE_SECOND, most)
    regular = early[-1] + np.cumsum(waits) if early.size else np.cumsum(waits)
    inside = regular[regular < duration_second - 0.5 * min(period_second, 1.0)]
    return np.round(np.concatenate([early, inside, [duration_second]]), 3)


def record(
    behaviours: list[Behaviour], *, periods_second: list[float], ambient_celsius: float, seed: int
) -> Columns:
    """What an ideal instrument with an imperfect clock would note down.

    Parameters
    ----------
    behaviours : one per step (see `behaviour.Behaviour`).
    periods_second : sampling period [s] asked in each step.
    ambient_celsius : chamber temperature [°C].
    seed : of the clock.

    Returns
    -------
    Columns of equal length: time_second, step (1, 2, …), current_ampere, voltage_volt,
    surface_celsius, ambient_celsius, charged_ampere_hour, discharged_ampere_hour, and of cells in
    parallel branch_1_current_ampere and so on.
    """
    random = np.random.default_rng(seed)
    begin, parts = 0.0, []
    for number, (behaviour, period) in enumerate(zip(behaviours, periods_second, strict=True), 1):
        second = sample_times(behaviour.duration_second, period_second=period, random=random)
        parts.append({"step": np.full(second.size, number), **_read(behaviour, second, begin)})
        begin = round(begin + behaviour.duration_second, 3)
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    for counter in ("charged_ampere_hour", "discharged_ampere_hour"):
        before = np.cumsum([0.0, *[part[counter][-1] for part in parts[:-1]]])
        columns[counter] = columns[counter] + before[columns["step"] - 1]
    return columns | {"ambient_celsius": np.full(columns["step"].size, float(ambient_celsius))}


def _read(behaviour, second, begin) -> Columns:
    """All channels of one step, its counters from zero."""
    second = np.minimum(second, behaviour.duration_second)
    steady = np.arange(0.0, behaviour.duration_second, STEADY_GRID_SECOND)
    grid = np.union1d(steady, second)
    current = behaviour.current(grid)
    rows = np.searchsorted(grid, second)
    return {
        "time_second": np.round(begin + second, 3),
        "current_ampere": current[rows],
        "voltage_volt": behaviour.voltage(second),
        "surface_celsius": behaviour.temperature(second),
        "charged_ampere_hour": _charge(grid, current.clip(min=0))[rows],
        "discharged_ampere_hour": _charge(grid, (-current).clip(min=0))[rows],
    } | {
        f"branch_{k}_current_ampere": branch(second)
        for k, branch in enumerate(behaviour.branches, 1)
    }


def _charge(second, current):
    pieces = 0.5 * (current[1:] + current[:-1]) * np.diff(second)
    return np.concatenate([[0.0], np.cumsum(pieces)]) / 3600


def measured(columns: Columns, *, seed: int, chain: Chain = CHAIN) -> Columns:
    """The columns as the instrument shows them: white noise added, then rounded to its steps.

    A rest shows a current of exactly zero, for the instrument opens its relay.
    """
    random = np.random.default_rng(seed)
    channels = {
        "voltage_volt": (chain.voltage_noise_volt, chain.voltage_resolution_volt),
        "surface_celsius": (chain.temperature_noise_celsius, chain.temperature_resolution_celsius),
        "ambient_celsius": (chain.temperature_noise_celsius, chain.temperature_resolution_celsius),
    }
    currents = [name for name in columns if name.endswith("current_ampere")]
    channels |= dict.fromkeys(
        currents, (chain.current_noise_ampere, chain.current_resolution_ampere)
    )
    shown = dict(columns)
    for name, (noise, resolution) in channels.items():
        noisy = columns[name] + random.normal(0.0, noise, columns[name].size)
        shown[name] = np.round(noisy / resolution) * resolution
    for name in currents:
        shown[name] = np.where(np.abs(columns[name]) < 1e-9, 0.0, shown[name])
    return shown


def with_spikes(columns: Columns, *, seed: int, count: int = 2, size_volt: float = 0.06) -> Columns:
    """Single corrupt voltage samples, one up, one down, as in the thesis (figure 5.3)."""
    random = np.random.default_rng(seed)
    rows = random.choice(np.arange(100, columns["voltage_volt"].size - 100), count, replace=False)
    voltage = columns["voltage_volt"].copy()
    voltage[rows] += size_volt * np.resize([1.0, -1.0], count)
    return columns | {"voltage_volt": voltage}


def with_repeats(columns: Columns, *, seed: int, count: int = 4) -> Columns:
    """Some rows written twice."""
    random = np.random.default_rng(seed)
    rows = np.arange(columns["step"].size)
    twice = np.sort(np.append(rows, random.choice(rows[10:-10], count, replace=False)))
    return {name: column[twice] for name, column in columns.items()}


def with_gap(columns: Columns, *, begin_second: float, end_second: float) -> Columns:
    """Nothing written for a while, the test going on."""
    time = columns["time_second"]
    kept = (time < begin_second) | (time > end_second)
    return {name: column[kept] for name, column in columns.items()}
