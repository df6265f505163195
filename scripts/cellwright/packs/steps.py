"""A pack step by step: how every cell's model moves, and how the wiring divides the current.

The numpy form of native/pack.c, which says the same a hundred times faster (`kernel.py`).
"""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import place
from cellwright.circuits.temperature import SMALLEST, ZERO_CELSIUS_KELVIN
from cellwright.numerics.lags import lag_step, lag_weights
from cellwright.packs.network import currents, reduced
from cellwright.refusal import Refusal

CURRENT, VOLTAGE, POWER = range(3)  # what is asked of a pack in a step
MOST_PASSES = 60  # of Newton's method, as in native/pack.c; a few are usual
LINEAR_PASSES = 4  # of resistors and RC pairs
MOST_TURNS = 30  # passes in which cells with hysteresis go on from rest
# A parameter that grows by more from one temperature to the next follows no Arrhenius law: a share
# of a resistance begins there, and shares are linear.
SAME_KIND = 1e4
SAME_SOC = 1e-4  # a cell without kinetics or hysteresis is linear within so much of its SoC


class NoPower(Refusal):
    """A power that a pack cannot give."""


class PackState(NamedTuple):
    """A pack at one moment: what its cells remember; (cells,), of several elements (cells, e).

    memory : name → (cells, e), of RC pairs relaxed_volt; kinetic_volt, way_volt, hysteresis_volt
    [V]; surface_soc, parts of what the surface leads by [1]. parameters : looked up at the moment,
    name → (cells, e).
    total_ampere : through the pack [A]. heat_watt : own heat of each cell, 0 where none warms [W].
    """

    soc: np.ndarray
    current_ampere: np.ndarray
    total_ampere: float
    memory: dict
    temperature_celsius: np.ndarray
    parameters: dict
    heat_watt: np.ndarray


class Step(NamedTuple):
    """One step: its length, and how the branch currents run in it.

    ramp_ampere : (cells,) a cell's current runs on a straight line that rises by this much to what
    it is at the end [A]. hold : weights of the lags are exact for it.
    """

    second: float
    ramp_ampere: np.ndarray
    hold: str


class Solved(NamedTuple):
    """Currents (elements,) [A], cells' voltages (cells,) [V], and the Reduced network."""

    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    network: object


def start(cells, network, initial_soc, ambient_celsius, thermal=None, *, first_ampere=0.0):
    """State of a pack at rest: PackState.

    Parameters
    ----------
    cells : PackCells. network : Network. initial_soc : scalar or (cells,) [1].
    ambient_celsius : [degC]. thermal : Thermal or None.
    first_ampere : total current of the first sample [A], whose direction counts as the load before
        it for cells of which the model knows a history.

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
    # The load before the first sample: that of the first one, at rest that which leads to a nearby
    # end of the SoC; none where the model knows no history.
    near, first = cells.near_end_soc, np.sign(first_ampere)
    at_rest = (soc > 1.0 - near).astype(float) - (soc < near)
    direction = np.where(near > 0, at_rest if first == 0 else first, 0.0)
    none = np.zeros(count)
    memory = {name: np.zeros_like(parameters[tau]) for name, (tau, _) in LAGS.items()}
    memory["hysteresis_volt"] = direction[:, None] * parameters["hysteresis_volt"]
    return PackState(
        soc=soc,
        current_ampere=none,
        total_ampere=0.0,
        memory=memory,
        temperature_celsius=celsius,
        parameters=parameters,
        heat_watt=none,
    )


def looked_up(cells, soc, temperature_celsius):
    """Parameters of every cell at its SoC and temperature: name → (cells, entries).

    Linear in SoC; between two temperatures voltages are linear in 1/T, and the logarithms of all
    else. Outside 0…1 and the tables' temperatures they stay what they are; the OCV goes on as
    steeply as it ends.

    Parameters
    ----------
    cells : PackCells. soc, temperature_celsius : (cells,) [1], [degC].
    """
    return {name: _entries(cells, name, soc, temperature_celsius)[0] for name in cells.tables}


def ocv_volt(cells, soc, temperature_celsius):
    """Open-circuit voltage of each cell (cells,) [V], at SoC and temperatures (cells,)."""
    return _entries(cells, "ocv_volt", soc, temperature_celsius)[0][:, 0]


def _entries(cells, name, soc, celsius):
    """Entries of a table at each cell's SoC and temperature, and their slopes over SoC."""
    table = cells.tables[name]
    last, rows = table.shape[-1] - 1, np.arange(len(soc))
    lower, share = place(soc, last + 1)
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
    # −1/T rises with T, as a search for the neighbours needs it.
    inverse = -1.0 / (measured + ZERO_CELSIUS_KELVIN)
    here = -1.0 / (np.clip(celsius, measured[0], measured[-1]) + ZERO_CELSIUS_KELVIN)
    right = np.clip(np.searchsorted(inverse, here, side="right"), 1, len(measured) - 1)
    weight = ((here - inverse[right - 1]) / (inverse[right] - inverse[right - 1]))[:, None]
    rows = np.arange(len(values))
    cold, hot = values[rows, right - 1], values[rows, right]
    if name in ("ocv_volt", "ocv_shift_volt"):
        return cold + weight * (hot - cold)
    # Resistances and time constants follow an Arrhenius law: straight in log over 1/T.
    low, high = (np.log(np.maximum(v, SMALLEST)) for v in (cold, hot))
    alike = np.abs(high - low) <= np.log(SAME_KIND)
    return np.where(alike, np.exp(low + weight * (high - low)), cold + weight * (hot - cold))


