"""Compiled lags against their numpy twin, for every shape that they are called in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright.models import kernels
from cellwright.models.kernels import HOLDS, lag, lag_weights

STEPS = arrays(float, 30, elements=st.floats(0, 1e4))


@pytest.fixture
def twin(monkeypatch):
    def run(*inputs, **settings):
        with monkeypatch.context() as patch:
            patch.setattr(kernels, "function", lambda *_types, **_result: None)
            return lag(*inputs, **settings)

    return run


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("columns", [(), (1,), (4,)])
@pytest.mark.parametrize("tau", [7.0, np.linspace(0.1, 900.0, 400)])
def test_compiled_and_numpy_agree(twin, hold, columns, tau):
    rng = np.random.default_rng(1)
    step, drive = rng.exponential(3.0, 400), rng.normal(size=(401, *columns))
    settings = {"hold": hold, "initial": 0.3}
    np.testing.assert_allclose(
        lag(step, tau, drive, **settings), twin(step, tau, drive, **settings), rtol=0, atol=1e-12
    )


@settings(deadline=None, max_examples=40)
@given(STEPS, st.floats(1e-3, 1e5), st.sampled_from(HOLDS))
def test_weights_share_out_one(steps, tau, hold):
    """A constant input is a fixed point, and no weight leaves 0…1."""
    weights = np.array(lag_weights(steps, tau, hold=hold))
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, rtol=0, atol=1e-15)
    assert weights.min() >= -1e-16
    assert weights.max() <= 1.0
