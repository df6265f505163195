"""What an instrument shows of a cell: samples with lag, gain, offset, noise, rounding.

`record` holds what is the same each time (clock, bandwidth, delay, gain and offset), `measured`
adds noise and the instrument's resolution. Faults of single files are in `faults`.
"""

from collections.abc import Callable, Sequence
from itertools import accumulate

import numpy as np

from virtual_lab.behaviour import Behaviour, running_integral
from virtual_lab.chamber import Chamber, temperature_at
from virtual_lab.instruments.chain import CHAIN, Chain, sample_times

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
    """Columns of an instrument without noise and with unlimited resolution.

    Parameters
    ----------
    behaviours : one per step (see `behaviour.Behaviour`).
    periods_second : sampling period [s] asked for in each step.
    seed : of the clock.
    chamber : temperature around the cell over the time of the test.
    chain : of the instrument.

    Returns
    -------
    Columns of equal length: time_second, step (1, 2, …), current_ampere, voltage_volt,
    surface_celsius, ambient_celsius, charged_ampere_hour, discharged_ampere_hour, and of cells in
    parallel branch_1_current_ampere and so on, of cells in series cell_1_voltage_volt and
    cell_1_temperature_celsius.
    """
    random = np.random.default_rng(seed)
    times = [
        sample_times(b.duration_second, period_second=period, random=random, clock=chain.clock)
        for b, period in zip(behaviours, periods_second, strict=True)
    ]
    own = [np.minimum(t, b.duration_second) for t, b in zip(times, behaviours, strict=True)]
    durations = np.array([b.duration_second for b in behaviours])
    step = np.repeat(np.arange(1, len(own) + 1), [second.size for second in own])
    # The instrument adds up its steps, each rounded to a millisecond.
    starts = accumulate(durations[:-1], lambda t, d: round(t + d, 3), initial=0.0)
    stamps = [np.round(start + s, 3) for start, s in zip(starts, own, strict=True)]
    columns = {"step": step, "time_second": np.concatenate(stamps)}
    columns |= _sensors(behaviours, durations, own, chain)
    columns |= _counters(behaviours, own, chain)
    celsius = temperature_at(chamber, columns["time_second"]) + chain.chamber_offset_celsius
    return columns | {"ambient_celsius": celsius}


def _sensors(behaviours, durations, own, chain) -> Columns:
    """Current, voltage, temperature and branch currents, with lag, delay, gain and offset."""
    begins = np.concatenate([[0.0], np.cumsum(durations)[:-1]])
    second = np.concatenate([t + s for t, s in zip(begins, own, strict=True)])

    def shown(pieces, **late):
        if not any(late.values()):
            return np.concatenate([piece(s) for piece, s in zip(pieces, own, strict=True)])
        return reading(pieces, durations, second, **late)

    def ammeter(pieces, gain, offset):
        true, lag = shown(pieces), chain.current_lag_second
        lagged = shown(pieces, lag_second=lag) if lag else true
        return _by_ammeter(true, lagged, gain, offset, chain)

    def voltmeter(pieces):
        lag, delay = chain.voltage_lag_second, chain.voltage_delay_second
        volt = shown(pieces, lag_second=lag, delay_second=delay)
        return _straight(volt, chain.voltage_gain, chain.voltage_offset_volt)

    def thermometer(pieces):
        return shown(pieces, lag_second=chain.surface_lag_second) + chain.surface_offset_celsius

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
    cells = {
        f"cell_{k + 1}_voltage_volt": voltmeter([b.cell_voltages[k] for b in behaviours])
        for k in range(len(behaviours[0].cell_voltages))
    }
    cells |= {
        f"cell_{k}_temperature_celsius": thermometer([b.cell_temperatures[k] for b in behaviours])
        for k in behaviours[0].cell_temperatures or ()
    }
    return {
        "current_ampere": total,
        "voltage_volt": voltmeter([b.voltage for b in behaviours]),
        "surface_celsius": thermometer([b.temperature for b in behaviours]),
    } | (branches | cells)


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
    """Charge counters that run on over the steps; they integrate the current shown."""
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
    return tuple((running_integral(grid, ampere) / 3600)[rows] for ampere in ways)


