"""A cell that needs no physics: what the measurement chain and the writers are tested on."""

import numpy as np
import pytest

from virtual_lab import measurement
from virtual_lab.behaviour import Behaviour


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
        ambient_celsius=25.0,
        seed=1,
    )
