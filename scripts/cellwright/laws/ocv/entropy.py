"""The entropic coefficient dOCV/dT over the state of charge, with sign, interval and linearity."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.laws.ocv.readings import LEAST_TEMPERATURES
from cellwright.numerics.lines import generalised_line

_COLUMNS = ("celsius", "ocv_volt", "std_volt", "common_volt")


class Entropic(NamedTuple):
    """Fitted at m states of charge about `reference_celsius`; arrays (m,), NaN where not known.

    ocv_volt : at the reference temperature [V]. slope : dOCV/dT [V/K] of a line, its std and
    confidence limits. bend : second coefficient of a parabola [V/K²], its std, and bend_p : how
    often a line would show such a bend by chance [1]. parabola : (m, 3) the parabola itself [V,
    V/K, V/K²]. shared : estimate of the common error's factor [1]. temperatures : how many.
    reach_kelvin : from the reference temperature to the furthest one read [K].
    """

    soc: np.ndarray
    ocv_volt: np.ndarray
    ocv_std_volt: np.ndarray
    slope: np.ndarray
    slope_std: np.ndarray
    slope_lower: np.ndarray
    slope_upper: np.ndarray
    bend: np.ndarray
    bend_std: np.ndarray
    bend_p: np.ndarray
    parabola: np.ndarray
    shared: np.ndarray
    temperatures: np.ndarray
    reach_kelvin: np.ndarray
    reference_celsius: float


class Crossing(NamedTuple):
    """State of charge at which the coefficient changes sign, the range in which it may, the sign
    above it (+1: the voltage rises with temperature from there on).
    """

    soc: float
    lower_soc: float
    upper_soc: float
    sign_above: int


def fit_entropic(readings, *, reference_celsius=25.0, level=0.95):
    """Line and parabola over temperature at every state of charge.

    Generalised least squares with C = diag(std²) + c·cᵀ, c the common error: overpotential that
    grows in the cold, or a relaxation, is told from entropy as far as its course over temperature
    allows, and widens the interval where it does not. Where the scatter is larger than the
    standard deviations say, these are made larger by it.

    Parameters
    ----------
    readings : `ocv_readings.Readings`.
    reference_celsius : about which the coefficients hold [degC].
    level : coverage of the interval.

    Returns
    -------
    entropic : Entropic.

    Source: thesis eq. 3.8 to 3.10: dOCV/dT = −dS/dn over the charge of the electrons.
    """
    from scipy.stats import norm
    from scipy.stats import t as student

    fits = [
        _at_one_soc(*row, reference_celsius)
        for row in zip(*(getattr(readings, name) for name in _COLUMNS), strict=True)
    ]
    line, line_std, curve, curve_std, shared, chi_square, count = (
        np.array(column, float) for column in zip(*fits, strict=True)
    )
    # A deviation that was enlarged by what scattered has that scatter's degrees of freedom.
    quantile = student.ppf((1 + level) / 2, np.maximum(count - 2, 1))
    reach = np.where(chi_square > 1, quantile, norm.ppf((1 + level) / 2)) * line_std[:, 1]
    away = np.where(np.isfinite(readings.ocv_volt), readings.celsius - reference_celsius, 0.0)
    ratio = np.abs(curve[:, 2]) / curve_std[:, 2]
    return Entropic(
        soc=readings.soc,
        ocv_volt=line[:, 0],
        ocv_std_volt=line_std[:, 0],
        slope=line[:, 1],
        slope_std=line_std[:, 1],
        slope_lower=line[:, 1] - reach,
        slope_upper=line[:, 1] + reach,
        bend=curve[:, 2],
        bend_std=curve_std[:, 2],
        bend_p=2 * student.sf(ratio, np.maximum(count - 3, 1)),
        parabola=curve,
        shared=shared,
        temperatures=count,
        reach_kelvin=np.max(np.abs(away), axis=1),
        reference_celsius=reference_celsius,
    )


def zero_crossings(soc, slope, std, lower, upper):
    """Where a coefficient changes sign over SoC for certain, and the range in which it may do so.

    Parameters
    ----------
    soc, slope, std, lower, upper : (m,) SoC ascending [1]; coefficient, its standard deviation and
        limits, NaN: not known.

    Returns
    -------
    crossings : list of Crossing, one for each pair of neighbouring states of charge at which the
        interval excludes zero on opposite sides. In between the change is put where signs on both
        sides agree best with the values.
    """
    known = np.isfinite(slope) & np.isfinite(std) & np.isfinite(lower) & np.isfinite(upper)
    columns = [np.asarray(column, float)[known] for column in (soc, slope, std, lower, upper)]
    sign = (columns[3] > 0).astype(int) - (columns[4] < 0)
    sure = np.flatnonzero(sign)
    return [
        _crossing(*(column[first : last + 1] for column in columns[:3]), int(sign[last]))
        for first, last in pairwise(sure)
        if sign[first] != sign[last]
    ]


def _crossing(soc, slope, std, sign):
    """The change of sign between the first and the last of these points."""
    weight = np.cumsum(sign * slope / std)
    low = int(np.argmin(weight[:-1]))
    share = slope[low] / (slope[low] - slope[low + 1])
    at = soc[low] + np.clip(share, 0.0, 1.0) * (soc[low + 1] - soc[low])
    return Crossing(float(at), float(soc[0]), float(soc[-1]), sign)


def _at_one_soc(celsius, volt, std, common, reference):
    """Line, parabola, their deviations, the common error's factor, χ² of the line, temperatures."""
    known = np.isfinite(volt) & np.isfinite(std) & np.isfinite(common)
    celsius, volt, std, common = (column[known] for column in (celsius, volt, std, common))
    count = len(np.unique(np.round(celsius)))
    nothing = np.full(3, np.nan)
    if count < LEAST_TEMPERATURES:
        return nothing[:2], nothing[:2], nothing, nothing, np.nan, np.nan, count
    columns = np.vander(celsius - reference, 3, increasing=True)
    covariance = np.diag(std**2) + np.outer(common, common)
    line = generalised_line(columns[:, :2], volt, covariance)
    shared = common @ np.linalg.solve(covariance, volt - columns[:, :2] @ line.values)
    found = (shared, line.reduced_chi_square, count)
    if count == LEAST_TEMPERATURES:
        return line.values, line.std, nothing, nothing, *found
    parabola = generalised_line(columns, volt, covariance)
    return line.values, line.std, parabola.values, parabola.std, *found
