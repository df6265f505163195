"""Diffusion in a sphere: the roots its series runs over."""

import numpy as np


def sphere_roots(modes):
    """First positive roots of tan x = x, by Newton's method from (n + ½)π − 1/((n + ½)π)."""
    far = (np.arange(1, modes + 1) + 0.5) * np.pi
    x = far - 1.0 / far
    for _ in range(4):
        x = x - (np.sin(x) - x * np.cos(x)) / (x * np.sin(x))
    return x
