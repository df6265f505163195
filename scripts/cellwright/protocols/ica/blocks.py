"""Readings of V(Q) for a fit: rows of a charge averaged in blocks, or by level of the converter."""

import numpy as np

MOST_READINGS = 4000
DITHERED = 0.1  # least share of steps downward at which noise blurs the converter's steps


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
    rows = [np.asarray(v, float) for v in (voltage_volt, charge_ampere_hour)]
    number = len(rows[0])
    size = -(-number // MOST_READINGS)
    *blocks, up, down = _blocks(*rows, size)
    if down < DITHERED * up and up < 0.5 * (number - 1):
        volt, counts, charge = tally(rows[0], np.maximum.accumulate(rows[1]))
        mean = charge / counts
        order = np.argsort(mean, kind="stable")
        return volt[order], mean[order], np.ones(len(mean))
    weight = np.ones(len(blocks[0]))
    weight[-1] = (number - size * (len(weight) - 1)) / size
    return *blocks, weight


def _blocks(voltage, charge, size):
    """Mean voltage and charge of blocks of rows, and how often the voltage steps up and down."""
    starts = np.arange(0, len(voltage), size)
    rows, change = np.diff(np.append(starts, len(voltage))), np.diff(voltage)
    columns = voltage, np.maximum.accumulate(charge)
    means = (np.add.reduceat(column, starts) / rows for column in columns)
    return *means, np.count_nonzero(change > 0), np.count_nonzero(change < 0)


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
