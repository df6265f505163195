"""The model that is searched for what it lacks, and its fit without any effect.

One function computes the voltage of all records for one vector of parameters, in stages that an
effect may step into: the current through the cell, the counting of charge, the resistances, the
OCV, the overpotentials, the reading. Without effects it is the plain isothermal circuit.
"""

from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function, real
from cellwright.numerics.lags import lag_weights

STAGES = ("current", "counting", "resistance", "ocv", "overpotential", "reading")
REFERENCE_CELSIUS = 25.0
OCV_KNOTS = 16
TAU_SECOND = {"tau1": (2.0, 40.0), "tau2": (40.0, 600.0)}
KEPT_RESPONSES = 40
SOC_LIMITS = (-0.5, 1.5)  # beyond them a trial step has lost its way, and only must not overflow
LOGARITHMS = ("log_r0", "log_r1", "log_tau1", "log_r2", "log_tau2")


class Fields(NamedTuple):
    """What the stages hand on; scalars or (n,).

    current : through the cell [A]. held : the same since the row before [A]. moved : charge that
    has moved since the row before, + on charge [Ah]. capacity : [Ah]. soc : [1].
    celsius : inside the cell [degC]. r0, r1, r2 : [ohm]. tau1, tau2 : [s]. ocv : [V].
    ohmic : voltage that follows the current at once [V]. volt : of the terminals [V].
    """

    current: np.ndarray
    held: np.ndarray
    moved: np.ndarray
    capacity: np.ndarray
    soc: np.ndarray
    celsius: np.ndarray
    r0: np.ndarray
    r1: np.ndarray
    r2: np.ndarray
    tau1: float
    tau2: float
    ocv: np.ndarray
    ohmic: np.ndarray
    volt: np.ndarray


class Cell(NamedTuple):
    """What is known of a cell before the search: capacity [Ah], OCV table on an even grid [V]."""

    capacity_ampere_hour: float
    ocv_volt: np.ndarray

    def ocv_at(self, soc):
        """OCV [V]; beyond the table on its last slope, bounded, so that nothing runs away."""
        spot = np.clip(soc, -0.05, 1.05) * (len(self.ocv_volt) - 1)
        left = np.clip(spot.astype(int), 0, len(self.ocv_volt) - 2)
        low, high = self.ocv_volt[left], self.ocv_volt[left + 1]
        return low + (spot - left) * (high - low)


def base_names(files):
    """Names of the plain model's parameters for a number of records.

    Logarithms of resistances and time constants, relative error of the capacity, SoC at the start
    of each record, and the error of the OCV table at evenly spaced knots [V].
    """
    starts = [f"soc0[{k}]" for k in range(files)]
    return (*LOGARITHMS, "capacity", *starts, *(f"ocv[{k}]" for k in range(OCV_KNOTS)))


def left_knot(soc):
    """Number of the knot of the OCV error below each SoC: (n,)."""
    spot = np.clip(soc, 0.0, 1.0) * (OCV_KNOTS - 1)
    return np.minimum(spot.astype(int), OCV_KNOTS - 2)


def hats(soc):
    """Share of each knot of the OCV error at each SoC: (n, knots), straight between knots."""
    spot, left = np.clip(soc, 0.0, 1.0) * (OCV_KNOTS - 1), left_knot(soc)
    part = spot - left
    found = np.zeros((len(spot), OCV_KNOTS))
    rows = np.arange(len(spot))
    found[rows, left], found[rows, left + 1] = 1.0 - part, part
    return found


def voltage(cell, stack, values, effects=()):
    """Voltage of the terminals over all records [V].

    Parameters
    ----------
    cell : Cell. stack : records.Stack.
    values : dict of parameters by name, those of `base_names` and of the effects.
    effects : sequence of Effect.

    Returns
    -------
    volt : (n,) [V].
    """
    return fields_of(cell, stack, values, effects).volt


