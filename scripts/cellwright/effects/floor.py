"""Error that no missing effect has made, and what is left beyond it."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.score import rms_of_blocks
from cellwright.effects.state import SIDES
from cellwright.numerics.least_squares import Problem, derivatives, inverse
from cellwright.numerics.statistics import rms


class Floor(NamedTuple):
    """Error that is left by readings and by the tolerances of what is known beforehand [V].

    fit_volt, validation_volt : root mean square over the rows that count, of the records fitted
    and of those that judge. by_test : of each record that judges, by its name.
    """

    fit_volt: float
    validation_volt: float
    by_test: dict

    def on(self, side):
        """Floor of a side, "fit" or "validation" [V]."""
        return self.fit_volt if side == "fit" else self.validation_volt


def floor_of(case, state, free, rows, read_volt):
    """Floor of a case: noise of the readings, and what stated tolerances leave on other records.

    The parameters of the plain model are known to within their posterior: priors (tolerances of
    the OCV, of the capacity, of the SoC at a start; of a group the declared spread of its branches)
    narrowed by the records fitted. Through the sensitivities of the validation records this is an
    error that no missing effect has made.

    Parameters
    ----------
    case : of a cell or of a group, as in `search`. state : state.State of the plain model.
    free : tuple of Free, of its fit. rows : (n,) bool, rows that count; or True, all.
    read_volt : noise of a single reading of each channel of `case.in_volt`, (c,) or one [V].

    Returns
    -------
    floor : Floor.
    """
    stack, solution, reads = case.validation, state.solution, np.atleast_1d(read_volt)
    shared = tuple(f for f in free if not f.name.startswith("soc0["))
    problem = Problem(
        lambda values: case.predict("validation", values, state.effects), None, None, shared
    )
    at = problem.predict(state.values)
    columns = derivatives(problem, state.values, at)
    place = [solution.names.index(f.name) for f in shared]
    covariance = inverse(solution.precision)[np.ix_(place, place)]
    variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
    unsure_volt = case.in_volt(np.sqrt(np.maximum(variance, 0.0)))
    squares = np.mean(unsure_volt**2 + reads[:, None] ** 2, axis=0)
    by_test = {
        test: float(np.sqrt(squares[rows & (stack.file == k)].mean()))
        for k, test in enumerate(stack.tests)
        if np.any(rows & (stack.file == k))
    }
    return Floor(rms(reads), float(np.sqrt(squares[rows].mean())), by_test)


def excess_volt(error_volt, floor_volt):
    """What is left of an rms error beyond its floor [V]."""
    return float(np.sqrt(max(error_volt**2 - floor_volt**2, 0.0)))


def excess_of_blocks(case, state, floor, filters):
    """Error of a model beyond the floor, each block once, of the side where it is larger [V].

    Parameters
    ----------
    case, state, floor : as above. filters : of the case, with `blocks` and `rows_on`.
    """
    blocks, left = filters.blocks, []
    for side, chosen in zip(SIDES, (~blocks.judges, blocks.judges), strict=True):
        volts = case.in_volt(state.residual_on(side)).ravel()
        block = np.where(filters.rows_on(side), blocks.on(side), -1)[-len(volts) :]
        left.append(excess_volt(rms_of_blocks(volts, block, chosen), floor.on(side)))
    return max(left)


def fallen_on_volt(side, before, after, floor):
    """Fall of the error of a side beyond the floor [V]; negative: a rise.

    What was 2.5 mV beyond the noise and is 2 mV with an effect is the same model to anyone, though
    their squares differ by (1.5 mV)².

    Parameters
    ----------
    side : "fit" or "validation". before, after : State without and with an effect. floor : Floor.
    """
    ends = (excess_volt(state.rmse_on(side), floor.on(side)) for state in (before, after))
    return float(np.subtract(*ends))


def fallen_volt(before, after, floor):
    """Fall of the error beyond the floor, of the side where it is larger [V]."""
    return max(fallen_on_volt(side, before, after, floor) for side in SIDES)


def left_volt(state, floor):
    """Error beyond the floor, of the side, fit or proof, where it is larger [V].

    Parameters
    ----------
    state : state.State. floor : Floor.
    """
    return max(excess_volt(state.rmse_on(side), floor.on(side)) for side in SIDES)
