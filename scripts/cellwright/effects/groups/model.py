"""The model of cells in parallel that is searched, its free parameters, and its document.

Every branch is the plain cell (OCV, ohmic resistance, two RC pairs) behind a wire; resistances
of the cells move with temperature, those of the wires do not. Kirchhoff's laws share the current.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline

from cellwright.circuits.cell import ocv_and_slope, ocv_on_grid
from cellwright.circuits.temperature import resistance_factor
from cellwright.effects.base import OCV_KNOTS
from cellwright.effects.library.groups import GROUP_LIBRARY
from cellwright.native import array, count, function
from cellwright.numerics.lags import lag_step, lag_weights
from cellwright.numerics.least_squares import Free
from cellwright.packs.network import star
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal

LEAST_OHM = 1e-6
SMOOTH_SOC = 0.01
FINE_KNOTS = 41  # of the error that the OCV of all branches branch_ampere


class Branch(NamedTuple):
    """One branch as it is known before the search.

    cell : name. capacity_ampere_hour : [Ah]. ocv_volt : (p,) on an even SoC grid from 0 to 1 [V].
    r_ohm : (3,) ohmic and of the two RC pairs at 25 degC [ohm]. tau_second : (2,) [s].
    activation_joule_per_mole : of the three. wire_ohm : stated resistance of the connection [ohm].
    own : known from tests of this very cell, not of its type.
    """

    cell: str
    capacity_ampere_hour: float
    ocv_volt: np.ndarray
    r_ohm: tuple
    tau_second: tuple
    activation_joule_per_mole: float = 0.0
    wire_ohm: float = 0.0
    own: bool = False


def smooth_ocv(ocv_volt):
    """An OCV table (p,) on an even grid without what is shorter than `SMOOTH_SOC` of SoC [V].

    Cells at slightly different SoC are pulled apart by every wiggle of a measured table.
    Source: cubic smoothing spline, its bandwidth after B. W. Silverman, Ann. Stat. 12 (1984) 898.
    """
    grid = np.linspace(0.0, 1.0, len(ocv_volt))
    return make_smoothing_spline(grid, ocv_volt, lam=len(grid) * SMOOTH_SOC**4)(grid)


class GroupFields(NamedTuple):
    """Quantities of a group that is simulated, which effects of its branches change.

    capacity : (b,) [Ah]. ocv : (b, p) [V]. r : (b, 3) [ohm]. tau : (b, 2) [s]. wire : (b,) [ohm].
    energy : (b,) [J/mol]. soc : (f, b) at the start of each record [1]. warmer : (b,) above the
    measured temperature [K]. offset : (b,) [A] and gain : (b,) [1] of the branch's sensor.
    """

    capacity: np.ndarray
    ocv: np.ndarray
    r: np.ndarray
    tau: np.ndarray
    wire: np.ndarray
    energy: np.ndarray
    soc: np.ndarray
    warmer: np.ndarray
    offset: np.ndarray
    gain: np.ndarray


def at_branch(effect, position):
    """An effect of the library in one branch of a group (0 is the first)."""
    return effect._replace(position=position)


class GroupRun(NamedTuple):
    """A simulated group: voltage (n,) [V], branch currents as read (n, b) [A], soc (n, b) [1]."""

    voltage: np.ndarray
    current: np.ndarray
    soc: np.ndarray


COMMON = ("log_r0", "log_r1", "log_r2", "log_tau1", "log_tau2", "capacity", "energy")
OF_BRANCH = (
    "capacity",
    "log_r0",
    "log_slow",
    "log_tau",
    "soc",
    "celsius",
    "wire",
    "offset",
    "gain",
)


def group_names(files, branches):
    """Names of all parameters but those of effects: common ones, then those of each branch."""
    common = [*COMMON, *(f"soc0[{k}]" for k in range(files))]
    of_branch = [*OF_BRANCH, *(f"ocv[{k}]" for k in range(OCV_KNOTS))]
    common += [f"fine[{k}]" for k in range(FINE_KNOTS)]
    return (*common, *(f"{b}.{name}" for b in range(branches) for name in of_branch))


def group_fields(cells, soc_at_start, values, effects=()):
    """GroupFields of a set of values.

    Parameters
    ----------
    cells : sequence of Branch. soc_at_start : (f, b) stated SoC [1].
    values : dict by the names of `group_names` and of the effects.
    effects : sequence of Effect, each in its branch.

    Returns
    -------
    fields : GroupFields.
    """
    branches = range(len(cells))

    def of_branch(name):
        return np.array([values[f"{b}.{name}"] for b in branches])

    slow = np.exp(of_branch("log_slow")[:, None] + [[values["log_r1"], values["log_r2"]]])
    factor = np.concatenate([np.exp(of_branch("log_r0") + values["log_r0"])[:, None], slow], axis=1)
    tau = np.exp(of_branch("log_tau")[:, None] + [[values["log_tau1"], values["log_tau2"]]])
    capacity = np.array([c.capacity_ampere_hour for c in cells])
    shift = np.array([values[f"soc0[{k}]"] for k in range(len(soc_at_start))])
    fields = GroupFields(
        capacity=capacity * (1.0 + values["capacity"]) * (1.0 + of_branch("capacity")),
        ocv=np.array([c.ocv_volt for c in cells]) + _ocv_errors(cells, values),
        r=np.array([c.r_ohm for c in cells]) * factor,
        tau=np.array([c.tau_second for c in cells]) * tau,
        wire=np.array([c.wire_ohm for c in cells]) + of_branch("wire"),
        energy=np.array([c.activation_joule_per_mole for c in cells]) + values["energy"],
        soc=np.asarray(soc_at_start, float) + shift[:, None] + of_branch("soc"),
        warmer=of_branch("celsius"),
        offset=of_branch("offset"),
        gain=of_branch("gain"),
    )
    for effect in effects:
        fields = effect.act(fields, None, effect.sizes_of(values) | {"branch": effect.position})
    return fields


def _ocv_errors(cells, values):
    knots = [[values[f"{b}.ocv[{k}]"] for k in range(OCV_KNOTS)] for b in range(len(cells))]
    points = len(cells[0].ocv_volt)
    common = smooth_shares(points, FINE_KNOTS) @ [values[f"fine[{k}]"] for k in range(FINE_KNOTS)]
    return common + np.array(knots) @ smooth_shares(points, OCV_KNOTS).T


@cache
def smooth_shares(points, knots):
    """Share of each knot of an OCV error at each point of an even SoC grid: (points, knots).

    Smooth between knots: cells in parallel are pulled apart by the slopes of their OCV.
    """
    spline = CubicSpline(np.linspace(0.0, 1.0, knots), np.eye(knots))
    return spline(np.linspace(0.0, 1.0, points))


def group_run(fields, stack):
    """Voltage, branch currents and SoC of a group over a stack of records: GroupRun.

    Between rows the current of each branch moves on a straight line whose end is found implicitly,
    with the slope of the OCV of that moment; at each row the total steps and is shared anew.

    Parameters
    ----------
    fields : GroupFields. stack : records.Stack.

    Returns
    -------
    run : GroupRun.

    Raises
    ------
    Refusal : a branch without any resistance.
    """
    if np.any(fields.r[:, 0] + fields.wire < LEAST_OHM) or np.any(fields.capacity <= 0):
        raise Refusal("a branch of the group has no resistance or no capacity")
    inside = stack.celsius[:, None] + fields.warmer
    factor = resistance_factor(inside, REFERENCE_CELSIUS, fields.energy)
    kernel = function("group_run", *[count] * 4, *[array] * 13)
    current, voltage, soc = (
        _twin(fields, stack, factor) if kernel is None else _compiled(kernel, fields, stack, factor)
    )
    return GroupRun(voltage, current * (1.0 + fields.gain) + fields.offset, soc)


def _compiled(kernel, fields, stack, factor):
    rows, cells = factor.shape
    results = np.empty((rows, cells)), np.empty(rows), np.empty((rows, cells))
    given = (stack.step_second, stack.fresh, stack.current_ampere, fields.ocv, fields.r)
    given += (fields.tau, fields.wire, 3600.0 * fields.capacity, factor, fields.soc)
    given = [np.ascontiguousarray(values, float) for values in given]
    first_order = stack.hold == "first_order"
    kernel(rows, cells, fields.ocv.shape[1], first_order, *given, *results)
    return results


def _twin(fields, stack, factor):
    rows, cells = factor.shape
    current, voltage, soc = np.empty((rows, cells)), np.empty(rows), np.empty((rows, cells))
    lags = lag_weights(stack.step_second[:, None, None], fields.tau, hold="first_order")
    charge = stack.step_second[:, None] / (3600.0 * fields.capacity) / 2.0
    total = stack.current_ampere
    held = total if stack.hold == "first_order" else np.roll(total, 1)
    for k in range(rows):
        ohm = factor[k][:, None] * fields.r
        if stack.fresh[k]:
            z, pair = fields.soc[stack.file[k]], np.zeros((cells, 2))
        else:
            weights = [weight[k] for weight in lags]
            z, pair = _moved(fields, ohm, z, pair, current[k - 1], charge[k], weights, held[k])
        source = ocv_on_grid(fields.ocv, z) + pair.sum(axis=1)
        voltage[k], current[k] = _shared(source, ohm[:, 0] + fields.wire, total[k])
        soc[k] = z
    return current, voltage, soc


def _shared(source, ohm, total):
    """Voltage [V] and branch currents [A] of sources behind resistances, by Kirchhoff's laws."""
    whole = star(source, ohm)
    volt = whole[0] + whole[1] * total
    return volt, (volt - source) / ohm


