"""Weights of a Savitzky-Golay filter: exact on polynomials of its order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellwright.numerics.linear import savitzky_golay_weights


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.integers(3, 30))
def test_the_filter_is_exact_on_polynomials_of_its_order(coefficients, half):
    offsets = np.arange(-half, half + 1) * 0.01
    values = np.polynomial.polynomial.polyval(offsets, coefficients)
    assert savitzky_golay_weights(half, 0.01, 0) @ values == pytest.approx(
        coefficients[0], abs=1e-9
    )
    assert savitzky_golay_weights(half, 0.01, 1) @ values == pytest.approx(
        coefficients[1], abs=1e-6
    )
