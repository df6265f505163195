"""Normal equations of a circuit at given time constants, in one pass over the record."""

from typing import NamedTuple

import numpy as np

from cellwright.models.kernels import lag
from cellwright.native import array, count, function
from cellwright.refusal import Refusal

STEP = 1e-30  # of a complex step: its square vanishes beside any real part
TYPES = (count, count, count, count, *[array] * 4, count, *[array] * 4)
MOST_LAGS, MOST_FIXED = 24, 6  # what the kernel has room for


class Load(NamedTuple):
    """A record as the linear model y = fixed·a + lags(tau)·r sees it.

    step_second : (n−1,) steps [s]. drive : (n,) current that the lags follow [A]. fixed : (f, n)
    columns that no time constant enters. target_volt : (n,) what is to be explained [V]. hold : of
    the drive, see `kernels.lag_weights`.
    """

    step_second: np.ndarray
    drive: np.ndarray
    fixed: np.ndarray
    target_volt: np.ndarray
    hold: str


class Normal(NamedTuple):
    """Products of the columns (fixed, lags, derivatives of the lags by ln tau) and the residual.

    gram : (c, c). moment : (c,) columns times residual. power : residual times itself
    [V²]. near : residual times the one before it [V²].
    """

    gram: np.ndarray
    moment: np.ndarray
    power: float
    near: float


def normal_equations(load, tau_second, linear, *, sloped=True):
    """Products of all columns of a circuit's linear model, and of its residual, in one pass.

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
    Refusal : a time constant that is not positive, an unknown hold, too many columns.
    """
    tau, linear = np.ascontiguousarray(tau_second, float), np.ascontiguousarray(linear, float)
    if len(tau) > MOST_LAGS or len(load.fixed) > MOST_FIXED:
        found = f"{len(tau)} lags and {len(load.fixed)} fixed columns"
        raise Refusal(f"{found}; at most {MOST_LAGS} and {MOST_FIXED} fit at once")
    if not (tau > 0).all():
        raise Refusal("a time constant is zero, negative or not a number")
    kernel = function("circuit_products", *TYPES)
    if kernel is None:
        return _by_numpy(load, tau, linear, sloped=sloped)
    size = len(linear) + sloped * len(tau) + 1
    gram, near = np.zeros((size, size)), np.zeros(1)
    head = (len(load.drive), len(load.fixed), len(tau), int(sloped))
    first_order = int(load.hold == "first_order")
    series = (load.step_second, load.drive, load.fixed, load.target_volt)
    kernel(*head, *series, first_order, tau, linear, gram, near)
    return _split(gram, near[0])


def columns_of(load, tau_second, *, sloped=True):
    """The columns themselves: fixed, lags, and (where sloped) their derivatives by ln tau: (c, n).

    Parameters
    ----------
    load, tau_second, sloped : as in `normal_equations`.
    """
    step = [1j * STEP if sloped else 0.0] * len(tau_second)
    pairs = zip(tau_second, step, strict=True)
    lags = [lag(load.step_second, t * (1 + h), load.drive, hold=load.hold) for t, h in pairs]
    slopes = [one.imag / STEP for one in lags] if sloped else []
    return np.vstack([load.fixed, *(np.real(one) for one in lags), *slopes])


def _by_numpy(load, tau_second, linear, *, sloped):
    columns = columns_of(load, tau_second, sloped=sloped)
    residual = load.target_volt - linear @ columns[: len(linear)]
    columns = np.vstack([columns, residual])
    return _split(columns @ columns.T, residual[1:] @ residual[:-1])


def _split(products, near):
    return Normal(products[:-1, :-1], products[:-1, -1], float(products[-1, -1]), float(near))