def fields_of(cell, stack, values, effects=()):
    """As `voltage`, with everything that led to it: Fields."""
    staged = {stage: [] for stage in STAGES}
    for effect in effects:
        own = {p.name: values[f"{effect.id}.{p.name}"] for p in effect.parameters}
        staged[effect.stage].append((effect, own))

    def through(stage, fields):
        for effect, own in staged[stage]:
            fields = effect.act(fields, stack, own)
        return fields

    fields = through("current", _begun(cell, stack, values))
    hours = stack.step_second / 3600.0
    fields = fields._replace(moved=fields.held * hours + stack.unseen_ampere_hour)
    fields = through("counting", fields)
    fields = _counted(stack, values, fields)
    fields = through("resistance", fields)
    fields = through("ocv", fields._replace(ocv=_open_circuit(cell, values, fields.soc)))
    fields = fields._replace(ohmic=fields.r0 * fields.current)
    fields = fields._replace(volt=fields.ocv + slow_volt(stack, fields))
    fields = through("overpotential", fields)
    known = values.get("known", 1.0) * stack.known_volt
    fields = fields._replace(volt=fields.volt + fields.ohmic + known)
    return through("reading", fields)


def _begun(cell, stack, values):
    r0, r1, tau1, r2, tau2 = (np.exp(values[name]) for name in LOGARITHMS)
    none = np.zeros(0)
    capacity = cell.capacity_ampere_hour * (1.0 + values["capacity"])
    return Fields(
        *(stack.current_ampere, stack.held_ampere, none, capacity, none, stack.celsius),
        *(r0, r1, r2, tau1, tau2, none, none, none),
    )


def _counted(stack, values, fields):
    """SoC by counting, each record from its own start."""
    moved = np.cumsum(fields.moved / fields.capacity)
    starts = np.array([values[f"soc0[{k}]"] for k in range(len(stack.first))])
    soc = moved + (starts - moved[stack.first])[stack.file]
    return fields._replace(soc=np.clip(soc, *SOC_LIMITS))


def _open_circuit(cell, values, soc):
    error = np.array([values[f"ocv[{k}]"] for k in range(OCV_KNOTS)])
    spot = np.clip(soc, 0.0, 1.0) * (OCV_KNOTS - 1)
    left = np.minimum(spot.astype(int), OCV_KNOTS - 2)
    low, high = error[left], error[left + 1]
    return cell.ocv_at(soc) + low + (spot - left) * (high - low)


def slow_volt(stack, fields):
    """Voltage of the two RC pairs [V]."""
    one = relaxed(stack, fields.current, fields.tau1, gain=fields.r1)
    return one + relaxed(stack, fields.current, fields.tau2, gain=fields.r2)


def relaxed(stack, drive, tau_second, *, gain=1.0):
    """First-order lag of gain·drive that begins at rest in every record; unit of their product."""
    start = np.zeros(len(drive))
    if np.ndim(gain) or drive is not stack.current_ampere:
        return lag_fresh(
            stack.step_second, stack.fresh, stack.linear, gain * drive, tau_second, start
        )
    kept = stack.responses
    if tau_second not in kept:
        if len(kept) >= KEPT_RESPONSES:
            kept.clear()
        kept[tau_second] = lag_fresh(
            stack.step_second, stack.fresh, stack.linear, drive, tau_second, start
        )
    return gain * kept[tau_second]


def lag_fresh(step, fresh, linear, drive, constant, start):
    """First-order lag over records that lie one after the other.

    Parameters
    ----------
    step : (n,) time, or another clock, since the row before. fresh : (n,) 1 in first rows, else 0.
    linear : (n,) 1 where the drive moved on a straight line since the row before, 0 where it kept
        its value. drive : (n,) input. constant : time constant, unit of `step`.
    start : (n,) state in first rows.

    Returns
    -------
    state : (n,) unit of the drive.
    """
    kernel = function("lag_fresh", count, array, array, array, real, array, array, array)
    if kernel is None:
        return _twin(step, fresh, linear, drive, constant, start)
    drive, step = np.ascontiguousarray(drive, float), np.ascontiguousarray(step)
    state = np.empty(len(drive))
    kernel(len(drive), step, fresh, linear, constant, start, drive, state)
    return state


def _twin(step, fresh, linear, drive, constant, start):
    held, moved = (lag_weights(step, constant, hold=hold) for hold in ("zero_order", "first_order"))
    pairs = zip(moved, held, strict=True)
    decay, before, after = (np.where(linear > 0, one, other) for one, other in pairs)
    state = np.empty(len(drive))
    for k in range(len(drive)):
        if fresh[k]:
            state[k] = start[k]
        else:
            state[k] = decay[k] * state[k - 1] + before[k] * drive[k - 1] + after[k] * drive[k]
    return state
