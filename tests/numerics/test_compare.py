"""Which of two models predicts better: the statistic, its level by chance, and what decides it."""

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from cellwright.numerics.compare import compare


def test_z_of_independent_blocks_is_that_of_their_mean():
    """Without neighbours (every block another record) it is the one-sample statistic."""
    each = np.random.default_rng(5).normal(0.3, 1.0, 50)
    found = compare(each, np.zeros(50), record=np.arange(50))
    assert found.z == pytest.approx(ttest_1samp(each, 0.0).statistic)
    assert compare(each, np.zeros(50)) == pytest.approx(found)
    assert compare(each, np.zeros(50), share=np.full(50, 0.3)).z == pytest.approx(found.z)
    assert found.total == pytest.approx(each.sum())


def test_models_that_do_not_differ_are_told_apart_as_often_as_chance_has_it():
    random, record = np.random.default_rng(11), np.repeat(np.arange(8), 10)
    found = [compare(random.standard_t(3, 80), np.zeros(80), record=record) for _ in range(400)]
    for name in ("z", "rank_z"):
        values = np.array([getattr(one, name) for one in found])
        assert np.std(values) == pytest.approx(1.0, abs=0.15)
        assert np.mean(values > 1.645) == pytest.approx(0.05, abs=0.03)


def test_neighbours_that_err_alike_count_as_fewer():
    random, record = np.random.default_rng(7), np.repeat(np.arange(20), 6)
    alike = np.repeat(random.normal(0.3, 1.0, 40), 3)
    z = compare(alike, np.zeros(120), record=record).z
    apart = compare(alike, np.zeros(120), record=np.arange(120)).z
    assert abs(z) < 0.85 * abs(apart)


def test_few_blocks_that_all_agree_are_as_sure_as_a_coin_that_falls_alike():
    """Ten of ten: 1 in 1024."""
    found = compare(np.arange(1.0, 11.0), np.zeros(10), record=np.zeros(10, int))
    assert found.rank_z == pytest.approx(3.097, abs=1e-3)
    turned = compare(np.zeros(10), np.arange(1.0, 11.0), record=np.zeros(10, int))
    assert turned.rank_z == -found.rank_z


def test_one_block_decides_no_rank():
    each = np.append(np.full(30, -0.01), 1000.0)
    found = compare(each, np.zeros(31), record=np.zeros(31, int))
    assert found.total > 0
    assert found.rank_z < -2.0


def test_models_that_are_the_same_do_not_differ():
    assert compare(np.ones(9), np.ones(9), record=np.zeros(9, int)) == (0.0, 0.0, 0.0)


def test_blocks_that_count_more_weigh_more():
    """A mean over two conditions, of 3 and 30 blocks, that count alike."""
    random = np.random.default_rng(2)
    each = np.concatenate([random.normal(1.0, 0.1, 3), random.normal(-1.0, 0.1, 30)])
    share = np.repeat([0.5 / 3, 0.5 / 30], [3, 30])
    assert compare(each, np.zeros(33)).z < -3
    assert abs(compare(each, np.zeros(33), share=share).z) < 1


@pytest.mark.parametrize(("each", "z"), [([1.0, 1.5], 0.0), ([2.0, 2.0, 2.0], np.inf)])
def test_two_blocks_tell_no_scatter_and_equal_ones_leave_no_doubt(each, z):
    assert compare(np.array(each), np.zeros(len(each))).z == z
    assert compare(np.zeros(len(each)), np.array(each)).z == -z
