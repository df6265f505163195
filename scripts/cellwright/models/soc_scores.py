"""How good an estimated SoC is: error, convergence, honesty of its interval, innovations."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

NORMAL_95 = 1.959963985
LAGS = 20  # of the autocorrelation that is tested


class Innovations(NamedTuple):
    """Tests of a filter's innovations, standardised by what they should be.

    nis_mean : mean of their squares; one where the filter's noise is right, larger where it trusts
        its model too much.
    nis_low, nis_high : where nis_mean lies in 95 % of such records.
    autocorrelation : of neighbours; zero where nothing is left to learn.
    white : whether the Ljung–Box statistic over `LAGS` lags stays below its 95 % bound.
    """

    nis_mean: float
    nis_low: float
    nis_high: float
    autocorrelation: float
    white: bool


def innovation_tests(innovation_volt, innovation_std_volt):
    """Normalised innovation squared against χ², and whiteness.

    Parameters
    ----------
    innovation_volt, innovation_std_volt : (n,) [V].

    Returns
    -------
    innovations : Innovations; NaN and False where a method has no innovations.

    Raises
    ------
    Refusal : fewer samples than lags.

    Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications (2001) 5.4;
        G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297.
    """
    ratio = innovation_volt / innovation_std_volt
    if np.isnan(ratio).all():
        return Innovations(*[np.nan] * 4, False)
    n = len(ratio)
    if n <= LAGS:
        raise Refusal(f"{n} innovations; more than {LAGS} are needed to test them")
    low, high = (chi_square(side, n) / n for side in (-NORMAL_95, NORMAL_95))
    centred = ratio - ratio.mean()
    power = max(centred @ centred, np.finfo(float).tiny)
    rho = np.array([centred[k:] @ centred[:-k] / power for k in range(1, LAGS + 1)])
    statistic = n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, LAGS + 1)))
    white = bool(statistic < chi_square(1.644853627, LAGS))
    return Innovations(float(np.mean(ratio**2)), low, high, float(rho[0]), white)


def chi_square(normal, degrees):
    """Quantile of χ² at the probability that a standard normal variable has at `normal`.

    Parameters
    ----------
    normal : quantile of the standard normal distribution.
    degrees : degrees of freedom.

    Source: E. B. Wilson, M. M. Hilferty, PNAS 17 (1931) 684; within 0.6 % from 20 degrees up.
    """
    ninth = 2.0 / (9.0 * degrees)
    return float(degrees * (1.0 - ninth + normal * np.sqrt(ninth)) ** 3)


def convergence_second(test_time_second, error_soc, *, band, hold_second):
    """Time until the error is within a band and stays there for a while.

    Parameters
    ----------
    test_time_second, error_soc : (n,) [s], [1].
    band : largest error that counts as converged [1].
    hold_second : for how long it has to stay there [s].

    Returns
    -------
    second : time since the first sample [s]; NaN where it never does.
    """
    inside = np.abs(error_soc) <= band
    bounds = np.flatnonzero(np.diff(inside.astype(int), prepend=0, append=0))
    first, last = bounds[::2], bounds[1::2] - 1
    stays = test_time_second[last] - test_time_second[first] >= hold_second
    if not stays.any():
        return np.nan
    return float(test_time_second[first[stays][0]] - test_time_second[0])


def scores(test_time_second, estimate, reference_soc, scored, *, band, hold_second):
    """Errors of an estimated SoC against a reference.

    Parameters
    ----------
    test_time_second : (n,) [s].
    estimate : soc.Estimate.
    reference_soc : (n,) [1].
    scored : (n,) bool, the samples that count.
    band, hold_second : as in `convergence_second`.

    Returns
    -------
    row : dict. rmse_soc and max_abs_soc are taken after convergence, or over all that counts where
        there is none; coverage_95 is the share of samples in the 95 % interval, all of them.

    Raises
    ------
    Refusal : no sample counts, or an estimate that is not finite.
    """
    error = estimate.soc - reference_soc
    if not scored.any():
        raise Refusal("no sample is left to score")
    if not np.isfinite(error).all():
        raise Refusal(f"{np.sum(~np.isfinite(error))} estimated SoC are not finite")
    time = test_time_second
    converged = convergence_second(time, error, band=band, hold_second=hold_second)
    late = scored & (time - time[0] >= (0.0 if np.isnan(converged) else converged))
    late = late if late.any() else scored
    covered = np.abs(error) <= NORMAL_95 * estimate.std
    tests = innovation_tests(estimate.innovation_volt[scored], estimate.innovation_std_volt[scored])
    return {
        "rmse_soc": float(np.sqrt(np.mean(error[late] ** 2))),
        "max_abs_soc": float(np.abs(error[late]).max()),
        "convergence_second": converged,
        "capacity_ampere_hour": float(estimate.capacity_ampere_hour[-1]),
        "capacity_std_ampere_hour": float(estimate.capacity_std_ampere_hour[-1]),
        "soc_std": float(estimate.std[late].mean()),
        "coverage_95": float(covered[scored].mean()),
        **tests._asdict(),
    }
