"""What healthy branches of a group may differ by: the declared spread, as free parameters."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.base import OCV_KNOTS
from cellwright.effects.group_model import FINE_KNOTS
from cellwright.effects.problem import Free


class Spread(NamedTuple):
    """How healthy branches scatter about what is known of them, as standard deviations.

    No healthy branch is farther out than `widest` of them: beyond, something is the matter.

    capacity, resistance, time_constant : relative, of a cell about its own tests.
    ocv_volt : of a cell's OCV, smooth over ocv_soc of SoC [V].
    type_capacity, type_resistance, type_time_constant, type_ocv_volt : the same of a cell of which
    only the type is known. soc : between the branches when the group was joined [1].
    celsius : between the branches [K]. wire_ohm : of a connection [ohm].
    current_offset_c_rate : of a branch's sensor, in its cell's capacity per hour [1/h].
    current_gain : of a branch's sensor [1].
    """

    capacity: float = 4e-3
    resistance: float = 8e-3
    time_constant: float = 0.03
    ocv_volt: float = 1e-3
    type_capacity: float = 0.05
    type_resistance: float = 0.17
    type_time_constant: float = 0.2
    type_ocv_volt: float = 2e-3
    soc: float = 2e-3
    celsius: float = 0.2
    wire_ohm: float = 1e-4
    current_offset_c_rate: float = 1e-3
    current_gain: float = 1e-3
    ocv_soc: float = 0.12
    widest: float = 3.0


class Shared(NamedTuple):
    """What all branches may be off by together, as standard deviations; meanings as in Spread."""

    resistance: float = 0.01
    type_resistance: float = 1.0
    time_constant: float = 0.03
    type_time_constant: float = 0.5
    capacity: float = 4e-3
    type_capacity: float = 0.05
    soc: float = 5e-3
    ocv_volt: float = 1e-3
    ocv_soc: float = 0.03
    activation_joule_per_mole: float = 1e3
    type_activation_joule_per_mole: float = 1e4


LOG_STEP, SOC_STEP, VOLT_STEP = 5e-3, 1e-3, 1e-3
STEPS = {
    "log_r0": LOG_STEP,
    "log_slow": LOG_STEP,
    "log_tau": 4 * LOG_STEP,
    "capacity": LOG_STEP,
    "soc": SOC_STEP,
    "celsius": 0.2,
    "wire": 1e-4,
    "offset": 1e-3,
    "gain": 1e-3,
}
OWN_KNOT = 0.1


def group_frees(cells, files, spread, shared, *, sensors):
    """Free parameters of a healthy group, in the order of `group_model.group_names`.

    Parameters
    ----------
    cells : sequence of Branch. files : number of records. spread : Spread. shared : Shared.
    sensors : bool; the branch currents were logged.

    Returns
    -------
    free : tuple of problem.Free. Without branch currents their sensors are not among them.
    """
    far = spread.widest
    free = _common(cells, shared, far)
    free += [_bounded(f"soc0[{k}]", SOC_STEP, shared.soc, far) for k in range(files)]
    free += _knots("fine", FINE_KNOTS, shared.ocv_volt, far)
    for b, cell in enumerate(cells):
        free += _of_branch(b, cell, spread, sensors)
        free += _knots(f"{b}.ocv", OCV_KNOTS, _ocv_volt(cell, spread), far)
    return tuple(free)


def _bounded(name, step, std, far):
    return Free(name, step, 0.0, std, -far * std, far * std)


def _knots(name, count, volt, far):
    """Knots of an OCV error; how they hang together is said by `group_coupling`."""
    most = far * volt
    return [Free(f"{name}[{k}]", VOLT_STEP, 0.0, np.inf, -most, most) for k in range(count)]


def _ocv_volt(cell, spread):
    return spread.ocv_volt if cell.own else spread.type_ocv_volt


def _common(cells, shared, far):
    own = all(cell.own for cell in cells)
    # A cell that was never tested over temperature has no activation energy to be held to.
    warmed = own and all(cell.activation_joule_per_mole for cell in cells)
    resistance = shared.resistance if own else shared.type_resistance
    time = shared.time_constant if own else shared.type_time_constant
    energy = shared.activation_joule_per_mole if warmed else shared.type_activation_joule_per_mole
    capacity = shared.capacity if own else shared.type_capacity
    return [
        *(_bounded(name, LOG_STEP, resistance, far) for name in ("log_r0", "log_r1", "log_r2")),
        *(_bounded(name, 4 * LOG_STEP, time, far) for name in ("log_tau1", "log_tau2")),
        _bounded("capacity", LOG_STEP, capacity, far),
        _bounded("energy", 500.0, energy, far),
    ]


def _of_branch(b, cell, spread, sensors):
    known = {
        "capacity": spread.capacity if cell.own else spread.type_capacity,
        "log_r0": spread.resistance if cell.own else spread.type_resistance,
        "log_slow": spread.resistance if cell.own else spread.type_resistance,
        "log_tau": spread.time_constant if cell.own else spread.type_time_constant,
        "soc": spread.soc,
        "celsius": spread.celsius,
        "wire": spread.wire_ohm,
    }
    if sensors:
        known["offset"] = spread.current_offset_c_rate * cell.capacity_ampere_hour
        known["gain"] = spread.current_gain
    return [_bounded(f"{b}.{n}", STEPS[n], s, spread.widest) for n, s in known.items()]


def group_coupling(free, cells, spread, shared):
    """Prior precision of the errors of all OCV curves, smooth over SoC: (k, k)."""
    found = np.zeros((len(free), len(free)))
    names = [one.name for one in free]
    at = [k for k, name in enumerate(names) if name.startswith("fine[")]
    found[np.ix_(at, at)] = _smooth(FINE_KNOTS, shared.ocv_soc) / shared.ocv_volt**2
    shape = _smooth(OCV_KNOTS, spread.ocv_soc)
    for b, cell in enumerate(cells):
        at = [k for k, name in enumerate(names) if name.startswith(f"{b}.ocv[")]
        found[np.ix_(at, at)] = shape / _ocv_volt(cell, spread) ** 2
    return found


def _smooth(knots, length):
    """Precision of a curve of unit size, smooth over a length of SoC."""
    soc = np.linspace(0.0, 1.0, knots)
    near = np.exp(-0.5 * (np.subtract.outer(soc, soc) / length) ** 2)
    return np.linalg.inv(near + OWN_KNOT**2 * np.eye(knots))
