"""Many cells taken through one protocol at once: arrays over cells, a loop over time.

Elements that are lags (RC pairs, modes of diffusion) are exact for a current that runs straight
between instants; charge, heat and hysteresis take one step per instant. Current positive on charge.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from virtual_lab.protocols import Step
from virtual_lab.zoo.cell import COURSE, PLAY_SOC, Cell
from virtual_lab.zoo.half_cells import THERMAL_VOLT

REFERENCE_KELVIN, GAS = 298.15, 8.314
SHELLS = 10
BENDS_SECOND = np.array([0.05, 0.3, 1.0, 3.0, 7.0])  # instants after a change of the load
JITTER_SECOND, JITTER_SHARE = 0.04, 0.1
CONTACT_WIDTH = 0.03
COLD_CELSIUS, STRIPPED, STRIPPED_PER_HOUR = 15.0, 4e-4, 0.2
WANDER_KELVIN, WANDER_SECOND = 0.3, 2400.0


class Fleet(NamedTuple):
    """Parameters of n cells: (n,), or (n, k) for elements, or (n, points) for courses."""

    ocv: np.ndarray
    ampere_hour: np.ndarray
    rated: np.ndarray
    limits: np.ndarray
    r: np.ndarray
    tau: np.ndarray
    courses: np.ndarray
    energy: np.ndarray
    own_energy: np.ndarray
    on_charge: np.ndarray
    exchange: np.ndarray
    exchange_course: np.ndarray
    symmetry: np.ndarray
    depletion: np.ndarray
    diffusion: np.ndarray
    play: np.ndarray
    loop: np.ndarray
    gap_volt: np.ndarray
    leak: np.ndarray
    lost: np.ndarray
    bend: np.ndarray
    entropy: np.ndarray
    heat: np.ndarray
    contact: np.ndarray
    growth: np.ndarray
    plating: np.ndarray


def fleet_of(cells: list[Cell], *, aged=0.0) -> Fleet:
    """Parameters of cells as arrays; `aged`: how far through the campaign [1], for `growth`."""

    def of(field):
        return np.array([field(cell) for cell in cells], float)

    return Fleet(
        ocv=of(lambda c: c.ocv),
        ampere_hour=of(lambda c: c.ampere_hour),
        rated=of(lambda c: c.rating.capacity_ampere_hour),
        limits=of(lambda c: (c.rating.lower_cutoff_volt, c.rating.upper_cutoff_volt)),
        r=of(lambda c: c.r),
        tau=of(lambda c: c.tau),
        courses=of(lambda c: c.course),
        energy=of(lambda c: c.energy) / GAS,
        own_energy=of(lambda c: c.own_energy) / GAS,
        on_charge=of(lambda c: c.on_charge),
        exchange=of(lambda c: c.exchange_ampere),
        exchange_course=of(lambda c: c.exchange_course),
        symmetry=of(lambda c: c.symmetry),
        depletion=of(lambda c: c.depletion_volt),
        diffusion=of(lambda c: (c.diffusion_second, c.diffusion_slope)),
        play=of(lambda c: c.play_volt),
        loop=of(lambda c: (c.loop_volt, c.loop_per_soc)),
        gap_volt=of(lambda c: c.gap_volt),
        leak=of(lambda c: c.leak),
        lost=of(lambda c: c.lost_share),
        bend=of(lambda c: c.ampere_hour_bend),
        entropy=of(lambda c: c.entropy),
        heat=of(lambda c: (*c.core, *c.can)),
        contact=of(lambda c: c.contact),
        growth=1.0 + aged * of(lambda c: c.growth),
        plating=of(lambda c: c.plating_volt),
    )


class State(NamedTuple):
    """State of n cells: SoC, overvoltages of the pairs, modes of diffusion, hysteresis, heat.

    `play`, `loop` and `sign` lie between −1 and 1; `core` and `can` are rises over the chamber
    [K]; `plated` lithium as a share of the capacity.
    """

    soc: np.ndarray
    pairs: np.ndarray
    modes: np.ndarray
    play: np.ndarray
    loop: np.ndarray
    sign: np.ndarray
    core: np.ndarray
    can: np.ndarray
    plated: np.ndarray


def rested(soc: np.ndarray) -> State:
    """Cells at rest at states of charge [1], (n,), after a charge."""
    n = len(soc)
    zero, one = np.zeros(n), np.ones(n)
    return State(
        np.array(soc, float),
        np.zeros((n, 3)),
        np.zeros((n, SHELLS)),
        np.ones((n, len(PLAY_SOC))),
        *(one, one, zero, zero, zero),
    )


def _at(table, soc, *, beyond=False):
    """Values of tables (n, points) at n states of charge; `beyond`: lines go on past the ends."""
    last = table.shape[1] - 1
    place = soc * last if beyond else np.clip(soc, 0.0, 1.0) * last
    k = np.clip(place.astype(np.intp), 0, last - 1)
    rows = np.arange(len(soc))
    low = table[rows, k]
    return low + (place - k) * (table[rows, k + 1] - low)


def _weights(ratio):
    """Decay, weight of the current before and after, of a lag over a step of `ratio` time constants."""
    ratio = np.maximum(ratio, 1e-9)
    gain = -np.expm1(-ratio)
    after = 1.0 - gain / ratio
    return 1.0 - gain, gain - after, after


@cache
def diffusion_modes() -> tuple[np.ndarray, np.ndarray]:
    """Rates and weights of the surface's departure from the mean in a sphere of equal shells.

    Finite volumes over the radius, flux at the surface. Rates are in units of D/R², weights sum to
    one: the departure after a long constant flux.
    """
    edge = np.linspace(0.0, 1.0, SHELLS + 1)
    volume = np.diff(edge**3) / 3.0
    area = edge[1:-1] ** 2 * SHELLS  # over the distance of the shells' middles
    between = np.diag(np.append(area, 0.0) + np.append(0.0, area))
    between -= np.diag(area, 1) + np.diag(area, -1)
    root = np.sqrt(volume)
    rate, shape = np.linalg.eigh(between / np.outer(root, root))
    source = np.zeros(SHELLS)
    source[-1] = 1.0
    weight = (shape.T @ (source / root)) * (shape[-1] / root[-1])
    rate, weight = rate[1:], weight[1:]  # the first mode is the mean
    share = weight / rate
    return np.append(rate, 1.0), np.append(share / share.sum(), 0.0)


def _factors(fleet, state, celsius):
    """Factors of the four elements by temperature (n, 4), and by SoC (n, 4)."""
    kelvin = 273.15 + celsius + state.core
    warm = fleet.energy * (1.0 / kelvin - 1.0 / REFERENCE_KELVIN)[:, None]
    own = 1.0 / (REFERENCE_KELVIN + state.core) - 1.0 / REFERENCE_KELVIN
    by_heat = np.exp(warm + (fleet.own_energy * own)[:, None])
    place = np.clip(state.soc, 0.0, 1.0) * (COURSE.size - 1)
    k = np.minimum(place.astype(np.intp), COURSE.size - 2)
    rows = np.arange(len(k))
    low, high = fleet.courses[rows, :, k], fleet.courses[rows, :, k + 1]
    return by_heat, low + (place - k)[:, None] * (high - low)


def advanced(fleet: Fleet, state: State, before, after, second, celsius) -> State:
    """State of the cells a step later.

    Parameters
    ----------
    before, after : current at both ends of the step [A], (n,). second : its length [s], (n,) or
        one. celsius : of the chamber [°C].
    """
    second = np.broadcast_to(np.asarray(second, float), before.shape)
    mean = 0.5 * (before + after)
    by_heat, by_soc = _factors(fleet, state, celsius)
    warmer = celsius + state.core - 25.0
    charge = fleet.ampere_hour * (1 + fleet.bend[:, 0] * np.tanh(warmer / fleet.bend[:, 1]))
    into = np.where(mean > 0, mean * (1 - fleet.lost), mean) - _at(fleet.leak, state.soc)
    moved = into * second / 3600.0 / charge
    decay, early, late = _weights(second[:, None] / (fleet.tau * by_heat[:, 1:]))
    ohm = (fleet.r * by_heat * by_soc)[:, 1:]
    pairs = decay * state.pairs + ohm * (early * before[:, None] + late * after[:, None])
    direction = np.sign(mean) * (np.abs(mean) > 2e-3 * fleet.rated)
    moving = np.where(direction == 0, 0.0, np.abs(moved))
    follow = -np.expm1(-fleet.loop[:, 1] * moving)
    plays = np.clip(state.play + moved[:, None] / PLAY_SOC, -1.0, 1.0)
    power = mean * (mean * fleet.r[:, 0] * by_heat[:, 0] + state.pairs.sum(axis=1))
    core, can = _heated(fleet.heat, state, power, second)
    return State(
        state.soc + moved,
        pairs,
        _depleted(fleet, state, before, after, second),
        plays,
        state.loop + follow * (direction - state.loop),
        np.where(direction == 0, state.sign, direction),
        core,
        can,
        _plated(fleet, state, mean, second, celsius),
    )


def _depleted(fleet, state, before, after, second):
    """Modes of diffusion a step later; they follow the C-rate."""
    if not fleet.depletion.any():
        return state.modes
    rate = diffusion_modes()[0]
    faster = np.exp(fleet.diffusion[:, 1] * (state.soc - 0.5)) / fleet.diffusion[:, 0]
    decay, early, late = _weights((second * faster)[:, None] * rate)
    c_rate = np.stack([before, after]) / fleet.rated
    return decay * state.modes + early * c_rate[0][:, None] + late * c_rate[1][:, None]


def _heated(heat, state, power, second):
    """Rises of core and can a step later: two thermal masses one after the other."""
    through = (state.core - state.can) / heat[:, 0]
    core = state.can + heat[:, 0] * power
    core = core + (state.core - core) * np.exp(-second / heat[:, 1])
    can = heat[:, 2] * through
    return core, can + (state.can - can) * np.exp(-second / heat[:, 3])


def _plated(fleet, state, mean, second, celsius):
    """Lithium plated on charge in the cold and stripped again afterwards."""
    if not fleet.plating.any():
        return state.plated
    rate = mean / fleet.rated
    cold = max((COLD_CELSIUS - celsius) / 10.0, 0.0)
    change = np.where(rate > 0, cold * rate, np.minimum(rate, -STRIPPED_PER_HOUR))
    return np.maximum(state.plated + change * second / 3600.0, 0.0)


def volt(fleet: Fleet, state: State, ampere, celsius) -> np.ndarray:
    """Voltage [V] of the cells at a current [A], (n,)."""
    by_heat, by_soc = _factors(fleet, state, celsius)
    ohm = fleet.r[:, 0] * by_heat[:, 0] * by_soc[:, 0] * fleet.growth
    ohm = ohm * np.where(ampere > 0, 1.0 + _at(fleet.on_charge, state.soc), 1.0)
    edge, above = fleet.contact[:, 1], np.abs(ampere)
    far = np.clip((above - edge) / (CONTACT_WIDTH * edge), -40.0, 40.0)
    ohm = ohm + fleet.contact[:, 0] / (1.0 + np.exp(-far))
    stripping = np.where(ampere > 0, 0.0, state.plated / (state.plated + STRIPPED))
    return (
        _at(fleet.ocv, state.soc, beyond=True)
        + ohm * ampere
        + state.pairs.sum(axis=1)
        + _kinetic(fleet, state, ampere, celsius)
        + fleet.depletion * (state.modes @ diffusion_modes()[1])
        + (fleet.play * state.play).sum(axis=1)
        + fleet.loop[:, 0] * state.loop
        + fleet.gap_volt * state.sign
        + _at(fleet.entropy, state.soc) * (celsius + state.core - 25.0)
        + fleet.plating * stripping
    )


def _kinetic(fleet, state, ampere, celsius):
    """Overvoltage [V] of Butler–Volmer kinetics I = I₀ (exp((1−α) f η) − exp(−α f η))."""
    if not fleet.exchange.any():
        return 0.0
    with_it = fleet.exchange > 0
    exchange = fleet.exchange * _at(fleet.exchange_course, state.soc)
    share = np.where(with_it, ampere / np.where(with_it, exchange, 1.0), 0.0)
    up, down = 1.0 - fleet.symmetry, fleet.symmetry
    x = 2.0 * np.arcsinh(0.5 * share)
    for _ in range(6):
        rise, fall = np.exp(up * x), np.exp(-down * x)
        x = x - (rise - fall - share) / (up * rise + down * fall)
    return x * THERMAL_VOLT * (273.15 + celsius) / REFERENCE_KELVIN


class Track(NamedTuple):
    """What happened at each instant (m, n): clock [s], step, current [A], voltage [V], SoC [1].

    `celsius` is that of the can; `there` is false where a cell's step had ended already.
    """

    second: np.ndarray
    step: np.ndarray
    ampere: np.ndarray
    volt: np.ndarray
    soc: np.ndarray
    celsius: np.ndarray
    there: np.ndarray


def track(
    steps: list[Step], fleet: Fleet, start_soc: np.ndarray, celsius: float, *, seed: int
) -> Track:
    """Take cells, rested and charged before, through a protocol for a cell of 1 Ah.

    Parameters
    ----------
    steps : protocol of a cell of `UNIT`: its currents are C-rates, its cut-offs 0 and 1 stand for
        the cell's own. fleet : the cells. start_soc : (n,). celsius : of the chamber. seed : of
        the clock and of the chamber's wandering.
    """
    random = np.random.default_rng(seed)
    n = len(start_soc)
    state, clock, ampere = rested(start_soc), np.zeros(n), np.zeros(n)
    phase = random.uniform(0.0, 2 * np.pi)
    rows = []
    for number, step in enumerate(steps, 1):
        around = celsius + WANDER_KELVIN * np.sin(2 * np.pi * clock.mean() / WANDER_SECOND + phase)
        one = _one_step(step, fleet, state, ampere, around, sampled(step, random))
        state, ampere = one.state, one.ampere
        rows += [(clock + second, np.full(n, number), *row) for second, *row in one.rows]
        clock = clock + one.second
    return Track(*(np.array(column) for column in zip(*rows, strict=True)))


def sampled(step: Step, random: np.random.Generator) -> np.ndarray:
    """Instants [s] of a step, from soon after its begin to its end, on a jittery clock."""
    end = float(step.duration_second)
    regular = np.arange(step.period_second, end, step.period_second)
    size = min(JITTER_SECOND, JITTER_SHARE * step.period_second)
    early = BENDS_SECOND[0.6 * step.period_second > BENDS_SECOND]
    early = early if early.size else BENDS_SECOND[:1]
    jittered = regular + random.uniform(-size, size, regular.size)
    times = np.concatenate([early[early < end], jittered, [end]])
    times = np.sort(times[(times > 0) & (times <= end)])
    return times[np.append(True, np.diff(times) > 1e-4)]


class OneStep(NamedTuple):
    """End of a step: state, current, its length for each cell, and rows at its instants."""

    state: State
    ampere: np.ndarray
    second: np.ndarray
    rows: list


def _one_step(step, fleet, state, ampere, celsius, times):
    limit = None if step.until_volt is None else fleet.limits[:, int(step.until_volt)]
    side = 1.0 if step.until_volt == 1.0 else -1.0
    held = fleet.limits[:, int(step.value)] if step.kind == "hold" else None
    active, own = np.ones(len(ampere), bool), np.zeros(len(ampere))
    shown, rows, before = volt(fleet, state, ampere, celsius), [], 0.0
    # The load is entered at once: the current at the begin of the step is the step's own.
    ampere = _asked(step, fleet, 0.0, ampere, held)
    for now in times:
        second = np.where(active, now - before, 0.0)
        after = _asked(step, fleet, now, ampere, held)
        if held is not None:
            after = _holding(fleet, state, ampere, second, celsius, held)
        new = advanced(fleet, state, ampere, after, second, celsius)
        level = volt(fleet, new, after, celsius)
        over = active & (side * (level - limit) > 0) if limit is not None else active & False
        if over.any():
            share = np.clip((limit - shown) / np.where(over, level - shown, 1.0), 0.02, 1.0)
            second = np.where(over, share * second, second)
            new = advanced(fleet, state, ampere, after, second, celsius)
            level = volt(fleet, new, after, celsius)
        own = own + second
        state, shown, before = new, level, now
        ampere = np.where(active, after, ampere)
        rows.append((own.copy(), ampere, level, state.soc, celsius + state.can, active.copy()))
        if step.until_ampere is not None and held is not None:
            over = over | (active & (np.abs(after) <= step.until_ampere * fleet.rated))
        active = active & ~over
        if not active.any():
            break
    return OneStep(state, ampere, own, rows)


def _asked(step, fleet, second, ampere, held):
    """Current [A] that a step asks for at a time [s] after its begin; of a hold, as it is."""
    if held is not None:
        return ampere
    if step.kind == "profile":
        return fleet.rated * np.interp(second, step.value[:, 0], step.value[:, 1])
    return fleet.rated * step.value


def _holding(fleet, state, ampere, second, celsius, held):
    """Current [A] at the end of a step at which the voltage is the one held, by three secants."""
    low, high = ampere, ampere * 0.98 - 1e-3 * fleet.rated

    def miss(after):
        return volt(fleet, advanced(fleet, state, ampere, after, second, celsius), after, celsius)

    at_low, at_high = miss(low) - held, miss(high) - held
    for _ in range(3):
        slope = (at_high - at_low) / np.where(high == low, 1.0, high - low)
        slope = np.where(np.abs(slope) > 1e-6, slope, 1e-2)
        low, at_low, high = high, at_high, high - at_high / slope
        at_high = miss(high) - held
    return high
