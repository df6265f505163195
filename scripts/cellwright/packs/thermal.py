"""Temperatures of the cells of a pack: own heat, the way to the ambient, and neighbours."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.heat import heat
from cellwright.packs.steps import ocv_volt
from cellwright.refusal import Refusal


class Thermal(NamedTuple):
    """Thermal constants of a pack's cells.

    heat_capacity_joule_per_kelvin, resistance_kelvin_per_watt : scalar or (cells,), the second from
    each cell to the ambient; infinite where a cell has no way to it [J/K], [K/W].
    between_watt_per_kelvin : conductance between neighbours, one number for a row of cells in
    order of position, or a symmetric matrix (cells, cells) [W/K].
    initial_celsius : scalar or (cells,); None is the ambient's at the start [degC].
    entropic_volt_per_kelvin : scalar, (cells,), or (cells, k) at k even steps of SoC from 0 to 1,
    slope of the OCV over temperature [V/K]; 0 leaves the reversible heat out.
    """

    heat_capacity_joule_per_kelvin: object
    resistance_kelvin_per_watt: object
    between_watt_per_kelvin: object = 0.0
    initial_celsius: object = None
    entropic_volt_per_kelvin: object = 0.0


class ThermalModes(NamedTuple):
    """The pack's cooling without its heat, as modes that each decay by themselves.

    rate : (cells,) of each mode [1/s]. to_modes, from_modes : (cells, cells); where no cell has a
    neighbour (cells,), all ones. capacity : (cells,) [J/K]. to_ambient : (cells,) [W/K].
    entropic : (cells, k) at even steps of SoC [V/K].
    """

    rate: np.ndarray
    to_modes: np.ndarray
    from_modes: np.ndarray
    capacity: np.ndarray
    to_ambient: np.ndarray
    entropic: np.ndarray


def thermal_modes(thermal, cells):
    """Thermal constants as modes: C·dT/dt = heat − (T − ambient)/R − Σ G·(T − T of the neighbour).

    Parameters
    ----------
    thermal : Thermal. cells : how many.

    Raises
    ------
    Refusal : constants that are not above zero (conductances: below zero), a matrix that is not
        symmetric or of another size.
    """
    # ASSUME: A cell has one temperature; contacts and busbars give it no heat and take none.
    capacity = _per_cell(thermal.heat_capacity_joule_per_kelvin, cells, "heat capacity", "J/K")
    resistance = _per_cell(thermal.resistance_kelvin_per_watt, cells, "thermal resistance", "K/W")
    entropic = _entropic(thermal.entropic_volt_per_kelvin, cells)
    between, to_ambient = _between(thermal.between_watt_per_kelvin, cells), 1.0 / resistance
    if not between.any():
        one = np.ones(cells)
        return ThermalModes(to_ambient / capacity, one, one, capacity, to_ambient, entropic)
    # Scaled by the roots of the capacities the matrix is symmetric: real rates, orthogonal modes.
    root = np.sqrt(capacity)
    laplacian = np.diag(between.sum(axis=1) + to_ambient) - between
    rate, vectors = np.linalg.eigh(laplacian / np.outer(root, root))
    to_modes, from_modes = vectors.T * root, vectors / root[:, None]
    # Without a way to the ambient one rate is 0, and rounding may leave it below.
    rate = np.maximum(rate, 0.0)
    return ThermalModes(rate, to_modes, from_modes, capacity, to_ambient, entropic)


def heat_of(cells, modes, state, voltage_volt):
    """Heat of each cell at a moment: I·(V − OCV) + I·T·dOCV/dT (cells,) [W].

    Parameters
    ----------
    cells : PackCells. modes : ThermalModes. state : PackState. voltage_volt : (cells,) [V].

    Source: D. Bernardi, E. Pawlikowski, J. Newman, J. Electrochem. Soc. 132 (1985) 5, without
    heat of mixing.
    """
    celsius = state.temperature_celsius
    slope = _at_soc(modes.entropic, state.soc)
    settings = {"temperature_celsius": celsius, "entropic_volt_per_kelvin": slope}
    return heat(state.current_ampere, voltage_volt, ocv_volt(cells, state.soc, celsius), **settings)


def _at_soc(table, soc):
    """Values (cells,) of a table (cells, k) over even steps of SoC, constant beyond 0 and 1."""
    last = table.shape[1] - 1
    place = np.clip(soc, 0.0, 1.0) * last
    below = np.minimum(place.astype(int), max(last - 1, 0))
    rows, share = np.arange(len(soc)), place - below
    return (1.0 - share) * table[rows, below] + share * table[rows, np.minimum(below + 1, last)]


def warmed(modes, celsius, heat_watt, ambient_celsius, step_second):
    """Temperatures a step later [degC], exact for heat and ambient that keep their values.

    Parameters
    ----------
    modes : ThermalModes.
    celsius, heat_watt : (cells,) at the begin of the step, in it [degC], [W].
    ambient_celsius : in the step [degC]. step_second : [s].
    """
    # Exact for any length of step: explicit steps would swing where a cell is small.
    inward = (heat_watt - modes.to_ambient * (celsius - ambient_celsius)) / modes.capacity
    if modes.to_modes.ndim == 1:
        return celsius + inward * _effective(modes.rate, step_second)
    flow = modes.to_modes @ (heat_watt / modes.capacity)
    flow -= modes.rate * (modes.to_modes @ (celsius - ambient_celsius))
    return celsius + modes.from_modes @ (flow * _effective(modes.rate, step_second))


def _effective(rate, step_second):
    """∫ exp(−rate·t) dt over the step, also where a mode does not decay [s]."""
    moved = -np.expm1(-rate * step_second)
    return np.divide(moved, rate, out=np.full(len(rate), float(step_second)), where=rate > 0)


def _per_cell(value, cells, name, unit):
    given = np.asarray(value, float)
    if given.shape not in ((), (cells,)):
        raise Refusal(f"{name} has shape {given.shape}; wanted one, or one for each of {cells}")
    if not np.all(given > 0):
        raise Refusal(f"{name} is {given.min():g} {unit}; it has to be above zero")
    return np.broadcast_to(given, (cells,)).copy()


def _entropic(value, cells):
    """Slopes of the OCV over temperature (cells, k) [V/K]."""
    given = np.asarray(value, float)
    if given.shape not in ((), (cells,)) and (given.ndim != 2 or len(given) != cells):
        raise Refusal(
            f"entropic coefficients have shape {given.shape}; wanted one, one for each of {cells} "
            "cells, or a row over SoC for each"
        )
    if not np.isfinite(given).all():
        raise Refusal("an entropic coefficient is not finite")
    return given if given.ndim == 2 else np.broadcast_to(given, (cells,))[:, None].copy()


def _between(value, cells):
    """Conductances between neighbours (cells, cells) [W/K]."""
    given = np.asarray(value, float)
    if given.shape == ():
        between = given * (np.eye(cells, k=1) + np.eye(cells, k=-1))
    elif given.shape == (cells, cells):
        # A cell exchanges no heat with itself.
        between = given - np.diag(np.diag(given))
    else:
        raise Refusal(
            f"conductances between neighbours have shape {given.shape}; wanted one number for a "
            f"row of cells, or {cells} × {cells}"
        )
    if not np.all(between >= 0):
        raise Refusal(f"a conductance between neighbours is {between.min():g} W/K, below zero")
    # Rounding of a matrix that was computed is allowed, a typing error is not.
    if np.abs(between - between.T).max(initial=0.0) > 1e-9 * between.max(initial=0.0):
        raise Refusal("conductances between neighbours are not symmetric: heat would be made")
    return between
