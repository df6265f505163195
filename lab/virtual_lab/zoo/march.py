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
NEWTON = 6
BENDS_SECOND = np.array([0.05, 0.3, 1.0, 3.0, 7.0])  # instants after a change of the load
JITTER_SECOND, JITTER_SHARE = 0.04, 0.1
CONTACT_WIDTH = 0.03
COLD_CELSIUS, STRIPPED, STRIPPED_PER_HOUR = 15.0, 4e-4, 0.2
WANDER_KELVIN, WANDER_SECOND = 0.3, 2400.0


class Fleet(NamedTuple):
    """Parameters of n cells: (n,), (n, k) for elements, (n, points, 8) for courses."""

    ocv: np.ndarray
    ampere_hour: np.ndarray
    rated: np.ndarray
    limits: np.ndarray
    r: np.ndarray
    tau: np.ndarray
    courses: np.ndarray
    energy: np.ndarray
    own_energy: np.ndarray
    exchange: np.ndarray
    symmetry: np.ndarray
    depletion: np.ndarray
    diffusion: np.ndarray
    play: np.ndarray
    loop: np.ndarray
    gap_volt: np.ndarray
    lost: np.ndarray
    bend: np.ndarray
    heat: np.ndarray
    contact: np.ndarray
    growth: np.ndarray
    plating: np.ndarray
    rows: np.ndarray


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
        courses=of(_courses).transpose(0, 2, 1).copy(),
        energy=of(lambda c: c.energy) / GAS,
        own_energy=of(lambda c: c.own_energy) / GAS,
        exchange=of(lambda c: c.exchange_ampere),
        symmetry=of(lambda c: c.symmetry),
        depletion=of(lambda c: c.depletion_volt),
        diffusion=of(lambda c: (c.diffusion_second, c.diffusion_slope)),
        play=of(lambda c: c.play_volt),
        loop=of(lambda c: (c.loop_volt, c.loop_per_soc)),
        gap_volt=of(lambda c: c.gap_volt),
        lost=of(lambda c: c.lost_share),
        bend=of(lambda c: c.ampere_hour_bend),
        heat=of(lambda c: (*c.core, *c.can)),
        contact=of(lambda c: c.contact),
        growth=1.0 + aged * of(lambda c: c.growth),
        plating=of(lambda c: c.plating_volt),
        rows=np.arange(len(cells)),
    )


def _courses(cell):
    """All that runs over COURSE, in the order of `Local.course`."""
    return (*cell.course, cell.on_charge, cell.exchange_course, cell.leak, cell.entropy)


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


class Local(NamedTuple):
    """What the cells are like in their states: OCV [V], factors of the elements by heat and SoC.

    `course`: values (n, 8) at the SoC: of four elements, of the charge's excess, of the exchange
    current, of the leak [A], of the entropy [V/K].
    """

    ocv: np.ndarray
    by_heat: np.ndarray
    course: np.ndarray


ON_CHARGE, EXCHANGE, LEAK, ENTROPY = 4, 5, 6, 7


def local(fleet: Fleet, state: State, celsius) -> Local:
    """What depends on SoC and temperature, at the states of n cells and a chamber [°C]."""
    rows, last = fleet.rows, fleet.ocv.shape[1] - 1
    # Beyond full and empty the OCV goes on straight; courses keep their ends.
    place = state.soc * last
    k = np.minimum(np.maximum(place, 0.0), last - 1).astype(np.intp)
    low = fleet.ocv[rows, k]
    ocv = low + (place - k) * (fleet.ocv[rows, k + 1] - low)
    place = np.minimum(np.maximum(state.soc, 0.0), 1.0) * (COURSE.size - 1)
    k = np.minimum(place.astype(np.intp), COURSE.size - 2)
    low = fleet.courses[rows, k]
    course = low + (place - k)[:, None] * (fleet.courses[rows, k + 1] - low)
    warm = 1.0 / (273.15 + celsius + state.core) - 1.0 / REFERENCE_KELVIN
    own = 1.0 / (REFERENCE_KELVIN + state.core) - 1.0 / REFERENCE_KELVIN
    by_heat = np.exp(fleet.energy * warm[:, None] + (fleet.own_energy * own)[:, None])
    return Local(ocv, by_heat, course)


def _weights(ratio):
    """Decay, and weights of the current before and after, over a step of `ratio` time constants."""
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


