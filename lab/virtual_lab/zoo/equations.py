"""Effects as they are planted in records of real cells: equations of their own.

Each changes the readings of all tests of a cell alike. Written from the names of the vocabulary
alone, without a look at the forms and constants by which the search fits them.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh

from virtual_lab.zoo.plain_circuit import Plain, lag
from virtual_lab.zoo.real_records import RealCell

GAS_PER_FARADAY = 8.314462618 / 96485.33212  # [V/K]
KELVIN = 273.15
Drawn = dict[str, Any]


class Effect(NamedTuple):
    """One effect.

    `short`: for names of cells. `parameter`: its size, with the unit; `first`: the size [its unit,
    or a share of what `scale` gives] that the search for a size begins with, `most`: the largest
    that is still a cell or an instrument. `act(cell, plain, size, drawn)` gives the records with
    the effect. `draw(random)` gives what else it needs. `either_sign`: the sign of the size is
    drawn. `scale`: size that the cell itself sets (ohm, A).
    """

    short: str
    parameter: str
    first: float
    most: float
    act: Callable[[RealCell, Plain, float, Drawn], tuple]
    draw: Callable[[np.random.Generator], Drawn] = lambda random: {}
    either_sign: bool = False
    scale: Callable[[RealCell, Plain], float] = lambda cell, plain: 1.0


def _ohm(cell, plain):
    """Resistance of the plain circuit, all of it [ohm]."""
    return max(plain.r0_ohm + sum(plain.pair_ohm), 1e-3)


def _c_rate(cell, plain):
    """Current that moves the capacity in an hour [A]."""
    return cell.capacity_ampere_hour


def _kept(random, low, high):
    return round(float(random.uniform(low, high)), 5)


def _each(change):
    """`act` that adds `change(record, cell, plain, size, drawn)` [V] to every record."""

    def act(cell, plain, size, drawn):
        return tuple(one.with_volt(change(one, cell, plain, size, drawn)) for one in cell.records)

    return act


# Hysteresis ----------------------------------------------------------------------------------


def stop_operators(soc, radii, start) -> np.ndarray:
    """Stop operators of a course of the state of charge, (n, k), each within ± its radius.

    A stop follows the state of charge and stays at its radius when that moves on: the elastic part
    of a Prandtl–Ishlinskii (Preisach) hysteresis. Computed from turning point to turning point.

    Parameters
    ----------
    soc : (n,) [1]. radii : (k,) [1]. start : (k,) values before the first row [1].
    """
    moved = np.diff(soc)
    direction = np.sign(moved)
    # A row without movement belongs to the movement before it.
    moving = np.flatnonzero(direction)
    if moving.size == 0:
        return np.tile(start, (soc.size, 1))
    turns = moving[1:][direction[moving[1:]] != direction[moving[:-1]]]
    edges = np.concatenate([[0], turns, [soc.size - 1]])
    radii, out = np.asarray(radii), np.empty((soc.size, len(radii)))
    state = np.asarray(start, float)
    for first, last in pairwise(edges):
        rise = soc[first : last + 1] - soc[first]
        out[first : last + 1] = np.clip(state + rise[:, None], -radii, radii)
        state = out[last]
    return out


def _at_start(record):
    """+1 where a record begins full, −1 where empty: which end the cell came to last; else 0."""
    return float(record.soc[0] > 0.9) - float(record.soc[0] < 0.1)


def _preisach(record, cell, plain, size, drawn):
    """Width over a sum of stop operators of unequal radii."""
    radii = np.array(drawn["radius_soc"])
    stops = stop_operators(record.soc, radii, _at_start(record) * radii)
    return size * (stops / radii) @ np.array(drawn["weight"])


def _preisach_draws(random):
    radii = np.array([0.004, 0.015, 0.05, 0.12]) * random.uniform(0.7, 1.4)
    weights = random.dirichlet([4.0, 4.0, 4.0, 4.0])
    return {
        "radius_soc": [round(float(x), 5) for x in radii],
        "weight": [round(float(x), 5) for x in weights],
    }


def _instant(record, cell, plain, size, drawn):
    """A voltage with the sign of the last load, kept through rests."""
    loaded = np.abs(record.ampere) > 0.01 * cell.capacity_ampere_hour
    last = np.maximum.accumulate(np.where(loaded, np.arange(loaded.size), -1))
    sign = np.where(last < 0, _at_start(record), np.sign(record.ampere[np.maximum(last, 0)]))
    return size * sign


# Resistances ---------------------------------------------------------------------------------


def _over_soc(record, cell, plain, size, drawn):
    """Extra resistance that grows towards empty as 1/(z + c), or towards both ends as |z − m|³."""
    soc = np.clip(record.soc, 0.0, 1.0)
    if drawn["form"] == "hyperbola":
        shape = drawn["c"] / (soc + drawn["c"])
    else:
        shape = 8.0 * np.abs(soc - drawn["c"] - 0.45) ** 3
    return size * shape * record.ampere


def _over_soc_draws(random):
    return {
        "form": str(random.choice(["hyperbola", "hyperbola", "cubic"])),
        "c": _kept(random, 0.05, 0.13),
    }


def _over_temperature(record, cell, plain, size, drawn):
    """Extra resistance by Vogel–Fulcher; its size is that at 25 °C."""

    def exponent(kelvin):
        return drawn["b_kelvin"] / (np.maximum(kelvin, 225.0) - drawn["vogel_kelvin"])

    grown = np.exp(exponent(record.celsius + KELVIN) - exponent(298.15))
    return size * grown * record.ampere


def _vogel_draws(random):
    return {"b_kelvin": _kept(random, 350, 620), "vogel_kelvin": _kept(random, 150, 175)}


def _asymmetry(record, cell, plain, size, drawn):
    """Extra resistance in one direction; the kink at zero is rounded over C/20."""
    rounding = 0.05 * cell.capacity_ampere_hour
    return size * 0.5 * (record.ampere + np.hypot(record.ampere, rounding) - rounding)


def _kinetics(record, cell, plain, size, drawn):
    """Butler–Volmer overpotential minus its linear part; size: one over the exchange current.

    I/I0 = exp(a·F·η/RT) − exp(−(1 − a)·F·η/RT), solved on a table of η: no asinh unless a = 0.5.
    """
    thermal = GAS_PER_FARADAY * (record.celsius + KELVIN)
    alpha, relative = drawn["alpha"], size * record.ampere
    table = np.linspace(-14.0, 14.0, 4001)  # η·F/RT
    reached = np.exp(alpha * table) - np.exp(-(1 - alpha) * table)
    return drawn["share"] * thermal * (np.interp(relative, reached, table) - relative)


def _kinetic_draws(random):
    alpha = random.uniform(0.34, 0.44)
    alpha = 1 - alpha if random.random() < 0.5 else alpha
    return {"alpha": round(float(alpha), 4), "share": _kept(random, 0.4, 1.0)}


def _kinetic_scale(cell, plain):
    """One over the exchange current at which all of R0 would be charge transfer [1/A]."""
    return max(plain.r0_ohm, 1e-3) / (GAS_PER_FARADAY * 298.15)


# Transport and heat --------------------------------------------------------------------------


def linear_network(step_second, drive, conductance, capacity, inlet) -> np.ndarray:
    """States (n, k) of C·dx/dt = −G·x + b·u from zero, as a sum of first-order lags.

    Parameters
    ----------
    step_second, drive : (n,) u, held over each step. conductance : (k, k) symmetric G.
    capacity : (k,) C. inlet : (k,) b. A mode that never decays is the plain integral.
    """
    root = np.sqrt(capacity)
    rates, modes = eigh(conductance / np.outer(root, root))
    passed = np.cumsum(step_second * drive)
    states = np.zeros((len(step_second), len(root)))
    for rate, mode in zip(rates, modes.T, strict=True):
        lone = rate < 1e-9 * rates[-1]
        response = passed if lone else lag(step_second, drive, 1 / rate) / rate
        states += np.outer(response * (mode @ (inlet / root)), mode / root)
    return states


SHELLS = 14


def surface_excess(record, diffusion_second) -> np.ndarray:
    """Surface minus mean concentration (n,) of a sphere, by finite volumes; per A of current.

    Shells of even thickness; the flux enters the outermost. In seconds of mean filling: a sphere
    whose mean rises by one a second has the excess in the units of this rise.

    Parameters
    ----------
    diffusion_second : radius squared over diffusivity [s].
    """
    edge = np.linspace(0.0, 1.0, SHELLS + 1)
    volume = np.diff(edge**3)  # of a sphere of volume one
    # 3 r² is the area over the volume of the whole sphere.
    between = 3 * edge[1:-1] ** 2 * SHELLS / diffusion_second
    conductance = np.zeros((SHELLS, SHELLS))
    for k, value in enumerate(between):
        conductance[k : k + 2, k : k + 2] += value * np.array([[1, -1], [-1, 1]])
    inlet = np.eye(SHELLS)[-1]
    states = linear_network(record.step_second, record.mean_ampere, conductance, volume, inlet)
    half = 0.5 / SHELLS
    surface = states[:, -1] + (states[:, -1] - states[:, -2]) * half * SHELLS
    return surface - states @ volume


def _diffusion(record, cell, plain, size, drawn):
    """Overpotential of a slow sphere; half of its gain follows the slope of the OCV."""
    # Excess of the state of charge per hour of 1C, so that the size is ohm of a long load.
    steady = drawn["diffusion_second"] / 15.0
    slope = plain.slope_at(np.clip(record.soc, 0.0, 1.0))
    typical = np.median(plain.slope_at(np.linspace(0.1, 0.9, 33)))
    gain = 0.5 + 0.5 * np.clip(slope / max(typical, 1e-3), 0.2, 5.0)
    return size * gain * surface_excess(record, drawn["diffusion_second"]) / steady


def _own_heat(record, cell, plain, size, drawn):
    """Core and surface, two nodes; the extra heat of the core lowers the resistance.

    Size: kelvin per watt from the core to the ambient, beyond what the probe shows.
    """
    ohm = _ohm(cell, plain)
    power = ohm * record.mean_ampere**2
    inner, outer = drawn["inner_share"], 1 - drawn["inner_share"]
    between, away = 1 / (inner * size), 1 / (outer * size)
    conductance = np.array([[between, -between], [-between, between + away]])
    heat = np.array([drawn["core_second"] / (inner * size), drawn["skin_second"] / (outer * size)])
    rise = linear_network(record.step_second, power, conductance, heat, np.array([1.0, 0.0]))[:, 0]
    fall = np.expm1(-drawn["per_kelvin"] * rise / (1 + rise / 80.0))
    return ohm * fall * record.ampere


def _heat_draws(random):
    return {
        "inner_share": _kept(random, 0.3, 0.6),
        "core_second": _kept(random, 150, 400),
        "skin_second": _kept(random, 300, 900),
        "per_kelvin": _kept(random, 0.012, 0.028),
    }


def _entropic(record, cell, plain, size, drawn):
    """Entropy of the reaction: a wave over the state of charge, times the kelvin from 25 °C."""
    wave = np.cos(2.2 * np.pi * (record.soc - drawn["phase"])) + drawn["level"]
    return size * wave * (record.celsius - 25.0)


def _entropic_draws(random):
    return {"phase": _kept(random, 0.0, 0.5), "level": _kept(random, -0.6, 0.6)}


# Charge that is lost -------------------------------------------------------------------------


def _shifted(record, plain, lost_soc):
    """Change of the voltage [V] where the state of charge is lower than counted."""
    return plain.volt_at(record.soc - lost_soc) - plain.volt_at(record.soc)


HELD_VOLT = 0.02  # of a cut-off, within which the voltage is held


def _leak(cell, plain, size, drawn):
    """A leak beside the terminals, by Ohm's law; size: its current at 3.3 V [A].

    The cell is larger by what leaks while the slow test empties it, so that the counted charge of
    this test, which ended at the cut-off, is what such a cell would have shown. Near a cut-off the
    cycler holds the voltage and replaces what leaks.
    """
    low, high = (cell.row[f"{side}_cutoff_volt"] for side in ("lower", "upper"))
    leaks, lost = [], []
    for one in cell.records:
        leak = size * np.maximum(one.volt, 0.0) / 3.3
        held = np.zeros(leak.size, bool) if low is None else one.volt < low + HELD_VOLT
        held |= False if high is None else one.volt > high - HELD_VOLT
        gone = np.cumsum(np.where(held, 0.0, leak) * one.step_second)
        leaks.append(leak)
        lost.append(gone / 3600 / cell.capacity_ampere_hour)
    slow = cell.slow
    larger = 0.0 if slow is None else lost[slow][np.argmin(cell.records[slow].soc)]
    changed = []
    for one, leak, gone in zip(cell.records, leaks, lost, strict=True):
        soc = 1.0 - (1.0 - one.soc + gone) / (1.0 + larger)
        volt = _shifted(one, plain, one.soc - soc) - plain.r0_ohm * leak
        changed.append(one.with_volt(volt))
    return tuple(changed)


def _inefficiency(record, cell, plain, size, drawn):
    """A share of the charge current that is not stored."""
    charging = np.maximum(record.mean_ampere, 0.0)
    lost = size * np.cumsum(charging * record.step_second) / 3600 / cell.capacity_ampere_hour
    return _shifted(record, plain, lost)


# Instruments and sheets ----------------------------------------------------------------------


def _offset(cell, plain, size, drawn):
    return tuple(one.with_ampere(1.0, size) for one in cell.records)


def _gain(cell, plain, size, drawn):
    """The ammeter of all tests but the slow ones: those ran on another channel."""
    return tuple(
        one if one.row["kind"] == "ocv" else one.with_ampere(1.0 + size, 0.0)
        for one in cell.records
    )


def _slow_charge(cell, plain, size, drawn):
    """The current of the slow test that the capacity is taken from, wrong by a share."""
    return tuple(
        one.with_ampere(1.0 + size, 0.0) if k == cell.slow else one
        for k, one in enumerate(cell.records)
    )


STEADY_SECOND = 1.5  # rows further apart than this were written at a step, not by the clock
EDGE_SECOND = 0.01


def _late(record, cell, plain, size, drawn):
    """The voltage is read late by `size` [s]: its channel shows what it was before.

    Between rows of the clock it runs straight. Where the current has stepped between rows further
    apart, the step was just before the later row.
    """
    second, volt = record.second, record.volt
    stepped = np.abs(np.diff(record.ampere)) > 0.02 * cell.capacity_ampere_hour
    wide = np.flatnonzero(stepped & (np.diff(second) > STEADY_SECOND)) + 1
    times = np.insert(second, wide, second[wide] - EDGE_SECOND)
    volts = np.insert(volt, wide, volt[wide - 1])
    return np.interp(second - size, times, volts) - volt


def _voltmeter_drift(cell, plain, size, drawn):
    """A voltmeter that has drifted by `size` [V] since the slow test, more from test to test."""
    dynamic = [k for k, one in enumerate(cell.records) if one.row["kind"] != "ocv"]
    share = dict(zip(dynamic, np.linspace(drawn["from_share"], 1.0, len(dynamic)), strict=True))
    return tuple(
        one.with_volt(np.full(one.volt.size, size * share.get(k, 0.0)))
        for k, one in enumerate(cell.records)
    )


EFFECTS = {
    "hysteresis_one_state": Effect(
        "hysteresis", "half_width_volt", 0.01, 0.06, _each(_preisach), _preisach_draws
    ),
    "hysteresis_instant": Effect("instant", "half_width_volt", 0.01, 0.06, _each(_instant)),
    "resistance_soc": Effect(
        "rsoc", "resistance_ohm", 0.5, 3.0, _each(_over_soc), _over_soc_draws, scale=_ohm
    ),
    "resistance_temperature": Effect(
        "rtemp", "resistance_ohm", 0.5, 2.0, _each(_over_temperature), _vogel_draws, scale=_ohm
    ),
    "resistance_asymmetry": Effect(
        "asymmetry", "resistance_ohm", 0.3, 1.5, _each(_asymmetry), scale=_ohm
    ),
    # Where all of R0 is charge transfer, no more of it can be taken away.
    "charge_transfer_nonlinearity": Effect(
        "kinetics",
        "per_exchange_current_per_ampere",
        0.3,
        1.0,
        _each(_kinetics),
        _kinetic_draws,
        scale=_kinetic_scale,
    ),
    "slow_diffusion": Effect(
        "diffusion",
        "resistance_ohm",
        0.3,
        2.0,
        _each(_diffusion),
        lambda random: {"diffusion_second": _kept(random, 8e3, 3e4)},
        scale=_ohm,
    ),
    "self_heating": Effect(
        "heat", "thermal_resistance_kelvin_per_watt", 4.0, 40.0, _each(_own_heat), _heat_draws
    ),
    "entropic_ocv": Effect(
        "entropy",
        "coefficient_volt_per_kelvin",
        2e-4,
        2e-3,
        _each(_entropic),
        _entropic_draws,
        either_sign=True,
    ),
    "leakage": Effect("leak", "leak_ampere", 0.005, 0.02, _leak, scale=_c_rate),
    "coulombic_inefficiency": Effect(
        "coulombic", "lost_share_of_charge", 0.01, 0.06, _each(_inefficiency)
    ),
    "current_offset": Effect(
        "offset", "offset_ampere", 0.004, 0.04, _offset, either_sign=True, scale=_c_rate
    ),
    "current_gain": Effect("gain", "gain_relative", 0.01, 0.12, _gain, either_sign=True),
    "capacity_error": Effect("capacity", "relative", 0.01, 0.15, _slow_charge, either_sign=True),
    "time_skew": Effect("skew", "voltage_delay_second", 0.3, 3.0, _each(_late), either_sign=True),
    "voltage_offset": Effect(
        "voltmeter",
        "offset_volt",
        0.01,
        0.08,
        _voltmeter_drift,
        lambda random: {"from_share": _kept(random, 0.3, 0.9)},
        either_sign=True,
    ),
}
