"""A record that is silent under load: whether the load went on, by the voltage."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cellwright.series import clean
from cellwright.series.doubts import Doubt
from cellwright.series.gaps import NO_LOAD, OTHER_LOAD, RAN, RESTED, UNKNOWN, verdicts


def record(*, gap, ran, slope=0.3, amps=-1.5, noise=2e-4, seed=0):
    """Time [s], current [A] and voltage [V] of a discharge of an hour with a gap [s] in its middle.

    The voltage falls by `slope` [V/Ah]; polarisation of 20 mV/A fades and comes back in 200 s.
    """
    time = np.concatenate([np.arange(0, 1800, 10.0), np.arange(1800, 3600, 10.0) + gap])
    under_load = np.where(time < 1800, time, time - gap * (not ran))
    fresh = np.where(time < 1800, time, time - 1800 - gap) if not ran else under_load
    lag = 0.02 * (1 - np.exp(-fresh / 200))
    charge = amps * under_load / 3600
    noisy = noise * np.random.default_rng(seed).standard_normal(len(time))
    return time, np.full(len(time), amps), 3.9 + slope * charge + lag * amps + noisy


@settings(max_examples=60, deadline=None)
@given(
    gap=st.sampled_from([300.0, 600.0, 1800.0, 7200.0]),
    ran=st.booleans(),
    slope=st.floats(0.1, 1.0),
    amps=st.sampled_from([-3.0, -1.5, 1.5]),
    seed=st.integers(0, 1000),
)
def test_the_voltage_tells_or_says_that_it_does_not(gap, ran, slope, amps, seed):
    time, current, voltage = record(gap=gap, ran=ran, slope=slope, amps=amps, seed=seed)
    (found,) = verdicts(time, current, voltage, np.array([180]))
    assert found in (RAN if ran else RESTED, UNKNOWN)
    if gap >= 600 and slope * abs(amps) > 0.3:
        assert found != UNKNOWN


def test_a_plateau_does_not_tell():
    time, current, voltage = record(gap=600.0, ran=True, slope=0.002)
    assert list(verdicts(time, current, voltage, np.array([180]))) == [UNKNOWN]


def test_unequal_currents_are_no_load_that_went_on():
    time, current, voltage = record(gap=600.0, ran=True)
    current[180:] = 0.0
    assert list(verdicts(time, current, voltage, np.array([180]))) == [NO_LOAD]


def test_what_flowed_between_unlike_loads_nobody_knows():
    """Rows lost in the middle of a drive: what is counted without them is in doubt."""
    time, current, voltage = record(gap=900.0, ran=True)
    current[180:] = -3.0
    assert list(verdicts(time, current, voltage, np.array([180]))) == [OTHER_LOAD]
    found = clean({"test_time_second": time, "current_ampere": current, "voltage_volt": voltage})
    assert found.columns["doubt"][180] & Doubt.GAP
    assert any("unlike loads" in note for note in found.notes)


@pytest.mark.parametrize("ran", [True, False])
def test_the_charge_of_a_gap_is_counted_where_the_load_went_on(ran):
    time, current, voltage = record(gap=1800.0, ran=ran)
    found = clean({"test_time_second": time, "current_ampere": current, "voltage_volt": voltage})
    hours = (3590 + 1800 * ran) / 3600 - (0 if ran else 10 / 3600)
    assert found.columns["charge_ampere_hour"][-1] == pytest.approx(-1.5 * hours, abs=0.006)
    (note,) = found.notes
    assert ("the charge is counted" in note) == ran


def test_a_counter_knows_what_a_gap_held():
    time, current, voltage = record(gap=1800.0, ran=False)
    counter = np.cumsum(np.full(len(time), -1.5 * 10 / 3600))
    columns = {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    found = clean(columns | {"net_capacity_ampere_hour": counter})
    assert found.notes == ()
    assert found.columns["charge_ampere_hour"][-1] == pytest.approx(-1.5 * 3590 / 3600, abs=0.006)


def test_a_plateau_between_two_slopes_is_no_rest():
    """A cell that goes on over a plateau hardly moves its voltage there, nor does it come back."""
    time = np.r_[np.arange(0, 3600, 10.0), np.arange(5400, 7200, 10.0)]
    charge = -1.5 * time / 3600
    curve = np.interp(charge, [-3.0, -2.25, -1.2, -0.8, 0.0], [3.1, 3.29, 3.292, 3.33, 3.335])
    (found,) = verdicts(time, np.full(len(time), -1.5), curve, np.array([360]))
    assert found == UNKNOWN


@pytest.mark.parametrize("larger", [False, True])
def test_a_hold_went_on_where_its_current_fell(larger):
    time = np.r_[np.arange(0, 600, 20.0), np.arange(1200, 1800, 20.0)]
    current = 2.0 * np.exp(-time / 1000)
    if larger:  # after a rest the cell takes more again
        current[30:] *= 3
    (found,) = verdicts(time, current, np.full(len(time), 4.2), np.array([30]))
    assert found == (NO_LOAD if larger else RAN)
    series = {"test_time_second": time, "current_ampere": current}
    charge = clean(series | {"voltage_volt": np.full(len(time), 4.2)}).columns["charge_ampere_hour"]
    moved = 2.0 * 1000 / 3600 * (np.exp(-0.58) - np.exp(-1.2))
    assert charge[30] - charge[29] == pytest.approx(0.0 if larger else moved, rel=0.04)