def advance(cells, network, state, step, mode, value, *, tolerance_volt):
    """A pack one step later.

    Parameters
    ----------
    cells : PackCells. network : Network. state : PackState. step : Step.
    mode, value : what is asked at the end of the step, see `asked`.
    tolerance_volt : of Newton's method [V].

    Returns
    -------
    solved : Solved. state : PackState.

    Raises
    ------
    Refusal : as `network.reduced` and `newton`; NoPower, a power that the pack cannot give.
    """
    rise = value - state.total_ampere if mode == CURRENT else 0.0
    guess = state.current_ampere + network.share * rise
    total_of = asked(mode, value)
    solved, after = newton(
        cells, network, state, step, guess, total_of, tolerance_volt=tolerance_volt
    )
    current = solved.current_ampere
    through = {"current_ampere": current[: network.cells], "total_ampere": float(current[-1])}
    return solved, after._replace(**through)


def newton(cells, network, state, step, guess, total_of, *, tolerance_volt):
    """Currents that satisfy the cells' equations and Kirchhoff's laws together.

    Parameters
    ----------
    cells, network, state, step, tolerance_volt : as in `advance`.
    guess : (cells,) currents to begin with [A]. total_of : see `asked`.

    Returns
    -------
    solved : Solved. after : PackState, its currents still those of before.

    Raises
    ------
    Refusal : not solved after 60 passes.
    """
    weights = _weights(state, step)
    volt, slope, after = respond(cells, state, step, weights, guess)
    if step.second == 0 and not guess.any() and not slope.all():
        # At rest at an instant: what acts at once decides nothing where it is nothing.
        lines = reduced(network, volt, np.ones(network.cells))
        return Solved(np.zeros(len(lines.source_volt)), volt, lines), after
    for turn in range(MOST_PASSES):
        lines = reduced(network, volt - slope * guess, slope)
        current = currents(network, lines, total_of(lines))
        through = current[: network.cells]
        on_line = volt + slope * (through - guess)
        moved = step.second * (through - guess) / (3600.0 * cells.capacity_ampere_hour)
        # A linear cell needs a further pass only where its SoC moves on to other parameters.
        plain = turn < LINEAR_PASSES and is_linear(cells)
        if plain and np.abs(moved).max() <= SAME_SOC:
            *_, after = respond(cells, state, step, weights, through, after.parameters)
            return Solved(current, on_line, lines), after
        found = respond(cells, state, step, weights, through)
        if plain:
            (volt, slope, after), guess = found, through
            continue
        off = found[0] - on_line
        if np.abs(off).max() <= tolerance_volt:
            return Solved(current, on_line, lines), found[2]
        # Cells that turn by turns would do so for ever: in later passes steps are shortened.
        turned = _turned(state, step, guess, through) if turn < MOST_TURNS else np.zeros(1, bool)
        short = 1.0 if turned.any() else _shortened(through - guess, slope, off)
        guess = guess + short * (through - guess)
        guess = np.where(turned, 0.5 * step.ramp_ampere, guess)
        same = short == 1.0 and not turned.any()
        volt, slope, after = found if same else respond(cells, state, step, weights, guess)
    worst = int(np.argmax(np.abs(off)))
    raise not_solved(cells, worst, abs(off[worst]), step.second)


def not_solved(cells, cell, off_volt, second):
    """What to raise where Newton's method does not arrive: of the cell that is furthest off."""
    return Refusal(
        f"{cells.names[cell]} is still {off_volt:.2g} V from its equations after {MOST_PASSES} "
        f"passes, in a step of {second:g} s"
    )


def asked(mode, value):
    """Total current that is asked of a pack, as a function of its Reduced network.

    Parameters
    ----------
    mode : CURRENT, VOLTAGE or POWER. value : [A], [V] or [W], positive on charge.
    """

    def total(lines):
        source, ohm = lines.source_volt[-1], lines.resistance_ohm[-1]
        if mode == VOLTAGE:
            return (value - source) / ohm
        # Of the two currents that give a power the smaller one, at which batteries are run; in this
        # form no digits are lost where the voltage drop is small.
        root = source**2 + 4.0 * ohm * value
        if root < 0:
            raise no_power(value)
        return 2.0 * value / (source + np.sqrt(root))

    return (lambda _: value) if mode == CURRENT else total


