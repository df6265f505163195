"""The plain model of one cell as a fit: what is free, what is known beforehand, where it begins."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from cellwright.effects import base
from cellwright.numerics.least_squares import Free

LOG_STEP, SOC_STEP, VOLT_STEP = 0.01, 2e-4, 1e-3
FIRST_TAU_SECOND = {"log_tau1": 8.0, "log_tau2": 130.0}
RESISTANCES = ("log_r0", "log_r1", "log_r2")
NO_LOG_OHM, UNIT = np.log(1e-7), 1e-2  # a size from which a derivative is taken [ohm]
LOG_STD = {"log_r0": 1.5, "log_r1": 1.5, "log_r2": 1.5, "log_tau1": 0.8, "log_tau2": 0.8}
STEEP = 2.0  # times the usual slope of the OCV
OWN_KNOT = 0.1  # of the tolerance of the OCV: what each knot may err alone


class Tolerance(NamedTuple):
    """What is known beforehand, as standard deviations.

    ocv_volt : error of the OCV table, smooth over `ocv_soc`. capacity : relative.
    soc : of the state of charge at the start of a record. steep_soc : an error of the SoC that no
    parameter follows, so that rows on a steep OCV count less. known : relative, of the size that
    a healthy cell's own misfit has in this cell (paired mode).
    """

    ocv_volt: float = 1.5e-3
    ocv_soc: float = 0.12
    capacity: float = 3e-3
    soc: float = 0.02
    steep_soc: float = 3e-3
    known: float = 0.2


def frees(stack, start, tolerance):
    """Free parameters of the plain model.

    Parameters
    ----------
    stack : records.Stack. start : dict of first values. tolerance : Tolerance.

    Returns
    -------
    free : tuple of problem.Free, in the order of `base.base_names`, in paired mode the scale of
        what healthy cells have in common after them.
    """
    logs = [
        Free(name, LOG_STEP, start[name], LOG_STD[name], *_limits(name)) for name in base.LOGARITHMS
    ]
    capacity = Free("capacity", LOG_STEP / 10, 0.0, tolerance.capacity)
    socs = [
        Free(f"soc0[{k}]", SOC_STEP, soc, tolerance.soc) for k, soc in enumerate(stack.soc_at_start)
    ]
    knots = [Free(f"ocv[{k}]", VOLT_STEP) for k in range(base.OCV_KNOTS)]
    known = [Free("known", LOG_STEP, 1.0, tolerance.known)] if stack.known_volt.any() else []
    return (*logs, capacity, *socs, *knots, *known)


def _limits(name):
    low, high = base.TAU_SECOND.get(name.removeprefix("log_"), (1e-7, 10.0))
    return np.log(low), np.log(high)


def coupling(free, tolerance):
    """Prior precision of the OCV's error: as large as its tolerance, smooth over SoC. (k, k)."""
    soc = np.linspace(0.0, 1.0, base.OCV_KNOTS)
    near = np.exp(-0.5 * (np.subtract.outer(soc, soc) / tolerance.ocv_soc) ** 2)
    covariance = tolerance.ocv_volt**2 * (near + OWN_KNOT**2 * np.eye(len(soc)))
    found = np.zeros((len(free), len(free)))
    knots = [k for k, one in enumerate(free) if one.name.startswith("ocv[")]
    found[np.ix_(knots, knots)] = np.linalg.inv(covariance)
    return found


def first_values(cell, stack):
    """Where a fit begins: resistances by linear regression at usual time constants.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack.

    Returns
    -------
    values : dict of all parameters of the plain model.
    """
    values = dict.fromkeys(base.base_names(len(stack.first)), 0.0) | {"known": 1.0}
    values |= {f"soc0[{k}]": float(soc) for k, soc in enumerate(stack.soc_at_start)}
    return regressed(cell, stack, values)


def regressed(cell, stack, values, effects=(), sizes=()):
    """Values with the resistances estimated by linear regression, effects held at given values.

    A search whose resistances have settled at a wrong optimum leaves it by these.

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
        (base.voltage(cell, stack, without | {name: one}, effects) - volt)[stack.used]
        for name, one in units.items()
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


def steep_volt(cell, soc, tolerance):
    """What an unfollowed error of the SoC does where the OCV is unusually steep [V]: (n,)."""
    slope = np.abs(cell.ocv_at(soc + 5e-3) - cell.ocv_at(soc - 5e-3)) / 0.01
    usual = STEEP * abs(np.median(np.diff(cell.ocv_volt))) * (len(cell.ocv_volt) - 1)
    return tolerance.steep_soc * np.maximum(slope - usual, 0.0)