def _moved(fields, ohm, soc, pair, begin, charge, weights, total):
    """SoC and pair voltages at the end of a step under a total."""
    ocv, slope = ocv_and_slope(fields.ocv, soc + charge * begin)
    at_begin, pairs = ohm[:, 1:] * begin[:, None], ohm[:, 1:]
    source = ocv + lag_step(weights, pair, at_begin, 0.0).sum(axis=1)
    behind = ohm[:, 0] + fields.wire + np.maximum(slope, 0.0) * charge
    end = _shared(source, behind + (pairs * weights[2]).sum(axis=1), total)[1]
    return soc + charge * (begin + end), lag_step(weights, pair, at_begin, pairs * end[:, None])


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
    """Free parameters of a healthy group, in the order of `group_names`.

    Parameters
    ----------
    cells : sequence of Branch. files : number of records. spread, shared :
    known.Spread, known.Shared.
    sensors : bool; the branch currents were logged.

    Returns
    -------
    free : tuple of least_squares.Free. Without branch currents their sensors are not among them.
    """
    far = spread.widest
    free = _common_frees(cells, shared, far)
    free += [_bounded(f"soc0[{k}]", SOC_STEP, shared.soc, far) for k in range(files)]
    free += _knots("fine", FINE_KNOTS, shared.ocv_volt, far)
    for b, cell in enumerate(cells):
        free += _of_branch(b, cell, spread, sensors)
        free += _knots(f"{b}.ocv", OCV_KNOTS, _ocv_volt(cell, spread), far)
    return tuple(free)


