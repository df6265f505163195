"""Fit of the equivalent circuit to a measured spectrum."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.protocols.impedance.circuits import NAMES, circuit_impedance
from cellwright.refusal import Refusal
from cellwright.uncertainty import covariance_from_jacobian, standard_deviations

# Search limits of the parameters in the order of NAMES, in units of the spectrum's own size.
LOWEST_EXPONENT, HIGHEST_EXPONENT = 0.3, 1.0


class CircuitFit(NamedTuple):
    """A fitted circuit.

    circuit : "R-(CPE|(R-W))", or "L-…" with the leads' inductance. names, values, std : of the
    parameters, in the units of `circuit_impedance`; std is NaN for a parameter at the limit of
    its search or not determined. at_bound : names of those at a limit. r_zero_crossing_ohm : real
    part where the imaginary part is zero, NaN where it never is [Ω]. fitted_ohm : (n,) complex.
    rms_relative_residual : of the complex error over the modulus.
    """

    circuit: str
    names: tuple
    values: np.ndarray
    std: np.ndarray
    at_bound: tuple
    r_zero_crossing_ohm: float
    fitted_ohm: np.ndarray
    rms_relative_residual: float


def fit_circuit(frequency_hertz, impedance_ohm):
    """Complex least squares with modulus weights, in the logarithms of the parameters.

    Inductance is part of the circuit where the spectrum shows any (a positive imaginary part).

    Parameters
    ----------
    frequency_hertz : (n,) in any order [Hz].
    impedance_ohm : (n,) complex [Ω], capacitive arc with a negative imaginary part.

    Returns
    -------
    fit : CircuitFit, the best of several starts.

    Raises
    ------
    Refusal : fewer than 8 points, not finite, a frequency or real part that is not positive, no
        capacitive part.
    """
    # ASSUME: Errors of an impedance are a fixed share of its modulus at every frequency.
    from scipy.optimize import least_squares

    frequency, impedance = np.asarray(frequency_hertz, float), np.asarray(impedance_ohm, complex)
    _check(frequency, impedance)
    inductive = bool((impedance.imag > 0).any())
    count = len(NAMES) if inductive else len(NAMES) - 1
    weight = 1 / np.abs(impedance)

    def residual(logs):
        error = (circuit_impedance(frequency, *np.exp(logs)) - impedance) * weight
        return np.concatenate([error.real, error.imag])

    starts, lower, upper = (np.log(part)[..., :count] for part in _search(frequency, impedance))
    found = [least_squares(residual, start, bounds=(lower, upper)) for start in starts]
    best = min(found, key=lambda one: one.cost)
    bound = (best.x - lower < 1e-3) | (upper - best.x < 1e-3)
    std = np.full(count, np.nan)
    std[~bound] = standard_deviations(covariance_from_jacobian(best.jac[:, ~bound], best.fun))
    fitted = circuit_impedance(frequency, *np.exp(best.x))
    return CircuitFit(
        circuit="L-R-(CPE|(R-W))" if inductive else "R-(CPE|(R-W))",
        names=NAMES[:count],
        values=np.exp(best.x),
        std=std * np.exp(best.x),
        at_bound=tuple(name for name, at in zip(NAMES, bound, strict=False) if at),
        r_zero_crossing_ohm=zero_crossing(frequency, impedance),
        fitted_ohm=fitted,
        rms_relative_residual=float(np.sqrt(np.mean(np.abs((fitted - impedance) * weight) ** 2))),
    )


def zero_crossing(frequency_hertz, impedance_ohm):
    """Real part where the imaginary part changes from inductive to capacitive, by a line [Ω].

    The crossing at the highest frequency counts; NaN without any: the leads hide it, or the
    spectrum ends before.
    """
    order = np.argsort(-np.asarray(frequency_hertz, float))
    real, imaginary = impedance_ohm.real[order], impedance_ohm.imag[order]
    crossings = np.flatnonzero((imaginary[:-1] > 0) & (imaginary[1:] <= 0))
    if not len(crossings):
        return np.nan
    before = crossings[0]
    share = imaginary[before] / (imaginary[before] - imaginary[before + 1])
    return float(real[before] + share * (real[before + 1] - real[before]))


def _check(frequency, impedance):
    if len(frequency) < 8:
        raise Refusal(f"spectrum of {len(frequency)} points; a fit needs 8")
    if not (np.isfinite(frequency).all() and np.isfinite(impedance).all()):
        raise Refusal("spectrum holds values that are not finite")
    if (frequency <= 0).any() or (impedance.real <= 0).any():
        raise Refusal("spectrum holds a frequency or a real part that is not positive")
    if not (impedance.imag < 0).any():
        raise Refusal("spectrum has no capacitive part (negative imaginary part)")


def _search(frequency, impedance):
    """Starts (s, 6) and limits (6,) of the parameters, from the spectrum's own size."""
    capacitive = impedance.imag < 0
    smallest, span = impedance.real[capacitive].min(), np.ptp(impedance.real[capacitive])
    rates = 2 * np.pi * frequency
    largest = np.abs(impedance).max()
    warburg = 1 / (np.sqrt(rates.min()) * np.abs(impedance.imag[frequency.argmin()]))
    leads = np.abs(impedance.imag[frequency.argmax()]) / rates.max()
    middle = np.sqrt(rates[capacitive].min() * rates[capacitive].max())
    starts = [
        (smallest, share * span, (peak * middle) ** -0.7 / (share * span), 0.7, warburg, leads)
        for share, peak in product((0.1, 0.4, 0.9), (0.1, 1.0, 10.0))
    ]
    low = (smallest / 100, span * 1e-4, 1e-6 / largest, LOWEST_EXPONENT, warburg * 1e-3)
    high = (largest, largest * 100, 1e9 / largest, HIGHEST_EXPONENT, warburg * 1e4)
    low, high = (*low, leads * 1e-4), (*high, leads * 1e2)
    tiny = np.finfo(float).tiny
    return np.clip(starts, low, high), np.maximum(low, tiny), np.maximum(high, 2 * tiny)
