"""Rows by their voltage: the compiled count and the sort agree, and nothing is lost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright.protocols.ica import levels as module
from cellwright.protocols.ica.levels import tally

LEVELS = arrays(float, st.integers(2, 80), elements=st.integers(-9, 9).map(lambda k: k * 0.1))


@pytest.fixture
def by_sorting(monkeypatch):
    def run(*columns):
        with monkeypatch.context() as patch:
            patch.setattr(module, "function", lambda *_types, **_result: None)
            return tally(*columns)

    return run


@settings(deadline=None, max_examples=60)
@given(LEVELS)
def test_the_count_is_that_of_numpy(voltage):
    charge = np.linspace(-1.0, 2.0, len(voltage))
    levels = tally(voltage, charge)
    volt, rows = np.unique(voltage, return_counts=True)
    np.testing.assert_array_equal(levels.volt, volt)
    np.testing.assert_array_equal(levels.rows, rows)
    sums = [charge[voltage == one].sum() for one in volt]
    np.testing.assert_allclose(levels.charge_ampere_hour, sums, rtol=0, atol=1e-13)


@pytest.mark.parametrize("levels", [50, 3000, 60_000])
def test_compiled_and_sorted_agree(by_sorting, levels):
    rng = np.random.default_rng(levels)
    voltage = 3.0 + 1e-5 * rng.integers(0, levels, 100_000)
    charge = rng.normal(size=100_000)
    for one, other in zip(tally(voltage, charge), by_sorting(voltage, charge), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
