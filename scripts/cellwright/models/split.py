"""Which part of a record may be fitted, where one record has to serve for fit and validation."""

import numpy as np

from cellwright.refusal import Refusal
from cellwright.series.rest_reading import hidden_rest_level


def blocks(test_time_second, current_ampere, *, rest_second=120.0, rest_ampere):
    """Number of the block that each row belongs to, from 0: a load and the rest that follows it.

    A relaxation so stays together with the load that caused it. A rest at the very start ends no
    block. Where the reading of the record's rests is above what counts as rest, a rest is also what
    stays within that of it: an offset of the sensor must not turn rests into loads.

    Parameters
    ----------
    test_time_second, current_ampere : (n,) [s], [A].
    rest_second : shortest stretch without current that ends a block [s].
    rest_ampere : current below which the cell rests [A].

    Returns
    -------
    block : (n,) integers.
    """
    level = hidden_rest_level(test_time_second, current_ampere, rest_ampere)
    resting = np.minimum(np.abs(current_ampere), np.abs(current_ampere - level)) <= rest_ampere
    bounds = np.flatnonzero(np.diff(resting.astype(int), prepend=0, append=0))
    first, last = bounds[::2], bounds[1::2] - 1
    long = test_time_second[last] - test_time_second[first] >= rest_second
    starts = last[long & (first > 0)] + 1
    return np.searchsorted(starts, np.arange(len(resting)), side="right")


def fit_mask(test_time_second, current_ampere, *, rest_second=120.0, rest_ampere):
    """Cut a record into blocks at its rests: odd blocks fit, even blocks validate, counted from 1.

    Parameters
    ----------
    test_time_second, current_ampere, rest_second, rest_ampere : as in `blocks`.

    Returns
    -------
    fit : (n,) bool, True where the row may be fitted.

    Raises
    ------
    Refusal : fewer than two blocks: nothing would be left to validate.

    Source: campaign contract, role `split`.
    """
    settings = {"rest_second": rest_second, "rest_ampere": rest_ampere}
    block = blocks(test_time_second, current_ampere, **settings)
    if block[-1] == 0:
        raise Refusal(f"no rest of {rest_second:g} s inside the record to cut it at")
    return block % 2 == 0


def blocks_of_used(records, *, rest_second, rest_ampere):
    """Number of the block of each used row of several records, counted on from one to the next.

    Parameters
    ----------
    records : sequence of `records.Record`. rest_second, rest_ampere : as in `blocks`.

    Returns
    -------
    block : list of (used rows,) integers, one a record.
    """
    found, next_free = [], 0
    for record in records:
        time, current = record.test_time_second, record.current_ampere
        block = blocks(time, current, rest_second=rest_second, rest_ampere=rest_ampere)
        found.append(next_free + block[record.used])
        next_free += block.max() + 1
    return found
