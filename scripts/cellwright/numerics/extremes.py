"""The rows of a long record that a drawing of it shows."""

import numpy as np


def rows_of_extremes(values, count):
    """Numbers of at most about `count` rows that draw the same line as all.

    The lowest and highest of each stretch, first and last, in order: means would hide a spike of
    one sample, which is what a reader looks for. Stretches without a value stay open.

    Parameters
    ----------
    values : (n,) NaN where there is none.
    """
    if len(values) <= count:
        return np.arange(len(values))
    size = -(-len(values) // (count // 2))
    starts = np.arange(0, len(values), size)
    stretches = np.full((len(starts), size), np.nan)
    stretches.flat[: len(values)] = values
    missing = np.isnan(stretches)
    lowest = np.argmin(np.where(missing, np.inf, stretches), axis=1)
    highest = np.argmax(np.where(missing, -np.inf, stretches), axis=1)
    return np.unique([0, *(starts + lowest), *(starts + highest), len(values) - 1])
