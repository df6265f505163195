"""The linear model of a circuit under a load: its columns, and which parameters the data tell."""

from math import isnan
from typing import NamedTuple

import numpy as np

from cellwright.numerics.exponentials import UNDETERMINED, Normal, best_of_grid
from cellwright.numerics.lags import lag

STEP = 1e-30  # of a complex step: its square vanishes beside any real part


class Load(NamedTuple):
    """A record as the linear model y = fixed·a + lags(tau)·r: what is fitted, by which columns.

    step_second : (n−1,) steps [s]. drive : (n,) current that the lags follow [A]. fixed : (f, n)
    columns that no time constant enters. target_volt : (n,) what is to be explained [V]. hold : of
    the drive, see `lags.lag_weights`.
    """

    step_second: np.ndarray
    drive: np.ndarray
    fixed: np.ndarray
    target_volt: np.ndarray
    hold: str


def normal_equations(load, tau_second, linear, *, sloped=True):
    """Gram matrix of all columns of a circuit's linear model, with its residual, in one pass.

    Parameters
    ----------
    load : Load.
    tau_second : (m,) time constants [s].
    linear : (f + m,) factors of the fixed columns and of the lags, from which the residual is.
    sloped : True adds the derivative of each lag by the logarithm of its time constant.

    Returns
    -------
    normal : Normal, of f + m + (m where sloped) columns.

    Raises
    ------
    Refusal : a time constant that is not positive, an unknown hold.
    """
    columns = columns_of(load, tau_second, sloped=sloped)
    residual = load.target_volt - linear @ columns[: len(linear)]
    power, near = residual @ residual, residual[1:] @ residual[:-1]
    return Normal(columns @ columns.T, columns @ residual, float(power), float(near))


def columns_of(load, tau_second, *, sloped=True):
    """Columns of a circuit's linear model (c, n): fixed, lags, where sloped their slopes by ln tau.

    Parameters
    ----------
    load, tau_second, sloped : as in `normal_equations`.
    """
    step = [1j * STEP if sloped else 0.0] * len(tau_second)
    pairs = zip(tau_second, step, strict=True)
    lags = [lag(load.step_second, t * (1 + h), load.drive, hold=load.hold) for t, h in pairs]
    slopes = [response.imag / STEP for response in lags] if sloped else []
    return np.vstack([load.fixed, *(np.real(response) for response in lags), *slopes])


ROWS = 800  # of the thinned record


def coarse_start(load, tau_bounds, linear_bounds):
    """Start of a fit: time constants [s] and linear parameters that fit best on a coarse grid.

    Parameters
    ----------
    load : Load of the whole record.
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


def thinned(load):
    """The record on every k-th row, at most ROWS rows; steps in between carry their mean current.

    Parameters
    ----------
    load : Load.
    """
    stride = -(-len(load.drive) // ROWS)
    rows = np.arange(0, len(load.drive), stride)
    if stride == 1:
        return load
    if load.hold == "zero_order":
        passed = load.step_second * load.drive[:-1]
    else:
        passed = load.drive[:-1] + load.drive[1:]
        passed *= load.step_second
        passed *= 0.5
    charge = np.add.reduceat(passed, rows[:-1])
    step = np.add.reduceat(load.step_second, rows[:-1])
    charge[-1] = passed[rows[-2] : rows[-1]].sum()
    step[-1] = load.step_second[rows[-2] : rows[-1]].sum()
    mean = np.divide(charge, step, out=np.zeros_like(step), where=step > 0)
    fixed = np.ascontiguousarray(load.fixed[:, rows])
    return Load(step, np.append(mean, 0.0), fixed, load.target_volt[rows], "zero_order")


# The sum or ratio of two parameters is named where it is known this many times better than each.
COMBINED_BETTER = 5.0


def verdict(names, values, covariance, lower, upper):
    """Which parameters of a fit the data do not determine, in words; "" where they determine all.

    A parameter is not determined where its 95 % interval, from the covariance, reaches zero
    (relative standard deviation above 0.51), or where the fit ran to the limit of its search. Of
    two that are not determined, their sum (resistances) or ratio (a pair's R/tau, one over its
    capacitance) is named where that is known five times better.

    Parameters
    ----------
    names, values, covariance, lower, upper : of the parameters (p,), (p, p); the limits of their
        search in their units.

    Returns
    -------
    words : sentences, joined by "; ".
    """
    spread = (np.sqrt(covariance.diagonal()) / np.abs(values)).tolist()
    sentences = []
    for index, name in enumerate(names):
        if lower[index] == upper[index]:
            continue
        limit = _at_limit(names, values, lower, upper, index)
        if limit:
            sentences.append(limit)
        elif spread[index] > UNDETERMINED and not name.startswith("ocv"):
            sentences.append(
                f"{name} cannot be told: it is known within ±{1.96 * spread[index]:.0%}"
            )
        elif isnan(spread[index]) and name.startswith("tau"):
            sentences.append(f"{name} cannot be told: its pair has no voltage")
    return "; ".join([*sentences, *_together(names, values, covariance, spread)])


def _at_limit(names, values, lower, upper, index):
    """Sentence on a parameter at the limit of its search; "" where it lies within."""
    name, value = names[index], values[index]
    tau = name.startswith("tau")
    if tau and value >= upper[index] * (1 - 1e-9):
        limit = f"the fit runs to the longest that was searched, {value:.3g} s"
        return f"{name} cannot be told, nor r{name[3]}_ohm: {limit}"
    if tau and value <= lower[index] * (1 + 1e-9):
        return (
            f"{name} is no longer than {value:.3g} s, the shortest searched: its pair acts at once"
        )
    if value <= lower[index] or value >= upper[index]:
        return f"{name} lies at the bound of its search, {value:.3g}"
    return ""


def _together(names, values, covariance, spread):
    """Sentences on sums and ratios that are known much better than their two parameters."""
    lost = [i for i in range(len(names)) if spread[i] > UNDETERMINED and names[i][:3] != "ocv"]
    for i, j in [(i, j) for i in lost for j in lost if i < j]:
        kind, gradient = _combined(names[i], names[j], values[[i, j]])
        part = covariance[np.ix_([i, j], [i, j])]
        std = np.sqrt(max(gradient @ part @ gradient, 0.0))
        if kind and std * COMBINED_BETTER < min(spread[i], spread[j]):
            correlation = part[0, 1] / np.sqrt(part[0, 0] * part[1, 1])
            words = f"{names[i]} and {names[j]} are told only as their {kind}"
            yield f"{words} (±{1.96 * std:.0%}; correlation {correlation:.3f})"


def _combined(first, second, values):
    """Name of what two parameters form (sum, ratio or ""), and the gradient of its logarithm."""
    if first[0] == second[0] == "r":
        return "sum", np.ones(2) / values.sum()
    if first[0] == "r" and second == f"tau{first[1]}_second":
        return "ratio", np.array([1.0, -1.0]) / values
    return "", np.zeros(2)
