"""A pack under load: how every cell's model moves, and how the wiring divides the current."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.temperature import SMALLEST, ZERO_CELSIUS_KELVIN
from cellwright.numerics.lags import HOLDS, lag_weights
from cellwright.packs.cells import TABLES
from cellwright.packs.network import currents, network_of, reduced
from cellwright.packs.thermal import thermal_modes, warmed
from cellwright.refusal import Refusal

TOLERANCE_VOLT = 1e-9
MOST_PASSES = 60
SAME_SOC = 1e-4  # a cell without kinetics or hysteresis is linear within so much of its SoC


class PackRun(NamedTuple):
    """A simulated pack; currents and voltages positive on charge.

    cell_current_ampere, cell_voltage_volt, soc, temperature_celsius : (n, cells) [A], [V], [1],
    [degC]. voltage_volt : (n,) between the pack's leads, or at the wiring's sense point [V].
    """

    cell_current_ampere: np.ndarray
    cell_voltage_volt: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray
    temperature_celsius: np.ndarray


class PackState(NamedTuple):
    """A pack at one moment: what its cells remember; (cells,), of several elements (cells, e).

    parameters : looked up at the moment, name → (cells, e). relaxed_volt : of RC pairs.
    kinetic_volt, hysteresis_volt : [V]. surface_soc : parts of what the surface leads by [1].
    total_ampere : through the pack [A]. heat_watt : losses, I·(V − OCV) [W].
    """

    soc: np.ndarray
    current_ampere: np.ndarray
    total_ampere: float
    relaxed_volt: np.ndarray
    kinetic_volt: np.ndarray
    hysteresis_volt: np.ndarray
    surface_soc: np.ndarray
    temperature_celsius: np.ndarray
    heat_watt: np.ndarray
    parameters: dict


class Step(NamedTuple):
    """One step: its length, and how the branch currents run in it.

    ramp_ampere : (cells,) a cell's current runs on a straight line that rises by this much to what
    it is at the end [A]. hold : weights of the lags are exact for it.
    """

    second: float
    ramp_ampere: np.ndarray
    hold: str


class Response(NamedTuple):
    """Voltage of each cell at a current, its slope [ohm], and what it remembers then."""

    voltage_volt: np.ndarray
    slope_ohm: np.ndarray
    ocv_volt: np.ndarray
    soc: np.ndarray
    relaxed_volt: np.ndarray
    kinetic_volt: np.ndarray
    hysteresis_volt: np.ndarray
    surface_soc: np.ndarray
    parameters: dict


class Solved(NamedTuple):
    """Currents (elements,), cells' voltages (cells,), the network, and the cells' responses."""

    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    network: object
    response: Response


def simulate_pack(
    test_time_second,
    current_ampere,
    cells,
    wiring,
    *,
    initial_soc,
    ambient_celsius=None,
    thermal=None,
    hold="first_order",
    tolerance_volt=TOLERANCE_VOLT,
):
    """Currents, voltages, SoC and temperatures of all cells of a pack under a total current.

    At every sample the cells' equations at that moment and Kirchhoff's laws hold together. 1. Each
    cell is linearised about its last iterate, V = E + Z·I. 2. The wiring is solved exactly for
    these. 3. Both again, until no cell's voltage is further from its line than `tolerance_volt`
    (Newton; a step that overshoots is shortened). Cells of resistors and RC pairs are linear: one
    pass, about the SoC that the last currents lead to, unless that was off by more than 1e-4.

    A cell's current runs in a step on a straight line that ends at what Kirchhoff's laws give and
    rises by the cell's share (by capacity) of the rise of the total. So a cell alone is what
    `circuits.simulate` gives, and currents that flow between unequal cells only decay, however
    long the step.

    Parameters
    ----------
    test_time_second, current_ampere : (n,) never falling [s]; total, positive on charge [A].
    cells : PackCells. wiring : Wiring of as many cells.
    initial_soc : scalar or (cells,) in the order of the wiring's leaves [1].
    ambient_celsius : scalar or (n,); without `thermal` the temperature of all cells [degC]. None
        where the tables know one temperature.
    thermal : Thermal, or None: cells have the ambient's temperature.
    hold : of the total current between samples: "first_order" (a straight line), or "zero_order"
        (it keeps its value until the next sample).
    tolerance_volt : of Newton's method [V].

    Returns
    -------
    run : PackRun.

    Raises
    ------
    Refusal : time that runs back, values that are not finite, another number of cells than in the
        wiring, no temperature where one is needed, a parallel member without any resistance, or a
        step whose equations are not solved.

    Source: docs/packs.md; of the parallel group thesis 5.3.
    """
    time, total = _record(test_time_second, current_ampere, hold)
    network = network_of(wiring, cells.capacity_ampere_hour)
    ambient = _ambient(ambient_celsius, cells, thermal, len(time))
    modes = None if thermal is None else thermal_modes(thermal, network.cells)
    state = start(cells, network, initial_soc, ambient[0], thermal, first_ampere=total[0])
    steps = np.diff(time, prepend=time[0])
    rows = []
    for k, second in enumerate(steps):
        if hold == "zero_order" and second > 0:
            held = Step(second, np.zeros(network.cells), hold)
            _, after = advance(cells, network, state, held, state.total_ampere, tolerance_volt)
            state = warm(modes, state, after, ambient[k], second)
            second = 0.0
        rise = (total[k] - state.total_ampere) * network.share
        step = Step(second, rise, hold)
        solved, after = advance(cells, network, state, step, total[k], tolerance_volt)
        state = warm(modes, state, after, ambient[k], second)
        sensed = sensed_volt(wiring, network, solved)
        through = solved.current_ampere[: network.cells]
        rows.append((through, solved.voltage_volt, sensed, state.soc, state.temperature_celsius))
    return PackRun(*(np.array(column) for column in zip(*rows, strict=True)))


def _record(test_time_second, current_ampere, hold):
    time = np.asarray(test_time_second, float)
    total = np.asarray(current_ampere, float)
    if time.shape != total.shape or time.ndim != 1 or not len(time):
        raise Refusal(f"time has shape {time.shape}, current {total.shape}; both must be (n,)")
    if not (np.isfinite(time).all() and np.isfinite(total).all()):
        raise Refusal("time or total current holds values that are not finite")
    if np.any(np.diff(time) < 0):
        raise Refusal(f"time runs back after sample {int(np.argmax(np.diff(time) < 0))}")
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")
    return time, total


def _ambient(ambient_celsius, cells, thermal, samples):
    if ambient_celsius is not None:
        return np.broadcast_to(np.asarray(ambient_celsius, float), (samples,))
    if thermal is not None or len(cells.temperature_celsius) > 1:
        raise Refusal("parameters follow temperature, but no ambient temperature is given")
    return np.full(samples, cells.temperature_celsius[0])


def start(cells, network, initial_soc, ambient_celsius, thermal=None, *, first_ampere=0.0):
    """State of a pack at rest.

    Parameters
    ----------
    cells : PackCells. network : Network. initial_soc : scalar or (cells,) [1].
    ambient_celsius : [degC]. thermal : Thermal or None.
    first_ampere : total current of the first sample [A], whose direction counts as the load before
        it for cells of which the model knows a history.

    Returns
    -------
    state : PackState.

    Raises
    ------
    Refusal : another number of cells, or of values of SoC.
    """
    count = network.cells
    if len(cells.capacity_ampere_hour) != count:
        raise Refusal(f"{len(cells.capacity_ampere_hour)} models for {count} cells of the wiring")
    given = np.asarray(initial_soc, float)
    if given.shape not in ((), (count,)) or not np.isfinite(given).all():
        raise Refusal(f"initial SoC is {initial_soc}; wanted one, or one for each of {count} cells")
    soc = np.broadcast_to(given, (count,)).copy()
    begin = None if thermal is None else thermal.initial_celsius
    celsius = np.full(count, ambient_celsius if begin is None else begin, float)
    parameters = looked_up(cells, soc, celsius)
    nothing = {"relaxed_volt": "r_ohm", "kinetic_volt": "kinetic_r_ohm"}
    nothing |= {"surface_soc": "soc_per_ampere"}
    remembered = {name: np.zeros_like(parameters[table]) for name, table in nothing.items()}
    direction = _led_here(cells, soc, np.sign(first_ampere))
    remembered["hysteresis_volt"] = direction[:, None] * parameters["hysteresis_volt"]
    none = np.zeros(count)
    return PackState(
        soc=soc,
        current_ampere=none,
        total_ampere=0.0,
        temperature_celsius=celsius,
        heat_watt=none,
        parameters=parameters,
        **remembered,
    )


def _led_here(cells, soc, first):
    """Direction of the load before the first sample, 0 where the model knows of none (cells,)."""
    near = cells.near_end_soc
    at_rest = (soc > 1.0 - near).astype(float) - (soc < near)
    return np.where(near > 0, at_rest if first == 0 else first, 0.0)


def looked_up(cells, soc, temperature_celsius):
    """Parameters of every cell at its SoC and temperature: name → (cells, entries).

    Linear in SoC; between two temperatures voltages are linear in 1/T, and the logarithms of all
    else. Outside 0…1 and the tables' temperatures they stay what they are; the OCV goes on as
    steeply as it ends.

    Parameters
    ----------
    cells : PackCells. soc, temperature_celsius : (cells,) [1], [degC].
    """
    return {name: _entries(cells, name, soc, temperature_celsius)[0] for name in TABLES}


def _entries(cells, name, soc, celsius):
    """Entries of a table at each cell's SoC and temperature, and their slopes over SoC."""
    table = getattr(cells, name)
    last, rows = table.shape[-1] - 1, np.arange(len(soc))
    lower = np.clip((soc * last).astype(int), 0, last - 1)
    share = soc * last - lower
    inside = share if name == "ocv_volt" else np.minimum(np.maximum(share, 0.0), 1.0)
    low, high = (
        _at_temperature(cells, table[:, rows, :, at], name, celsius) for at in (lower, lower + 1)
    )
    return low + (high - low) * inside[:, None], (high - low) * last


