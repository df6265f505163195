"""Readings of a charge: blocks of rows, levels of a converter without noise."""

import numpy as np
import pytest

from cellwright.protocols.ica.blocks import MOST_READINGS, readings


def rows_of(number, seed):
    """A noisy rising voltage and a charge that falls back now and then."""
    rng = np.random.default_rng(seed)
    charge = np.linspace(0, 3, number)
    charge[rng.integers(1, number, number // 50)] -= 0.01
    return 3.2 + 0.3 * charge + 1e-3 * rng.standard_normal(number), charge


def test_blocks_keep_the_mean_of_all_rows_and_never_fall_in_charge():
    voltage, charge = rows_of(30_011, 2)
    volt, ampere_hour, rows = readings(voltage, charge)
    assert len(volt) <= MOST_READINGS
    assert np.average(volt, weights=rows) == pytest.approx(voltage.mean(), rel=1e-12)
    highest = np.maximum.accumulate(charge)
    assert np.average(ampere_hour, weights=rows) == pytest.approx(highest.mean(), rel=1e-12)
    assert np.all(np.diff(ampere_hour) >= 0)


def test_levels_of_a_converter_without_noise_count_once_each():
    charge = np.linspace(0, 1, 5000)
    voltage = 3.0 + np.round(charge / 0.01) * 0.01
    volt, ampere_hour, rows = readings(voltage, charge)
    assert len(volt) == len(np.unique(voltage))
    assert np.all(rows == 1)
    assert ampere_hour[50] == pytest.approx(0.5, abs=1e-4)
