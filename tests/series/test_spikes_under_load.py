"""Spikes of the voltage while the current changes every second."""

import numpy as np
import pytest

from cellwright.series.spikes import spike_free, spikes_under_load

OHM = 0.03


@pytest.fixture
def drive():
    """An hour of a drive at 1 Hz: time [s], current [A], voltage [V] of a cell with one RC."""
    rng = np.random.default_rng(11)
    current = np.convolve(rng.normal(0, 6, 3604), np.ones(5) / 5, "valid")
    slow = np.zeros(3600)
    for row in range(1, 3600):
        slow[row] = slow[row - 1] * np.exp(-1 / 30) + 0.02 * (1 - np.exp(-1 / 30)) * current[row]
    noise = rng.normal(0, 0.0005, 3600)
    return np.arange(3600.0), current, 3.7 + OHM * current + slow + noise


def test_a_true_step_is_no_spike(drive):
    assert not len(spikes_under_load(*drive, limit_volt=0.02))


def test_spikes_beyond_what_the_current_makes_are_found_and_replaced(drive):
    time, current, voltage = drive
    rows = np.arange(100, 3500, 170)
    spoilt = voltage.copy()
    spoilt[rows] += np.where(rows % 2, 0.6, -0.6)
    found = spikes_under_load(time, current, spoilt, limit_volt=0.02)
    assert set(found) <= set(rows)
    assert len(found) >= 0.9 * len(rows)
    repaired = spike_free(time, current, spoilt, found)
    # By the neighbours alone it would be wrong by what the current does: about 0.1 V.
    assert np.abs(repaired - voltage)[found].max() < 0.03


def test_nothing_is_said_where_the_channels_lag(drive):
    time, current, voltage = drive
    spoilt = np.roll(voltage, 1)
    spoilt[500] += 0.6
    assert not len(spikes_under_load(time, current, spoilt, limit_volt=0.02))