def _at_temperature(cells, values, name, celsius):
    """Values (cells, temperatures, e) at each cell's temperature (cells, e)."""
    measured = cells.temperature_celsius
    if len(measured) == 1:
        return values[:, 0]
    inverse = -1.0 / (measured + ZERO_CELSIUS_KELVIN)
    here = -1.0 / (np.clip(celsius, measured[0], measured[-1]) + ZERO_CELSIUS_KELVIN)
    right = np.clip(np.searchsorted(inverse, here, side="right"), 1, len(measured) - 1)
    weight = ((here - inverse[right - 1]) / (inverse[right] - inverse[right - 1]))[:, None]
    rows = np.arange(len(values))
    cold, hot = values[rows, right - 1], values[rows, right]
    if name in ("ocv_volt", "ocv_shift_volt"):
        return cold + weight * (hot - cold)
    low, high = (np.log(np.maximum(v, SMALLEST)) for v in (cold, hot))
    return np.where((cold > 0) & (hot > 0), np.exp(low + weight * (high - low)), 0.0)


def advance(cells, network, state, step, total_ampere, tolerance_volt=TOLERANCE_VOLT):
    """A pack one step later, at a total current.

    Parameters
    ----------
    cells : PackCells. network : Network. state : PackState. step : Step.
    total_ampere : at the end of the step [A]. tolerance_volt : of Newton's method [V].

    Returns
    -------
    solved : Solved. state : PackState, still with the temperatures before the step.

    Raises
    ------
    Refusal : as `simulate_pack`.
    """
    guess = state.current_ampere + network.share * (total_ampere - state.total_ampere)
    solved = newton(cells, network, state, step, guess, tolerance_volt, lambda _: total_ampere)
    response, through = solved.response, solved.current_ampere[: network.cells]
    heat = through * (solved.voltage_volt - response.ocv_volt)
    return solved, state._replace(
        soc=response.soc,
        current_ampere=through,
        total_ampere=float(solved.current_ampere[-1]),
        relaxed_volt=response.relaxed_volt,
        kinetic_volt=response.kinetic_volt,
        hysteresis_volt=response.hysteresis_volt,
        surface_soc=response.surface_soc,
        heat_watt=heat,
        parameters=response.parameters,
    )


