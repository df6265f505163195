"""One slow curve of a cell as the difference of two half cells: where each electrode stands."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from cellwright.health.electrodes.half_cells import CHARGE_STD, at_share
from cellwright.numerics.lines import whitened
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

MISFIT_VOLT = 0.005  # half cells that miss the slow curves by more are not those of the cell
CORRELATED_SOC = 0.05  # range over which half cells and polarisation are wrong alike
# ASSUME: Polarisation and hysteresis shift a slow charge by up to some 40 mV, and change by up to
# some 10 mV from empty to full; of the mean of a slow charge and discharge little is left.
# In a rest no current flows: half the hysteresis is left.
SHIFT_STD_VOLT = {
    "charge": (0.02, 0.005),
    "discharge": (0.02, 0.005),
    "both": (0.005, 0.002),
    "rests": (0.005, 0.002),
}
FIRST_STD_VOLT = 0.002  # error of the half cells that a fit begins with
# Beside a minimum in which one electrode ends the discharge may lie one in which the other does.
MOVED = np.zeros((5, 6))
MOVED[1:, 0], MOVED[1:, 2] = (-0.003, 0.02, 0.0, 0.0), (-0.02, 0.0, -0.06, 0.02)
STEPS = np.array([0.01, 0.02, 0.02, 0.02, 0.005, 0.002])  # typical changes of the limits


class SlowCurve(NamedTuple):
    """Slow charge, slow discharge, mean of both, or rests of one check-up.

    cell, test : names. cycle : of the check-up. ambient_temperature_celsius : of the chamber, NaN
    where not known. current_ampere : the slow one. soc : (n,) rising, 0 and 1 are the ends of this
    curve's own charge. voltage_volt : (n,). capacity_ampere_hour : from soc 0 to 1. branches :
    "both", "charge", "discharge", or "rests": one sample a rest, the current that of the loads.
    """

    cell: str
    test: str
    cycle: float
    ambient_temperature_celsius: float
    current_ampere: float
    soc: np.ndarray
    voltage_volt: np.ndarray
    capacity_ampere_hour: float
    branches: str


class Alignment(NamedTuple):
    """The four stoichiometric limits of one curve, what they say, and how well it fits.

    limits : (p,) lithiation [1] of the negative electrode at soc 0 and 1, of the positive one
    at 0 and 1, the shift of the voltage by current and hysteresis at half charge [V], by how
    much more it is at soc 1 than at 0 [V], and the share of each electrode that is a blend [1].
    covariance : (p, p). spread : (p, n) change of `limits` per volt of error in each sample.
    residual_volt : (n,) measured less model. error_volt : (n,)
    standard deviation of each sample. rmse_volt : of the voltage, steep ends weighed down.
    """

    curve: SlowCurve
    limits: np.ndarray
    covariance: np.ndarray
    spread: np.ndarray
    residual_volt: np.ndarray
    error_volt: np.ndarray
    rmse_volt: float


class Pair(NamedTuple):
    """Half cells of the negative and the positive electrode."""

    negative: object
    positive: object

    @property
    def blends(self):
        """Half cells of which the share of the second material is fitted."""
        return [one for one in self if one.parts is not None]

    def at(self, shares):
        """The pair with these shares of its blends [1]."""
        given = iter(shares)
        return Pair(*(one if one.parts is None else at_share(one, next(given)) for one in self))


def cell_volt(pair, limits, soc):
    """Voltage of a cell [V] from its half cells.

    Parameters
    ----------
    pair : Pair. limits : (p,), as in `Alignment`; of (6,) blends have their own share.
    soc : (n,) [1].

    Source: U(soc) = Up(y(soc)) − Un(x(soc)) + shift; Honkura and Horiba, J. Power Sources 264
    (2014) 140; Birkl et al., J. Power Sources 341 (2017) 373.
    """
    x = limits[0] + (limits[1] - limits[0]) * soc
    y = limits[2] + (limits[3] - limits[2]) * soc
    negative, positive = pair.at(limits[6:]) if len(limits) > 6 else pair
    return (
        np.interp(y, positive.lithiation, positive.potential_volt)
        - np.interp(x, negative.lithiation, negative.potential_volt)
        + limits[4]
        + limits[5] * (soc - 0.5)
    )


def align(curve, pair, *, starts=()):
    """Fit the four limits and the shift of one curve to its voltage and its slope together.

    The half cells' error is a random walk that is pulled back over 5 % of SoC. To whiten it, each
    sample is compared less a part of the one before: voltage and dV/dQ are weighed together as the
    error demands, with nothing to choose. Its size is that of the misfit.

    Parameters
    ----------
    curve : SlowCurve. pair : Pair.
    starts : limits (p,) to begin from, beside a search over the whole range.

    Returns
    -------
    alignment : Alignment.
    """
    curve = _without_steep_ends(curve)
    starts, errors = [*starts, *_search(curve, pair)], _errors(curve, FIRST_STD_VOLT, 0.0)
    # The second fit knows the size of the half cells' error from the first.
    for _ in range(2):
        fits = _minima(curve, pair, starts, errors)
        best = fits[0]
        residual = curve.voltage_volt - cell_volt(pair, best.x, curve.soc)
        # No half cell is known better than to 1 mV, and few cyclers read better.
        std = max(_std(residual, errors, best, curve.soc), 0.001)
        moved = np.pad(MOVED, ((0, 0), (0, len(pair.blends))))
        starts = [*(best.x + moved), *(fit.x for fit in fits[1:])]
        errors = _errors(curve, std, best.x[4])
    return _alignment(curve, fits, residual, errors)


def realigned(alignment, pair, kept):
    """The same fit to a part of the curve, from where the whole one ended.

    Parameters
    ----------
    alignment : Alignment. pair : Pair. kept : (n,) bool, samples of its curve that count.

    Returns
    -------
    alignment : Alignment of which only `limits` are those of the part.
    """
    if kept.all():
        return alignment
    curve = alignment.curve
    part = curve._replace(soc=curve.soc[kept], voltage_volt=curve.voltage_volt[kept])
    (fit,) = _fits(part, pair, [alignment.limits], alignment.error_volt[kept])
    return alignment._replace(limits=fit.x)


def _minima(curve, pair, starts, errors):
    """Different minima from several starts, best first, those not hopelessly worse.

    Only states in which a charge fills the negative electrode and empties the positive one.
    """
    fits = sorted(_fits(curve, pair, starts, errors), key=lambda fit: fit.cost)
    forward = [fit for fit in fits if fit.x[1] > fit.x[0] and fit.x[2] > fit.x[3]] or fits[:1]
    kept, steps = [], _steps(pair)
    for fit in forward:
        near = [np.abs((fit.x - other.x) / steps).max() < 1.0 for other in kept]
        # Eight in half of chi-square: three thousand times less likely.
        if fit.cost < forward[0].cost + 8.0 and not any(near):
            kept.append(fit)
    return kept


def _fits(curve, pair, starts, errors, *, most_steps=100):
    """Least squares from each start."""
    low, high = _bounds(pair)
    return [
        least_squares(
            _whitened,
            np.clip(start, low + 1e-6, high - 1e-6),
            jac=_derivatives,
            bounds=(low, high),
            x_scale=_steps(pair),
            args=(curve, pair, errors),
            max_nfev=most_steps,
            ftol=1e-6,
            xtol=1e-6,
        )
        for start in starts
    ]


def _steps(pair):
    return np.append(STEPS, [0.02] * len(pair.blends))


def _without_steep_ends(curve):
    """Curve without the samples at its ends where an electrode is all but empty or full.

    Slopes of 20 V and more per SoC tell how a test ends, not where the cell stands.
    """
    kept = np.abs(np.gradient(curve.voltage_volt, curve.soc)) < 20.0
    return curve._replace(soc=curve.soc[kept], voltage_volt=curve.voltage_volt[kept])


def _bounds(pair):
    """Limits [1], shift [V] and shares [1] that the half cells' tables allow."""
    tables = [one.lithiation if one.parts is None else one.parts for one in pair]
    (low_x, high_x), (low_y, high_y) = ((table.min(), table.max()) for table in tables)
    shares = len(pair.blends)
    low = np.array([low_x, low_x, low_y, low_y, -0.1, -0.05, *[0.0] * shares])
    return low, np.array([high_x, high_x, high_y, high_y, 0.1, 0.05, *[1.0] * shares])


