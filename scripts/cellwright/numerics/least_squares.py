"""Nonlinear least squares: many parameters with priors, and models linear in all but a few rates.

`fit` finds the most likely values of a `Problem` (its prediction, measurement and priors) by damped
Gauss–Newton steps. It is our own, not lmfit's, for it is the hot loop of the search for missing
effects: a prediction simulates hours of record, so derivatives are kept from step to step (chord
method) or made for many parameters in one simulation, and priors with couplings enter the normal
equations.

`best_logarithms` searches the rates by lmfit; the linear parameters follow in closed form.
`impedance.fit` has a search of its own: many starts in a compiled kernel.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

STEPS = 30
SETTLED = 0.02  # a fall of the cost below this ends the search
LEAST_DAMPING = 0.1  # of the diagonal, where a step without damping failed: less hardly changes it
AS_FORESEEN = 0.1  # of a step's fall: the derivatives that foresaw it so closely still hold
TWO_STDS = 4.0  # standard deviations: so much the cost rises there
EXCHANGES = 12  # of the bounds that are held, after which they are met one by one
LEVEL_STEPS = 4  # of a fit beside a parameter that is held, with derivatives that are kept


class Free(NamedTuple):
    """A fitted parameter. step: for its derivative. prior, std: mean and std of its prior.

    lower, upper: bounds, on which a step ends.
    """

    name: str
    step: float
    prior: float = 0.0
    std: float = np.inf
    lower: float = -np.inf
    upper: float = np.inf


class Problem(NamedTuple):
    """A least-squares problem: prediction, measurement, whitening, free parameters, priors.

    predict : function (values) → (n,) prediction. measured : (n,). whiten : rows → rows.

    free : tuple of Free. coupling : (k, k) prior precision beyond that of the single parameters, or
    None, about zero. apart : function (values) → list of (names, owner): parameters of one step
    that each move rows of their own, and for each row the number of that which moves it. Their
    derivatives are made together, across a bound if need be. None: there are none.
    """

    predict: Callable
    measured: np.ndarray
    whiten: Callable
    free: tuple
    coupling: np.ndarray | None = None
    apart: Callable | None = None


class Solution(NamedTuple):
    """Most likely values, residual and the quadratic approximation of the cost about them.

    values : dict. prediction, residual : (n,). chi_square : of the whitened residual, without
    priors. cost : with them. columns : (n, k) derivatives at (or near) the solution, not whitened.
    white : the same whitened. gram : (k, k) their products. precision : (k, k) of the posterior,
    priors included. at_bound : names of the parameters on a bound.
    names : of the columns. whitened : (n,) residual, whitened. slope : (k,) minus half the
    derivative of the cost there: zero at the very minimum, where no fit ends exactly.
    """

    values: dict
    prediction: np.ndarray
    residual: np.ndarray
    chi_square: float
    cost: float
    columns: np.ndarray
    white: np.ndarray
    gram: np.ndarray
    precision: np.ndarray
    at_bound: tuple
    names: tuple
    whitened: np.ndarray
    slope: np.ndarray

    @property
    def inside(self):
        """The same without the parameters on a bound, which follow no further change."""
        off = [k for k, name in enumerate(self.names) if name not in self.at_bound]
        return self._replace(
            columns=self.columns[:, off],
            white=self.white[:, off],
            gram=self.gram[np.ix_(off, off)],
            precision=self.precision[np.ix_(off, off)],
            names=tuple(self.names[k] for k in off),
            slope=self.slope[off],
        )


def fit(
    problem, values, *, columns=None, white=None, gram=None, renew=(), steps=STEPS, settled=SETTLED
):
    """Most likely values of a problem by damped Gauss–Newton steps, and the curvature there.

    Parameters
    ----------
    problem : Problem. values : dict, start; also holds what is not free.
    columns : (n, j) derivatives by the first j parameters to begin with, or None: they are made.
        Where given, only those of further parameters and of those named in `renew` are made anew
        at each step (a chord method: near the solution the others hardly change).
    white : (n, j) those derivatives whitened, or None: they are whitened here. gram : (j, j) their
        products, or None: they are made.
    steps : at most so many; of derivatives that are made anew, those after which that was needed.
    settled : where a step would not lower the cost by so much the walk ends.

    Returns
    -------
    solution : Solution.
    """
    prior, pull = priors(problem)
    state, damping = _evaluated(problem, values, prior, pull), 1e-6
    chord = columns is not None
    columns = columns if chord else derivatives(problem, state.values, state.prediction)
    white = problem.whiten(columns) if white is None else white
    names = [f.name for f in problem.free]
    at_renewed = [k for k, n in enumerate(names) if k >= columns.shape[1] or n in renew]
    if at_renewed:
        gram = None if gram is None else _widened(_widened(gram, len(names)).T, len(names))
        columns, white = (_widened(rows, len(names)) for rows in (columns, white))
    while steps:
        if at_renewed:
            _renew(problem, state, columns, white, at_renewed)
        gram = _products(white, gram, at_renewed)
        slope = _slope(problem, state, white, prior, pull)
        next_state, damping, foreseen = _damped_step(
            problem, state, slope, gram + prior, (prior, pull), damping, settled
        )
        fell, state = state.cost - next_state.cost, next_state
        if fell < settled:
            break
        if chord:
            steps -= 1
        elif abs(fell - foreseen) > AS_FORESEEN * fell:
            steps -= 1
            columns = derivatives(problem, state.values, state.prediction)
            white, gram = problem.whiten(columns), None
    free = [f for f in problem.free if f.lower < f.upper]
    bound = tuple(f.name for f in free if state.values[f.name] in (f.lower, f.upper))
    residual = problem.measured - state.prediction
    outcome = (state.values, state.prediction, residual, state.chi_square, state.cost)
    gram = _products(white, gram, [])
    shapes = columns, white, gram, gram + prior
    slope = _slope(problem, state, white, prior, pull)
    return Solution(*outcome, *shapes, bound, tuple(names), state.whitened, slope)


def derivatives(problem, values, prediction, names=None):
    """Derivatives (n, k) of the prediction by the free parameters, or by those named."""
    wanted = [free for free in problem.free if names is None or free.name in names]
    by_name = _together(problem, values, prediction, wanted)
    for free in wanted:
        if free.name not in by_name:
            by_name[free.name] = _derivative(problem, values, prediction, free)
    return np.stack([by_name[free.name] for free in wanted]).T


def _together(problem, values, prediction, wanted):
    """Derivatives by parameters that move different rows, from one prediction a set: by name."""
    steps, by_name = {free.name: free.step for free in wanted}, {}
    if problem.apart is None or len(wanted) < len(problem.free):
        return by_name
    for names, owner in problem.apart(values):
        moved_names = [name for name in names if name in steps]
        moved = problem.predict(values | {name: values[name] + steps[name] for name in moved_names})
        for name in moved_names:
            change = (moved - prediction) / steps[name]
            by_name[name] = np.where(owner == names.index(name), change, 0.0)
    return by_name


def _derivative(problem, values, prediction, free):
    """Derivative (n,) of the prediction by one parameter, by a difference within its bounds."""
    step = free.step if values[free.name] + free.step <= free.upper else -free.step
    moved = problem.predict(values | {free.name: values[free.name] + step})
    return (moved - prediction) / step


class _State(NamedTuple):
    """Values of the search, their prediction, whitened residual, sum of its squares, and cost."""

    values: dict
    prediction: np.ndarray
    whitened: np.ndarray
    chi_square: float
    cost: float


def cost_of(problem, values):
    """Cost of a problem at some values: chi-square and priors, less a constant of the priors."""
    return _evaluated(problem, values, *priors(problem)).cost


def _evaluated(problem, values, prior, pull):
    """State of the search at some values."""
    prediction = problem.predict(values)
    white = problem.whiten(problem.measured - prediction)
    square = float(white @ white)
    at = np.array([values[f.name] for f in problem.free])
    return _State(
        values, prediction, white, square, square + float(at @ prior @ at - 2 * pull @ at)
    )


def priors(problem):
    """Prior precision (k, k) of the free parameters and its product with their means (k,)."""
    weight = np.array([f.std**-2.0 for f in problem.free])
    prior = np.diag(weight)
    if problem.coupling is not None:
        prior = prior + problem.coupling
    return prior, weight * np.array([f.prior for f in problem.free])


def _widened(rows, width):
    """Copy of rows (n, j) with columns of zeros after them: (n, width)."""
    wide = np.zeros((width, len(rows))).T
    wide[:, : rows.shape[1]] = rows
    return wide


def _renew(problem, state, columns, white, at):
    """Make the derivatives by some parameters (numbers `at`) anew, plain and whitened, in place."""
    names = {problem.free[k].name for k in at}
    made = derivatives(problem, state.values, state.prediction, names)
    columns.T[at], white.T[at] = made.T, problem.whiten(made).T


def _products(white, gram, renewed):
    """Products (k, k) of columns with each other: those given, but for columns that are new."""
    if gram is None:
        return white.T @ white
    if not renewed:
        return gram
    products, gram = white.T @ white.T[renewed].T, gram.copy()
    gram[:, renewed], gram[renewed] = products, products.T
    return gram


def _slope(problem, state, white, prior, pull):
    """Minus half the derivative (k,) of the cost by the free parameters."""
    at = np.array([state.values[free.name] for free in problem.free])
    return white.T @ state.whitened + pull - prior @ at


def _damped_step(problem, state, slope, precision, known, damping, settled):
    """State after a damped step that lowers the cost, the damping, and by how much the cost would
    have fallen were it quadratic; else the state as it was.

    known : prior precision and its product with the means, see `priors`. settled : where the cost
    would not fall by so much, the step is not tried.
    """
    scale = np.diag(np.diag(precision) + 1e-9)
    names = [f.name for f in problem.free]
    lower = np.array([f.lower for f in problem.free])
    upper = np.array([f.upper for f in problem.free])
    at = np.array([state.values[name] for name in names])
    for _ in range(5):
        move = bounded_minimum(precision + damping * scale, slope, lower - at, upper - at)
        foreseen = float(move @ (2.0 * slope - precision @ move))
        if not foreseen >= settled:  # nor where it is no number
            break
        # Snapped, for a bound that is missed by rounding is not seen as one.
        on = np.where(move <= lower - at, lower, np.where(move >= upper - at, upper, at + move))
        values = state.values | dict(zip(names, on.tolist(), strict=True))
        trial = _evaluated(problem, values, *known)
        if np.isfinite(trial.cost) and trial.cost <= state.cost:
            return trial, max(damping / 10, 1e-9), foreseen
        damping = max(damping * 30, LEAST_DAMPING)
    return state, damping, foreseen


def bounded_minimum(precision, moment, lower, upper):
    """Minimum of x'Px/2 − m'x between bounds, by active sets: of all bounds at once, which takes
    two or three solutions, or one by one where that goes round in circles.

    Parameters
    ----------
    precision : (k, k) positive definite P. moment : (k,) m. lower, upper : (k,).

    Returns
    -------
    x : (k,).

    Source: M. Hintermüller, K. Ito, K. Kunisch, SIAM J. Optim. 13 (2002) 865, algorithm 1;
    J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., 2006, algorithm 16.3.
    """
    x = _bounded_at_once(precision, moment, lower, upper)
    return _bounded_one_by_one(precision, moment, lower, upper) if x is None else x


def _bounded_at_once(precision, moment, lower, upper):
    """The minimum, each bound held that is overstepped, each left that pulls inward; or None."""
    low = high = np.zeros(len(moment), bool)
    for _ in range(EXCHANGES):
        free = np.flatnonzero(~(low | high))
        x = np.where(low, lower, np.where(high, upper, 0.0))
        rest = moment[free] - precision[free] @ x
        x[free] = np.linalg.solve(precision[free[:, None], free], rest)
        slope = precision @ x - moment
        before = low, high
        low = (x < lower) | (low & (slope > 0.0))
        high = (x > upper) | (high & (slope < 0.0))
        if np.array_equal(low, before[0]) and np.array_equal(high, before[1]):
            return x
    return None


def _bounded_one_by_one(precision, moment, lower, upper):
    """The minimum, from zero or the bound nearest to it, one bound met or left at a time."""
    x = np.clip(np.zeros(len(moment)), lower, upper)
    held = (x <= lower) | (x >= upper)
    for _ in range(5 * len(x)):
        slope = precision @ x - moment
        free = np.flatnonzero(~held)
        way = np.zeros(len(x))
        way[free] = -np.linalg.solve(precision[np.ix_(free, free)], slope[free])
        share, stop = _first_bound(x, way, lower, upper)
        x = x + share * way
        if stop is not None:
            x[stop], held[stop] = (upper if way[stop] > 0 else lower)[stop], True
            continue
        gain = _gain_of_release(precision, precision @ x - moment, x, held, lower, upper)
        # A fall of the cost that is worth freeing a bound for.
        if gain.max(initial=0.0) < 1e-6:
            return x
        held[int(np.argmax(gain))] = False
    return x


def _first_bound(x, way, lower, upper):
    """Share of the step to the first bound and its index; (1, None) where no bound is met."""
    room = np.where(way > 0, upper - x, lower - x)
    shares = np.divide(room, way, out=np.full(len(x), np.inf), where=way != 0)
    first = int(np.argmin(shares))
    return (float(shares[first]), first) if shares[first] < 1.0 else (1.0, None)


def _gain_of_release(precision, slope, x, held, lower, upper):
    """Fall of the cost predicted for releasing each parameter that is held on a bound."""
    inward = ((x <= lower) & (slope < 0)) | ((x >= upper) & (slope > 0))
    return np.where(held & inward & (upper > lower), slope**2 / np.diag(precision), 0.0)


def stds(solution, blocks=None):
    """Standard deviations of the free parameters by name: the larger ones of `covariances`.

    Parameters
    ----------
    solution : Solution. blocks : (n,) number of the block of each row, from 0, or None.

    Returns
    -------
    stds : dict.
    """
    variances = np.max([np.diag(one) for one in covariances(solution, blocks)], axis=0)
    pairs = zip(solution.names, variances, strict=True)
    return {name: float(np.sqrt(max(v, 0.0))) for name, v in pairs}


def level(problem, solution, name):
    """Interval of a parameter over which the cost is level, the others fitted, or None: it bends.

    A clock of even rows that hold their current shows a delay in whole rows: beside resistances
    that make up for it any within one row fits as well, which no curvature at one value tells.

    Parameters
    ----------
    problem : Problem. solution : Solution of it. name : of a free parameter that is on no bound.

    Returns
    -------
    interval : (lower, upper), beyond which the cost rises by that of two standard deviations, as
        finely as a tenth of the step of the parameter.
    """
    free, at = next(one for one in problem.free if one.name == name), solution.values[name]

    def rise(value):
        fixed = free._replace(lower=value, upper=value)
        others = problem._replace(free=tuple(fixed if f is free else f for f in problem.free))
        begun = solution.values | {name: value}
        known = {"columns": solution.columns, "white": solution.white, "gram": solution.gram}
        return fit(others, begun, **known, steps=LEVEL_STEPS).cost - solution.cost

    ends = []
    for bound, step in ((free.lower, -free.step), (free.upper, free.step)):
        inside, beyond = at, float(np.clip(at + step, free.lower, free.upper))
        while beyond != bound and rise(beyond) <= TWO_STDS:
            inside, beyond = beyond, float(np.clip(at + 2 * (beyond - at), free.lower, free.upper))
        while abs(beyond - inside) > free.step / 10:
            middle = (inside + beyond) / 2
            inside, beyond = (middle, beyond) if rise(middle) <= TWO_STDS else (inside, middle)
        ends.append(inside)
    # Half way to its ends a parabola has risen by a quarter.
    between = np.interp([0.25, 0.75], [0.0, 1.0], ends).tolist()
    bends = ends[0] == ends[1] or max(map(rise, between)) > TWO_STDS / 8
    return None if bends else tuple(ends)


def covariances(solution, blocks=None):
    """Covariances of the free parameters, each by one reading of the scatter that is left.

    The first is that of the posterior: whitened residuals have unit size by the noise; what the
    model still lacks widens it by the scatter that is left. With blocks there is a second, from the
    sums over blocks, which holds where residuals are alike for longer than the noise model knows
    (an OCV a millivolt off errs for an hour). The variance of a quantity is the larger of both.

    Parameters
    ----------
    solution : Solution. blocks : (n,) number of the block of each row, from 0, or None.

    Returns
    -------
    covariances : tuple of (p, p), in the order of `solution.names`.

    Source: K.-Y. Liang, S. Zeger, Biometrika 73 (1986) 13 (sums over clusters); the blocks' number
    b enters as b/(b − 1), and by Student's t with b − 1 degrees of freedom, as wide at 95 % as the
    normal deviation told here (A. Cameron, D. Miller, J. Human Resources 50 (2015) 317).
    """
    from scipy.special import ndtri, stdtrit  # here: other steps of the method need none of it

    scatter = max(solution.chi_square / len(solution.residual), 1.0)
    covariance = inverse(solution.precision)
    if blocks is None:
        return (covariance * scatter,)
    moved = (solution.white @ covariance) * solution.whitened[:, None]
    sums = np.stack([np.bincount(blocks, column) for column in moved.T], axis=1)
    off = sums - sums.mean(axis=0)
    few = len(sums) - 1
    wider = stdtrit(few, 0.975) / ndtri(0.975)
    return covariance * scatter, off.T @ off * (len(sums) / few * wider**2)


def inverse(precision):
    """Covariance of parameters from their precision, whatever units they have.

    Each parameter is measured in its own deviation first: a pseudo-inverse leaves out what is small
    beside the largest eigenvalue, and in volts, ohms and seconds that is every time constant.

    Parameters
    ----------
    precision : (k, k) symmetric, not negative.

    Returns
    -------
    covariance : (k, k); zero for a parameter that no row and no prior tells of.
    """
    # A parameter that nothing tells of has no information at all.
    size = np.sqrt(np.maximum(np.diag(precision), 1e-300))
    scales = np.outer(size, size)
    return np.linalg.pinv(precision / scales, hermitian=True) / scales


def best_logarithms(residual, starts, *, bounds, scale=1.0):
    """Logarithms of the rates that fit best, from several starts, by lmfit.

    Only what a model is not linear in is searched, for at given rates the other parameters follow
    from linear least squares (variable projection).

    Parameters
    ----------
    residual : function (k,) logarithms → (n,) residual of the best linear parameters there.
    starts : (s, k) logarithms to set out from; with k = 0 there is nothing to search.
    bounds : (lowest, highest) of every logarithm.
    scale : change of a logarithm that matters.

    Returns
    -------
    logarithms : (k,) of the start that led to the least sum of squares.

    Source: G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; lmfit, method
    "least_squares" (trust region reflective).
    """
    starts = np.asarray(starts, float)
    if not starts.shape[1]:
        return np.empty(0)
    # Its import takes longer than most jobs' own: only who searches pays.
    from lmfit import Minimizer, Parameters

    def of_parameters(parameters):
        return residual(np.array(list(parameters.valuesdict().values())))

    fits = []
    for start in starts:
        parameters = Parameters()
        for k, value in enumerate(start):
            parameters.add(f"rate_{k}", value, min=bounds[0], max=bounds[1])
        search = Minimizer(of_parameters, parameters, nan_policy="propagate", calc_covar=False)
        fits.append(search.minimize(method="least_squares", x_scale=scale))
    best = min(fits, key=lambda fit: fit.chisqr)
    return np.array(list(best.params.valuesdict().values()))
