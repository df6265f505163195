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


def test_z_of_independent_blocks_is_that_of_their_mean():
    """Without neighbours (every block another record) it is the one-sample statistic."""
    each = np.random.default_rng(5).normal(0.3, 1.0, 50)
    found = score.difference(each, np.zeros(50), np.arange(50))
    std = np.std(each) * np.sqrt(50)
    assert found.z == pytest.approx(each.sum() / std)
    assert found.total == pytest.approx(each.sum())


def test_models_that_do_not_differ_are_told_apart_as_often_as_chance_has_it():
    random, record = np.random.default_rng(11), np.repeat(np.arange(8), 10)
    found = [score.difference(random.standard_t(3, 80), np.zeros(80), record) for _ in range(400)]
    for name in ("z", "rank_z"):
        values = np.array([getattr(one, name) for one in found])
        assert np.std(values) == pytest.approx(1.0, abs=0.15)
        assert np.mean(values > 1.645) == pytest.approx(0.05, abs=0.03)


def test_neighbours_that_err_alike_count_as_fewer():
    random, record = np.random.default_rng(7), np.repeat(np.arange(20), 6)
    alike = np.repeat(random.normal(0.3, 1.0, 40), 3)
    z = score.difference(alike, np.zeros(120), record).z
    apart = score.difference(alike, np.zeros(120), np.arange(120)).z
    assert abs(z) < 0.85 * abs(apart)


def test_few_blocks_that_all_agree_are_as_sure_as_a_coin_that_falls_alike():
    """Ten of ten: 1 in 1024."""
    found = score.difference(np.arange(1.0, 11.0), np.zeros(10), np.zeros(10, int))
    assert found.rank_z == pytest.approx(3.097, abs=1e-3)
    turned = score.difference(np.zeros(10), np.arange(1.0, 11.0), np.zeros(10, int))
    assert turned.rank_z == -found.rank_z


def test_one_block_decides_no_rank():
    each = np.append(np.full(30, -0.01), 1000.0)
    found = score.difference(each, np.zeros(31), np.zeros(31, int))
    assert found.total > 0
    assert found.rank_z < -2.0


def test_models_that_are_the_same_do_not_differ():
    assert score.difference(np.ones(9), np.ones(9), np.zeros(9, int)) == (0.0, 0.0, 0.0)


def test_a_large_error_costs_by_its_logarithm():
    small, large = score.densities(np.array([1.0, 1e4]))
    assert large - small > -25
    assert score.densities(np.array([0.0]))[0] == 0.0


def test_each_block_counts_once_whatever_its_rows():
    residual, block = np.r_[np.full(90, 1.0), np.full(10, 3.0)], np.repeat([0, 1], [90, 10])
    assert score.rms_of_blocks(residual, block, np.ones(2, bool)) == pytest.approx(5**0.5)