def _errors(curve, std, shift):
    """Standard deviation of each sample (n,) [V]: of the half cells, more where the curve is steep.

    As the current starts its shift has yet to build up: there it is as wrong as it is large.
    """
    slope = np.abs(np.gradient(curve.voltage_volt, curve.soc))
    start = {"charge": curve.soc, "discharge": 1 - curve.soc}.get(curve.branches)
    # Polarisation and hysteresis build up over some 4 % of SoC.
    starting = 0.0 if start is None else shift * np.exp(-start / 0.04)
    charge_std = slope * CHARGE_STD / FIRST_STD_VOLT
    return np.sqrt(std**2 * (1 + charge_std**2) + starting**2)


def _whitened(limits, curve, pair, errors):
    """Residuals of unit variance and no correlation, then how far shift and shares are off."""
    scaled = (curve.voltage_volt - cell_volt(pair, limits, curve.soc)) / errors
    expected, std = _expected(curve, pair)
    return np.append(_white(scaled, curve.soc), (limits[4:] - expected) / std)


def _expected(curve, pair):
    """Expected shift [V] and shares [1], and their standard deviations."""
    # ASSUME: A share of a blend, stated or by default, is right within 10 % of the electrode's
    # lithium.
    expected = np.array([0.0, 0.0, *(blend.share for blend in pair.blends)])
    return expected, np.array([*SHIFT_STD_VOLT[curve.branches], *[0.1] * len(pair.blends)])


