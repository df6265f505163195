"""How far predictions miss: root mean square and share of the variance explained."""

import numpy as np


def rms(values):
    """Root mean square of errors, in their unit; NaN where there are none.

    Parameters
    ----------
    values : array of any shape.
    """
    values = np.asarray(values, float)
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else np.nan


def r_squared(value, predicted):
    """Share of the variance that a prediction explains; NaN where nothing varies.

    Parameters
    ----------
    value, predicted : (n,) in one unit.
    """
    spread = np.sum((value - value.mean()) ** 2)
    return float(1 - np.sum((value - predicted) ** 2) / spread) if spread > 0 else np.nan
