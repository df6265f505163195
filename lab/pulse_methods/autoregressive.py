"""Circuit parameters online: recursive least squares on the autoregressive form (thesis 2.17–2.19).

On a uniform step, the exact solution of R0 and n RC pairs for a held current is the recurrence
    y(k) = Σ c_i·y(k−i) + Σ d_i·I(k−i),    y = V − OCV,  i = 1…n for c, 0…n for d,
whose poles are a_j = exp(−step/tau_j). It is linear in c and d, so that each sample updates them.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.lags import HOLDS, lag_weights
from cellwright.refusal import Refusal


class Estimate(NamedTuple):
    """Coefficients after every sample.

    coefficient : (n, q): c_1…c_m, d_0…d_m; NaN before the first update. covariance : (q, q) of the
    last ones, for equation errors that are white and not correlated with past voltages, which
    measured noise never is: it states too little.
    """

    coefficient: np.ndarray
    covariance: np.ndarray


class Circuit(NamedTuple):
    """Parameters of one set of coefficients; pairs by ascending time constant.

    r0_ohm. r_ohm, tau_second : (m,).
    """

    r0_ohm: float
    r_ohm: np.ndarray
    tau_second: np.ndarray


def track(current_ampere, voltage_volt, ocv_volt, *, n_rc=1):
    """Recursive least squares on V − OCV, one update per sample, no sample forgotten.

    Parameters
    ----------
    current_ampere, voltage_volt : (n,) on a uniform step [A] positive on charge, [V].
    ocv_volt : scalar or (n,) open-circuit voltage [V].
    n_rc : 1 or 2.

    Returns
    -------
    estimate : Estimate.

    Raises
    ------
    Refusal : lengths differ, not finite, too few samples, another number of pairs, a current that
        never changes.

    Source: thesis (2.17)–(2.19). Erratum: (2.18) lists V(k) among what predicts V(k); the lags
    begin at k − 1. Recursion: L. Ljung, System Identification (1999), sec. 11.2.
    """
    rows, target = _equations(current_ampere, voltage_volt, ocv_volt, n_rc)
    size = rows.shape[1]
    # A large variance at the start, since nothing is known.
    coefficient, covariance = np.zeros(size), 1e10 * np.eye(size)
    course = np.full((len(rows) + n_rc, size), np.nan)
    for k, (row, value) in enumerate(zip(rows, target, strict=True)):
        shared = covariance @ row
        gain = shared / (1.0 + row @ shared)
        coefficient = coefficient + gain * (value - row @ coefficient)
        covariance = covariance - np.outer(gain, shared)
        # Rounding would make it asymmetric, and then indefinite, after some thousand samples.
        covariance = (covariance + covariance.T) / 2
        course[k + n_rc] = coefficient
    power = float(np.sum((target - rows @ coefficient) ** 2))
    return Estimate(course, covariance * power / (len(rows) - size))


def circuit_of_coefficients(coefficient, step_second, *, hold, n_rc=1):
    """Resistances and time constants of a recurrence, exact for the stated hold of the current.

    Poles a_j are the roots of 1 − Σ c_i·w^i in 1/w, tau_j = −step/ln a_j. The residue of
    Σ d_i·w^i / (1 − Σ c_i·w^i) at each pole over that of the unit lag (before + after/w… of
    `numerics.lags.lag_weights`) is R_j; what is left at w = 0 is R0.

    Parameters
    ----------
    coefficient : (q,) one row of `Estimate.coefficient`.
    step_second : uniform step [s].
    hold : "zero_order" or "first_order": how the current runs between two samples.
    n_rc : 1 or 2.

    Returns
    -------
    circuit : Circuit.

    Raises
    ------
    Refusal : not finite, poles that are complex, not between 0 and 1 (unstable or alternating), or
        equal: no RC pairs have them.

    Source: partial fractions of the discrete transfer function; thesis (2.17).
    """
    coefficient = np.asarray(coefficient, float)
    if len(coefficient) != 2 * n_rc + 1 or hold not in HOLDS:
        raise Refusal(f"{len(coefficient)} coefficients for {n_rc} pairs, hold {hold!r}")
    if not np.isfinite(coefficient).all():
        raise Refusal("coefficients are not finite: no sample has updated them")
    c, d = coefficient[:n_rc], coefficient[n_rc : 2 * n_rc + 1]
    pole = _poles(c)
    tau = -step_second / np.log(pole)
    _, before, after = lag_weights(np.full(n_rc, float(step_second)), tau, hold=hold)
    others = [np.prod(1 - np.delete(pole, j) / pole[j]) for j in range(n_rc)]
    r = np.polyval(d[::-1], 1 / pole) / others / (after + before / pole)
    return Circuit(float(d[0] - r @ after), r, tau)


def _poles(c):
    root = np.roots(np.concatenate([[1.0], -c]))
    if np.iscomplexobj(root) and np.abs(root.imag).max() > 0:
        raise Refusal(f"poles {root[0]:.4g} and its conjugate are complex: no RC pairs have them")
    pole = np.sort(root.real)
    if not ((pole > 0) & (pole < 1)).all():
        raise Refusal(f"poles {np.array2string(pole, precision=4)} do not lie between 0 and 1")
    if len(pole) > 1 and np.diff(pole).min() < 1e-9:
        raise Refusal(f"poles coincide at {pole[0]:.6g}: pairs of one time constant are one pair")
    return pole


def _equations(current_ampere, voltage_volt, ocv_volt, n_rc):
    """Rows (2.18) and their targets; the first n_rc samples have no row."""
    current, voltage = np.asarray(current_ampere, float), np.asarray(voltage_volt, float)
    if current.shape != voltage.shape or current.ndim != 1:
        raise Refusal(f"current has shape {current.shape}, voltage {voltage.shape}; both (n,)")
    if n_rc not in (1, 2):
        raise Refusal(f"{n_rc} RC pairs; the autoregressive form is offered for 1 and 2")
    if len(current) <= 3 * n_rc + 2:
        raise Refusal(f"{len(current)} samples are too few for {2 * n_rc + 1} coefficients")
    y = voltage - ocv_volt
    if not (np.isfinite(y).all() and np.isfinite(current).all()):
        raise Refusal("current, voltage or OCV holds values that are not finite")
    if current.max() == current.min():
        raise Refusal(f"current is {current[0]:g} A throughout: nothing moves")
    past = [y[n_rc - i : len(y) - i] for i in range(1, n_rc + 1)]
    drive = [current[n_rc - i : len(y) - i] for i in range(n_rc + 1)]
    return np.column_stack([*past, *drive]), y[n_rc:]
