"""Spikes: found where they are, and no true step touched."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.series.cleaning import spike_rows
from cellwright.series.spikes import spike_free


def rest_and_pulses(rows=400, seed=0):
    """A record with pulses of 20 samples and single-sample pulses, quantised to 0.3 mV."""
    current = np.zeros(rows)
    for start in range(30, rows - 30, 60):
        current[start : start + 20] = -3.0
    current[55::60] = -3.0
    rng = np.random.default_rng(seed)
    voltage = 3.7 + 0.03 * current + 3e-4 * rng.standard_normal(rows)
    return current, np.round(voltage / 3e-4) * 3e-4


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 99), st.sampled_from([20, 87, 125, 205, 265, 322]), st.floats(0.02, 0.5))
def test_a_spike_is_found_and_repaired(seed, row, height):
    current, voltage = rest_and_pulses(seed=seed)
    spiked = voltage.copy()
    spiked[row] += height * (-1) ** seed
    rows = spike_rows(current, spiked, current_step_ampere=0.03)
    assert rows.tolist() == [row]
    repaired = spike_free(np.arange(float(len(current))), current, spiked, rows)
    assert abs(repaired[row] - voltage[row]) < 3e-3
    np.testing.assert_array_equal(np.delete(repaired, row), np.delete(spiked, row))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 99), st.integers(-2, 2))
def test_a_step_of_the_current_is_never_touched(seed, lag):
    current, voltage = rest_and_pulses(seed=seed)
    assert spike_rows(current, np.roll(voltage, lag), current_step_ampere=0.03).size == 0


def test_a_short_pulse_half_seen_is_never_touched():
    """A pulse between two samples of a coarse grid: little of its current, much of its voltage."""
    current, voltage = rest_and_pulses()
    current[20] -= 0.02
    voltage[20] -= 0.05
    assert spike_rows(current, voltage, current_step_ampere=0.03).size == 0


def test_noise_is_no_spike():
    rng = np.random.default_rng(0)
    assert spike_rows(np.zeros(5000), 3.7 + 5e-3 * rng.standard_normal(5000),
                      current_step_ampere=0.01).size == 0  # fmt: skip


def test_too_short_a_record():
    assert spike_rows(np.zeros(4), np.zeros(4), current_step_ampere=1.0).size == 0
