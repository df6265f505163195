"""Rows of a charge told apart by their voltage: how many, and how much charge, at each level."""

import numpy as np


def tally(voltage_volt, charge_ampere_hour):
    """Number of rows and charge at each distinct voltage.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour : (n,) [V], [Ah].

    Returns
    -------
    volt, rows, charge_ampere_hour : (k,) in rising order; the charge summed over the rows [V], [1],
        [Ah].
    """
    volt, level = np.unique(voltage_volt, return_inverse=True)
    return volt, np.bincount(level) + 0.0, np.bincount(level, charge_ampere_hour)


def rises(voltage_volt):
    """Whether the last tenth of the rows lies above the first, by medians of 500 rows of each.

    Parameters
    ----------
    voltage_volt : (n,) rows of a charge, at least ten [V].
    """
    tenth = max(len(voltage_volt) // 10, 1)
    sampled = slice(None, None, tenth // 500 + 1)
    first, last = voltage_volt[:tenth][sampled], voltage_volt[-tenth:][sampled]
    return bool(np.median(last) > np.median(first))