def _bounded(name, step, std, far):
    return Free(name, step, 0.0, std, -far * std, far * std)


def _knots(name, count, volt, far):
    """Free knots of an OCV error; their correlation is that of `group_coupling`."""
    most = far * volt
    return [Free(f"{name}[{k}]", VOLT_STEP, 0.0, np.inf, -most, most) for k in range(count)]


def _ocv_volt(cell, spread):
    return spread.ocv_volt if cell.own else spread.type_ocv_volt


def _common_frees(cells, shared, far):
    tested = all(cell.own for cell in cells)
    # The activation energy of a cell never tested over temperature is not known.
    warmed = tested and all(cell.activation_joule_per_mole for cell in cells)
    resistance = shared.resistance if tested else shared.type_resistance
    time = shared.time_constant if tested else shared.type_time_constant
    energy = shared.activation_joule_per_mole if warmed else shared.type_activation_joule_per_mole
    capacity = shared.capacity if tested else shared.type_capacity
    return [
        *(_bounded(name, LOG_STEP, resistance, far) for name in ("log_r0", "log_r1", "log_r2")),
        *(_bounded(name, 4 * LOG_STEP, time, far) for name in ("log_tau1", "log_tau2")),
        _bounded("capacity", LOG_STEP, capacity, far),
        _bounded("energy", 500.0, energy, far),
    ]


