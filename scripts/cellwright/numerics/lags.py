"""First-order lag of an input on uneven time steps, exact for its hold: recursion and weights."""

import numpy as np

from cellwright.native import array, count, function, real
from cellwright.refusal import Refusal

HOLDS = ("zero_order", "first_order")


def lag_weights(step_second, tau_second, *, hold):
    """Weights of a first-order lag over each step, exact for the stated hold of its input.

    u[k+1] = decay[k]·u[k] + before[k]·x[k] + after[k]·x[k+1] solves tau·du/dt = x − u.

    Parameters
    ----------
    step_second : (n−1,) steps between samples [s]; zero is allowed (an edge: nothing decays).
    tau_second : scalar or (n−1,) time constant over each step [s].
    hold : "zero_order" (the input keeps its value until the next sample) or "first_order" (it
        moves on a straight line to the next sample).

    Returns
    -------
    decay, before, after : (n−1,) each [1].

    Raises
    ------
    Refusal : unknown hold, or time constants that are not positive.
    """
    _check(tau_second, hold)
    ratio = np.asarray(step_second) / tau_second
    gain = -np.expm1(-ratio)
    if hold == "zero_order":
        return 1.0 - gain, gain, np.zeros_like(gain)
    mean = np.divide(gain, ratio, out=np.ones_like(ratio), where=np.real(ratio) > 0)
    return 1.0 - gain, mean + gain - 1.0, 1.0 - mean


def lag_step(weights, state, before, after):
    """State of a lag at the end of a step; unit of its input.

    Parameters
    ----------
    weights : decay, before and after of the step, see `lag_weights`. state : at its begin.
    before, after : input at its begin and at its end.
    """
    return weights[0] * state + weights[1] * before + weights[2] * after


def lag(step_second, tau_second, drive, *, hold, initial=0.0):
    """Response of a first-order lag with unit gain to one or many inputs.

    In C where that can be built (`native`), else as a lower bidiagonal system of equations by
    LAPACK's banded triangular solve: the same recurrence, with a true step and time constant per
    sample either way.

    Parameters
    ----------
    step_second, tau_second, hold : as in `lag_weights`.
    drive : (n,) or (n, m) inputs, any unit.
    initial : scalar or (m,) state at the first sample, unit of the input.

    Returns
    -------
    state : shape of drive, unit of the input.
    """
    types = (count, count, array, array, count, count, array, array)
    kernel = function("lag", *types)
    if kernel is None or np.iscomplexobj(drive) or np.iscomplexobj(tau_second):
        return _lag_by_lapack(step_second, tau_second, drive, hold=hold, initial=initial)
    _check(tau_second, hold)
    drive, state = np.ascontiguousarray(drive, float), np.empty(np.shape(drive))
    state[0] = initial
    step = np.ascontiguousarray(step_second, float)
    tau = np.ascontiguousarray(np.atleast_1d(tau_second), float)
    rows, columns = len(drive), drive.size // len(drive)
    kernel(rows, columns, step, tau, len(tau) > 1, hold == "first_order", drive, state)
    return state


def mean_over_steps(values, hold):
    """Mean over each step (n−1,) of an input (n,) by its hold, see `lag_weights`; unit of both."""
    return values[:-1] if hold == "zero_order" else (values[:-1] + values[1:]) / 2


def lag_by_charge(passed_ampere_hour, charge_ampere_hour, drive):
    """Response of a lag that moves with the charge passed, to an input that is constant per step.

    Parameters
    ----------
    passed_ampere_hour : (n−1,) charge passed in each step, never negative [Ah].
    charge_ampere_hour : scalar or (n−1,) charge after which 1/e is left [Ah].
    drive : (n−1,) or (n−1, m) where the state goes to in each step, any unit.

    Returns
    -------
    state : (n,) or (n, m), zero at first.
    """
    held = np.concatenate([drive, drive[-1:]])
    return lag(passed_ampere_hour, charge_ampere_hour, held, hold="zero_order")


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
        return _lag_fresh_by_lapack(step, fresh, linear, drive, constant, start)
    drive, step = np.ascontiguousarray(drive, float), np.ascontiguousarray(step)
    state = np.empty(len(drive))
    kernel(len(drive), step, fresh, linear, constant, start, drive, state)
    return state


def _lag_fresh_by_lapack(step, fresh, linear, drive, constant, start):
    weights = (lag_weights(step, constant, hold=hold) for hold in HOLDS)
    kept, moved = (np.array(one) for one in weights)
    decay, before, after = np.where(linear > 0, moved, kept)
    earlier = np.concatenate([drive[:1], drive[:-1]])
    right = np.where(fresh > 0, start, before * earlier + after * drive)
    return _recursion(np.where(fresh > 0, 0.0, decay)[1:], right)


def _lag_by_lapack(step_second, tau_second, drive, *, hold, initial):
    """Response of a lag without a kernel; inputs and time constants may be complex."""
    decay, before, after = lag_weights(step_second, tau_second, hold=hold)
    column = (slice(None),) + (None,) * (drive.ndim - 1)
    right = np.empty(drive.shape, np.result_type(drive, decay), order="F")
    right[0] = initial
    right[1:] = before[column] * drive[:-1] + after[column] * drive[1:]
    return _recursion(decay, right)


def _recursion(decay, right):
    """State u[k+1] = decay[k]·u[k] + right[k+1], u[0] = right[0], by a banded triangular solve."""
    from scipy.linalg.lapack import dtbtrs, ztbtrs

    band = np.ones((2, len(right)), right.dtype, order="F")
    band[1, :-1] = -decay
    solve = ztbtrs if right.dtype.kind == "c" else dtbtrs
    return solve(band, right, uplo="L", overwrite_b=True)[0].reshape(right.shape)


def check_hold(hold):
    """Refuse an unknown hold of the current between samples."""
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")


def _check(tau_second, hold):
    """Refuse an unknown hold and time constants that are not positive."""
    check_hold(hold)
    if not np.all(np.real(tau_second) > 0):
        raise Refusal("a time constant is zero, negative or not a number")
