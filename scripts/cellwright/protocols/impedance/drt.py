"""Distribution of relaxation times: what arcs a spectrum holds, without a circuit."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

RIPPLE = 0.02  # of the whole resistance: smaller processes are made by noise


class Distribution(NamedTuple):
    """Distribution of relaxation times of one spectrum.

    tau_second : (m,) [s]. gamma_ohm : (m,) resistance per unit of ln τ [Ω], none negative.
    r_ohmic_ohm : in series. strength : of the smoothing.
    """

    tau_second: np.ndarray
    gamma_ohm: np.ndarray
    r_ohmic_ohm: float
    strength: float


def relaxation_times(frequency_hertz, impedance_ohm):
    """Smooth, non-negative distribution of relaxation times beside series R, L and C.

    Z = R + jωL + 1/(jωC) + ∫ γ/(1 + jωτ) dln τ, modulus weights, curvature of γ punished: as hard
    as the discrepancy principle allows, the noise being what the closest non-negative distribution
    leaves.

    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].

    Returns distribution: Distribution.

    Source: T. H. Wan et al., Electrochimica Acta 184 (2015) 483 (Tikhonov regularisation);
    V. A. Morozov, Soviet Math. Dokl. 7 (1966) 414 (discrepancy principle).
    """
    omega = 2 * np.pi * np.asarray(frequency_hertz, float)
    # Ten time constants a decade, to half a decade beyond what was measured.
    edges = np.log10([1 / omega.max(), 1 / omega.min()]) + [-0.5, 0.5]
    tau = np.logspace(*edges, round(10 * np.ptp(edges)) + 1)
    matrix, target, size = _system(omega, np.asarray(impedance_ohm, complex), tau)
    # Second differences of the distribution, zero beyond both ends; nothing of R, L and C.
    penalty = np.diff(np.eye(len(tau) + 4)[:, 2:-2], n=2, axis=0)
    penalty = np.concatenate([penalty, np.zeros((len(penalty), 3))], axis=1)
    strength = _strongest(matrix, target, penalty)
    parameters = _fitted(matrix, target, penalty, strength)[0] / size
    return Distribution(
        tau_second=tau,
        gamma_ohm=parameters[: len(tau)] / np.log(tau[1] / tau[0]),
        r_ohmic_ohm=float(parameters[-3]),
        strength=float(strength),
    )


def peaks(distribution):
    """Processes of a spectrum: peaks of the distribution, each from valley to valley.

    distribution : Distribution. Peaks below `RIPPLE` of the whole resistance do not count.

    Returns rows: list of dicts peak (from 1, fastest first), tau_second [s], frequency_hertz [Hz],
    resistance_ohm [Ω], share [1], in_range: its top lies within what was measured.
    """
    gamma, tau = distribution.gamma_ohm, distribution.tau_second
    width, whole = np.log(tau[1] / tau[0]), gamma.sum()
    inner = np.concatenate([[-1.0], gamma, [-1.0]])
    tops = np.flatnonzero((inner[1:-1] > inner[:-2]) & (inner[1:-1] >= inner[2:]) & (gamma > 0))
    valleys = [a + int(np.argmin(gamma[a:b])) for a, b in pairwise(tops)]
    starts, ends = [0, *valleys], [*valleys, len(gamma)]
    areas = [gamma[a:b].sum() for a, b in zip(starts, ends, strict=True)][: len(tops)]
    large = [(top, area) for top, area in zip(tops, areas, strict=True) if area > RIPPLE * whole]
    # Half a decade at either end lies beyond what was measured.
    edge = round(0.5 * np.log(10) / width)
    return [
        {
            "peak": number,
            "tau_second": float(tau[top]),
            "frequency_hertz": float(1 / (2 * np.pi * tau[top])),
            "resistance_ohm": float(area * width),
            "share": float(area / whole),
            "in_range": bool(edge <= top < len(tau) - edge),
        }
        for number, (top, area) in enumerate(large, 1)
    ]


def _system(omega, impedance, tau):
    """Weighted equations (2n, m + 3), right side (2n,), scales of the columns (m + 3,)."""
    relaxing = 1 / (1 + 1j * omega[:, None] * tau)
    series = np.stack([np.ones(len(omega)), 1j * omega, -1j / omega], axis=1)
    weight = 1 / np.abs(impedance)
    columns = np.concatenate([relaxing, series], axis=1) * weight[:, None]
    # One scale for all time constants: smoothness compares neighbours.
    size = np.linalg.norm(columns, axis=0)
    size[: len(tau)] = size[: len(tau)].mean()
    stacked = np.concatenate([columns.real, columns.imag]) / size
    target = impedance * weight
    return stacked, np.concatenate([target.real, target.imag]), size


def _fitted(matrix, target, penalty, strength):
    """Non-negative solution (m + 3,) and its error (2n,) at one strength of the smoothing."""
    from scipy.optimize import nnls

    stacked = np.concatenate([matrix, np.sqrt(strength) * penalty])
    solution, _ = nnls(stacked, np.concatenate([target, np.zeros(len(penalty))]))
    return solution, matrix @ solution - target


def _strongest(matrix, target, penalty):
    """Strongest smoothing whose error is at most 1.1 times the least possible.

    Below 0.1 % RMS no spectrum is believed, however close a distribution follows it.
    """
    weak, strong = -8.0, 2.0  # powers of ten relative to the data's own weight
    least = np.linalg.norm(_fitted(matrix, target, penalty, 10**weak)[1])
    allowed = max(1.1 * least, 1e-3 * np.sqrt(len(target) / 2))
    for _ in range(7):  # to a factor of 1.2
        middle = (weak + strong) / 2
        error = np.linalg.norm(_fitted(matrix, target, penalty, 10**middle)[1])
        weak, strong = (middle, strong) if error <= allowed else (weak, middle)
    return 10**weak
