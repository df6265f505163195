"""Error that no missing effect has made, and what is left beyond it."""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.numerics.least_squares import inverse


class Floor(NamedTuple):
    """Error that is left by readings and by the tolerances of what is known beforehand [V].

    fit_volt, validation_volt : root mean square over the rows that count, of the records fitted
    and of those that judge. by_test : of each record that judges, by its name.
    """

    fit_volt: float
    validation_volt: float
    by_test: dict


def floor_of(case, state, free, rows, read_volt):
    """Floor of a case: noise of the readings, and what stated tolerances leave on other records.

    The parameters of the plain model are known to within their posterior: priors (tolerances of
    the OCV, of the capacity, of the SoC at a start) narrowed by the records fitted. Through the
    sensitivities of the records that judge this is an error that no missing effect has made.

    Parameters
    ----------
    case : case.Case. state : state.State of the plain model. free : tuple of Free, of its fit.
    rows : (m,) bool, rows that count. read_volt : noise of a single reading [V].

    Returns
    -------
    floor : Floor.
    """
    stack, solution = case.validation, state.solution
    at = base.voltage(case.cell, stack, state.values, state.effects)
    shared = [f for f in free if not f.name.startswith("soc0[")]
    columns = np.stack([_derivative(case, state, at, f) for f in shared], axis=1)
    place = [solution.names.index(f.name) for f in shared]
    covariance = inverse(solution.precision)[np.ix_(place, place)]
    variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
    variance = np.maximum(variance, 0.0) + read_volt**2
    by_test = {
        test: float(np.sqrt(variance[rows & (stack.file == k)].mean()))
        for k, test in enumerate(stack.tests)
        if np.any(rows & (stack.file == k))
    }
    return Floor(read_volt, float(np.sqrt(variance[rows].mean())), by_test)


def _derivative(case, state, at, free):
    """Derivative of the voltage of the records that judge by one parameter (m,)."""
    moved = state.values | {free.name: state.values[free.name] + free.step}
    return (base.voltage(case.cell, case.validation, moved, state.effects) - at) / free.step


def excess_volt(error_volt, floor_volt):
    """What is left of an rms error beyond its floor [V]."""
    return float(np.sqrt(max(error_volt**2 - floor_volt**2, 0.0)))


def fallen_volt(before, after, floor):
    """Fall of the error beyond the floor, of the side where it is larger [V]; negative: a rise.

    What was 2.5 mV beyond the noise and is 2 mV with an effect is the same model to anyone, though
    their squares differ by (1.5 mV)².

    Parameters
    ----------
    before, after : State without and with an effect. floor : Floor.
    """
    return max(
        excess_volt(before.rmse_volt, floor.fit_volt)
        - excess_volt(after.rmse_volt, floor.fit_volt),
        fallen_where_judged_volt(before, after, floor),
    )


def fallen_where_judged_volt(before, after, floor):
    """Fall of the error beyond the floor on the records that judge [V]; see `fallen_volt`."""
    ends = (excess_volt(one.validation_rmse_volt, floor.validation_volt) for one in (before, after))
    return float(np.subtract(*ends))


def left_volt(state, floor):
    """Error beyond the floor, of the side, fit or proof, where it is larger [V].

    Parameters
    ----------
    state : state.State. floor : Floor.
    """
    fit = excess_volt(state.rmse_volt, floor.fit_volt)
    return max(fit, excess_volt(state.validation_rmse_volt, floor.validation_volt))
