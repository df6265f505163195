"""Current that a record logs in its rests, found by how the voltage settles."""

import numpy as np
import pytest

from cellwright.series.rest_current import offset_at_rest

TIME = np.arange(0.0, 7200.0, 10.0)
RESTS = (TIME >= 1800) & (TIME < 3600) | (TIME >= 5400)
LIMITS = {"least_ampere": 0.01, "most_ampere": 0.08}


def measured(offset, settling=True):
    """Two loads of 3 A and the rests after them: time, current, voltage."""
    current = np.where(RESTS, 0.0, -3.0) + offset
    age = TIME % 1800
    settled = 3.7 - 0.1 * np.exp(-age / 300) if settling else 3.7 - 2e-5 * age
    return TIME, current, np.where(RESTS, settled, 3.4 - 1e-4 * age)


@pytest.mark.parametrize("offset", [0.02, -0.03])
def test_an_offset_is_read_where_the_voltage_settles(offset):
    assert offset_at_rest(*measured(offset), **LIMITS) == pytest.approx(offset)


@pytest.mark.parametrize("seed", range(5))
def test_readings_that_scatter_do_not_hide_how_little_a_voltage_settles(seed):
    """A cell of little resistance: its rests move by 5 mV, and readings scatter by 1.5 mV."""
    time, current, voltage = measured(-0.03)
    voltage = np.where(RESTS, 3.7 + (voltage - 3.7) / 20, voltage)
    voltage = voltage + np.random.default_rng(seed).normal(0, 1.5e-3, len(voltage))
    assert offset_at_rest(time, current, voltage, **LIMITS) == pytest.approx(-0.03)


def test_a_small_load_under_which_the_voltage_falls_evenly_is_no_rest():
    assert offset_at_rest(*measured(-0.03, settling=False), **LIMITS) == 0.0


def test_a_reading_that_counts_as_rest_is_none():
    assert offset_at_rest(*measured(0.005), **LIMITS) == 0.0
