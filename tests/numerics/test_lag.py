"""Compiled lags against their numpy twin, for every shape that they are called in."""

import ctypes
import os
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cellwright import native
from cellwright.numerics import lags
from cellwright.numerics.lags import HOLDS, lag, lag_weights

STEPS = arrays(float, 30, elements=st.floats(0, 1e4))


@pytest.fixture
def twin(monkeypatch):
    def run(*inputs, **settings):
        with monkeypatch.context() as patch:
            patch.setattr(lags, "function", lambda *_types, **_result: None)
            return lag(*inputs, **settings)

    return run


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("columns", [(), (1,), (4,)])
@pytest.mark.parametrize("tau", [7.0, np.linspace(0.1, 900.0, 400)])
def test_compiled_and_numpy_agree(twin, hold, columns, tau):
    rng = np.random.default_rng(1)
    step, drive = rng.exponential(3.0, 400), rng.normal(size=(401, *columns))
    step[:200] = rng.choice([0.0, 0.1, 0.3, 10.0], 200)  # of a clock in tenths, and edges
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


COMPILER = next((c for c in ("cc", "gcc", "clang") if shutil.which(c)), None)
compiled = pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")


@compiled
def test_the_sources_build_without_a_word_and_hold_every_kernel():
    """The library of today's sources: built here, where no test before has asked for it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        about = (COMPILER, native.FLAGS, native.SOURCES, native.HEADERS)
        path = native.library_file("kernels", *about)
    assert path
    library = ctypes.CDLL(str(path))
    asked = [p.read_text() for p in (Path(native.__file__).parents[1]).rglob("*.py")]
    names = {n for text in asked for n in re.findall(r'\bfunction\(\s*"(\w+)"', text)}
    assert "lag" in names
    assert [name for name in sorted(names) if not hasattr(library, name)] == []


@compiled
def test_a_broken_source_is_said_and_gives_no_library(tmp_path):
    broken = tmp_path / "broken.c"
    broken.write_text("double half(double x) { return x / ; }")
    sources = [native.SOURCES[0], broken]
    with pytest.warns(RuntimeWarning, match="no compiled kernels: .*broken.c"):
        assert not native._built(COMPILER, tmp_path / "kernels.so", native.FLAGS, sources)
    assert not (tmp_path / "kernels.so").exists()


@compiled
def test_kernels_serve_where_a_compiler_is_and_not_where_they_are_switched_off():
    ask = "from cellwright.native import *; print(build(), function('lag') is not None)"
    for value, expected in (("1", "True True"), ("0", "False False")):
        environment = os.environ | {
            "CELLWRIGHT_NATIVE": value,
            "PYTHONPATH": os.pathsep.join(sys.path),
        }
        run = subprocess.run(
            [sys.executable, "-c", ask], env=environment, capture_output=True, text=True, check=True
        )
        assert run.stdout.strip() == expected
