"""A cell that needs no physics: what the measurement chain and the writers are tested on.

And the records of the committed campaign, read once.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from cellwright import formats
from virtual_lab import campaigns
from virtual_lab.behaviour import Behaviour
from virtual_lab.chamber import steady
from virtual_lab.instruments import measurement

ROOT = Path(__file__).resolve().parents[2]
# Small matrices: threads of the linear algebra only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Cells and campaigns of known truth, as the core's tests have them, and examples of the pages.
KNOWN = ("tests/known", "tests/workflow", "lab/tests/known", "docs/examples")
sys.path[:0] = [str(ROOT / folder) for folder in KNOWN]


def constant(current_ampere, duration_second):
    """A step of a steady current, 3.6 V and 10 milliohm, at 25 °C."""
    return Behaviour(
        duration_second=duration_second,
        current=lambda second: np.full(np.shape(second), current_ampere),
        voltage=lambda second: np.full(np.shape(second), 3.6 + 0.01 * current_ampere),
        temperature=lambda second: np.full(np.shape(second), 25.0),
    )


@pytest.fixture
def ideal():
    """Columns of a rest, an hour of discharge at 2 A and a quarter of an hour of charge at 1 A."""
    return measurement.record(
        [constant(0.0, 60.0), constant(-2.0, 3600.0), constant(1.0, 900.0)],
        periods_second=[5.0, 1.0, 0.5],
        chamber=steady(25.0),
        seed=1,
    )


@pytest.fixture(scope="session")
def demo_records():
    """Each record of the demo with its test, currents positive on charge."""
    found = []
    for test in campaigns.plan("demo").tests:
        if test.steps is not None:
            columns = formats.read((ROOT / test.file).read_bytes(), name=test.file).columns
            columns["current_ampere"] = columns["current_ampere"] * (
                1 - 2 * test.discharge_positive
            )
            found.append((test, columns))
    return found
