"""The model of cells in parallel that is searched for what one branch has of its own.

Every branch is the plain cell (OCV, ohmic resistance, two RC pairs) behind a wire; resistances
of the cells move with temperature, those of the wires do not. Kirchhoff's laws share the current.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline

from cellwright.effects.base import OCV_KNOTS, REFERENCE_CELSIUS
from cellwright.models.kernels import lag_weights
from cellwright.models.tables import warmth
from cellwright.native import array, count, function
from cellwright.refusal import Refusal

LEAST_OHM = 1e-6
SMOOTH_SOC = 0.01
FINE_KNOTS = 41  # of the error that the OCV of all branches shares


class Branch(NamedTuple):
    """What is known of one branch beforehand.

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
    """The group as it is simulated; what an effect of a branch changes.

    capacity : (b,) [Ah]. ocv : (b, p) [V]. r : (b, 3) [ohm]. tau : (b, 2) [s]. wire : (b,) [ohm].
    energy : (b,) [J/mol]. soc : (f, b) at the start of each record [1]. warmer : (b,) above what
    was measured [K]. offset : (b,) [A] and gain : (b,) [1] of the branch's sensor.
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


class Placed(NamedTuple):
    """An effect in one branch (0 is the first). name : of its one parameter within the model."""

    effect: object
    branch: int

    @property
    def name(self):
        return f"{self.effect.id}[{self.branch}]"


class GroupRun(NamedTuple):
    """voltage : (n,) [V]. current : (n, b) as the sensors read it [A]. soc : (n, b) [1]."""

    voltage: np.ndarray
    current: np.ndarray
    soc: np.ndarray


COMMON = ("log_r0", "log_r1", "log_r2", "log_tau1", "log_tau2", "capacity", "energy")
OWN = ("capacity", "log_r0", "log_slow", "log_tau", "soc", "celsius", "wire", "offset", "gain")


def group_names(files, branches):
    """Names of all parameters but those of effects: common ones, then those of each branch."""
    common = [*COMMON, *(f"soc0[{k}]" for k in range(files))]
    own = [*OWN, *(f"ocv[{k}]" for k in range(OCV_KNOTS))]
    common += [f"fine[{k}]" for k in range(FINE_KNOTS)]
    return (*common, *(f"{b}.{name}" for b in range(branches) for name in own))


def group_fields(cells, soc_at_start, values, placed=()):
    """The group of a set of values.

    Parameters
    ----------
    cells : sequence of Branch. soc_at_start : (f, b) stated SoC [1].
    values : dict by the names of `group_names` and of the effects. placed : sequence of Placed.

    Returns
    -------
    fields : GroupFields.
    """
    branches = range(len(cells))

    def own(name):
        return np.array([values[f"{b}.{name}"] for b in branches])

    slow = np.exp(own("log_slow")[:, None] + [[values["log_r1"], values["log_r2"]]])
    factor = np.concatenate([np.exp(own("log_r0") + values["log_r0"])[:, None], slow], axis=1)
    tau = np.exp(own("log_tau")[:, None] + [[values["log_tau1"], values["log_tau2"]]])
    capacity = np.array([c.capacity_ampere_hour for c in cells])
    shift = np.array([values[f"soc0[{k}]"] for k in range(len(soc_at_start))])
    fields = GroupFields(
        capacity=capacity * (1.0 + values["capacity"]) * (1.0 + own("capacity")),
        ocv=np.array([c.ocv_volt for c in cells]) + _ocv_errors(cells, values),
        r=np.array([c.r_ohm for c in cells]) * factor,
        tau=np.array([c.tau_second for c in cells]) * tau,
        wire=np.array([c.wire_ohm for c in cells]) + own("wire"),
        energy=np.array([c.activation_joule_per_mole for c in cells]) + values["energy"],
        soc=np.asarray(soc_at_start, float) + shift[:, None] + own("soc"),
        warmer=own("celsius"),
        offset=own("offset"),
        gain=own("gain"),
    )
    for one in placed:
        fields = one.effect.act(fields, one.branch, values[one.name])
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
    """Simulate a group over a stack of records.

    Between rows the current of each branch moves on a straight line whose end is found implicitly,
    with the slope of the OCV of that moment; at each row the total steps and is shared anew.

    Parameters
    ----------
    fields : GroupFields. stack : group_records.GroupStack.

    Returns
    -------
    run : GroupRun.

    Raises
    ------
    Refusal : a branch without any resistance.
    """
    if np.any(fields.r[:, 0] + fields.wire < LEAST_OHM) or np.any(fields.capacity <= 0):
        raise Refusal("a branch of the group has no resistance or no capacity")
    warm = warmth(stack.celsius[:, None] + fields.warmer, REFERENCE_CELSIUS, fields.energy)
    kernel = function("group_run", *[count] * 4, *[array] * 13)
    current, voltage, soc = (
        _twin(fields, stack, warm) if kernel is None else _compiled(kernel, fields, stack, warm)
    )
    return GroupRun(voltage, current * (1.0 + fields.gain) + fields.offset, soc)


def _compiled(kernel, fields, stack, warm):
    rows, cells = warm.shape
    found = np.empty((rows, cells)), np.empty(rows), np.empty((rows, cells))
    given = (stack.step_second, stack.fresh, stack.current_ampere, fields.ocv, fields.r)
    given += (fields.tau, fields.wire, 3600.0 * fields.capacity, warm, fields.soc)
    given = [np.ascontiguousarray(one, float) for one in given]
    first_order = stack.hold == "first_order"
    kernel(rows, cells, fields.ocv.shape[1], first_order, *given, *found)
    return found


def _twin(fields, stack, warm):
    rows, cells = warm.shape
    current, voltage, soc = np.empty((rows, cells)), np.empty(rows), np.empty((rows, cells))
    lags = lag_weights(stack.step_second[:, None, None], fields.tau, hold="first_order")
    charge = stack.step_second[:, None] / (3600.0 * fields.capacity) / 2.0
    held = stack.current_ampere if stack.hold == "first_order" else np.roll(stack.current_ampere, 1)
    pair = np.zeros((cells, 2))
    for k in range(rows):
        pairs = warm[k][:, None] * fields.r[:, 1:]
        if stack.fresh[k]:
            z, pair = fields.soc[stack.file[k]], np.zeros((cells, 2))
        else:
            weights = [one[k] for one in lags]
            z, pair = _moved(fields, pairs, warm[k], z, pair, here, charge[k], weights, held[k])
        source = _ocv_at(fields.ocv, z)[0] + pair.sum(axis=1)
        voltage[k], here = _met(source, warm[k] * fields.r[:, 0] + fields.wire, stack, k)
        current[k], soc[k] = here, z
    return current, voltage, soc


def _met(source, ohm, stack, k):
    volt = (stack.current_ampere[k] + (source / ohm).sum()) / (1.0 / ohm).sum()
    return volt, (volt - source) / ohm


def _moved(fields, pairs, warm, soc, pair, begin, charge, weights, total):
    """SoC and pair voltages at the end of a step under a total."""
    decay, before, after = weights
    ocv, slope = _ocv_at(fields.ocv, soc + charge * begin)
    source = ocv + (decay * pair + pairs * before * begin[:, None]).sum(axis=1)
    ohm = warm * fields.r[:, 0] + fields.wire + np.maximum(slope, 0.0) * charge
    ohm = ohm + (pairs * after).sum(axis=1)
    end = ((total + (source / ohm).sum()) / (1.0 / ohm).sum() - source) / ohm
    moved = decay * pair + pairs * (before * begin[:, None] + after * end[:, None])
    return soc + charge * (begin + end), moved


def _ocv_at(table, soc):
    last, rows = table.shape[1] - 1, np.arange(len(soc))
    left = np.clip((soc * last).astype(int), 0, last - 1)
    slope = (table[rows, left + 1] - table[rows, left]) * last
    return table[rows, left] + slope * (soc - left / last), slope
