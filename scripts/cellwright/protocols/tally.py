"""The rows of a charge by their voltage: what dQ/dV needs of them, without a sort of all rows."""

from typing import NamedTuple

import numpy as np

from cellwright.native import array, count, function

ROOM = 32768  # levels; half of the slots in ica.c


class Tally(NamedTuple):
    """Distinct voltages of a record in rising order, and what lies at each (k,).

    volt [V], rows [1], charge_ampere_hour: sum over the rows [Ah]. scatter_volt: white noise of
    one row along the axis of voltage, from the second differences [V].
    """

    volt: np.ndarray
    rows: np.ndarray
    charge_ampere_hour: np.ndarray
    scatter_volt: float


def tally(voltage_volt, charge_ampere_hour):
    """Rows and charge at each distinct voltage.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour : (n,) [V], [Ah].

    Returns
    -------
    tally : Tally.
    """
    types = (count, array, array, count, array, array, array, array)
    kernel = function("tally", *types, result=count)
    room = min(ROOM, len(voltage_volt) // 2)
    if kernel is None or not room:
        return _tally_by_sorting(voltage_volt, charge_ampere_hour)
    rows = (
        np.ascontiguousarray(voltage_volt, float),
        np.ascontiguousarray(charge_ampere_hour, float),
    )
    volt, sums, bend = np.empty(room), np.zeros((2, 2, room)), np.empty(1)
    levels = kernel(len(rows[0]), *rows, room, volt, *sums, bend)
    if levels < 0:
        return _tally_by_sorting(*rows)
    order = volt[:levels].argsort()
    sums = (sums[:, 0, :levels] + sums[:, 1, :levels])[:, order]
    return Tally(volt[order], *sums, _scatter(bend[0], len(rows[0])))


def volt_at_rank(counted, rank):
    """Voltage at a place in the order of rising voltage.

    Parameters
    ----------
    counted : Tally.
    rank : (m,) places from 0 [1].

    Returns
    -------
    voltage_volt : (m,) [V].
    """
    return counted.volt[np.searchsorted(np.cumsum(counted.rows), rank, side="right")]


def _tally_by_sorting(voltage, charge):
    volt, place = np.unique(voltage, return_inverse=True)
    bend = np.sum(np.diff(voltage, 2) ** 2)
    return Tally(
        volt, np.bincount(place) + 0.0, np.bincount(place, charge), _scatter(bend, len(voltage))
    )


def _scatter(bend, rows):
    return float(np.sqrt(bend / max(rows - 2, 1) / 6))
