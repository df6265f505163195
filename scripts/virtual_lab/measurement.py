"""The measurement chain: when samples are taken and what the instrument shows.

`record` holds what is the same each time (clock, bandwidth, delay, gain and offset), `measured`
adds noise and the instrument's steps. Faults of single files are in `faults`.
"""

from itertools import accumulate

import numpy as np

from virtual_lab import channel
from virtual_lab.behaviour import Behaviour
from virtual_lab.chain import CHAIN, TYPICAL, Chain
from virtual_lab.chamber import Chamber, at
from virtual_lab.clock import EARLY_SECOND, LATE_SECOND, sample_times

__all__ = [
    "CHAIN", "EARLY_SECOND", "LATE_SECOND", "TYPICAL", "Chain", "Columns", "measured", "record",
    "sample_times",
]  # fmt: skip

STEADY_GRID_SECOND = 0.25
# A longer test is counted by the generator's own charge: its grid would have millions of points.
LONGEST_GRID_SECOND = 250_000.0
NO_CURRENT_AMPERE = 1e-9

Columns = dict[str, np.ndarray]


def record(
    behaviours: list[Behaviour],
    *,
    periods_second: list[float],
    seed: int,
    chamber: Chamber,
    chain: Chain = CHAIN,
) -> Columns:
    """What an instrument without noise and of endless resolution would note down.

    Parameters
    ----------
    behaviours : one per step (see `behaviour.Behaviour`).
    periods_second : sampling period [s] asked in each step.
    seed : of the clock.
    chamber : temperature around the cell over the time of the test.
    chain : of the instrument.

    Returns
    -------
    Columns of equal length: time_second, step (1, 2, …), current_ampere, voltage_volt,
    surface_celsius, ambient_celsius, charged_ampere_hour, discharged_ampere_hour, and of cells in
    parallel branch_1_current_ampere and so on.
    """
    random = np.random.default_rng(seed)
    times = [
        sample_times(b.duration_second, period_second=period, random=random, clock=chain.clock)
        for b, period in zip(behaviours, periods_second, strict=True)
    ]
    own = [np.minimum(t, b.duration_second) for t, b in zip(times, behaviours, strict=True)]
    durations = np.array([b.duration_second for b in behaviours])
    step = np.repeat(np.arange(1, len(own) + 1), [second.size for second in own])
    columns = {"step": step, "time_second": _stamps(own, durations)}
    columns |= _sensors(behaviours, durations, own, chain)
    columns |= _counters(behaviours, own, chain)
    celsius = at(chamber, columns["time_second"]) + chain.chamber_offset_celsius
    return columns | {"ambient_celsius": celsius}


def _stamps(own, durations):
    """Time of the test, as the instrument adds up its steps."""
    begins = [0.0, *accumulate(durations[:-1], lambda t, d: round(t + d, 3), initial=0.0)][1:]
    return np.concatenate([np.round(t + s, 3) for t, s in zip(begins, own, strict=True)])


def _sensors(behaviours, durations, own, chain) -> Columns:
    """Current, voltage, temperature and branch currents, with lag, delay, gain and offset."""
    begins = np.concatenate([[0.0], np.cumsum(durations)[:-1]])
    second = np.concatenate([t + s for t, s in zip(begins, own, strict=True)])

    def shown(pieces, **late):
        if not any(late.values()):
            return np.concatenate([piece(s) for piece, s in zip(pieces, own, strict=True)])
        return channel.reading(pieces, durations, second, **late)

    def ammeter(pieces, gain, offset):
        true, lag = shown(pieces), chain.current_lag_second
        lagged = shown(pieces, lag_second=lag) if lag else true
        return _by_ammeter(true, lagged, gain, offset, chain)

    volt = shown(
        [b.voltage for b in behaviours],
        lag_second=chain.voltage_lag_second,
        delay_second=chain.voltage_delay_second,
    )
    surface = shown([b.temperature for b in behaviours], lag_second=chain.surface_lag_second)
    total = ammeter(
        [b.current for b in behaviours], chain.current_gain, chain.current_offset_ampere
    )
    branches = {
        f"branch_{k + 1}_current_ampere": ammeter(
            [b.branches[k] for b in behaviours],
            _of_branch(chain.branch_gain, k),
            _of_branch(chain.branch_offset_ampere, k),
        )
        for k in range(len(behaviours[0].branches))
    }
    return {
        "current_ampere": total,
        "voltage_volt": _straight(volt, chain.voltage_gain, chain.voltage_offset_volt),
        "surface_celsius": surface + chain.surface_offset_celsius,
    } | branches


