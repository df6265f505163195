"""A rising curve through noisy readings: a penalised spline whose logarithmic slope is smooth.

The curve is a cubic B-spline over cells of a stretched abscissa; its coefficients rise, so it
does. Penalised are third differences of the logarithms of the steps between the coefficients: a
slope may change by a factor of a thousand along the curve, and each part of it is smoothed in
proportion. How strongly, the readings say (restricted maximum likelihood), and where the curve
bends more than elsewhere too (the prior variance of each difference, by expectation maximisation).

Source: P. Eilers, B. Marx, Stat. Sci. 11 (1996) 89 (penalised B-splines); J. Ramsay, J. R. Stat.
Soc. B 60 (1998) 365 (monotone curves by their logarithmic slope); S. Wood, J. R. Stat. Soc. B 73
(2011) 3 (restricted maximum likelihood, Laplace's approximation); A. Dempster, N. Laird, D. Rubin,
J. R. Stat. Soc. B 39 (1977) 1 (expectation maximisation).
"""

from math import comb
from typing import NamedTuple

import numpy as np

from cellwright.numerics.rising_curve import (
    RisingCurve,
    b_splines,
    band_factor,
    band_solution,
    cells_of,
    local_deviations,
    values,
    x_at,
)

ORDER = 3  # of the differences that are penalised
STEPS, FIRST_STEPS, WORSE_DECADES = 5, 15, 2


def rising_curve(x, y, weight, *, cells):
    """Rising curve through readings y at rising x.

    1. Cells of an abscissa that gives flat and steep parts their share, fitted from the stiffest
    penalty down. 2. Cells that give every change of the logarithmic slope its share too. 3. The
    penalty of each difference is divided by its expected square near there, three times.

    Parameters
    ----------
    x, y : (n,) x not falling. weight : (n,) rows behind each reading, or any inverse variance.
    cells : number of cells; the penalty decides how much of their freedom is used.

    Returns
    -------
    curve : RisingCurve.

    Raises
    ------
    ValueError : fewer than twelve readings, or none that rise from begin to end.
    numpy.linalg.LinAlgError : no such curve can be found.
    """
    if len(x) < 12 or not y[-1] > y[0] or not x[-1] > x[0]:
        raise ValueError("a rising curve needs at least twelve readings that rise")
    readings = (*(np.asarray(v, float) for v in (x, y, weight)), cells)
    plain = np.ones(cells + 2 - ORDER)
    stretch = _stretch(x, y, weight)
    curve = _searched(readings, stretch, plain, _first_logs(readings, stretch), None)
    stretch = _stretch_by_slope(curve)
    curve = _searched(readings, stretch, plain, _logs_from(curve, stretch), curve.decade)
    for _ in range(3):
        logs = np.log(np.diff(curve.coefficients))
        curve = _searched(readings, stretch, _stiffness(curve), logs, curve.decade)
    return curve


