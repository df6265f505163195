"""Records cut into blocks, of which some are fitted and the others predicted."""

import numpy as np

from cellwright.refusal import Refusal
from cellwright.series.rest_current import hidden_rest_level

MOST_PARTS = 16  # of a record without rests: of a whole discharge about as long as knots are apart
PART_RESTS = 2.0  # least length of a part, in rests that would have cut the record


def blocks(test_time_second, current_ampere, *, rest_second=120.0, rest_ampere):
    """Number of the block of each row, from 0; a block is a load and the rest that follows it.

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


def parts(test_time_second, current_ampere, *, rest_second=120.0, rest_ampere):
    """Number of the part of each row, from 0, of a record without a rest that could cut it.

    Parts are equally long, `MOST_PARTS` of them or as many as are `PART_RESTS` rests long, so that
    what relaxes within such a rest does not reach over the next part. Each cut lies where the
    current is smallest within a quarter of a part, nearest to the even division.

    Parameters
    ----------
    test_time_second, current_ampere, rest_second, rest_ampere : as in `blocks`; currents within a
        `rest_ampere` of each other count as equal.

    Returns
    -------
    part : (n,) integers; all 0 where the record is too short for two parts.
    """
    time, size = test_time_second, np.abs(current_ampere) // rest_ampere
    length = time[-1] - time[0]
    count = min(int(length // (PART_RESTS * rest_second)), MOST_PARTS)
    if count < 2:
        return np.zeros(len(time), int)
    off = np.abs(time - (time[0] + length * np.arange(1, count)[:, None] / count))
    near = off <= np.maximum(length / count / 4, off.min(axis=1, keepdims=True))
    cuts = [np.lexsort((row, size, ~inside))[0] for row, inside in zip(off, near, strict=True)]
    return np.searchsorted(np.unique(cuts), np.arange(len(time)), side="left")


def fit_mask(test_time_second, current_ampere, *, rest_second=120.0, rest_ampere):
    """Rows of a record that may be fitted: its odd blocks, counted from 1; even ones validate.

    A record without a rest to cut it at is cut into `parts`.

    Parameters
    ----------
    test_time_second, current_ampere, rest_second, rest_ampere : as in `blocks`.

    Returns
    -------
    fit : (n,) bool, True where the row may be fitted.

    Raises
    ------
    Refusal : fewer than two blocks or parts: nothing would be left to validate.

    Source: campaign contract, role `split`.
    """
    settings = {"rest_second": rest_second, "rest_ampere": rest_ampere}
    block = blocks(test_time_second, current_ampere, **settings)
    if block[-1] == 0:
        block = parts(test_time_second, current_ampere, **settings)
    if block[-1] == 0:
        length = test_time_second[-1] - test_time_second[0]
        raise Refusal(
            f"no rest of {rest_second:g} s inside the record to cut it at, and its {length:.0f} s "
            f"are too short for two parts of {PART_RESTS * rest_second:g} s without one"
        )
    return block % 2 == 0


def blocks_of_used(records, *, rest_second, rest_ampere):
    """Block number of each used row of several records, counted through all records.

    Where all of them are one block, so that nothing could be left out, the record is cut into
    `parts`.

    Parameters
    ----------
    records : sequence of Record. rest_second, rest_ampere : as in `blocks`.

    Returns
    -------
    block : list of (used rows,) integers, one a record.
    """
    rest = {"rest_second": rest_second, "rest_ampere": rest_ampere}
    numbers = _numbered(records, blocks, rest)
    alone = len(np.unique(np.concatenate(numbers))) < 2
    return _numbered(records, parts, rest) if alone else numbers


def _numbered(records, cut, rest):
    """Block number of each used row of several records by one way of cutting them."""
    numbers, next_free = [], 0
    for record in records:
        block = cut(record.test_time_second, record.current_ampere, **rest)
        numbers.append(next_free + block[record.used])
        next_free += block.max() + 1
    return numbers
