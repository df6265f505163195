"""Rows of a charge told apart by their voltage: how many, and how much charge, at each level."""

from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function


class Tally(NamedTuple):
    """Number of rows and charge at each distinct voltage of a record, in rising order (k,).

    volt [V], rows [1], charge_ampere_hour: sum over the rows [Ah].
    """

    volt: np.ndarray
    rows: np.ndarray
    charge_ampere_hour: np.ndarray


def tally(voltage_volt, charge_ampere_hour):
    """Number of rows and charge at each distinct voltage, compiled where that is possible.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour : (n,) [V], [Ah].

    Returns
    -------
    tally : Tally.
    """
    types = (count, array, array, count, array, array, array)
    kernel = function("tally", *types, result=count)
    room = min(32768, len(voltage_volt) // 2)  # half of the slots in ica.c
    if kernel is None or not room:
        return _tally_by_sorting(voltage_volt, charge_ampere_hour)
    rows = [np.ascontiguousarray(column, float) for column in (voltage_volt, charge_ampere_hour)]
    volt, sums = np.empty(room), np.zeros((2, 2, room))
    levels = kernel(len(rows[0]), *rows, room, volt, *sums)
    if levels < 0:
        return _tally_by_sorting(*rows)
    order = volt[:levels].argsort()
    sums = (sums[:, 0, :levels] + sums[:, 1, :levels])[:, order]
    return Tally(volt[order], *sums)


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


def _tally_by_sorting(voltage, charge):
    """As `tally`, without a compiler."""
    volt, level = np.unique(voltage, return_inverse=True)
    return Tally(volt, np.bincount(level) + 0.0, np.bincount(level, charge))
