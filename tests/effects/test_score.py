"""The score of models: blocks left out in closed form, and what a difference of models means."""

import numpy as np
import pytest

from cellwright.effects import score

ROWS, PARAMETERS, BLOCKS = 240, 5, 6


@pytest.fixture
def linear():
    """A linear model with priors: columns, measured values, prior precision, blocks of rows."""
    random = np.random.default_rng(3)
    columns = random.normal(size=(ROWS, PARAMETERS))
    measured = columns @ random.normal(size=PARAMETERS) + random.normal(size=ROWS)
    return columns, measured, np.diag([0.0, 0.1, 1.0, 10.0, 0.0]), np.arange(ROWS) % BLOCKS


@pytest.mark.parametrize("beside", [0.0, 0.01, -3.0])
def test_left_out_blocks_are_those_of_a_refit_without_them(linear, beside):
    """Also where the fit of all blocks ended beside its minimum."""
    columns, measured, prior, block = linear
    precision = columns.T @ columns + prior
    at = np.linalg.solve(precision, columns.T @ measured) + beside
    whitened = measured - columns @ at
    slope = columns.T @ whitened - prior @ at
    found = score.left_out(columns, whitened, precision, slope, block, BLOCKS)
    for k in range(BLOCKS):
        kept = block != k
        refitted = np.linalg.solve(
            columns[kept].T @ columns[kept] + prior, columns[kept].T @ measured[kept]
        )
        error = measured[~kept] - columns[~kept] @ refitted
        assert found.squares[k] == pytest.approx(np.mean(error**2), rel=1e-6)
        assert at - found.change[k] == pytest.approx(refitted, rel=1e-6)


def left_out_row_by_row(white, whitened, precision, slope, block, blocks):
    """The same by its formula, a block at a time: (change, grams, moments, sums)."""
    least = 1e-9 * np.diag(np.diag(precision))
    found = []
    for k in range(blocks):
        mine, w = white[block == k], whitened[block == k]
        gram, moment = mine.T @ mine, mine.T @ w
        change = np.linalg.solve(precision - gram + least, moment - slope)
        found.append((change, gram, moment, w @ w))
    return [np.array(each) for each in zip(*found, strict=True)]


@pytest.mark.parametrize("order", ["C", "F"])
def test_blocks_left_out_are_those_of_the_formula_also_without_rows(linear, order):
    """Rows of no block and blocks of no row, derivatives in either layout."""
    columns, measured, prior, block = linear
    block = np.where(np.arange(ROWS) % 7 == 0, -1, 2 * block)  # odd ones have no rows
    columns = np.asarray(columns * np.geomspace(1e-3, 1e3, PARAMETERS), order=order)
    given = columns, measured, columns.T @ columns + prior, 0.1 * np.arange(PARAMETERS), block
    found = score.left_out(*given, 2 * BLOCKS)
    for one, other in zip(found, left_out_row_by_row(*given, 2 * BLOCKS), strict=False):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(other).max())
    assert found.rows[1::2].max() == 0
    assert np.isnan(found.squares[1::2]).all()
    assert np.isfinite(found.squares[::2]).all()


def test_a_block_holds_all_channels_of_its_rows():
    side = np.zeros(12, int), np.repeat([0.05, 0.55], 6), np.ones(12, bool)
    blocks = score.blocks_of(side, side, channels=2)
    assert blocks.fitted.tolist() == 2 * ([0] * 6 + [1] * 6)
    assert blocks.judging.tolist() == 2 * ([2] * 6 + [3] * 6)


def test_what_one_block_alone_tells_is_predicted_to_be_absent():
    """A size of 7 that only block 1 shows: without that block nothing is known of it."""
    columns = np.where(np.arange(20) >= 10, 1.0, 0.0)[:, None]
    block, precision = np.repeat([0, 1], 10), np.array([[10.0]])
    vague = np.array([1e-4]), np.array([7.0])
    nothing, still = np.zeros(20), np.zeros(1)
    found = score.left_out(columns, nothing, precision, still, block, 2, vague=vague)
    assert found.squares == pytest.approx([0.0, 49.0], rel=1e-3)


def test_blocks_are_a_records_tenths_of_the_soc_with_five_rows():
    soc = np.repeat([0.05, 0.55, 0.95], [6, 4, 5])
    file, rows = np.zeros(15, int), np.ones(15, bool)
    blocks = score.blocks_of((file, soc, rows), (file[:6], soc[:6], rows[:6]))
    assert blocks.fitted.tolist() == [0] * 6 + [-1] * 4 + [1] * 5
    assert blocks.judging.tolist() == [2] * 6
    assert blocks.record.tolist() == [0, 0, 1]
    assert blocks.band.tolist() == [0, 9, 0]
    assert blocks.judges.tolist() == [False, False, True]


def test_rows_that_do_not_count_are_in_no_block():
    rows = np.zeros(8, bool)
    blocks = score.blocks_of(*[(np.zeros(8, int), np.full(8, 0.5), rows)] * 2)
    assert (blocks.fitted == -1).all()
    assert len(blocks.record) == 0


def test_a_large_error_costs_by_its_logarithm():
    small, large = score.densities(np.array([1.0, 1e4]))
    assert large - small > -25
    assert score.densities(np.array([0.0]))[0] == 0.0


def test_each_block_counts_once_whatever_its_rows():
    residual, block = np.r_[np.full(90, 1.0), np.full(10, 3.0)], np.repeat([0, 1], [90, 10])
    assert score.rms_of_blocks(residual, block, np.ones(2, bool)) == pytest.approx(5**0.5)
