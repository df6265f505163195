"""Columns of artefacts as figures take them: chosen rows, fewer points, the test's temperature."""

from itertools import pairwise

import numpy as np


def rows_where(columns: dict, chosen) -> dict:
    """The same columns with some of their rows: `chosen` (n,) is a mask, or row numbers."""
    return {name: values[chosen] for name, values in columns.items()}


def ambient_celsius(about: dict):
    """Temperature [°C] that the sheet states for the test of an artefact; None where it does not.

    `about` is what the artefact says of itself.
    """
    return about["params"]["test"]["ambient_temperature_celsius"]


def evenly_spread(count: int, most: int) -> np.ndarray:
    """Places of at most `most` of `count` items, first and last among them."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(int))


def thinned(x, y, *, points=2000):
    """Fewer points (x, y) that draw the same line: lowest and highest of each stretch, in order.

    Stretches without a value stay open.
    """
    if len(x) <= points:
        return x, y
    low, high = np.where(np.isnan(y), np.inf, y), np.where(np.isnan(y), -np.inf, y)
    edges = np.linspace(0, len(x), points // 2 + 1).astype(int)
    keep = [
        start + np.sort([np.argmin(low[start:stop]), np.argmax(high[start:stop])])
        for start, stop in pairwise(edges)
    ]
    keep = np.unique(np.concatenate([[0], *keep, [len(x) - 1]]))
    return x[keep], y[keep]