def _of_branch(b, cell, spread, sensors):
    stds = {
        "capacity": spread.capacity if cell.own else spread.type_capacity,
        "log_r0": spread.resistance if cell.own else spread.type_resistance,
        "log_slow": spread.resistance if cell.own else spread.type_resistance,
        "log_tau": spread.time_constant if cell.own else spread.type_time_constant,
        "soc": spread.soc,
        "celsius": spread.celsius,
        "wire": spread.wire_ohm,
    }
    if sensors:
        stds["offset"] = spread.current_offset_c_rate * cell.capacity_ampere_hour
        stds["gain"] = spread.current_gain
    return [_bounded(f"{b}.{n}", STEPS[n], s, spread.widest) for n, s in stds.items()]


def group_coupling(free, cells, spread, shared):
    """Prior precision of the errors of all OCV curves, smooth over SoC: (k, k)."""
    precision = np.zeros((len(free), len(free)))
    names = [parameter.name for parameter in free]
    at = [k for k, name in enumerate(names) if name.startswith("fine[")]
    precision[np.ix_(at, at)] = _smooth(FINE_KNOTS, shared.ocv_soc) / shared.ocv_volt**2
    shape = _smooth(OCV_KNOTS, spread.ocv_soc)
    for b, cell in enumerate(cells):
        at = [k for k, name in enumerate(names) if name.startswith(f"{b}.ocv[")]
        precision[np.ix_(at, at)] = shape / _ocv_volt(cell, spread) ** 2
    return precision


def _smooth(knots, length):
    """Precision of a curve of unit size, smooth over a length of SoC."""
    soc = np.linspace(0.0, 1.0, knots)
    near = np.exp(-0.5 * (np.subtract.outer(soc, soc) / length) ** 2)
    return np.linalg.inv(near + OWN_KNOT**2 * np.eye(knots))


def document(case, state):
    """Model of a group as a document, from which `fields_of` and `group_run` simulate it.

    Parameters
    ----------
    case : case.GroupCase. state : state.State.

    Returns
    -------
    model : dict: branches (each as Branch), values (of group_names and effects by name), effects
    (effect and branch, from 1), initial_soc (f, b) of the records fitted [1], hold.
    """
    return {
        "branches": [
            cell._asdict() | {"ocv_volt": np.asarray(cell.ocv_volt).tolist()} for cell in case.cells
        ],
        "values": {name: float(value) for name, value in state.solution.values.items()},
        "effects": [{"effect": e.id, "branch": e.position + 1} for e in state.effects],
        "initial_soc": case.fit.soc_at_start.tolist(),
        "hold": case.fit.hold,
    }


def fields_of(model, library=GROUP_LIBRARY):
    """GroupFields of a document, at the starts of its records.

    Parameters
    ----------
    model : dict, of `document`. library : dict of Effect by id.

    Returns
    -------
    fields : GroupFields.
    """
    cells = [
        Branch(**{**branch, "ocv_volt": np.asarray(branch["ocv_volt"], float)})
        for branch in model["branches"]
    ]
    effects = [at_branch(library[e["effect"]], e["branch"] - 1) for e in model["effects"]]
    return group_fields(cells, np.asarray(model["initial_soc"], float), model["values"], effects)
