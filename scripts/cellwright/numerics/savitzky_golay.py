"""Savitzky-Golay filter of order 5, without the slow import of scipy.signal."""

from functools import lru_cache

import numpy as np

ORDER = 5


def weights(half, width, derivative):
    """Weights of the 2·half + 1 points about a point for a derivative of the local polynomial.

    Parameters
    ----------
    half : points to either side. width : distance of the points, in any unit.
    derivative : 0 smooths, 1 gives the slope.

    Returns
    -------
    weights : (2·half + 1,).

    Source: Savitzky & Golay, Anal. Chem. 36 (1964) 1627; least squares by the pseudo-inverse.
    """
    return _fit(half)[derivative] / (half * width) ** derivative


@lru_cache(maxsize=64)
def _fit(half):
    """Polynomial coefficients (ORDER + 1, 2·half + 1) by values at half + half + 1 points."""
    powers = (np.arange(-half, half + 1) / half)[:, None] ** np.arange(ORDER + 1)
    return np.linalg.pinv(powers)
