"""The lowest of costs that fall to it and rise from there, found from few of them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cellwright.identification.search import lowest


@given(st.integers(1, 12), st.integers(0, 11), st.integers(0, 11), st.integers(0, 9))
def test_the_lowest_of_a_valley_is_found_from_anywhere(count, bottom, start, seed):
    bottom, start = min(bottom, count - 1), min(start, count - 1)
    steps = np.random.default_rng(seed).uniform(0.1, 5.0, count)
    costs = [steps[min(n, bottom) : max(n, bottom)].sum() for n in range(count)]
    asked = []
    found = lowest(lambda n: asked.append(n) or costs[n], count, start=start)
    assert found == bottom
    assert len(asked) == len(set(asked)) <= abs(bottom - start) + 3