def advanced(fleet: Fleet, state: State, here: Local, before, after, second, celsius) -> State:
    """State of the cells a step later.

    Parameters
    ----------
    here : of `local`. before, after : current at both ends of the step [A], (n,).
    second : its length [s], (n,). celsius : of the chamber [°C].
    """
    mean = 0.5 * (before + after)
    warmer = celsius + state.core - 25.0
    charge = fleet.ampere_hour * (1 + fleet.bend[:, 0] * np.tanh(warmer / fleet.bend[:, 1]))
    into = np.where(mean > 0, mean * (1 - fleet.lost), mean) - here.course[:, LEAK]
    moved = into * second / 3600.0 / charge
    decay, early, late = _weights(second[:, None] / (fleet.tau * here.by_heat[:, 1:]))
    ohm = fleet.r * here.by_heat * here.course[:, :4]
    driven = early * before[:, None] + late * after[:, None]
    direction = np.sign(mean) * (np.abs(mean) > 2e-3 * fleet.rated)
    moving = np.where(direction == 0, 0.0, np.abs(moved))
    follow = -np.expm1(-fleet.loop[:, 1] * moving)
    plays = np.minimum(np.maximum(state.play + moved[:, None] / PLAY_SOC, -1.0), 1.0)
    power = mean * (mean * ohm[:, 0] + state.pairs.sum(axis=1))
    core, can = _heated(fleet.heat, state, power, second)
    return State(
        state.soc + moved,
        decay * state.pairs + ohm[:, 1:] * driven,
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
    cold = np.maximum((COLD_CELSIUS - celsius) / 10.0, 0.0)
    change = np.where(rate > 0, cold * rate, np.minimum(rate, -STRIPPED_PER_HOUR))
    return np.maximum(state.plated + change * second / 3600.0, 0.0)


def volt(fleet: Fleet, state: State, here: Local, ampere, celsius) -> np.ndarray:
    """Voltage [V] of the cells at a current [A], (n,); `here`: of `local`."""
    ohm = fleet.r[:, 0] * here.by_heat[:, 0] * here.course[:, 0] * fleet.growth
    ohm = ohm * np.where(ampere > 0, 1.0 + here.course[:, ON_CHARGE], 1.0)
    ohm = ohm + _contact(fleet, ampere)
    stripping = np.where(ampere > 0, 0.0, state.plated / (state.plated + STRIPPED))
    return (
        here.ocv
        + ohm * ampere
        + state.pairs.sum(axis=1)
        + _kinetic(fleet, here, ampere, celsius)
        + fleet.depletion * (state.modes @ diffusion_modes()[1])
        + (fleet.play * state.play).sum(axis=1)
        + fleet.loop[:, 0] * state.loop
        + fleet.gap_volt * state.sign
        + here.course[:, ENTROPY] * (celsius + state.core - 25.0)
        + fleet.plating * stripping
    )


def _contact(fleet, ampere):
    """Resistance [ohm] of a contact that opens above a current."""
    if not fleet.contact[:, 0].any():
        return 0.0
    edge = fleet.contact[:, 1]
    far = np.clip((np.abs(ampere) - edge) / (CONTACT_WIDTH * edge), -40.0, 40.0)
    return fleet.contact[:, 0] / (1.0 + np.exp(-far))


def _kinetic(fleet, here, ampere, celsius):
    """Overvoltage [V] of Butler–Volmer kinetics I = I₀ (exp((1−α) f η) − exp(−α f η))."""
    own = np.flatnonzero(fleet.exchange)
    shown = np.zeros(len(ampere))
    if not own.size:
        return shown
    share = ampere[own] / (fleet.exchange[own] * here.course[own, EXCHANGE])
    up, down = 1.0 - fleet.symmetry[own], fleet.symmetry[own]
    x = 2.0 * np.arcsinh(0.5 * share)
    for _ in range(NEWTON):
        rise, fall = np.exp(up * x), np.exp(-down * x)
        x = x - (rise - fall - share) / (up * rise + down * fall)
    kelvin = 273.15 + np.broadcast_to(celsius, ampere.shape)[own]
    shown[own] = x * THERMAL_VOLT * kelvin / REFERENCE_KELVIN
    return shown


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


def track(steps: list[Step], fleet: Fleet, start_soc: np.ndarray, celsius, *, seed: int) -> Track:
    """Take cells, rested and charged before, through a protocol for a cell of 1 Ah.

    Parameters
    ----------
    steps : protocol of a cell of `UNIT`: its currents are C-rates, its cut-offs 0 and 1 stand for
        the cell's own. fleet : the cells. start_soc : (n,). celsius : of the chamber, (n,) or
        one. seed : of the clock and of the chamber's wandering.
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
    here = local(fleet, state, celsius)
    shown, rows, before = volt(fleet, state, here, ampere, celsius), [], 0.0
    # The load is entered at once: the current at the begin of the step is the step's own.
    ampere = _asked(step, fleet, 0.0, ampere, held)
    for now in times:
        second = np.where(active, now - before, 0.0)
        after = _asked(step, fleet, now, ampere, held)
        if held is not None:
            after = _holding(fleet, state, here, ampere, second, celsius, held)
        new = advanced(fleet, state, here, ampere, after, second, celsius)
        there = local(fleet, new, celsius)
        level = volt(fleet, new, there, after, celsius)
        over = active & (side * (level - limit) > 0) if limit is not None else active & False
        if over.any():
            share = np.clip((limit - shown) / np.where(over, level - shown, 1.0), 0.02, 1.0)
            second = np.where(over, share * second, second)
            new = advanced(fleet, state, here, ampere, after, second, celsius)
            there = local(fleet, new, celsius)
            level = volt(fleet, new, there, after, celsius)
        own = own + second
        state, here, shown, before = new, there, level, now
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


def _holding(fleet, state, here, ampere, second, celsius, held):
    """Current [A] at the end of a step at which the voltage is the one held, by three secants."""
    low, high = ampere, ampere * 0.98 - 1e-3 * fleet.rated

    def miss(after):
        new = advanced(fleet, state, here, ampere, after, second, celsius)
        return volt(fleet, new, local(fleet, new, celsius), after, celsius)

    at_low, at_high = miss(low) - held, miss(high) - held
    for _ in range(3):
        slope = (at_high - at_low) / np.where(high == low, 1.0, high - low)
        slope = np.where(np.abs(slope) > 1e-6, slope, 1e-2)
        low, at_low, high = high, at_high, high - at_high / slope
        at_high = miss(high) - held
    return high
