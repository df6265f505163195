"""Rows by their voltage: nothing is lost."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright.protocols.ica.levels import tally

LEVELS = arrays(float, st.integers(2, 80), elements=st.integers(-9, 9).map(lambda k: k * 0.1))


@settings(deadline=None, max_examples=60)
@given(LEVELS)
def test_the_count_is_that_of_numpy(voltage):
    charge = np.linspace(-1.0, 2.0, len(voltage))
    levels, counts, sums = tally(voltage, charge)
    volt, rows = np.unique(voltage, return_counts=True)
    np.testing.assert_array_equal(levels, volt)
    np.testing.assert_array_equal(counts, rows)
    wanted = [charge[voltage == one].sum() for one in volt]
    np.testing.assert_allclose(sums, wanted, rtol=0, atol=1e-13)
