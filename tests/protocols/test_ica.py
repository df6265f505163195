"""Incremental capacity: peaks of a known curve through steps, noise and coarse sampling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.numerics.linear import savitzky_golay_weights
from cellwright.protocols.ica import (
    charge_peaks,
    constant_current_charge,
    incremental_capacity,
    peaks,
)
from cellwright.refusal import Refusal

VOLT = np.linspace(3.2, 4.15, 200_001)
PEAKS = ((3.55, 0.020, 0.8), (3.70, 0.025, 1.0), (3.95, 0.022, 0.6))


def bell(centre, width, area):
    return area * np.exp(-0.5 * ((VOLT - centre) / width) ** 2) / (width * np.sqrt(2 * np.pi))


DENSITY = 0.5 + sum(bell(*peak) for peak in PEAKS)
CHARGE = np.append(0, np.cumsum((DENSITY[1:] + DENSITY[:-1]) / 2 * np.diff(VOLT)))
TOPS = np.flatnonzero((DENSITY[1:-1] > DENSITY[:-2]) & (DENSITY[1:-1] > DENSITY[2:])) + 1


def record(rows, seed, step_volt=3e-4, noise_volt=5e-5):
    """Charge at constant current from 3.2 V to 4.15 V, as a converter with coarse steps sees it."""
    rng = np.random.default_rng(seed)
    charge = np.linspace(0, CHARGE[-1], rows)
    voltage = np.interp(charge, CHARGE, VOLT) + noise_volt * rng.standard_normal(rows)
    # Each seed has its own offset of the converter's levels.
    offset = rng.uniform(0, step_volt)
    return np.round((voltage - offset) / step_volt) * step_volt + offset, charge


def test_twenty_seeds_find_the_three_peaks_and_no_other():
    peaks_found = [peaks(incremental_capacity(*record(200_000, seed))) for seed in range(20)]
    assert {len(one.voltage_volt) for one in peaks_found} == {3}
    position = np.array([one.voltage_volt for one in peaks_found]) - VOLT[TOPS]
    height = np.array([one.height_ampere_hour_per_volt for one in peaks_found]) / DENSITY[TOPS] - 1
    assert np.sqrt(np.mean(position**2, axis=0)).max() < 1e-4
    assert np.abs(height.mean(axis=0)).max() < 0.01


def test_standard_deviation_of_the_position_is_of_the_right_size():
    peaks_found = [
        peaks(incremental_capacity(*record(20_000, s, noise_volt=5e-4))) for s in range(20)
    ]
    errors = np.array([one.voltage_volt for one in peaks_found]) - VOLT[TOPS]
    stated = np.mean([one.voltage_std_volt for one in peaks_found], axis=0)
    ratio = stated / np.sqrt(np.mean(errors**2, axis=0))
    assert ((ratio > 0.5) & (ratio < 3)).all()


def test_coarse_sampling_of_thirty_seconds_still_finds_them():
    peaks_found = peaks(incremental_capacity(*record(2400, 1, step_volt=1e-3, noise_volt=3e-4)))
    np.testing.assert_allclose(peaks_found.voltage_volt, VOLT[TOPS], atol=4e-3)


def test_areas_add_up_to_the_charge_of_the_curve():
    curve = incremental_capacity(*record(50_000, 2))
    total = np.diff(np.interp(curve.voltage_volt[[0, -1]], VOLT, CHARGE))[0]
    assert peaks(curve).area_ampere_hour.sum() == pytest.approx(total, rel=1e-3)


def test_a_straight_charge_has_no_peaks():
    rng = np.random.default_rng(0)
    voltage = np.linspace(3.2, 4.2, 20_000) + 2e-4 * rng.standard_normal(20_000)
    peaks_found = peaks(incremental_capacity(voltage, np.linspace(0, 2, 20_000)))
    assert all(len(column) == 0 for column in peaks_found)


def test_peaks_as_columns_are_numbered_and_none_is_a_refusal():
    columns = charge_peaks(incremental_capacity(*record(5000, 4)), c_rate=0.05, prominence=0.05)
    assert columns["peak"].tolist() == [1, 2, 3]
    assert columns["c_rate"].tolist() == [0.05] * 3
    straight = incremental_capacity(np.linspace(3, 4, 5000), np.linspace(0, 2, 5000))
    with pytest.raises(Refusal, match="no peaks: dQ/dV at 0"):
        charge_peaks(straight, c_rate=0.05, prominence=0.05)


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


@settings(max_examples=20, deadline=None)
@given(st.floats(0.1, 50), st.floats(-1, 1), st.floats(-5, 5))
def test_shift_and_scale_of_the_record_shift_and_scale_the_peaks(scale, shift, start):
    voltage, charge = record(5000, 3)
    plain = peaks(incremental_capacity(voltage, charge))
    moved = peaks(incremental_capacity(voltage + shift, start + scale * charge))
    np.testing.assert_allclose(moved.voltage_volt, plain.voltage_volt + shift, atol=2e-4)
    np.testing.assert_allclose(
        moved.height_ampere_hour_per_volt, scale * plain.height_ampere_hour_per_volt, rtol=5e-3
    )


@pytest.mark.parametrize(
    ("voltage", "charge", "reason"),
    [
        (np.linspace(3, 4, 20), np.linspace(0, 1, 20), "20 rows"),
        (np.linspace(4, 3, 500), np.linspace(0, 1, 500), "does not rise"),
        (3.3 + np.tile([0, 1e-3], 300) + np.linspace(0, 1e-3, 600), np.arange(600.0), "spans"),
    ],
)
def test_refusals(voltage, charge, reason):
    with pytest.raises(Refusal, match=reason):
        incremental_capacity(voltage, charge)


def steps(**columns):
    return {name: np.array(values) for name, values in columns.items()}


def test_the_largest_charge_counts_without_its_hold():
    table = steps(
        kind=["CC", "rest", "CC", "CCCV"],
        first_row=[0, 10, 20, 40],
        last_row=[9, 19, 39, 99],
        cv_first_row=[-1, -1, -1, 80],
        current_mean_ampere=[-1.0, 0.0, 1.0, 0.8],
    )
    charge = np.concatenate([np.linspace(0, -1, 20), np.linspace(-1, 3, 80)])
    assert constant_current_charge(table, charge) == (40, 79, 3)


def test_a_record_without_a_charge_is_refused():
    table = steps(
        kind=["CC"], first_row=[0], last_row=[9], cv_first_row=[-1], current_mean_ampere=[-1.0]
    )
    with pytest.raises(Refusal, match="no constant-current charge among 1 step"):
        constant_current_charge(table, np.linspace(0, -1, 10))
