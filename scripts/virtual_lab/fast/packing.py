"""Cells as arrays: what the kernel reads, what it keeps from step to step, what it works on."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from virtual_lab.chamber import Chamber, at
from virtual_lab.fast.cell import Cell
from virtual_lab.fast.diffusion import chain

POINTS = 1001
DIRECTION_C_RATE = 0.01
NOTHING = 1e-12


class Pack(NamedTuple):
    """Parameters of n cells (first axis), of e exponentials each; names as in `Cell`.

    `factor`: n, 1 + e tables, r0 first. `r`, `tau` and their energies: n, e. `wire`: ohm.
    """

    coulomb: np.ndarray
    coulomb_per_kelvin: np.ndarray
    c_rate_ampere: np.ndarray
    threshold: np.ndarray
    leak: np.ndarray
    efficiency: np.ndarray
    ocv: np.ndarray
    ocv_slope: np.ndarray
    entropic: np.ndarray
    r0: np.ndarray
    r0_energy: np.ndarray
    asymmetry: np.ndarray
    drift_per_second: np.ndarray
    kinetic_share: np.ndarray
    kinetic_volt: np.ndarray
    factor: np.ndarray
    flat: np.ndarray
    r: np.ndarray
    tau: np.ndarray
    r_energy: np.ndarray
    tau_energy: np.ndarray
    instant: np.ndarray
    hysteresis: np.ndarray
    hysteresis_per_soc: np.ndarray
    heat_capacity: np.ndarray
    core_resistance: np.ndarray
    surface_resistance: np.ndarray
    rise_resistance: np.ndarray
    rise_tau: np.ndarray
    rise_energy: np.ndarray
    wire: np.ndarray
    chamber_second: np.ndarray
    chamber_celsius: np.ndarray


class State(NamedTuple):
    """What n cells remember: state of charge, hysteresis h, sign of the last current, temperature
    [°C] of the core and its hidden rise [K], heat of all but the ohmic element [W], current [A],
    voltage of each exponential.
    """

    soc: np.ndarray
    hysteresis: np.ndarray
    direction: np.ndarray
    core: np.ndarray
    rise: np.ndarray
    heat: np.ndarray
    current: np.ndarray
    element: np.ndarray


class Work(NamedTuple):
    """What is tried for the end of an internal step, and coefficients that hold within it.

    `r`, `tau`: as they are at this temperature (and charge); `decay`, `old`, `new`: of v at the
    end = decay·v + r·(old·current before + new·current after).
    """

    current: np.ndarray
    direction: np.ndarray
    core: np.ndarray
    rise: np.ndarray
    celsius: np.ndarray
    second: np.ndarray
    volt: np.ndarray
    slope: np.ndarray
    coulomb: np.ndarray
    r0_warm: np.ndarray
    r0: np.ndarray
    kept: np.ndarray
    gain: np.ndarray
    r_warm: np.ndarray
    r: np.ndarray
    tau: np.ndarray
    decay: np.ndarray
    old: np.ndarray
    new: np.ndarray


def pack(cells: list[Cell], wire_ohm: list[float], chambers: list[Chamber]) -> Pack:
    """Arrays of a group of cells, each with the wire [ohm] and the chamber of its own."""
    for number, cell in enumerate(cells, 1):
        _check(cell, number)
    singles = [single(cell) for cell in cells]
    most = max(one["r"].size for one in singles)
    rows = [_padded(one, most) for one in singles]
    times = np.unique(np.concatenate([chamber.second for chamber in chambers])).astype(float)
    return Pack(
        **{name: np.array([row[name] for row in rows]) for name in rows[0]},
        wire=np.array(wire_ohm, float),
        chamber_second=times,
        chamber_celsius=np.array([at(chamber, times) for chamber in chambers], float),
    )


def state(packed: Pack, soc: list[float], hysteresis: float, begin_second: float) -> State:
    """Cells at rest, as warm as their chambers."""
    n, elements = packed.r.shape
    core = [np.interp(begin_second, packed.chamber_second, row) for row in packed.chamber_celsius]
    return State(
        soc=np.array(soc, float),
        hysteresis=np.full(n, float(hysteresis)),
        direction=np.full(n, float(np.sign(hysteresis))),
        core=np.array(core),
        rise=np.zeros(n),
        heat=np.zeros(n),
        current=np.zeros(n),
        element=np.zeros((n, elements)),
    )


def work(packed: Pack) -> Work:
    """Room to work in; no temperature and no step known yet, which NaN says."""
    n, elements = packed.r.shape
    singles = {name: np.zeros(n) for name in Work._fields[:13]}
    singles |= {name: np.full(n, np.nan) for name in ("celsius", "second")}
    return Work(**singles, **{name: np.zeros((n, elements)) for name in Work._fields[13:]})


def _check(cell, number):
    pairs = len(cell.pair_r_ohm)
    if not cell.r0_ohm > 0 or not cell.capacity_ampere_hour > 0:
        raise ValueError(f"cell {number}: r0 and capacity must be positive")
    if len(cell.pair_tau_second) != pairs or min(cell.pair_tau_second, default=1.0) <= 0:
        raise ValueError(f"cell {number}: every RC pair needs a positive time constant")
    for name in ("pair_factor", "pair_activation_joule_per_mole"):
        if len(getattr(cell, name)) not in (0, pairs):
            raise ValueError(f"cell {number}: {name} has {len(getattr(cell, name))} of {pairs}")
    if cell.warburg_r_ohm and cell.warburg_tau_second <= 0:
        raise ValueError(f"cell {number}: diffusion needs a positive time constant")


def single(cell: Cell) -> dict:
    """Arrays of one cell, by the names of `Pack`; without its wire and chamber."""
    factor = np.array([_table(t) for t in (cell.r0_factor, *_factors(cell))])
    value, slope = _open_circuit(cell.ocv_volt)
    coulomb = 3600.0 * cell.capacity_ampere_hour
    return {
        "coulomb": coulomb,
        "coulomb_per_kelvin": coulomb * cell.capacity_per_kelvin,
        "c_rate_ampere": cell.rating.ampere(1.0),
        "threshold": cell.rating.ampere(DIRECTION_C_RATE),
        "leak": cell.leak_ampere,
        "efficiency": cell.coulombic_efficiency,
        "ocv": value,
        "ocv_slope": slope,
        "entropic": _table(cell.entropic_volt_per_kelvin),
        "r0": cell.r0_ohm,
        "r0_energy": cell.r0_activation_joule_per_mole,
        "asymmetry": cell.charge_asymmetry,
        "drift_per_second": cell.r0_drift_per_hour / 3600.0,
        "kinetic_share": cell.kinetic_share,
        "kinetic_volt": 2.0 * cell.exchange_current_ampere * cell.kinetic_share * cell.r0_ohm,
        "factor": factor,
        "flat": np.ptp(factor, axis=1) == 0.0,
        **elements(cell),
        "instant": cell.hysteresis_instant_volt,
        "hysteresis": cell.hysteresis_volt,
        "hysteresis_per_soc": cell.hysteresis_per_soc,
        "heat_capacity": cell.heat_capacity_joule_per_kelvin,
        "core_resistance": cell.core_resistance_kelvin_per_watt,
        "surface_resistance": cell.surface_resistance_kelvin_per_watt,
        "rise_resistance": cell.rise_kelvin_per_watt,
        "rise_tau": cell.rise_tau_second,
        "rise_energy": cell.rise_activation_joule_per_mole,
    }


def elements(cell: Cell) -> dict:
    """All exponentials of a cell, pairs and diffusion: `r` [ohm], `tau` [s], energies [J/mol]."""
    pairs = len(cell.pair_r_ohm)
    shares = chain(cell.warburg_shape) if cell.warburg_r_ohm else (np.zeros(0), np.zeros(0))
    each = np.ones(shares[0].size)

    def joined(of_pairs, of_chain):
        return np.append(np.array(of_pairs or (0.0,) * pairs, float), of_chain)

    return {
        "r": joined(cell.pair_r_ohm, cell.warburg_r_ohm * shares[0]),
        "tau": joined(cell.pair_tau_second, cell.warburg_tau_second * shares[1]),
        "r_energy": joined(
            cell.pair_activation_joule_per_mole, cell.warburg_activation_joule_per_mole * each
        ),
        "tau_energy": joined(
            cell.pair_tau_activation_joule_per_mole,
            cell.warburg_tau_activation_joule_per_mole * each,
        ),
    }


def _factors(cell):
    pairs = cell.pair_factor or (1.0,) * len(cell.pair_r_ohm)
    chained = chain(cell.warburg_shape)[0].size if cell.warburg_r_ohm else 0
    return [*pairs, *[cell.warburg_factor] * chained]


def _padded(single, most) -> dict:
    """Exponentials that are nothing, so that all cells have as many."""
    missing = most - single["r"].size
    filled = {"r": 0.0, "tau": 1.0, "r_energy": 0.0, "tau_energy": 0.0, "flat": True}
    padded = {
        name: np.append(single[name], np.full(missing, value)) for name, value in filled.items()
    }
    padded["factor"] = np.vstack([single["factor"], np.ones((missing, POINTS))])
    return single | padded


def _table(values) -> np.ndarray:
    values = np.atleast_1d(np.asarray(values, float))
    own = np.linspace(0.0, 1.0, values.size)
    return np.interp(np.linspace(0.0, 1.0, POINTS), own, values)


def _open_circuit(ocv_volt):
    """Table and slopes [V] on the kernel's grid, by a spline through the points given."""
    values = np.asarray(ocv_volt, float)
    spline = CubicSpline(np.linspace(0.0, 1.0, values.size), values)
    soc = np.linspace(0.0, 1.0, POINTS)
    return spline(soc), spline(soc, 1)
