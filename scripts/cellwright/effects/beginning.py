"""Where a fit of the search begins: resistances by linear regression, and the capacity."""

import numpy as np
from scipy.optimize import nnls

from cellwright.effects import base

FIRST_TAU_SECOND = {"log_tau1": 8.0, "log_tau2": 130.0}
FIRST_CAPACITIES = (0.0, 0.05, -0.05, 0.1, -0.1, 0.15, -0.15, 0.2, -0.2)  # off the measured one
FINER_CAPACITY = 0.025
LESS_ERROR = 2 / 3  # of the error at the measured capacity: what another start must come down to
RESISTANCES = ("log_r0", "log_r1", "log_r2")
NO_LOG_OHM, UNIT = np.log(1e-7), 1e-2  # no resistance; a step for derivatives [ohm]


def first_values(cell, stack, *, capacity=0.0):
    """First values of a fit: resistances by linear regression at usual time constants.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. capacity : off the measured one, relative [1].

    Returns
    -------
    values : dict of all parameters of the plain model.
    """
    values = dict.fromkeys(base.base_names(len(stack.first)), 0.0) | {"known": 1.0, base.LEAD: 0.0}
    values |= {"capacity": capacity} | base.stated_starts(stack)
    return regressed(cell, stack, values)


def first_capacity(cell, stack):
    """Capacity, off the measured one [1], from which a fit finds its way: 0 but for gross errors.

    A capacity that is wrong by 10 % takes records beyond empty, where the OCV says nothing, or ends
    them before its knee: a fit that begins there stays at errors of hundreds of millivolts, or lets
    the OCV follow. Another start must take a third off the mean absolute error.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack.
    """

    def error(capacity):
        volt = base.voltage(cell, stack, first_values(cell, stack, capacity=capacity))
        return float(np.abs(stack.voltage_volt - volt)[stack.used].mean())

    errors = {capacity: error(capacity) for capacity in FIRST_CAPACITIES}
    best = min(errors, key=errors.get)
    if best:
        errors |= {near: error(near) for near in (best - FINER_CAPACITY, best + FINER_CAPACITY)}
        best = min(errors, key=errors.get)
    return best if errors[best] < LESS_ERROR * errors[0.0] else 0.0


def regressed(cell, stack, values, effects=(), sizes=()):
    """Values with the resistances estimated by linear regression, effects held at given values.

    For a fit whose resistances have settled at a local optimum, a start beyond it.

    Parameters
    ----------
    cell, stack : as above. values : dict. effects : sequence of Effect.
    sizes : names of further parameters, zero or above, that the voltage is proportional to.
    """
    values = values | {name: float(np.log(tau)) for name, tau in FIRST_TAU_SECOND.items()}
    without = values | dict.fromkeys(RESISTANCES, NO_LOG_OHM) | dict.fromkeys(sizes, 0.0)
    volt = base.voltage(cell, stack, without, effects)
    units = dict.fromkeys(RESISTANCES, np.log(UNIT)) | dict.fromkeys(sizes, UNIT)
    columns = [
        (base.voltage(cell, stack, without | {name: unit}, effects) - volt)[stack.used]
        for name, unit in units.items()
    ]
    error = (stack.voltage_volt - volt)[stack.used]
    sizes_by_name = dict(
        zip(units, UNIT * _nonnegative(np.stack(columns, axis=1), error), strict=True)
    )
    floor = max(max(sizes_by_name.values()), 1e-5) / 30
    logs = {name: float(np.log(max(sizes_by_name[name], floor))) for name in RESISTANCES}
    return values | logs | {name: float(sizes_by_name[name]) for name in sizes}


def _nonnegative(columns, target):
    """Non-negative least squares by way of the normal equations: few columns, many rows."""
    gram = columns.T @ columns
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    gram = gram / np.outer(size, size) + 1e-9 * np.eye(len(size))
    root = np.linalg.cholesky(gram)
    moment = np.linalg.solve(root, (columns.T @ target) / size)
    return nnls(root.T, moment)[0] / size