def newton(cells, network, state, step, guess, tolerance_volt, total_of):
    """Currents that satisfy the cells' equations and Kirchhoff's laws together.

    Parameters
    ----------
    cells, network, state, step, tolerance_volt : as in `advance`.
    guess : (cells,) currents to begin with [A].
    total_of : function of `network.Reduced` → total current [A]: what is asked of the pack.

    Returns
    -------
    solved : Solved.

    Raises
    ------
    Refusal : not solved after 60 passes.
    """
    weights = _weights(state, step)
    linear = not (state.kinetic_volt.size or state.hysteresis_volt.size)
    linear &= not cells.two_way_ohm.size
    at = respond(cells, state, step, weights, guess)
    if step.second == 0 and not guess.any() and not at.slope_ohm.all():
        # At rest at an instant: what acts at once decides nothing where it is nothing.
        lines = reduced(network, at.voltage_volt, np.ones(network.cells))
        return Solved(np.zeros(len(lines.source_volt)), at.voltage_volt, lines, at)
    for _ in range(MOST_PASSES):
        lines = reduced(network, at.voltage_volt - at.slope_ohm * guess, at.slope_ohm)
        current = currents(network, lines, total_of(lines))
        through = current[: network.cells]
        on_line = at.voltage_volt + at.slope_ohm * (through - guess)
        moved = step.second * (through - guess) / (3600.0 * cells.capacity_ampere_hour)
        if linear and np.abs(moved).max() <= SAME_SOC:
            found = respond(cells, state, step, weights, through, at.parameters)
            return Solved(current, on_line, lines, found)
        found = respond(cells, state, step, weights, through)
        off = found.voltage_volt - on_line
        if np.abs(off).max() <= tolerance_volt:
            return Solved(current, on_line, lines, found)
        short = _shortened(through - guess, at.slope_ohm, off)
        guess = guess + short * (through - guess)
        at = found if short == 1.0 else respond(cells, state, step, weights, guess)
    worst = int(np.argmax(np.abs(off)))
    raise Refusal(
        f"{cells.names[worst]} is still {abs(off[worst]):.2g} V from its equations after "
        f"{MOST_PASSES} passes, in a step of {step.second:g} s"
    )