def _of_branch(values, k):
    return values[k] if values else 0.0


def _straight(true, gain, offset):
    """Gain and offset; left alone where both are nought, for the last bit's sake."""
    return (1 + gain) * true + offset if gain or offset else true


def _by_ammeter(true, lagged, gain, offset, chain):
    """Gain and offset; nothing at all where the relay is open."""
    shown = _straight(lagged, gain, offset)
    return np.where(np.abs(true) < NO_CURRENT_AMPERE, 0.0, shown) if chain.rest_is_open else shown


def _counters(behaviours, own, chain) -> Columns:
    """Both counters run on over the steps, and count what the ammeter shows."""
    long = sum(b.duration_second for b in behaviours) > LONGEST_GRID_SECOND
    parts = [_counted(b, second, chain, long) for b, second in zip(behaviours, own, strict=True)]
    counters = {}
    for k, name in enumerate(("charged_ampere_hour", "discharged_ampere_hour")):
        before = np.cumsum([0.0, *[part[k][-1] for part in parts[:-1]]])
        counters[name] = np.concatenate(
            [part[k] + start for part, start in zip(parts, before, strict=True)]
        )
    return counters


def _counted(behaviour, second, chain, long):
    """Charge in and charge out [Ah] since the step began."""
    gain, offset = chain.current_gain, chain.current_offset_ampere
    if long and behaviour.charge is not None:
        true = behaviour.current(second)
        one_way = (true >= 0).all() or (true <= 0).all()
        closed = not chain.rest_is_open or np.any(np.abs(true) >= NO_CURRENT_AMPERE)
        drift = offset * second / 3600 if closed else 0.0
        if one_way:
            net = (1 + gain) * behaviour.charge(second) + drift
            return net.clip(min=0), (-net).clip(min=0)
    steady_grid = np.arange(0.0, behaviour.duration_second, STEADY_GRID_SECOND)
    grid = np.union1d(steady_grid, second)
    true = behaviour.current(grid)
    current = _by_ammeter(true, true, gain, offset, chain)
    rows = np.searchsorted(grid, second)
    ways = (current.clip(min=0), (-current).clip(min=0))
    return tuple(_charge(grid, ampere)[rows] for ampere in ways)


def _charge(second, current):
    pieces = 0.5 * (current[1:] + current[:-1]) * np.diff(second)
    return np.concatenate([[0.0], np.cumsum(pieces)]) / 3600


def measured(columns: Columns, *, seed: int, chain: Chain = CHAIN) -> Columns:
    """The columns as the instrument shows them: noise added, then rounded to its steps.

    Where the relay is open at rest, the current shown stays exactly zero.
    """
    random = np.random.default_rng(seed)
    slow_random = np.random.default_rng([seed, 1])
    shown = dict(columns)
    for name, noise, slow, slow_second, resolution in _noises(columns, chain):
        noisy = columns[name] + random.normal(0.0, noise, columns[name].size)
        if slow:
            noisy += slow * _slow_noise(columns["time_second"], slow_second, slow_random)
        shown[name] = np.round(noisy / resolution) * resolution
        if chain.rest_is_open and name.endswith("current_ampere"):
            shown[name] = np.where(np.abs(columns[name]) < NO_CURRENT_AMPERE, 0.0, shown[name])
    return shown


def _noises(columns, chain):
    """Name, white noise, slow noise and its time, resolution of each noisy channel."""
    kelvin = (chain.temperature_noise_celsius, 0.0, 1.0, chain.temperature_resolution_celsius)
    volt = (chain.voltage_noise_volt, chain.voltage_slow_noise_volt)
    volt += (chain.voltage_slow_noise_second, chain.voltage_resolution_volt)
    ampere = (chain.current_noise_ampere, chain.current_slow_noise_ampere)
    ampere += (chain.current_slow_noise_second, chain.current_resolution_ampere)
    currents = [name for name in columns if name.endswith("current_ampere")]
    return [
        ("voltage_volt", *volt),
        ("surface_celsius", *kelvin),
        ("ambient_celsius", *kelvin),
        *[(name, *ampere) for name in currents],
    ]


def _slow_noise(second, correlation_second, random):
    """An Ornstein–Uhlenbeck process of unit variance at the instants [s] given."""
    kept = np.exp(-np.diff(second, prepend=-np.inf) / correlation_second)
    fresh = np.sqrt(1 - kept**2) * random.normal(size=second.size)
    pairs = zip(kept.tolist(), fresh.tolist(), strict=True)
    return np.array([*accumulate(pairs, lambda x, p: p[0] * x + p[1], initial=0.0)][1:])
