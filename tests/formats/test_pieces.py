"""Formulas piece by piece give what numpy gives of whole columns, to the last bit."""

import numpy as np
import pytest

from cellwright.formats import pieces
from cellwright.formats.pieces import PIECE_ROWS

ROWS = (0, 1, 2, 3, 7, PIECE_ROWS - 1, PIECE_ROWS, PIECE_ROWS + 1, 2 * PIECE_ROWS + 1, 100_003)


@pytest.mark.parametrize("rows", ROWS)
def test_rows_and_columns_are_those_of_the_whole(rows):
    values = np.random.default_rng(rows).normal(size=rows)
    bent = values[1:-1] - 0.5 * (values[:-2] + values[2:])

    def bend(part):
        return part[1:-1] - 0.5 * (part[:-2] + part[2:])

    assert np.array_equal(pieces.column_of(bend, values, beside=2), bent)
    wanted = np.flatnonzero(bent > 1.0)
    assert np.array_equal(pieces.rows_where(lambda v: bend(v) > 1.0, values, beside=2), wanted)
    assert pieces.count_where(lambda v: bend(v) > 1.0, values, beside=2) == len(wanted)
    assert pieces.any_where(lambda v: bend(v) > 1.0, values, beside=2) == bool(len(wanted))
    assert pieces.all_where(lambda v: bend(v) <= 1.0, values, beside=2) == (not len(wanted))
    assert pieces.largest(values) == np.max(np.abs(values), initial=0.0)


@pytest.mark.parametrize("rows", ROWS)
def test_sums_of_pieces_are_those_of_all_steps(rows):
    steps = np.random.default_rng(rows).normal(size=rows)
    found, last = steps.copy(), None
    for part in pieces.pieces(rows):
        last = pieces.summed(found[part], last)
    assert found.tobytes() == np.cumsum(steps).tobytes()
    assert last is None if rows == 0 else last == found[-1]


@pytest.mark.parametrize("rows", ROWS)
@pytest.mark.parametrize("course", ["noise", "trend", "digits", "constant", "two values"])
def test_a_median_by_pieces_is_the_median(rows, course):
    rng = np.random.default_rng(rows + len(course))
    values = {
        "noise": rng.normal(size=rows),
        "trend": np.arange(rows) ** 2.0,
        "digits": np.round(rng.normal(size=rows), 1),
        "constant": np.full(rows, 0.1),
        "two values": np.where(np.arange(rows) < rows / 2, 1.0, 2.0),
    }[course]
    wanted = np.median(values) if rows else np.nan
    assert np.array_equal(pieces.median_of(lambda v: v, values), wanted, equal_nan=True)


def test_a_median_of_what_is_no_number_is_none():
    """One NaN, wherever it stands, as numpy has it; and values that the formula leaves out."""
    values = np.random.default_rng(5).normal(size=100_003)
    for row in (0, 64, 77_777):
        spoilt = values.copy()
        spoilt[row] = np.nan
        assert np.isnan(pieces.median_of(lambda v: v, spoilt))
    above = pieces.median_of(lambda v: v[v > 0], values)
    assert above == np.median(values[values > 0])
    assert np.isnan(pieces.median_of(lambda v: v[v > 9], values))
