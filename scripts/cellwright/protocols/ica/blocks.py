"""Readings of V(Q) for a fit: rows of a charge averaged in blocks, or by level of the converter."""

import numpy as np

from cellwright.native import array, count, function, integers
from cellwright.protocols.ica.levels import tally

MOST_READINGS = 4000


def readings(voltage_volt, charge_ampere_hour):
    """Readings of V(Q) that a fit may take as independent: voltage, charge, rows behind each.

    Neighbouring rows are averaged, at most 4,000 blocks. A converter without noise reads the same
    voltage many times and then the next: there the mean charge of each of its levels counts, since
    the error of rows at one level is the same error. Charge counts as the highest so far.

    Parameters
    ----------
    voltage_volt, charge_ampere_hour : (n,) rows of one constant-current charge.

    Returns
    -------
    voltage, charge, rows : (m,), charge rising.
    """
    rows = [np.ascontiguousarray(v, float) for v in (voltage_volt, charge_ampere_hour)]
    number = len(rows[0])
    size = -(-number // MOST_READINGS)
    *blocks, up, down = _blocks(*rows, size)
    # From a tenth of steps downward on, noise blurs the converter's steps.
    if down < 0.1 * up and up < 0.5 * (number - 1):
        volt, count_at, charge = tally(rows[0], np.maximum.accumulate(rows[1]))
        mean = charge / count_at
        order = np.argsort(mean, kind="stable")
        return volt[order], mean[order], np.ones(len(mean))
    weight = np.ones(len(blocks[0]))
    weight[-1] = (number - size * (len(weight) - 1)) / size
    return *blocks, weight


def _blocks(voltage, charge, size):
    """Mean voltage and charge of blocks of rows, and how often the voltage steps up and down."""
    types = (count, array, array, count, array, array, integers)
    kernel, starts = function("charge_blocks", *types), np.arange(0, len(voltage), size)
    if kernel is None:
        rows, change = np.diff(np.append(starts, len(voltage))), np.diff(voltage)
        columns = voltage, np.maximum.accumulate(charge)
        means = (np.add.reduceat(column, starts) / rows for column in columns)
        return *means, np.count_nonzero(change > 0), np.count_nonzero(change < 0)
    means, steps = (np.empty(len(starts)), np.empty(len(starts))), np.empty(2, np.int64)
    kernel(len(voltage), voltage, charge, size, *means, steps)
    return *means, int(steps[0]), int(steps[1])
