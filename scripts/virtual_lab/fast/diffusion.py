"""Diffusion in a particle as a chain of exponentials.

A flux i enters at the surface of a body of length L and diffusivity D; tau = L²/D, x = sqrt(s·tau).
How far the concentration at the surface runs ahead of the mean over the body is, up to scale,

    plate (closed at the back)   coth(x)/x - 1/x²            = sum of 2 / (x² + (n·pi)²)
    sphere                       tanh(x)/(x - tanh(x)) - 3/x² = sum of 2 / (x² + y_n²), tan y = y

for Laplace's s (Mittag-Leffler expansions; the term in 1/x² is the mean itself, which is the state
of charge). Each summand is an RC pair with tau_n = tau/y_n² and a resistance in proportion to
1/y_n². All resistances together, the response to a steady current, are 1/3 and 1/5: so r_n is
6/y_n² (plate) or 10/y_n² (sphere) of the whole.

The chain is cut after a number of pairs. The rest becomes one pair more, which has the rest's
resistance and its mean time constant: the steady state and the charge that settles stay exact.
"""

import numpy as np
from scipy.optimize import brentq

PAIRS = 9
# Sums over all y_n of 1/y² and of 1/y⁴.
SUMS = {"planar": (1 / 6, 1 / 90), "spherical": (1 / 10, 1 / 350)}


def chain(shape: str) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the resistance and of tau, shape (10,) each, slowest pair first."""
    y = _roots(shape)
    whole, moment = SUMS[shape]
    r = 1 / y**2 / whole
    rest = 1 - r.sum()
    rest_tau = (moment - (1 / y**4).sum()) / whole / rest
    return np.append(r, rest), np.append(1 / y**2, rest_tau)


def _roots(shape):
    """The first roots y: of sin y = 0 for a plate, of tan y = y for a sphere; none is zero."""
    n = np.arange(1, PAIRS + 1)
    if shape == "planar":
        return n * np.pi
    # Between n·pi and (n + 1/2)·pi; sin y = y·cos y has no poles.
    return np.array(
        [brentq(lambda y: np.sin(y) - y * np.cos(y), k * np.pi, (k + 0.5) * np.pi) for k in n]
    )
