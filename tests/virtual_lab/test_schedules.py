"""Driving schedules keep to the figures that they state, the stress test to its definition."""

import numpy as np
import pytest

from virtual_lab import loads, schedules
from virtual_lab.rating import Rating

RATING = Rating(5.0, 2.5, 4.2)
# 40 CFR 86, appendix I: duration [s], distance [km], mean and top speed [km/h], hardest start.
UDDS = (1369, 12.07, 31.5, 91.25, 1.48)
US06 = (596, 12.8, 77.9, 129.2, 3.78)


def _figures(name):
    speed = schedules.speed_profile(schedules.STYLES[name])
    return (
        speed.size - 1,
        speed.sum() / 1000,
        3.6 * speed.mean(),
        3.6 * speed.max(),
        np.diff(speed).max(),
    )


@pytest.mark.parametrize(
    ("name", "public", "share"),
    [("ftp72", UDDS, 0.01), ("sftp", US06, 0.01), ("udds", UDDS, 0.18), ("us06", US06, 0.18)],
)
def test_figures_of_the_public_schedule(name, public, share):
    assert _figures(name) == pytest.approx(public, rel=share)


@pytest.mark.parametrize(("name", "trips"), [("ftp72", 17), ("sftp", 5)])
def test_as_many_trips_from_rest_to_rest(name, trips):
    speed = schedules.speed_profile(schedules.STYLES[name])
    assert np.sum((speed[1:] > 0) & (speed[:-1] == 0)) == trips
    assert speed[0] == speed[-1] == 0


@pytest.mark.parametrize("name", [n for n in loads.SCHEDULES if n != "dst"])
def test_current_has_braking_and_the_stated_peak(name):
    time, current = loads.current_profile(name, RATING).T
    assert current.min() == pytest.approx(-14.0)
    assert current.max() > 1.0
    assert current[0] == current[-1] == 0
    assert (np.diff(time) == 1).all()


def test_a_van_brings_back_more_of_its_brakes_than_a_car():
    car, van = (loads.current_profile(name, RATING)[:, 1] for name in ("ftp72", "fuds"))
    assert van.clip(min=0).sum() > car.clip(min=0).sum()


def test_dynamic_stress_test_is_the_one_of_the_manual():
    second, power = loads.DYNAMIC_STRESS.T
    assert second.size == 20
    assert second.sum() == 360
    assert second @ power / 360 == pytest.approx(-1 / 8)
    assert (power.min(), power.max()) == (-1.0, 0.5)
    assert second[power == -1.0] == [8]


def test_dynamic_stress_test_holds_its_levels():
    time, current = loads.current_profile("dst", RATING).T
    assert time[-1] == 360
    assert (np.diff(time) > 0).all()
    middle = np.cumsum(loads.DYNAMIC_STRESS[:, 0]) - loads.DYNAMIC_STRESS[:, 0] / 2
    expected = 14.0 * loads.DYNAMIC_STRESS[:, 1]
    np.testing.assert_allclose(np.interp(middle, time, current), expected, atol=1e-3)
    assert np.trapezoid(current, time) == pytest.approx(-14.0 / 8 * 360, rel=1e-3)


def test_an_unknown_schedule_is_named_with_the_known_ones():
    with pytest.raises(ValueError, match=r"'nedc'.*udds.*dst"):
        loads.current_profile("nedc", RATING)


@pytest.mark.parametrize("name", loads.SCHEDULES)
def test_repetition_takes_out_what_was_asked(name):
    parts = schedules.repeated(loads.current_profile(name, RATING), ampere_hour=3.5)
    drawn = sum(-np.trapezoid(part[:, 1], part[:, 0]) / 3600 for part in parts)
    # A rest of a schedule shorter than half a minute is left out: at 2.8C at most 0.117 Ah.
    assert drawn == pytest.approx(3.5, abs=0.05)
    assert all(part[-1, 1] == 0 for part in parts)