def measured(columns: Columns, *, seed: int, chain: Chain = CHAIN) -> Columns:
    """Columns as the instrument shows them: noise added, then rounded to its resolution.

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
    voltages = [name for name in columns if name.endswith("_voltage_volt")]
    temperatures = [name for name in columns if name.endswith("_temperature_celsius")]
    return [
        ("voltage_volt", *volt),
        ("surface_celsius", *kelvin),
        ("ambient_celsius", *kelvin),
        *[(name, *ampere) for name in currents],
        *[(name, *volt) for name in voltages],
        *[(name, *kelvin) for name in temperatures],
    ]


def _slow_noise(second, correlation_second, random):
    """An Ornstein–Uhlenbeck process of unit variance at the instants [s] given."""
    kept = np.exp(-np.diff(second, prepend=-np.inf) / correlation_second)
    fresh = np.sqrt(1 - kept**2) * random.normal(size=second.size)
    pairs = zip(kept.tolist(), fresh.tolist(), strict=True)
    return np.array([*accumulate(pairs, lambda x, p: p[0] * x + p[1], initial=0.0)][1:])


Piece = Callable[[np.ndarray], np.ndarray]
# Ages over which a first-order low-pass remembers, in time constants; what is older weighs 2e-9.
AGE = np.concatenate([[0.0], np.geomspace(0.02, 20.0, 60)])
ROWS_AT_ONCE = 50_000


def reading(
    pieces: Sequence[Piece],
    durations_second: np.ndarray,
    second: np.ndarray,
    *,
    lag_second: float = 0.0,
    delay_second: float = 0.0,
) -> np.ndarray:
    """A quantity as a sensor shows it: delayed and low-passed.

    The quantity is known at any instant, so no samples are shifted or filtered.

    Parameters
    ----------
    pieces : the quantity in each step, a function of the time [s] since the step began.
    durations_second : of the steps, shape (n,).
    second : instants from the start of the test, ascending, shape (m,); one that falls on the end
        of a step belongs to it, not to the next.
    lag_second : time constant of a first-order low-pass, y' = (x − y)/τ; 0: none.
    delay_second : the value shown at t is that at t − delay; negative: shown early.

    Returns
    -------
    Array, shape (m,). Before the first step the quantity is as it begins, after the last as it
    ends.
    """
    begins = np.concatenate([[0.0], np.cumsum(durations_second)])
    asked = second - delay_second
    if lag_second == 0:
        return _at(pieces, begins, asked)
    parts = np.array_split(asked, asked.size // ROWS_AT_ONCE + 1)
    return np.concatenate([_low_passed(pieces, begins, part, lag_second) for part in parts])


def _at(pieces, begins, second):
    """The quantity itself at ascending instants."""
    inside = np.clip(second, 0.0, begins[-1])
    rows = np.searchsorted(inside, begins[1:], side="right")
    rows = np.concatenate([[0], rows])
    shown = np.empty(inside.size)
    for k in np.flatnonzero(np.diff(rows)):
        own = slice(rows[k], rows[k + 1])
        shown[own] = pieces[k](inside[own] - begins[k])
    return shown


def _low_passed(pieces, begins, second, tau):
    """Low-pass of the quantity without its jumps between steps, and of the jumps.

    Without its jumps the quantity is all but straight between neighbouring ages; a jump J answers
    with J (1 − exp(−t/τ)), whatever the sampling.
    """
    edge = begins[1:-1]
    jump = _jumps(pieces, np.diff(begins))
    risen = np.concatenate([[0.0], np.cumsum(jump)])
    past = second[:, None] - tau * AGE
    before = np.searchsorted(edge, past, side="left")
    order = np.argsort(past, axis=None, kind="stable")
    there = np.empty(past.size)
    there[order] = _at(pieces, begins, past.ravel()[order])
    smooth = (there.reshape(past.shape) - risen[before]) @ _weights()
    now = before[:, 0]
    pending, since = _pending(jump, edge, tau), np.append(0.0, edge)
    return smooth + risen[now] - pending[now] * np.exp(-(second - since[now]) / tau)


def _jumps(pieces, durations):
    """Jumps of the quantity where one step follows another."""
    ends = [float(p(np.array([d]))[0]) for p, d in zip(pieces[:-1], durations[:-1], strict=True)]
    starts = [float(piece(np.zeros(1))[0]) for piece in pieces[1:]]
    return np.array(starts) - np.array(ends)


def _pending(jump, edge, tau):
    """Difference between a jump and its low-pass right after each edge; none before the first."""
    lacking = [0.0]
    waits = np.diff(edge, prepend=edge[:1])
    for rise, kept in zip(jump, np.exp(-waits / tau), strict=True):
        lacking.append(rise + kept * lacking[-1])
    return np.array(lacking)


def _weights():
    """Integral of exp(−age) over the hat function of each age; they sum to one."""
    low, high = AGE[:-1], AGE[1:]
    whole = np.exp(-low) - np.exp(-high)
    late = whole / (high - low) - np.exp(-high)
    weights = np.append(whole - late, 0.0) + np.append(0.0, late)
    weights[-1] += np.exp(-AGE[-1])
    return weights


FREQUENCY_HERTZ = np.logspace(3, -2, 41)
RELATIVE_NOISE = 0.003


def measured_spectrum(
    impedance_ohm: np.ndarray,
    *,
    ambient_celsius: float,
    seed: int,
    frequency_hertz: np.ndarray = FREQUENCY_HERTZ,
    relative_noise: float = RELATIVE_NOISE,
) -> Columns:
    """Columns of an impedance analyser: noise in proportion to the modulus on both parts.

    Parameters
    ----------
    impedance_ohm : true impedance [ohm] at each frequency.
    ambient_celsius : chamber temperature [°C].
    seed : of the noise.
    frequency_hertz : where it was measured [Hz].
    relative_noise : standard deviation of either part over the modulus [1].
    """
    random = np.random.default_rng(seed)
    spread = relative_noise * np.abs(impedance_ohm)
    noise = random.normal(0.0, 1.0, (2, impedance_ohm.size)) * spread
    surface = ambient_celsius + random.normal(
        0.0, CHAIN.temperature_noise_celsius, impedance_ohm.size
    )
    return {
        "frequency_hertz": frequency_hertz,
        "real_ohm": impedance_ohm.real + noise[0],
        "imaginary_ohm": impedance_ohm.imag + noise[1],
        "surface_celsius": surface,
    }
