"""Incremental capacity: peaks of a known curve through steps, noise and coarse sampling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.protocols.ica.charge import (
    charge_slope,
    constant_current_charge,
    constant_rows,
    ica_peaks,
)
from cellwright.protocols.ica.parts import parts_joined
from cellwright.protocols.ica.spline import slope_peaks
from cellwright.refusal import Refusal
from cellwright.result import Result

VOLT = np.linspace(3.2, 4.15, 200_001)
PEAKS = ((3.55, 0.020, 0.8), (3.70, 0.025, 1.0), (3.95, 0.022, 0.6))


def bell(centre, width, area):
    return area * np.exp(-0.5 * ((VOLT - centre) / width) ** 2) / (width * np.sqrt(2 * np.pi))


DENSITY = 0.5 + sum(bell(*peak) for peak in PEAKS)
CHARGE = np.append(0, np.cumsum((DENSITY[1:] + DENSITY[:-1]) / 2 * np.diff(VOLT)))
TOPS = np.flatnonzero((DENSITY[1:-1] > DENSITY[:-2]) & (DENSITY[1:-1] > DENSITY[2:])) + 1


def read(volt, charge, rows, seed, step_volt, noise_volt):
    """A charge V(Q) at constant current as a converter with steps reads it; offset by seed."""
    rng = np.random.default_rng(seed)
    even = np.linspace(0, charge[-1], rows)
    voltage = np.interp(even, charge, volt) + noise_volt * rng.standard_normal(rows)
    offset = rng.uniform(0, step_volt)
    return np.round((voltage - offset) / step_volt) * step_volt + offset, even


def record(rows, seed, step_volt=3e-4, noise_volt=5e-5):
    """The charge of three peaks from 3.2 V to 4.15 V."""
    return read(VOLT, CHARGE, rows, seed, step_volt, noise_volt)


def found_in(voltage, charge):
    """Curve and peaks of a charge."""
    curve, slope = charge_slope(voltage, charge)
    return curve, slope_peaks(slope)


@pytest.fixture(scope="module")
def twenty():
    """Peaks of twenty charges of 20,000 rows, noise and steps of 0.3 mV, by the default."""
    return [found_in(*record(20_000, seed, noise_volt=3e-4))[1] for seed in range(20)]


def test_twenty_seeds_find_the_three_peaks_and_no_other(twenty):
    assert {len(one.voltage_volt) for one in twenty} == {3}
    position = np.array([one.voltage_volt for one in twenty]) - VOLT[TOPS]
    height = np.array([one.height_ampere_hour_per_volt for one in twenty]) / DENSITY[TOPS] - 1
    assert np.sqrt(np.mean(position**2, axis=0)).max() < 1.5e-3
    assert np.sqrt(np.mean(height**2, axis=0)).max() < 0.01


def test_intervals_hold_the_truth_and_are_not_three_times_too_wide(twenty):
    position = np.array([one.voltage_volt for one in twenty]) - VOLT[TOPS]
    std = np.array([one.voltage_std_volt for one in twenty])
    height = np.array([one.height_ampere_hour_per_volt for one in twenty]) - DENSITY[TOPS]
    height_std = np.array([one.height_std_ampere_hour_per_volt for one in twenty])
    for error, sigma in ((position, std), (height, height_std)):
        assert np.mean(np.abs(error) < 1.96 * sigma) >= 0.9
        assert np.sqrt(np.mean((error / sigma) ** 2)) > 1 / 3


def test_two_hundred_thousand_rows_give_the_position_to_a_tenth_of_a_millivolt():
    found = [found_in(*record(200_000, seed))[1] for seed in range(8)]
    error = np.array([one.voltage_volt for one in found]) - VOLT[TOPS]
    assert np.sqrt(np.mean(error**2)) < 1e-4
    height = np.array([one.height_ampere_hour_per_volt for one in found]) / DENSITY[TOPS] - 1
    assert np.abs(height).max() < 0.005


def test_height_area_and_width_are_those_of_the_curve(twenty):
    found = twenty[0]
    total = found.area_ampere_hour.sum()
    assert total == pytest.approx(CHARGE[-1], rel=0.01)
    half = (
        DENSITY[TOPS[1]] / 2
        + max(DENSITY[TOPS[0] : TOPS[1]].min(), DENSITY[TOPS[1] : TOPS[2]].min()) / 2
    )
    inside = np.flatnonzero(DENSITY[TOPS[0] + 20_000 : TOPS[2] - 20_000] > half)
    width = (VOLT[1] - VOLT[0]) * len(inside)
    assert abs(found.width_volt[1] - width) < 3 * found.width_std_volt[1] + 5e-4


@pytest.mark.parametrize(("width_volt", "rows"), [(0.010, 7200), (0.005, 7200), (0.003, 20_000)])
def test_a_narrow_peak_keeps_its_height(width_volt, rows):
    """Peaks as of an LFP cell, 30 times as high as what lies beside; full width at half height."""
    volt = np.linspace(3.1, 3.5, 100_001)
    scale = width_volt / 3.525  # of a logistic step: its slope falls to half at 1.763 scales
    step = 1 / (4 * scale) / np.cosh((volt - 3.33) / (2 * scale)) ** 2
    density = step.max() / 30 + step
    charge = np.append(0, np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(volt)))
    error = []
    for seed in range(3):
        _, found = found_in(*read(volt, charge, rows, seed, 3e-4, 3e-4))
        assert len(found.voltage_volt) == 1
        assert found.voltage_volt[0] == pytest.approx(3.33, abs=4e-4)
        error.append(found.height_ampere_hour_per_volt[0] / density.max() - 1)
    assert abs(np.mean(error)) < 0.05


def test_steps_of_a_converter_without_noise_are_no_peaks():
    _, found = found_in(*record(7200, 5, step_volt=1e-3, noise_volt=0))
    np.testing.assert_allclose(found.voltage_volt, VOLT[TOPS], atol=5e-4)


def test_coarse_sampling_of_thirty_seconds_still_finds_them():
    _, found = found_in(*record(240, 1, step_volt=1.6e-4, noise_volt=1e-4))
    np.testing.assert_allclose(found.voltage_volt, VOLT[TOPS], atol=4e-3)


def test_what_few_readings_cannot_resolve_is_no_peak():
    _, found = found_in(*record(60, 1, step_volt=1.6e-4, noise_volt=1e-4))
    nearest = np.abs(found.voltage_volt[:, None] - VOLT[TOPS]).min(axis=1)
    assert np.all(nearest < 8e-3)


def test_dv_dq_is_one_over_dq_dv_and_the_charge_its_integral():
    curve, _ = found_in(*record(20_000, 2))
    assert curve.dv_dq_volt_per_ampere_hour * curve.dq_dv_ampere_hour_per_volt == pytest.approx(1)
    moved = np.interp(curve.voltage_volt, VOLT, CHARGE)
    np.testing.assert_allclose(curve.charge_ampere_hour, moved - moved[0], atol=2e-3)


def test_a_straight_charge_has_no_peaks():
    rng = np.random.default_rng(0)
    voltage = np.linspace(3.2, 4.2, 20_000) + 2e-4 * rng.standard_normal(20_000)
    _, found = found_in(voltage, np.linspace(0, 2, 20_000))
    assert all(len(column) == 0 for column in found)


def test_peaks_as_columns_are_numbered_and_none_is_a_refusal():
    slope = charge_slope(*record(5000, 4))[1]
    columns = ica_peaks(Result({}, {"slope": slope, "c_rate": 0.05})).rows
    assert columns["peak"].tolist() == [1, 2, 3]
    assert columns["c_rate"].tolist() == [0.05] * 3
    _, straight = charge_slope(np.linspace(3, 4, 5000), np.linspace(0, 2, 5000))
    with pytest.raises(Refusal, match="no peaks: dQ/dV at 0"):
        ica_peaks(Result({}, {"slope": straight, "c_rate": 0.05}))


@settings(max_examples=10, deadline=None)
@given(st.floats(0.1, 50), st.floats(-1, 1), st.floats(-5, 5))
def test_shift_and_scale_of_the_record_shift_and_scale_the_peaks(scale, shift, start):
    voltage, charge = record(5000, 3)
    _, plain = found_in(voltage, charge)
    _, moved = found_in(voltage + shift, start + scale * charge)
    np.testing.assert_allclose(moved.voltage_volt, plain.voltage_volt + shift, atol=2e-4)
    np.testing.assert_allclose(
        moved.height_ampere_hour_per_volt, scale * plain.height_ampere_hour_per_volt, rtol=5e-3
    )


@pytest.mark.parametrize(
    ("voltage", "charge", "reason"),
    [
        (np.linspace(3, 4, 20), np.linspace(0, 1, 20), "20 rows"),
        (np.linspace(4, 3, 500), np.linspace(0, 1, 500), "does not rise"),
        (np.repeat([3.3, 3.301], 300), np.arange(600.0), "2 distinct readings"),
    ],
)
def test_refusals(voltage, charge, reason):
    with pytest.raises(Refusal, match=reason):
        charge_slope(voltage, charge)


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


def test_rows_count_while_the_current_is_its_usual_one():
    current = np.concatenate([[0.2], np.full(80, 1.0), [0.97, 0.9, 0.8]])
    assert constant_rows(current, 0, len(current) - 1) == (1, 80)


def interrupted(*pauses, amperes=(0.4, 0.4, 0.4), ohm=0.03, tau=120.0, step=10.0):
    """A charge over the three peaks in parts of these currents, pauses [s] between, one RC pair."""
    time, current, ampere_hour, volts, lag = [0.0], [0.0], [0.0], [VOLT[0]], 0.0
    shares = np.linspace(0, CHARGE[-1], len(amperes) + 1)[1:]
    steps_of = {name: [] for name in ("kind", "first_row", "last_row", "current_mean_ampere")}
    for part, (ampere, end) in enumerate(zip(amperes, shares, strict=True)):
        spans = [("CC", ampere, np.inf)] + [
            ("rest", 0.0, second) for second in pauses[part : part + 1]
        ]
        for kind, flowing, seconds in spans:
            first, begun = len(time), time[-1]
            while ampere_hour[-1] < end - 1e-9 if kind == "CC" else time[-1] - begun < seconds:
                time.append(time[-1] + step)
                current.append(flowing)
                ampere_hour.append(ampere_hour[-1] + flowing * step / 3600)
                lag += (ohm * flowing - lag) * -np.expm1(-step / tau)
                volts.append(np.interp(ampere_hour[-1], CHARGE, VOLT) + lag + 0.02 * flowing)
            for name, value in zip(steps_of, (kind, first, len(time) - 1, flowing), strict=True):
                steps_of[name].append(value)
    table = {name: np.array(values) for name, values in steps_of.items()}
    arrays = [np.array(column) for column in (time, current, volts, ampere_hour)]
    arrays[2] = arrays[2] + 1e-4 * np.random.default_rng(3).standard_normal(len(time))
    table["cv_first_row"] = np.full(len(table["kind"]), -1)
    table["start_time_second"] = arrays[0][table["first_row"] - 1]
    table["end_time_second"] = arrays[0][table["last_row"]]
    return arrays, table


def joined(arrays, table):
    *ends, step = constant_current_charge(table, arrays[3])
    return parts_joined(*arrays, table, step, constant_rows(arrays[1], *ends))


@pytest.mark.parametrize("pauses", [(60.0, 60.0), (3600.0, 600.0)])
def test_pauses_neither_add_nor_take_peaks(pauses):
    arrays, table = interrupted(*pauses)
    kept, notes = joined(arrays, table)
    _, found = found_in(arrays[2][kept], arrays[3][kept])
    np.testing.assert_allclose(found.voltage_volt, VOLT[TOPS] + 0.4 * 0.05, atol=3e-3)
    np.testing.assert_allclose(found.height_ampere_hour_per_volt, DENSITY[TOPS], rtol=0.06)
    assert "interrupted 2 ×" in notes[0]


def test_a_second_stage_is_no_part_and_where_the_curve_begins_is_said():
    arrays, table = interrupted(amperes=(0.4, 0.2))
    moved = [np.ptp(arrays[3][arrays[1] == ampere]) for ampere in (0.4, 0.2)]
    kept, notes = joined(arrays, table)
    larger, other = (0.4, 0.2) if moved[0] >= moved[1] else (0.2, 0.4)
    assert set(arrays[1][kept]) == {larger}
    assert f"the current is {other:g} A instead of {larger:g} A" in notes[0]