def _derivatives(limits, curve, pair, errors):
    """Derivatives (n + 2 + blends, p) of `_whitened` by the limits."""
    soc, ends = curve.soc, np.stack([1.0 - curve.soc, curve.soc], axis=1)
    columns, shares = [], []
    for sign, one, empty in zip((-1, 1), pair.at(limits[6:]), (0, 2), strict=True):
        lithiation = ends @ limits[empty : empty + 2]
        slope = sign * _slope(one, lithiation)
        columns.append(slope[:, None] * ends)
        if one.parts is not None:  # at one lithiation the potential follows what the second lacks
            more = np.interp(lithiation, one.lithiation, one.parts[1] - one.parts[0])
            shares.append(-slope * more)
    columns.append(np.stack([np.ones(len(soc)), soc - 0.5, *shares], axis=1))
    std = _expected(curve, pair)[1]
    expected = np.pad(np.diag(1.0 / std), ((0, 0), (4, 0)))
    volt = np.concatenate(columns, axis=1)
    return np.concatenate([_white(-volt / errors[:, None], soc), expected])


def _slope(half_cell, lithiation):
    """Slope of a half cell's table (n,) [V]; none beyond its ends, where it is continued flat."""
    table, volt = half_cell.lithiation, half_cell.potential_volt
    slopes = np.concatenate([[0.0], np.diff(volt) / np.diff(table), [0.0]])
    return slopes[np.searchsorted(table, lithiation, side="right")]


def _white(series, soc):
    """Samples (n, …) correlated over `CORRELATED_SOC`, made independent."""
    return whitened(series, soc / CORRELATED_SOC, np.exp(-1.0))[0]


def _search(curve, pair, *, best=4):
    """The best of a coarse grid of limits, as starts: list of (p,)."""
    # Lithiation of the negative electrode when empty and full, then of the positive one.
    grid = [
        (x0, x1, y0, y1)
        for x0 in (0.005, 0.02, 0.06, 0.15)
        for x1 in (0.3, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95)
        for y0 in (0.55, 0.7, 0.8, 0.88, 0.94, 0.985)
        for y1 in (0.01, 0.1, 0.2, 0.27, 0.35, 0.45)
        if x1 > x0 + 0.1 and y0 > y1 + 0.1
    ]
    low, high = (bound[:6] for bound in _bounds(pair))
    limits = np.clip(np.c_[grid, np.zeros((len(grid), 2))], low, high)
    # A quarter of the samples shows which starts are worth a fit.
    sparse = slice(None, None, 4 if len(curve.soc) > 100 else 1)
    soc, voltage = curve.soc[sparse], curve.voltage_volt[sparse]
    model = cell_volt(pair, limits.T[:, :, None], soc[None, :])
    misfit = (voltage - model) / _errors(curve, FIRST_STD_VOLT, 0.0)[sparse]
    order = np.argsort(np.mean(np.abs(misfit), axis=1))
    chosen = []
    for row in order:
        far = [np.abs(limits[row] - one).max() > 0.08 for one in chosen]
        if all(far):
            chosen.append(limits[row])
        if len(chosen) == best:
            break
    return [np.append(one, [blend.share for blend in pair.blends]) for one in chosen]


