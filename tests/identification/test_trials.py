"""Trials of held numbers: the lowest of costs, found from few of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import data, measured

from cellwright.identification.columns import Held
from cellwright.identification.identify import DIFFUSION_SECOND
from cellwright.identification.search import cheapest, cost_of, lowest, settled, shared_of


@given(st.integers(1, 12), st.integers(0, 11), st.integers(0, 11), st.integers(0, 9))
def test_the_lowest_of_a_valley_is_found_from_anywhere(count, bottom, start, seed):
    bottom, start = min(bottom, count - 1), min(start, count - 1)
    steps = np.random.default_rng(seed).uniform(0.1, 5.0, count)
    costs = [steps[min(n, bottom) : max(n, bottom)].sum() for n in range(count)]
    asked = []
    found = lowest(lambda n: asked.append(n) or costs[n], count, start=start)
    assert found == bottom
    assert len(asked) == len(set(asked)) <= abs(bottom - start) + 3


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_diffusion_time_found_from_few_trials_is_that_of_all(seed):
    shared = shared_of(data(*measured(seed, seconds=6000)))
    start = settled(shared, Held((1.0, 30.0)))
    tries = [start.held._replace(diffusion_second=s) for s in (None, *DIFFUSION_SECOND)]
    factor = start.solution.factor
    few = cheapest(shared, tries, factor, valley=True)
    of_all = cheapest(shared, tries, factor)
    assert few == of_all
    assert cost_of(shared, few, factor) <= cost_of(shared, start.held, factor)