def no_power(watt):
    """What to raise where a pack cannot give a power [W]: no current would."""
    return NoPower(f"the pack cannot give {-watt:g} W at this moment, whatever the current")


def is_linear(cells):
    """Whether all cells are resistors and RC pairs: linear but for what SoC does to them."""
    more = ("charge_ohm", "kinetic_r_ohm", "hysteresis_volt", "soc_per_ampere")
    return not any(cells.tables[name].size for name in more)


def _turned(state, step, guess, through):
    """Cells with hysteresis whose current of the step turned (cells,): they go on from rest.

    There their voltage bends; from the bend on Newton's method runs straight to the solution.
    """
    half = 0.5 * step.ramp_ampere
    return (state.memory["hysteresis_volt"].shape[1] > 0) & ((guess - half) * (through - half) < 0)


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
    for name, _ in LAGS.values():
        tau = state.parameters[name]
        at_once = tau <= 0
        # A time constant of 0 acts at once: nothing decays, all is of the input at the end.
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
    voltage_volt, slope_ohm : (cells,) [V], [ohm]. after : PackState, what the cells remember then.
    """
    begin = current - step.ramp_ampere
    per_ampere = step.second / (3600.0 * cells.capacity_ampere_hour)
    mean = 0.5 * (begin + current)
    soc = state.soc + per_ampere * mean
    celsius, before = state.temperature_celsius, state.parameters
    now = looked_up(cells, soc, celsius) if parameters is None else parameters
    after, slopes = {}, {}
    for name, (tau, drive) in LAGS.items():
        (was, was_slope), (is_, is_slope) = (
            drive(*one) for one in ((before, begin[:, None]), (now, current[:, None]))
        )
        after[name] = lag_step(weights[tau], state.memory[name], was, is_)
        slopes[name] = lag_step(weights[tau], 0.0, was_slope, is_slope)
    held = state.memory["hysteresis_volt"]
    after["hysteresis_volt"], by_charge = _by_charge(held, before, mean, step.second)
    surface, surface_slope = after["surface_soc"], slopes.pop("surface_soc")
    slopes["hysteresis_volt"] = by_charge
    ahead = soc + surface.sum(axis=1)
    volt, rise = (v[:, 0] for v in _entries(cells, "ocv_volt", ahead, celsius))
    # With diffusion the OCV is that of the surface; what belongs to the counted SoC stays there.
    if surface.size:
        volt = volt + now["ocv_shift_volt"][:, 0]
        volt = volt - _entries(cells, "ocv_shift_volt", ahead, celsius)[0][:, 0]
    # Where an OCV falls its slope would lead Newton's method away: none is on the safe side.
    ocv_slope = np.maximum(rise, 0.0) * (per_ampere + surface_slope.sum(axis=1))
    return (
        volt + now["r0_ohm"][:, 0] * current + sum(after[name].sum(axis=1) for name in slopes),
        ocv_slope + now["r0_ohm"][:, 0] + sum(slope.sum(axis=1) for slope in slopes.values()),
        state._replace(soc=soc, memory=after, parameters=now),
    )


def _ohmic(name):
    """Drive of a resistance, or of what a current leads the SoC by, and its slope."""
    return lambda p, current: (p[name] * current, p[name])


def _arcsinh(p, current):
    """Drive of kinetics and its slope: scale·arcsinh(r·I/scale)."""
    r, scale = p["kinetic_r_ohm"], p["kinetic_scale_volt"]
    return scale * np.arcsinh(r * current / scale), r / np.hypot(1.0, r * current / scale)


def _one_way(p, current):
    """Drive of resistances that differ by the direction of the current, and its slope."""
    r = np.where(current > 0, p["charge_ohm"], p["discharge_ohm"])
    return r * current, r


# What decays in a cell, in the order of native/pack.c: by which time constant, and what drives it.
LAGS = {
    "relaxed_volt": ("tau_second", _ohmic("r_ohm")),
    "kinetic_volt": ("kinetic_tau_second", _arcsinh),
    "way_volt": ("way_tau_second", _one_way),
    "surface_soc": ("soc_tau_second", _ohmic("soc_per_ampere")),
}


def _by_charge(held, p, mean, second):
    """Hysteresis after the charge of the step, and its slope over the current at its end."""
    charge = 3600.0 * p["hysteresis_ampere_hour"]
    decay = np.exp(-np.abs(mean)[:, None] * second / charge)
    goal = p["hysteresis_volt"] * np.sign(mean)[:, None]
    # At rest the steeper of both directions, so that the first pass is on the safe side.
    towards = np.where(mean[:, None] == 0, np.abs(p["hysteresis_volt"]) + np.abs(held), 0.0)
    towards = towards + np.sign(mean)[:, None] * (goal - held)
    return goal + decay * (held - goal), np.maximum(towards, 0.0) * decay * second / charge