def _std(residual, errors, fit, soc):
    """Error of the half cells that explains a misfit [V], what the fit has taken up added."""
    slopes = _coloured(fit.jac[: len(soc)], soc)
    taken_up = np.mean(np.einsum("ni,ij,nj->n", slopes, _covariance(fit), slopes))
    return _rms(residual, errors) / float(np.sqrt(max(1 - taken_up, 0.1)))


def _covariance(fit):
    """Covariance (p, p) of a fit to residuals of unit variance: Fisher's information inverted."""
    return np.linalg.pinv(fit.jac.T @ fit.jac, rcond=1e-14, hermitian=True)


def _coloured(series, soc):
    """Inverse of `_white`."""
    kept = np.exp(-np.diff(soc) / CORRELATED_SOC)
    rest = np.sqrt(1 - kept**2)
    rows = [series[0]]
    for row, share, new in zip(series[1:], kept, rest, strict=True):
        rows.append(share * rows[-1] + new * row)
    return np.array(rows)


def _rms(misfit, errors):
    """Root mean square of a misfit, each sample weighed as the best known one."""
    return rms(misfit * errors.min() / errors)


def _alignment(curve, fits, residual, errors):
    """Alignment of a fit; its covariance is of the error that the half cells turned out to have.

    Other minima about as likely widen it: the covariance is that of their mixture about the best.
    """
    best = fits[0]
    covariance = _covariance(best)
    whitening = _white(np.diag(1 / errors), curve.soc)
    # Costs are half of chi-square: their differences are log likelihoods.
    likely = np.exp([best.cost - fit.cost for fit in fits])
    apart = np.array([fit.x - best.x for fit in fits])
    return Alignment(
        curve=curve,
        limits=best.x,
        covariance=covariance + (apart * (likely / likely.sum())[:, None]).T @ apart,
        spread=-covariance @ best.jac[: len(curve.soc)].T @ whitening,
        residual_volt=residual,
        error_volt=errors,
        rmse_volt=_rms(residual, errors),
    )


def chosen_pair(curves, pairs, *, misfit_volt=MISFIT_VOLT):
    """Pair of half cells that fits a cell's curves best, and the others that fit.

    Parameters
    ----------
    curves : list of SlowCurve, of which the first and the last count. pairs : list of Pair.
    misfit_volt : largest misfit of a curve at which half cells count as this cell's [V].

    Returns
    -------
    fitting : list of (Pair, rmse_volt), best first: all that fit.

    Raises
    ------
    Refusal : no pair fits.
    """
    ends = curves[:1] if len(curves) == 1 else [curves[0], curves[-1]]
    scored = [
        (pair, rms([align(curve, pair).rmse_volt for curve in ends]))
        for pair in _promising(ends[0], pairs)
    ]
    scored.sort(key=lambda entry: entry[1])
    best = scored[0][1]
    if best > misfit_volt:
        names = " and ".join(one.name for one in scored[0][0])
        raise Refusal(
            f"the half cells do not fit: best are {names} with a misfit of {1e3 * best:.0f} mV, "
            f"at most {1e3 * misfit_volt:.0f} mV; is the chemistry right?"
        )
    return [entry for entry in scored if entry[1] <= misfit_volt]


def _promising(curve, pairs):
    """Pairs worth a thorough fit: the six of least misfit in a quick one of twelve steps."""
    curve = _without_steep_ends(curve)
    errors = _errors(curve, FIRST_STD_VOLT, 0.0)
    quick = []
    for pair in pairs:
        fits = _fits(curve, pair, _search(curve, pair, best=2), errors, most_steps=12)
        quick.append(min(fit.cost for fit in fits))
    return [pairs[row] for row in np.argsort(quick)[:6]]