def _stretch(x, y, weight):
    """Cumulative abscissa in which flat and steep parts have their share of the cells.

    Its density is half that of x and half that of y, both over their whole range, smoothed.
    """
    blocks = max(min(256, len(x) // 4), 3)
    edges = np.linspace(0, len(x), blocks + 1).astype(int)[:-1]
    rows = np.add.reduceat(weight, edges)
    pilot_x = np.add.reduceat(weight * x, edges) / rows
    pilot_y = np.maximum.accumulate(np.add.reduceat(weight * y, edges) / rows)
    apart = np.append(True, np.diff(pilot_x) > 1e-9 * (x[-1] - x[0]))
    pilot_x, pilot_y = pilot_x[apart], pilot_y[apart]
    slope = np.maximum(np.gradient(pilot_y, pilot_x), 0)
    density = 1 / (x[-1] - x[0]) + slope / max(np.ptp(pilot_y), 1e-12)
    return _cumulative(pilot_x, density, 2.0)


def _stretch_by_slope(curve):
    """Stretch in which every change of the logarithmic slope has its share of the cells too."""
    cells = cells_of(curve)
    place = np.linspace(0, cells, cells + 1)
    x = x_at(curve, place)
    y, slope, bend = values(curve, place)
    change = _change(x, bend / slope)
    varied = np.sum((change[1:] + change[:-1]) / 2 * np.diff(x))
    density = 1 / (x[-1] - x[0]) + slope / (y[-1] - y[0]) + change / max(varied, 1e-12)
    return _cumulative(x, density, 3.0)


def _change(x, rate):
    """Rate of change of the logarithmic slope (n,), as its envelope rather than its value.

    Where the slope is extreme the rate is zero and its own change is largest; a dip of the envelope
    there would crowd out cells and look like a peak itself. Of a sine both together are constant.
    """
    square, bent = rate**2, np.gradient(rate, x) ** 2
    scale = _smoothed(square, 8.0) / np.maximum(_smoothed(bent, 8.0), 1e-300)
    return np.sqrt(_smoothed(square + scale * bent, 3.0))


def _cumulative(x, density, width):
    """Twice differentiable integral of a density (n,) over x, smoothed over `width` rows."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    smooth = np.exp(_smoothed(np.log(density), width))
    spline = CubicSpline(x, smooth, bc_type="natural")
    between = np.linspace(0, 1, 5)[1:-1, None]
    if np.min(spline(x[:-1] + between * np.diff(x))) <= 0:
        # Of few readings far apart a smoother spline may swing below zero.
        spline = PchipInterpolator(x, smooth)
    return spline.antiderivative()


def _smoothed(values, width):
    """Values (n,) under a Gaussian of a width in rows; the ends continue as constants."""
    reach = int(3 * width)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    return np.convolve(np.pad(values, reach, mode="edge"), kernel / kernel.sum(), "valid")


def _first_logs(readings, stretch):
    """Logarithms of the steps between coefficients, from means over three cells."""
    x, y, weight, cells = readings
    groups = max(cells // 3, 2)
    share = (stretch(x) - stretch(x[0])) / (stretch(x[-1]) - stretch(x[0]))
    number = np.clip((share * groups).astype(int), 0, groups - 1)
    rows = np.bincount(number, weight, groups)
    filled = rows > 0
    mean = np.bincount(number, weight * y, groups)[filled] / rows[filled]
    centre = (np.flatnonzero(filled) + 0.5) * cells / groups
    steps = np.diff(np.interp(np.arange(cells + 3) - 1.0, centre, mean))
    return _smoothed(np.log(np.maximum(steps, 1e-3 * np.ptp(mean) / cells)), 3.0)


def _logs_from(curve, stretch):
    """Logarithms of the steps between coefficients over another stretch, for the same curve."""
    cells, fine = cells_of(curve), np.linspace(*curve.x_range, 16 * cells_of(curve) + 1)
    at = (stretch(fine) - stretch(fine[0])) / (stretch(fine[-1]) - stretch(fine[0])) * cells
    middle = np.clip(np.arange(cells + 2) - 0.5, 0, cells)
    x = np.interp(middle, at, fine)
    place = np.clip((curve.stretch(x) - curve.first) / curve.span * cells, 0, cells)
    slope = values(curve, place)[1]
    return np.log(slope / stretch(x, 1) * (stretch(fine[-1]) - stretch(fine[0])) / cells)


def _stiffness(curve):
    """Root of the weight of each penalised difference: one over its expected square near there."""
    steps = np.diff(curve.coefficients)
    rows = _penalty_rows(steps)
    std = local_deviations(curve, np.arange(rows.shape[1]), rows)
    square = np.diff(np.log(steps), ORDER) ** 2 + std**2
    # Within eight cells a curve bends about alike.
    expected = np.log(_smoothed(square, 8.0))
    return np.exp(0.5 * (expected.mean() - expected))


class _Problem(NamedTuple):
    """Normal equations of the readings, lower banded; stiffness of each penalised difference."""

    normal: np.ndarray
    right: np.ndarray
    square: float
    readings: int
    stiffness: np.ndarray


class _Fit(NamedTuple):
    """Fit at one strength of the penalty; evidence is minus twice the log of the likelihood."""

    decade: float
    coefficients: np.ndarray
    factor: np.ndarray
    objective: float
    evidence: float
    logs: np.ndarray


def _searched(readings, stretch, stiffness, logs, decade):
    """Curve over the cells of a stretch, with the penalty that the readings make most likely."""
    x, y, weight, cells = readings
    first = float(stretch(x[0]))
    span = float(stretch(x[-1])) - first
    place = np.clip((stretch(x) - first) / span * cells, 0, cells)
    level = float(np.average(y, weights=weight))
    equations = _normal_equations(place, y - level, weight, cells)
    problem = _Problem(*equations, len(y), stiffness)
    best = _from_stiffest(problem, logs) if decade is None else _nearby(problem, logs, decade)
    return RisingCurve(
        coefficients=best.coefficients + level,
        factor=best.factor,
        inverse=_inverse_band(best.factor),
        variance=best.objective / (len(y) - ORDER),
        stretch=stretch,
        first=first,
        span=span,
        x_range=(float(x[0]), float(x[-1])),
        decade=best.decade,
    )


def _normal_equations(place, y, weight, cells):
    """Products of the B-splines with each other and with the readings, and sum of squares."""
    first, splines = b_splines(place, cells, 0)
    number = cells + 3
    normal, right = np.zeros((ORDER + 2, number)), np.zeros(number)
    for a in range(4):
        weighted = weight * splines[a]
        right += np.bincount(first + a, weighted * y, number)
        for d in range(4 - a):
            normal[d] += np.bincount(first + a, weighted * splines[a + d], number)
    return normal, right, float(weight @ y**2)


def _from_stiffest(problem, logs):
    """Most likely fit, in steps of a decade from the stiffest penalty."""
    best, fit, worse = None, None, 0
    for decade in np.arange(9.0, -4.0, -1.0):
        fit = _fitted(problem, decade, fit.logs if fit else logs, STEPS if fit else FIRST_STEPS)
        better = best is None or fit.evidence < best.evidence
        best, worse = (fit, 0) if better else (best, worse + 1)
        if worse == WORSE_DECADES:
            break
    return best


def _nearby(problem, logs, decade):
    """Most likely fit, in steps of half a decade from a penalty near the right one."""
    best = _fitted(problem, decade, logs, FIRST_STEPS)
    for step in (-0.5, 0.5):
        fit = _fitted(problem, best.decade + step, best.logs, STEPS)
        begun = best.decade
        while fit.evidence < best.evidence and abs(fit.decade - decade) < WORSE_DECADES + 1:
            best = fit
            fit = _fitted(problem, best.decade + step, best.logs, STEPS)
        if best.decade != begun:
            break
    return best


def _fitted(problem, decade, logs, most):
    """Fit at one strength, by Gauss-Newton steps in the logarithms of the steps."""
    strength = 1e-9 * 10**decade * max(problem.square, 1e-30) / problem.readings
    return _judged(problem, decade, strength, *_stepped(problem, strength, logs, most))


def _stepped(problem, strength, logs, most):
    """Logarithms after Gauss-Newton steps, first coefficient, factor."""
    base = _base(problem, np.append(0, np.cumsum(np.exp(logs))))
    for _ in range(most):
        steps = np.exp(logs)
        coefficients = base + np.append(0, np.cumsum(steps))
        rows = _penalty_rows(steps) * problem.stiffness
        factor = _factor(problem.normal, rows, strength)
        width = rows.shape[1]
        aim = sum(row * coefficients[k : k + width] for k, row in enumerate(rows))
        aim -= np.diff(logs, ORDER) * problem.stiffness
        right = problem.right.copy()
        for k, row in enumerate(rows):
            right[k : k + width] += strength * row * aim
        change = np.diff(band_solution(factor, right)) / steps - 1
        # At once a step falls at most to a third and grows at most fourfold: it stays above 0.
        logs = logs + np.where(change < 0, np.maximum(change, -1), np.log1p(np.clip(change, 0, 3)))
        # A wider range of steps double precision does not bear.
        logs = np.maximum(logs, logs.max() - 14.0)
        base = _base(problem, np.append(0, np.cumsum(np.exp(logs))))
        if np.abs(change).max() < 1e-3:
            break
    rows = _penalty_rows(np.exp(logs)) * problem.stiffness
    return logs, base, _factor(problem.normal, rows, strength)


def _penalty_rows(steps):
    """Derivative of the penalised differences by the coefficients: (ORDER + 2, rows) diagonals."""
    width = len(steps) - ORDER
    signs = [(-1) ** (ORDER - k) * comb(ORDER, k) for k in range(ORDER + 1)]
    shares = np.array([sign / steps[k : k + width] for k, sign in enumerate(signs)])
    rows = np.zeros((ORDER + 2, width))
    rows[1:] += shares
    rows[:-1] -= shares
    return rows


def _factor(normal, rows, strength):
    """Lower banded Cholesky factor of the normal equations with the penalty."""
    whole, width = normal.copy(), rows.shape[1]
    for k in range(ORDER + 2):
        for d in range(ORDER + 2 - k):
            whole[d, k : k + width] += strength * rows[k] * rows[k + d]
    # Above rounding, so that a factor exists.
    whole[0] *= 1 + 1e-12
    return band_factor(whole)


def _times(normal, coefficients):
    """Product of a symmetric lower banded matrix with a vector."""
    product = normal[0] * coefficients
    for d in range(1, len(normal)):
        product[d:] += normal[d, :-d] * coefficients[:-d]
        product[:-d] += normal[d, :-d] * coefficients[d:]
    return product


def _base(problem, rise):
    """First coefficient that leaves no mean residual: the B-splines add up to one."""
    product = _times(problem.normal, np.ones(len(rise)))
    return float((problem.right.sum() - product @ rise) / product.sum())


def _judged(problem, decade, strength, logs, base, factor):
    """Fit with its objective and twice its negative logarithmic restricted likelihood."""
    steps = np.exp(logs)
    coefficients = base + np.append(0, np.cumsum(steps))
    square = problem.square - 2 * coefficients @ problem.right
    square += coefficients @ _times(problem.normal, coefficients)
    objective = square + strength * np.sum((problem.stiffness * np.diff(logs, ORDER)) ** 2)
    objective = max(objective, 1e-24 * problem.square)
    evidence = (problem.readings - ORDER) * np.log(objective)
    evidence += 2 * np.log(factor[0]).sum() + 2 * logs.sum()
    evidence -= (len(steps) - ORDER) * np.log(strength)
    return _Fit(decade, coefficients, factor, float(objective), float(evidence), logs)


def _inverse_band(factor):
    """Band (ORDER + 2, n) of the inverse of what this is the banded Cholesky factor of."""
    whole = band_solution(factor, np.eye(factor.shape[1]))
    return np.array([np.append(np.diagonal(whole, -d), np.zeros(d)) for d in range(len(factor))])
