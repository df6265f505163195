"""Parameters of a cell of the fast generator, and the arrays that its compiled kernel works on.

Diffusion in a particle is a chain of exponentials. A flux i enters at the surface of a body of
length L and diffusivity D; tau = L²/D, x = sqrt(s·tau). The lead of the surface concentration over
the mean of the body is, up to scale,

    plate (closed at the back)   coth(x)/x - 1/x²            = sum of 2 / (x² + (n·pi)²)
    sphere                       tanh(x)/(x - tanh(x)) - 3/x² = sum of 2 / (x² + y_n²), tan y = y

for Laplace's s (Mittag-Leffler expansions; the term in 1/x² is the mean itself, which is the state
of charge). Each summand is an RC pair with tau_n = tau/y_n² and a resistance in proportion to
1/y_n². All resistances together, the response to a steady current, are 1/3 and 1/5: so r_n is
6/y_n² (plate) or 10/y_n² (sphere) of the whole.

The chain is cut after a number of pairs. The rest becomes one pair more, which has the rest's
resistance and its mean time constant: the steady state and the charge that settles stay exact.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from virtual_lab.behaviour import Rating
from virtual_lab.chamber import Chamber, temperature_at

Table = np.ndarray | float


class Cell(NamedTuple):
    """Parameters at 25 °C; tables over the state of charge (0 … 1, evenly spaced; or one number).

    With the defaults it is an open-circuit voltage, an ohmic resistance and RC pairs, the same
    at every temperature and as warm as its chamber. U is the open-circuit voltage, I the current
    (positive on charge), T the temperature of the core.

    Open circuit and charge
        rating : what its data sheet says.
        ocv_volt : table of U [V], at least 4 points; a smooth curve (spline) runs through them.
        capacity_ampere_hour : charge between state of charge 0 and 1 [Ah].
        capacity_per_kelvin : k of Q(T) = Q·(1 + k·(T - 25 °C)), T of the chamber [1/K]. ASSUME: the
            state of charge stays while Q moves.
        entropic_volt_per_kelvin : table of dU/dT [V/K].
        leak_ampere : current that no instrument sees: the cell gets I minus it [A].
        coulombic_efficiency : share of the charging current that is stored [1].

    Ohmic element
        r0_ohm, r0_factor : resistance [ohm] and its table over the state of charge [1].
        r0_activation_joule_per_mole : exp(E/R·(1/T - 1/298.15 K)) multiplies it.
        charge_asymmetry : (1 + a) multiplies it on charge [1].
        r0_drift_per_hour : (1 + d·hours since the test began) multiplies it [1/h].
        kinetic_share : share s of r0 that follows 2·I0·asinh(I / (2·I0)) instead of I [1]; its
            slope at zero current is that of a resistance. Where r0 moves with temperature or
            state of charge, I0 moves against it: the voltage 2·I0·s·r0 stays.
        exchange_current_ampere : I0 [A].

    RC pairs (any number; one entry per pair, activations and factors may be left empty)
        pair_r_ohm, pair_tau_second, pair_factor : r [ohm], tau [s], table of r over charge [1].
        pair_activation_joule_per_mole, pair_tau_activation_joule_per_mole : of r and of tau.

    Solid diffusion (see the top of this module)
        warburg_r_ohm : its resistance to a steady current [ohm], 0: none.
        warburg_tau_second : length² over diffusivity [s].
        warburg_shape : "spherical" or "planar".
        warburg_factor, warburg_activation_joule_per_mole, warburg_tau_activation_joule_per_mole :
            as those of a pair.

    Hysteresis
        hysteresis_instant_volt : times the sign of the last current above C/100 [V].
        hysteresis_volt, hysteresis_per_soc : M [V] and g [1] of U + M·h, where
            dh = -g·|dsoc|·(h - sign of dsoc).

    Heat
        heat_capacity_joule_per_kelvin : of the whole cell [J/K]; 0: as warm as the chamber.
        core_resistance_kelvin_per_watt, surface_resistance_kelvin_per_watt : from the core to the
            surface, and from there to the chamber [K/W].
        rise_kelvin_per_watt, rise_tau_second : a rise of temperature that acts on resistances and
            time constants, and that no sensor shows [K/W, s].
        rise_activation_joule_per_mole : of all resistances by that rise alone, whatever the
            chamber's temperature does to them.
    """

    rating: Rating
    ocv_volt: np.ndarray
    capacity_ampere_hour: float
    r0_ohm: float
    pair_r_ohm: tuple[float, ...] = ()
    pair_tau_second: tuple[float, ...] = ()
    capacity_per_kelvin: float = 0.0
    entropic_volt_per_kelvin: Table = 0.0
    leak_ampere: float = 0.0
    coulombic_efficiency: float = 1.0
    r0_factor: Table = 1.0
    r0_activation_joule_per_mole: float = 0.0
    charge_asymmetry: float = 0.0
    r0_drift_per_hour: float = 0.0
    kinetic_share: float = 0.0
    exchange_current_ampere: float = 1.0
    pair_factor: tuple[Table, ...] = ()
    pair_activation_joule_per_mole: tuple[float, ...] = ()
    pair_tau_activation_joule_per_mole: tuple[float, ...] = ()
    warburg_r_ohm: float = 0.0
    warburg_tau_second: float = 0.0
    warburg_shape: str = "spherical"
    warburg_factor: Table = 1.0
    warburg_activation_joule_per_mole: float = 0.0
    warburg_tau_activation_joule_per_mole: float = 0.0
    hysteresis_instant_volt: float = 0.0
    hysteresis_volt: float = 0.0
    hysteresis_per_soc: float = 0.0
    heat_capacity_joule_per_kelvin: float = 0.0
    core_resistance_kelvin_per_watt: float = 0.0
    surface_resistance_kelvin_per_watt: float = 1.0
    rise_kelvin_per_watt: float = 0.0
    rise_tau_second: float = 0.0
    rise_activation_joule_per_mole: float = 0.0


DIFFUSION_PAIRS = 9
# Sums over all y_n of 1/y² and of 1/y⁴.
DIFFUSION_SUMS = {"planar": (1 / 6, 1 / 90), "spherical": (1 / 10, 1 / 350)}


def diffusion_chain(shape: str) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the diffusion resistance and of tau, shape (10,) each, slowest pair first."""
    y = _roots(shape)
    whole, moment = DIFFUSION_SUMS[shape]
    r = 1 / y**2 / whole
    rest = 1 - r.sum()
    rest_tau = (moment - (1 / y**4).sum()) / whole / rest
    return np.append(r, rest), np.append(1 / y**2, rest_tau)


