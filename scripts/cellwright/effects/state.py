"""A fitted model and its errors, and how well it predicts each block."""

from typing import NamedTuple

import numpy as np

from cellwright.effects.score import densities, left_out, mean_squares
from cellwright.numerics.compare import compare
from cellwright.numerics.least_squares import inverse
from cellwright.numerics.statistics import rms

PRICE = 1.0  # nats an effect
SIDES = ("fit", "validation")  # training and validation records


class State(NamedTuple):
    """A fitted model: its effects, and its errors on training and validation records.

    values : of the validation records, with their own starts. validation : residual (m,), errors of
    the starts taken out. validation_white : the same whitened. rmse_volt, validation_rmse_volt : of
    a cell's voltage, of a group's branch currents times their cells' ohmic resistance [V].
    """

    effects: tuple
    solution: object
    values: dict
    validation: np.ndarray
    validation_white: np.ndarray
    rmse_volt: float
    validation_rmse_volt: float

    @property
    def worst_volt(self):
        """The larger of both rms errors [V]."""
        return max(self.rmse_volt, self.validation_rmse_volt)

    def values_on(self, side):
        """Values of the parameters on a side, one of `SIDES`: dict by name."""
        return self.solution.values if side == "fit" else self.values

    def residual_on(self, side):
        """Errors (m,) on a side."""
        return self.solution.residual if side == "fit" else self.validation

    def rmse_on(self, side):
        """Rms error on a side [V]."""
        return self.rmse_volt if side == "fit" else self.validation_rmse_volt


class Filters(NamedTuple):
    """Whitening of both stacks by one noise, and which of their rows an rms error counts.

    noise : noise.Noise, of several channels a tuple of them. fit, validation : with `apply`.
    fit_rows, validation_rows : (n,) bool, or a slice: rows that count; rows on a steep end of the
    OCV, where a little charge is many millivolts, do not. blocks : score.Blocks of the rows of one
    channel, by the SoC as it is counted before the search. extra_volt : two of (n,), error of each
    row beyond the noise: on a steep OCV, or not compared [V].
    """

    noise: object
    fit: object
    validation: object
    fit_rows: np.ndarray | slice
    validation_rows: np.ndarray | slice
    blocks: object
    extra_volt: tuple = ()

    def rows_on(self, side):
        """Rows of a side that an rms error counts."""
        return self.fit_rows if side == "fit" else self.validation_rows


def state_of(case, effects, solution, filters):
    """State of a fitted model: its errors on the records that judge.

    Of these records only the first rest enters a parameter, their SoC at the start. What that and a
    stated temperature leave unsure is taken out of their errors.

    Parameters
    ----------
    case : of a cell or of a group, as in `search`. effects : of the model.
    solution : least_squares.Solution of its fit. filters : Filters.
    """
    values = case.started(effects, solution)
    volt = case.predict("validation", values, effects)
    unsure, error = case.unsure(values, effects, volt), case.measured("validation") - volt
    errors = unsure.errors_in(error, filters.validation)
    kelvin = errors[:, -1] if unsure.of_temperature else np.zeros(len(errors))
    values = values | {f"kelvin[{k}]": float(one) for k, one in enumerate(kelvin)}
    error = error - unsure.change_by(errors)
    white = filters.validation.apply(error)
    ends = (solution.residual, filters.fit_rows), (error, filters.validation_rows)
    sizes = (rms(case.in_volt(one)[:, rows]) for one, rows in ends)
    return State(effects, solution, values, error, white, *sizes)


class Yardstick(NamedTuple):
    """By what all models of a search are compared.

    filters : whitening of both sides by the noise, and the blocks. scale : mean square by which
    the best model so far errs in half of the blocks that it was fitted to, each left out, in units
    of the noise, 1 or more: nobody acts on what is small beside that. price : what an effect must
    be worth to be told from those that could stand in its place [nats]. by_cost : what a model is
    worth is its cost, and not how well it predicts: where all parameters are known closely.
    """

    filters: object
    scale: float = np.inf
    price: float = PRICE
    by_cost: bool = False

    @property
    def blocks(self):
        """Blocks of both sides: score.Blocks."""
        return self.filters.blocks

    @property
    def cost_of_nat(self):
        """Fall of a fit's cost that is worth a nat where it lies in blocks that err as usual."""
        if self.by_cost:
            return 2.0
        fitted = np.sum(self.blocks.fitted >= 0) / max(np.sum(~self.blocks.judges), 1)
        return 2.0 * fitted * (self.scale if np.isfinite(self.scale) else 1.0)

    def finer(self, squares):
        """The yardstick with the scale of a model by its squares, if that is less."""
        usual = float(np.median(squares[~self.blocks.judges]))
        return self._replace(scale=min(self.scale, max(1.0, usual)))

    def density(self, squares):
        """Log predictive density (b,) of each block by the mean squares of its errors (b,)."""
        return densities(squares / self.scale)

    def worth(self, density, cost, effects):
        """What a model is worth [nats]: densities (b,) of its blocks, or half its cost, less the
        price of its effects.

        Parameters
        ----------
        density : (b,). cost : of its fit. effects : how many it has.
        """
        value = -cost / 2.0 if self.by_cost else float(np.sum(density))
        return value - self.price * effects

    def difference(self, better, worse):
        """How much better a model predicts than another, by their squares: compare.Difference."""
        ends = self.density(better), self.density(worse)
        return compare(*ends, record=self.blocks.record)


def squares_of(state, blocks):
    """Mean square (b,) of the whitened errors of each block by a fitted model.

    A block of the records fitted is predicted by the fit without it.

    Parameters
    ----------
    state : State. blocks : score.Blocks.
    """
    seen = mean_squares(state.validation_white, blocks.judging, len(blocks.record))
    return np.where(blocks.judges, seen, _left_out(state, blocks).squares)


def most_telling(state, effect, blocks):
    """Number of the block of the records fitted without which the sizes of an effect move most.

    Parameters
    ----------
    state : State of a model with the effect. effect : Effect. blocks : score.Blocks.

    Source: Cook's distance of a subset of the parameters: R. Cook, S. Weisberg, Residuals and
    Influence in Regression (1982), 3.5.
    """
    solution = state.solution.inside
    mine = [k for k, name in enumerate(solution.names) if name in effect.names]
    change = _left_out(state, blocks).change[:, mine]
    covariance = inverse(solution.precision)[np.ix_(mine, mine)]
    return int(np.argmax(np.einsum("bk,kj,bj->b", change, inverse(covariance), change)))


def _left_out(state, blocks):
    """Fits without each block, score.LeftOut, of a state's parameters that are on no bound."""
    solution = state.solution.inside
    fitted = solution.white, solution.whitened, solution.precision, solution.slope
    vague = _vague(state.effects, solution)
    return left_out(*fitted, blocks.fitted, len(blocks.record), vague=vague)


def _vague(effects, solution):
    """Precision of parameters that have no prior, by their bounds, and their distance from absent.

    Without it what a single block tells of would not be predicted there at all.
    """
    known, away = np.zeros(len(solution.names)), np.zeros(len(solution.names))
    place = {name: k for k, name in enumerate(solution.names)}
    for effect in effects:
        for p, name in zip(effect.parameters, effect.names, strict=True):
            if name in place and not np.isfinite(p.prior_std):
                known[place[name]] = (p.plausible or p.upper - p.lower) ** -2.0
                away[place[name]] = solution.values[name] - p.neutral
    return known, away
