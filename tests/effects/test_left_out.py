"""The model of a search fitted without some blocks: which, and that they had no influence."""

import numpy as np
import pytest
import small_plant
from small_plant import Truth, case

from cellwright.effects.member import folds

TRUTH = Truth(asymmetry=0.3)
SIZE = "resistance_asymmetry.charge_resistance_excess_relative"
REST_SECOND = 60.0


@pytest.fixture(scope="module")
def searched():
    found, result, _ = small_plant.searched(TRUTH)
    return case(TRUTH), result.last, found.filters.noise


def test_every_row_is_left_out_once(searched):
    cell, last, noise = searched
    steps = folds(cell, last, noise, split_rest_second=REST_SECOND)
    assert len(steps) == 4
    blocks = sorted(tuple(block) for fold in steps for block in fold["blocks"])
    assert len(set(blocks)) == len(blocks)
    for file, test in enumerate(cell.fit.tests):
        spans = [(begin, end) for name, begin, end in blocks if name == test]
        second = cell.fit.second[cell.fit.part([file])]
        inside = [(second >= begin) & (second <= end) for begin, end in spans]
        assert (np.sum(inside, axis=0) == 1).all()


def test_the_size_of_the_effect_hardly_needs_a_fold(searched):
    cell, last, noise = searched
    sizes = [f["values"][SIZE] for f in folds(cell, last, noise, split_rest_second=REST_SECOND)]
    assert last.solution.values[SIZE] == pytest.approx(0.3, abs=0.06)
    np.testing.assert_allclose(sizes, 0.3, atol=0.08)
    assert len(set(sizes)) == len(sizes)


def test_a_spoiled_block_moves_all_folds_but_its_own(searched):
    cell, last, noise = searched
    clean = folds(cell, last, noise, split_rest_second=REST_SECOND)
    test, begin, end = clean[1]["blocks"][0]
    stack = cell.fit
    rows = stack.part([stack.tests.index(test)]) & (stack.second >= begin) & (stack.second <= end)
    volt = np.where(rows, stack.voltage_volt + 0.02 * np.sign(stack.current_ampere), 0.0)
    volt = np.where(rows, volt, stack.voltage_volt)
    spoiled = cell._replace(fit=stack._replace(voltage_volt=volt))
    moved = folds(spoiled, last, noise, split_rest_second=REST_SECOND)
    shift = [
        abs(a["values"]["log_r0"] - b["values"]["log_r0"])
        for a, b in zip(clean, moved, strict=True)
    ]
    # Its own fold begins where the whole fit ended, which is all that it could know of the block.
    assert shift[1] < 1e-6
    assert min(shift[0], shift[2], shift[3]) > 1e-4


def test_one_block_has_no_folds(searched):
    cell, last, noise = searched
    assert folds(cell, last, noise, split_rest_second=1e9)[0]["values"].keys() >= {"log_r0"}
    single = cell._replace(fit=cell.fit._replace(used=cell.fit.part([0])))
    assert folds(single, last, noise, split_rest_second=1e9) == []