def _roots(shape):
    """The first roots y > 0: of sin y = 0 for a plate, of tan y = y for a sphere."""
    n = np.arange(1, DIFFUSION_PAIRS + 1)
    if shape == "planar":
        return n * np.pi
    # Between n·pi and (n + 1/2)·pi; sin y = y·cos y has no poles.
    return np.array(
        [brentq(lambda y: np.sin(y) - y * np.cos(y), k * np.pi, (k + 0.5) * np.pi) for k in n]
    )


TABLE_POINTS = 1001
DIRECTION_C_RATE = 0.01


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
    """State of n cells.

    State of charge, hysteresis h, sign of the last current, temperature [°C] of the core and its
    hidden rise [K], heat of all but the ohmic element [W], current [A], voltage of each
    exponential.
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
    """State tried for the end of an internal step, and coefficients that hold within it.

    `r`, `tau`: at this temperature (and charge); `decay`, `old`, `new`: the voltage of an
    exponential at the end is decay·v + r·(old·current before + new·current after); `carried`,
    `gain`: their sums.
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
    carried: np.ndarray
    gain: np.ndarray
    r_warm: np.ndarray
    r: np.ndarray
    tau: np.ndarray
    decay: np.ndarray
    old: np.ndarray
    new: np.ndarray


def packed_cells(cells: list[Cell], wire_ohm: list[float], chambers: list[Chamber]) -> Pack:
    """Arrays of a group of cells, each with its own wire [ohm] and chamber."""
    for number, cell in enumerate(cells, 1):
        _check(cell, number)
    singles = [cell_arrays(cell) for cell in cells]
    most = max(one["r"].size for one in singles)
    rows = [_padded(one, most) for one in singles]
    times = np.unique(np.concatenate([chamber.second for chamber in chambers])).astype(float)
    return Pack(
        **{name: np.array([row[name] for row in rows]) for name in rows[0]},
        wire=np.array(wire_ohm, float),
        chamber_second=times,
        chamber_celsius=np.array([temperature_at(chamber, times) for chamber in chambers], float),
    )


