"""Chambers over time: what they hold, how they wobble, step and follow the day."""

import numpy as np
import pytest

from virtual_lab import chamber

DAY_SECOND = 86_400.0


def test_a_steady_chamber_holds():
    np.testing.assert_array_equal(
        chamber.temperature_at(chamber.steady(5), np.array([-1.0, 0, 1e9])), 5.0
    )


def test_a_later_test_sees_the_same_chamber():
    first = chamber.stepped((20.0, 0.0), rest_second=600.0, hold_second=3600.0)
    then = chamber.later(first, 900.0)
    assert chamber.temperature_at(then, 0.0) == chamber.temperature_at(first, 900.0)


def test_wobble_stays_within_its_amplitude_and_swings_at_its_period():
    made = chamber.wobbling(
        25.0, amplitude_kelvin=0.4, period_second=1200.0, duration_second=86_400.0, seed=1
    )
    second = np.arange(0.0, 86_400.0, 10.0)
    off = chamber.temperature_at(made, second) - 25.0
    assert np.abs(off).max() <= 0.4
    assert np.abs(off).max() > 0.3
    assert abs(off.mean()) < 0.02
    crossings = np.count_nonzero(np.diff(np.sign(off)) != 0)
    assert crossings / 2 == pytest.approx(86_400 / 1200, rel=0.1)
    assert made.second[-1] == 86_400.0


def test_wobble_is_decided_by_its_seed():
    how = {"amplitude_kelvin": 0.4, "period_second": 600.0, "duration_second": 5000.0}
    one, again, other = (chamber.wobbling(25.0, seed=s, **how) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.celsius, again.celsius)
    assert not np.array_equal(one.celsius, other.celsius)


def test_a_room_goes_by_the_time_of_day():
    made = chamber.room(
        25.0, swing_kelvin=4.0, duration_second=6 * DAY_SECOND, begin_hour=8, warmest_hour=16
    )
    second = np.arange(0, 6 * DAY_SECOND, 600.0)
    celsius = chamber.temperature_at(made, second)
    assert np.ptp(celsius) == pytest.approx(4.0, rel=1e-6)
    assert celsius.mean() == pytest.approx(25.0, abs=0.02)
    warmest = second[:144][np.argmax(celsius[:144])]
    assert warmest == pytest.approx(8 * 3600.0)
    np.testing.assert_allclose(celsius[144:288], celsius[:144], atol=1e-9)


def test_days_differ_where_asked():
    made = chamber.room(25.0, duration_second=29 * DAY_SECOND, drift_kelvin=0.5, seed=3)
    days = chamber.temperature_at(made, np.arange(29 * 48) * 1800.0).reshape(29, 48).mean(axis=1)
    assert 0.2 < days.std() < 0.7


def test_a_stepped_chamber_takes_its_time():
    points = tuple(np.arange(20.0, -21.0, -5.0))
    made = chamber.stepped(points, rest_second=36_000.0, hold_second=7200.0, kelvin_per_minute=0.5)
    assert chamber.temperature_at(made, 36_000.0) == 20.0
    assert chamber.temperature_at(made, 36_000.0 + 300.0) == pytest.approx(17.5)
    ends = 36_000.0 + 7200.0 * np.arange(1, 9) - 1
    np.testing.assert_allclose(chamber.temperature_at(made, ends), points[1:])
    slopes = np.diff(made.celsius) / np.diff(made.second)
    assert np.abs(slopes).max() == pytest.approx(0.5 / 60)


def test_a_ramp_longer_than_its_hold_is_refused():
    with pytest.raises(ValueError, match="ramp takes 2400 s"):
        chamber.stepped((20.0, -20.0), rest_second=0.0, hold_second=600.0)


def test_wobble_can_be_added_to_steps():
    steps = chamber.stepped((20.0, 10.0), rest_second=1000.0, hold_second=5000.0)
    wobble = chamber.wobbling(
        0.0, amplitude_kelvin=0.3, period_second=900.0, duration_second=6000.0, seed=1
    )
    both = chamber.added(steps, wobble, about_celsius=0.0)
    second = np.linspace(0, 6000, 777)
    expected = chamber.temperature_at(steps, second) + chamber.temperature_at(wobble, second)
    np.testing.assert_allclose(chamber.temperature_at(both, second), expected, atol=1e-9)