def _shortened(direction, slope, off):
    """Share of a step to take, 1 where it does not overshoot what the cells dissipate.

    The wiring's part of the dissipation is solved exactly, so the slope of all of it along the
    step is at its end Σ direction·off (Tellegen), and at its begin −Σ slope·direction² or less.
    """
    begin, end = slope @ direction**2, direction @ off
    return 1.0 if end <= 0.5 * begin else begin / (begin + end)


def _weights(state, step):
    """Weights of the lags over the step, by name of the time constant: (decay, before, after)."""
    found = {}
    for name in ("tau_second", "kinetic_tau_second", "soc_tau_second"):
        tau = state.parameters[name]
        at_once = tau <= 0
        weights = lag_weights(step.second, np.where(at_once, 1.0, tau), hold=step.hold)
        found[name] = [np.where(at_once, w, v) for w, v in zip((0, 0, 1), weights, strict=True)]
    return found


def respond(cells, state, step, weights, current, parameters=None):
    """Voltage of each cell a step later if its current ends at a value, and its slope.

    Parameters
    ----------
    cells, state, step : as in `advance`. weights : of the lags in this step.
    current : (cells,) at the end of the step [A].
    parameters : at the end of the step; None: looked up where the current leads.

    Returns
    -------
    response : Response.
    """
    begin, per_ampere = (
        current - step.ramp_ampere,
        step.second / (3600.0 * cells.capacity_ampere_hour),
    )
    mean = 0.5 * (begin + current)
    soc = state.soc + per_ampere * mean
    celsius, before = state.temperature_celsius, state.parameters
    now = looked_up(cells, soc, celsius) if parameters is None else parameters
    column, begin_column = current[:, None], begin[:, None]

    def lagged(held, drive, name):
        decay, old, new = weights[name]
        (was, was_slope), (is_, is_slope) = drive(before, begin_column), drive(now, column)
        return decay * held + old * was + new * is_, old * was_slope + new * is_slope

    relaxed, slope = lagged(state.relaxed_volt, _ohmic("r_ohm"), "tau_second")
    kinetic, kinetic_slope = lagged(state.kinetic_volt, _arcsinh, "kinetic_tau_second")
    surface, surface_slope = lagged(state.surface_soc, _ohmic("soc_per_ampere"), "soc_tau_second")
    hysteresis, hysteresis_slope = _by_charge(state.hysteresis_volt, before, mean, step.second)
    at_once, at_once_slope = _at_once(now, current)
    ahead = soc + surface.sum(axis=1)
    volt, rise = (v[:, 0] for v in _entries(cells, "ocv_volt", ahead, celsius))
    if surface.size:
        volt = volt + now["ocv_shift_volt"][:, 0]
        volt = volt - _entries(cells, "ocv_shift_volt", ahead, celsius)[0][:, 0]
    parts = [relaxed, kinetic, hysteresis]
    slopes = [slope, kinetic_slope, hysteresis_slope]
    ocv_slope = np.maximum(rise, 0.0) * (per_ampere + surface_slope.sum(axis=1))
    return Response(
        volt + at_once + sum(part.sum(axis=1) for part in parts),
        ocv_slope + at_once_slope + sum(part.sum(axis=1) for part in slopes),
        now["ocv_volt"][:, 0],
        *(soc, relaxed, kinetic, hysteresis, surface, now),
    )