def rested_state(packed: Pack, soc: list[float], hysteresis: float, begin_second: float) -> State:
    """Cells at rest, at the temperatures of their chambers."""
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


def work_arrays(packed: Pack) -> Work:
    """Empty work arrays; NaN says that no temperature and no step are known yet."""
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


def cell_arrays(cell: Cell) -> dict:
    """Arrays of one cell, by the names of `Pack`; without its wire and chamber."""
    pairs = cell.pair_factor or (1.0,) * len(cell.pair_r_ohm)
    chained = diffusion_chain(cell.warburg_shape)[0].size if cell.warburg_r_ohm else 0
    tables = (cell.r0_factor, *pairs, *[cell.warburg_factor] * chained)
    factor = np.array([_table(table) for table in tables])
    ocv = np.asarray(cell.ocv_volt, float)
    curve, soc = CubicSpline(np.linspace(0.0, 1.0, ocv.size), ocv), np.linspace(0, 1, TABLE_POINTS)
    coulomb = 3600.0 * cell.capacity_ampere_hour
    return {
        "coulomb": coulomb,
        "coulomb_per_kelvin": coulomb * cell.capacity_per_kelvin,
        "c_rate_ampere": cell.rating.ampere(1.0),
        "threshold": cell.rating.ampere(DIRECTION_C_RATE),
        "leak": cell.leak_ampere,
        "efficiency": cell.coulombic_efficiency,
        "ocv": curve(soc),
        "ocv_slope": curve(soc, 1),
        "entropic": _table(cell.entropic_volt_per_kelvin),
        "r0": cell.r0_ohm,
        "r0_energy": cell.r0_activation_joule_per_mole,
        "asymmetry": cell.charge_asymmetry,
        "drift_per_second": cell.r0_drift_per_hour / 3600.0,
        "kinetic_share": cell.kinetic_share,
        "kinetic_volt": 2.0 * cell.exchange_current_ampere * cell.kinetic_share * cell.r0_ohm,
        "factor": factor,
        "flat": np.ptp(factor, axis=1) == 0.0,
        **exponentials(cell),
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


def exponentials(cell: Cell) -> dict:
    """All exponentials of a cell, pairs and diffusion: `r` [ohm], `tau` [s], energies [J/mol]."""
    pairs = len(cell.pair_r_ohm)
    shares = (
        diffusion_chain(cell.warburg_shape) if cell.warburg_r_ohm else (np.zeros(0), np.zeros(0))
    )
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


def _padded(single, most) -> dict:
    """Exponentials of zero resistance added, so that all cells have as many."""
    missing = most - single["r"].size
    filled = {"r": 0.0, "tau": 1.0, "r_energy": 0.0, "tau_energy": 0.0, "flat": True}
    padded = {
        name: np.append(single[name], np.full(missing, value)) for name, value in filled.items()
    }
    padded["factor"] = np.vstack([single["factor"], np.ones((missing, TABLE_POINTS))])
    return single | padded


def _table(values) -> np.ndarray:
    values = np.atleast_1d(np.asarray(values, float))
    own = np.linspace(0.0, 1.0, values.size)
    return np.interp(np.linspace(0.0, 1.0, TABLE_POINTS), own, values)
