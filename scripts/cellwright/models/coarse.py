"""Where to start a fit of time constants: every combination of a coarse grid, on thinned rows."""

from functools import cache
from itertools import product

import numpy as np

from cellwright.models.normal import MOST_LAGS, Load, normal_equations
from cellwright.models.projection import RANK
from cellwright.refusal import Refusal

ROWS = 800  # of the thinned record
GRID = {1: 24, 2: 14, 3: 8}  # time constants per pair


def coarse_start(load, tau_bounds, linear_bounds):
    """Time constants, and linear parameters for them, near which the best fit lies.

    Parameters
    ----------
    load : normal.Load of the whole record.
    tau_bounds : (m, 2) bounds of each time constant [s].
    linear_bounds : (lower, upper), (l,) each.

    Returns
    -------
    tau_second, linear : (m,) [s] ascending where the bounds are alike, (l,).

    Raises
    ------
    Refusal : the bounds hold two time constants at one value.
    """
    thin = thinned(load)
    fixed = len(load.fixed)

    def normal_at(tau):
        return normal_equations(thin, tau, np.zeros(fixed + len(tau)), sloped=False)

    return best_of_grid(normal_at, fixed, tau_bounds, linear_bounds)


def best_of_grid(normal_at, fixed, tau_bounds, linear_bounds):
    """Best combination of time constants of a coarse grid, and the linear parameters for it.

    Parameters
    ----------
    normal_at : function (k,) time constants → Normal of the fixed columns and one per constant,
        with the residual taken at zero.
    fixed : number of columns that no time constant enters.
    tau_bounds, linear_bounds : as in `coarse_start`.
    """
    kinds = list(dict.fromkeys(map(tuple, tau_bounds)))
    size = max(2, min(GRID.get(len(tau_bounds), 6), MOST_LAGS // len(kinds)))
    tau = np.concatenate([_inner(lower, upper, size) for lower, upper in kinds])
    combinations = _places(tuple(kinds.index(tuple(one)) for one in tau_bounds), size)
    ascending = np.sort(tau[combinations], axis=1)
    combinations = combinations[(ascending[:, 1:] > ascending[:, :-1]).all(axis=1)]
    if not len(combinations):
        raise Refusal("bounds hold two time constants at one value: their pairs are one")
    normal = normal_at(tau)
    linear, power = _solved(normal, fixed, combinations)
    inside = ((linear >= linear_bounds[0]) & (linear <= linear_bounds[1])).all(axis=1)
    best = int(np.argmin(np.where(inside, power, power + 1e6 * normal.power)))
    return tau[combinations[best]], linear[best]


def thinned(load):
    """The record on every so-manieth row; between them the lags follow the mean current."""
    stride = -(-len(load.drive) // ROWS)
    rows = np.arange(0, len(load.drive), stride)
    if stride == 1:
        return load
    if load.hold == "zero_order":
        passed = load.step_second * load.drive[:-1]
    else:
        passed = load.step_second * (load.drive[:-1] + load.drive[1:]) / 2
    charge = np.add.reduceat(passed, rows[:-1])
    step = np.add.reduceat(load.step_second, rows[:-1])
    charge[-1] = passed[rows[-2] : rows[-1]].sum()
    step[-1] = load.step_second[rows[-2] : rows[-1]].sum()
    mean = np.divide(charge, step, out=np.zeros_like(step), where=step > 0)
    fixed = np.ascontiguousarray(load.fixed[:, rows])
    return Load(step, np.append(mean, 0.0), fixed, load.target_volt[rows], "zero_order")


@cache
def _places(kinds, size):
    """Every combination of places in a list of grids, one grid per kind of bounds: (k, m)."""
    found = np.array(list(product(*(range(kind * size, (kind + 1) * size) for kind in kinds))))
    alike = np.equal(kinds[1:], kinds[:-1])
    return found[((found[:, 1:] > found[:, :-1]) | ~alike).all(axis=1)]


def _inner(lower, upper, size):
    """Logarithmic grid inside of two bounds, all one point where they coincide."""
    return np.exp(np.linspace(np.log(lower), np.log(upper), size + 2)[1:-1])


def _solved(normal, fixed, combinations):
    """Least squares of every combination: (k, l) parameters, (k,) power."""
    columns = np.hstack([np.tile(np.arange(fixed), (len(combinations), 1)), fixed + combinations])
    scale = np.sqrt(np.diag(normal.gram))
    scale = np.where(scale > 0, scale, 1.0)
    unit = normal.gram / np.outer(scale, scale)
    gram = unit[columns[:, :, None], columns[:, None, :]]
    moment = (normal.moment / scale)[columns]
    ridge = RANK * np.eye(gram.shape[1])
    found = np.linalg.solve(gram + ridge, moment[:, :, None])[:, :, 0]
    return found / scale[columns], normal.power - (found * moment).sum(axis=1)