def _ohmic(name):
    """Drive of a linear element and its slope."""
    return lambda p, current: (p[name] * current, p[name])


def _arcsinh(p, current):
    """Drive of kinetics and its slope: scale·arcsinh(r·I/scale)."""
    r, scale = p["kinetic_r_ohm"], p["kinetic_scale_volt"]
    return scale * np.arcsinh(r * current / scale), r / np.hypot(1.0, r * current / scale)


def _at_once(p, current):
    """Voltage of the resistances that act at once, and its slope."""
    r = p["r0_ohm"][:, 0]
    if p["two_way_ohm"].size:
        r = r + np.where(current > 0, *p["two_way_ohm"].T)
    return r * current, r


def _by_charge(held, p, mean, second):
    """Hysteresis after the charge of the step, and its slope over the current at its end."""
    charge = 3600.0 * p["hysteresis_ampere_hour"]
    decay = np.exp(-np.abs(mean)[:, None] * second / charge)
    goal = p["hysteresis_volt"] * np.sign(mean)[:, None]
    # At rest the steeper of both directions, so that the first pass is on the safe side.
    towards = np.where(mean[:, None] == 0, np.abs(p["hysteresis_volt"]) + np.abs(held), 0.0)
    towards = towards + np.sign(mean)[:, None] * (goal - held)
    return goal + decay * (held - goal), np.maximum(towards, 0.0) * decay * second / charge


def warm(modes, before, after, ambient_celsius, second):
    """A pack's state with the temperatures at the end of a step.

    Parameters
    ----------
    modes : ThermalModes, or None: the cells have the ambient's temperature.
    before, after : PackState at the begin and at the end of the step; the heat in between is the
        mean of both.
    ambient_celsius : in the step [degC]. second : its length [s].
    """
    if modes is None:
        return after._replace(temperature_celsius=np.full(len(after.soc), ambient_celsius))
    celsius = after.temperature_celsius
    mean = 0.5 * (before.current_ampere + after.current_ampere)
    reversible = mean * (celsius + ZERO_CELSIUS_KELVIN) * modes.entropic
    heat = 0.5 * (before.heat_watt + after.heat_watt) + reversible
    after_step = warmed(modes, celsius, heat, ambient_celsius, second)
    return after._replace(temperature_celsius=after_step)


def sensed_volt(wiring, network, solved):
    """Voltage between the pack's leads, or at the terminals of its sensed member [V].

    Parameters
    ----------
    wiring : Wiring. network : Network. solved : Solved.
    """
    element = -1
    if wiring.sense is not None:
        element = network.member[network.first[-2] + wiring.sense]
    if 0 <= element < network.cells:
        return float(solved.voltage_volt[element])
    lines = solved.network
    return float(
        lines.source_volt[element] + lines.resistance_ohm[element] * solved.current_ampere[element]
    )
