"""Protocols and dynamic loads: what the cycler is told, without any cell."""

from itertools import pairwise

import numpy as np
import pytest

from virtual_lab import protocols
from virtual_lab.behaviour import Behaviour, Rating
from virtual_lab.chamber import temperature_at
from virtual_lab.hidden.setup import CHAIN as HIDDEN_CHAIN
from virtual_lab.protocols import drives

SMALL, LARGE = Rating(1.2, 2.5, 3.65), Rating(12.0, 2.5, 3.65)
FULL = {SMALL: 1.1, LARGE: 11.0}
MADE = {
    "capacity": lambda r: protocols.capacity(r),
    "slow_ocv": lambda r: protocols.slow_ocv(r),
    "incremental_capacity": lambda r: protocols.incremental_capacity(r, c_rate=0.5),
    "hybrid_pulses": lambda r: protocols.hybrid_pulses(r, FULL[r]),
    "hybrid_pulses_below_full": lambda r: protocols.hybrid_pulses_below_full(r, FULL[r]),
    "pulses_on_discharge": lambda r: protocols.pulses_on_discharge(r, FULL[r]),
    "pulses_at_rest": lambda r: protocols.pulses_at_rest(r, FULL[r]),
    "relaxations": lambda r: protocols.relaxations(r, FULL[r]),
    "temperature_steps": lambda r: protocols.temperature_steps(r, FULL[r])[0],
    "dst": lambda r: protocols.drive(r, FULL[r], schedule="dst"),
    "soft": lambda r: protocols.dynamic_load(r, style="soft", seed=3),
    "high_power": lambda r: protocols.ageing_cycles(r, "high_power", cycles=3),
    "fast_charge": lambda r: protocols.fast_charge(r),
    "group_capacity": lambda r: protocols.group_capacity(r),
}


def _asked_ampere_hour(step):
    if step.kind == "profile":
        return np.trapezoid(step.value[:, 1], step.value[:, 0]) / 3600
    return step.value * step.duration_second / 3600


def _ends_and_rows(shown):
    """Time [s] at which each step of a record ended, and the rows of each."""
    number = shown.get("step_count", shown.get("step_index"))
    rows = [np.flatnonzero(number == k) for k in range(1, number.max() + 1)]
    return [shown["test_time_second"][of_step].max() for of_step in rows], rows


def _asked_ampere(step, second):
    if step.kind == "profile":
        return np.interp(second, step.value[:, 0], step.value[:, 1])
    return np.full(second.size, step.value)


def _farthest_ampere(test):
    """Five times the noise, and half of the resolution of the instrument that made a file."""
    chain = test.chain or HIDDEN_CHAIN
    return 5.0 * chain.current_noise_ampere + 0.5 * chain.current_resolution_ampere


def test_demo_asks_for_what_its_files_hold(demo_records):
    """Every sample of every step of set current, and how long each lasted."""
    checked = 0
    for test, shown in demo_records:
        if callable(test.steps):  # decided while the cell was charged
            continue
        ends, rows = _ends_and_rows(shown)
        assert len(test.steps) == len(ends), test.file
        for step, begin, end, of_step in zip(test.steps, [0.0, *ends], ends, rows, strict=False):
            assert end - begin < step.duration_second + 0.002, test.file
            if step.kind == "hold":
                continue
            second = shown["test_time_second"][of_step] - begin
            error = shown["current_ampere"][of_step] - _asked_ampere(step, second)
            assert np.abs(error).max() < _farthest_ampere(test), test.file
            checked += step.until_volt is None or end - begin > step.duration_second - 0.002
    assert checked > 700


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_currents_go_with_the_rating(make):
    for small, large in zip(make(SMALL), make(LARGE), strict=True):
        assert large.duration_second == pytest.approx(small.duration_second)
        if small.kind == "hold":
            assert large.value == small.value
            assert large.until_ampere == pytest.approx(10 * small.until_ampere)
        else:
            own = np.array(small.value) * ([1, 10] if small.kind == "profile" else 10)
            np.testing.assert_allclose(large.value, own, atol=0.006)


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_loads_end_at_their_own_cutoff(make):
    for step in make(SMALL):
        if step.kind == "current" and step.until_volt is not None:
            assert step.until_volt == (2.5 if step.value < 0 else 3.65)
        assert step.duration_second > 0
        assert step.period_second > 0


def _loads(steps):
    return [step for step in steps if step.kind != "current" or step.value != 0.0]


def _taken(steps):
    return -sum(_asked_ampere_hour(step) for step in steps)


def test_capacity_of_the_thesis():
    """4.3: 0.5C discharge, CCCV charge to C/20, an hour of rest, three times."""
    steps = protocols.capacity(LARGE)
    assert [step.value for step in _loads(steps)] == [-6.0, 6.0, 3.65] * 3
    holds = [step.until_ampere for step in steps if step.kind == "hold"]
    assert holds == pytest.approx([0.6] * 3)
    assert [s.duration_second for s in steps if s.value == 0.0][1:] == [3600.0] * 6


def test_pulses_at_every_tenth_and_a_twentieth():
    steps = protocols.hybrid_pulses(LARGE, 11.0)
    pulses = [step for step in steps if step.duration_second == 10.0]
    assert sum(step.value < 0 for step in pulses) == 11
    assert sum(step.value > 0 for step in pulses) == 9
    taken = [step for step in steps if step.value == -6.0]
    assert _taken(taken) == pytest.approx(0.95 * 11.0, rel=1e-3)


def test_pulses_below_full_as_in_the_examples():
    """README of hidden_examples: nine points, 10 s 1.5C, 40 s, 10 s 1C, first 0.4C; 40 min."""
    steps = protocols.hybrid_pulses_below_full(Rating(5.0, 2.5, 4.2), 5.0)
    pulses = [step.value for step in steps if step.duration_second == 10.0]
    assert pulses[::2] == [-7.5] * 9
    assert pulses[1::2] == [2.0] + [5.0] * 8
    down = [step for step in steps if step.value == pytest.approx(-5 / 3)]
    assert _taken(down) == pytest.approx(0.9 * 5.0, rel=1e-3)
    assert sum(step.duration_second == 2400.0 for step in steps) == 9


def test_a_pulse_every_fifteen_seconds_down_to_a_twentieth():
    steps = protocols.pulses_on_discharge(LARGE, 11.0)
    pulses = [step for step in steps if step.duration_second == 0.015]
    assert {step.value for step in pulses} == {-24.0}
    pairs = [a.duration_second + b.duration_second for a, b in pairwise(steps[1:])]
    assert pairs[: 2 * len(pulses) - 1] == pytest.approx([15.0] * (2 * len(pulses) - 1))
    # What is left for the discharge after the last pulse.
    assert 1 - _taken(steps[1:-2]) / 11.0 == pytest.approx(0.05, abs=0.002)


def test_relaxations_take_a_tenth_each_time():
    """S8: 10 % at 0.5C, 40 min of rest, again."""
    steps = protocols.relaxations(LARGE, 11.0)[1:]
    assert [_taken([step]) for step in steps[::2]] == pytest.approx([1.1] * 9, abs=1e-3)
    assert {step.duration_second for step in steps[1::2]} == {2400.0}


def test_chamber_steps_only_while_the_cell_rests():
    """S6: 10 h of rest at each state of charge, then 20 to -20 °C by 5."""
    steps, chamber = protocols.temperature_steps(LARGE, 11.0, soc=(1.0, 0.6, 0.2))
    begins = np.cumsum([0.0, *[step.duration_second for step in steps]])
    rests = [k for k, step in enumerate(steps) if step.duration_second > 36_000]
    assert len(rests) == 3
    for k in rests:
        quiet = np.linspace(begins[k], begins[k] + 36_000, 50)
        np.testing.assert_allclose(temperature_at(chamber, quiet), 20.0)
        shown = temperature_at(chamber, np.linspace(begins[k], begins[k + 1], 5000))
        assert shown.min() == -20.0
        assert shown[-1] == 20.0
    for k, step in enumerate(steps):
        if step.value != 0.0:
            np.testing.assert_allclose(temperature_at(chamber, begins[k : k + 2]), 20.0)
    assert _taken(steps) == pytest.approx(0.8 * 11.0, rel=1e-3)


@pytest.mark.parametrize(("taken_first", "begin"), [(0.1, 0.9), (0.0, 1.0)])
@pytest.mark.parametrize("schedule", ["ftp72", "sftp", "fuds", "dst"])
def test_drives_go_down_to_a_tenth(schedule, taken_first, begin):
    steps = protocols.drive(LARGE, 11.0, schedule=schedule, taken_first=taken_first)
    profiles = [step for step in steps if step.kind == "profile"]
    assert _taken(profiles) == pytest.approx((begin - 0.1) * 11.0, abs=0.02 * 11.0)
    assert _taken(steps) == pytest.approx(0.9 * 11.0, abs=0.02 * 11.0)
    assert all(step.duration_second == step.value[-1, 0] for step in profiles)


@pytest.mark.parametrize(("style", "second"), [("soft", 3840), ("harsh", 3200)])
def test_random_load_as_in_the_examples(style, second):
    before, load, after = protocols.dynamic_load(Rating(5.0, 2.5, 4.2), style=style, seed=7)
    time, current = load.value.T
    assert (before.duration_second, after.duration_second) == (300.0, 900.0)
    assert time[-1] == second
    assert _taken([load]) == pytest.approx(4.0, abs=1e-3)
    assert current.min() == pytest.approx(-12.5)
    assert 2.0 < current.max() <= 6.0
    assert 0.1 < np.mean(current == 0) < 0.3
    assert current[0] == current[-1] == 0
    drawn = -np.cumsum(current) / 3600
    assert (current[drawn < 0.05 * 5.0] <= 0).all(), "a full cell is not charged"


def test_harsh_is_harsher_and_a_seed_is_a_load():
    def load(style, seed):
        return protocols.dynamic_load(LARGE, style=style, seed=seed)[1].value

    assert (load("soft", 1) == load("soft", 1)).all()
    assert (load("soft", 1) != load("soft", 2)).any()
    soft, harsh = (np.diff(load(style, 1)[:, 1]).std() for style in ("soft", "harsh"))
    assert harsh > 1.3 * soft


def test_a_load_too_short_for_its_charge_is_refused():
    with pytest.raises(ValueError, match="too short"):
        protocols.dynamic_load(LARGE, style="soft", seed=1, ampere_hour=10.0, duration_second=600)


def test_a_string_is_ended_by_time():
    steps = protocols.series_drive(LARGE, schedule="fuds", ampere_hour=8.0)
    assert {step.until_volt for step in steps} == {None}
    assert _taken(steps) == pytest.approx(8.0, abs=0.02 * 12)


@pytest.mark.parametrize(
    ("protocol", "values"),
    [
        ("standard", [-12.0, 12.0, 3.65]),
        ("high_power", [-36.0, 12.0]),
        ("fast_charge", [-24.0, 24.0]),
    ],
)
def test_ageing_protocols_of_the_thesis(protocol, values):
    """S11: 1C and 1C CCCV; 2 to 5C and 1C without a hold; 2C and 2C without a hold."""
    assert [step.value for step in _loads(protocols.ageing_cycle(LARGE, protocol))] == values


def test_high_power_up_to_five():
    down = protocols.ageing_cycle(LARGE, "high_power", discharge_c_rate=5.0)[0]
    assert down.value == -60.0


def test_fast_charge_takes_half_an_hour_in_all():
    def run(steps):
        ended = [step.duration_second for step in steps[:-1]] + [1234.5]
        return [Behaviour(second, *[None] * 3) for second in ended]

    *_, constant, held, _ = protocols.fast_charge(LARGE, run=run)
    assert (constant.value, constant.duration_second) == (24.0, 1800.0)
    assert (held.kind, held.duration_second) == ("hold", 565.5)


def test_a_charge_that_takes_all_the_time_is_not_held():
    def run(steps):
        return [Behaviour(step.duration_second, *[None] * 3) for step in steps]

    assert all(step.kind == "current" for step in protocols.fast_charge(LARGE, run=run))


RATING = Rating(5.0, 2.5, 4.2)
# 40 CFR 86, appendix I: duration [s], distance [km], mean and top speed [km/h], hardest start.
UDDS = (1369, 12.07, 31.5, 91.25, 1.48)
US06 = (596, 12.8, 77.9, 129.2, 3.78)


def _figures(name):
    speed = drives.speed_profile(drives.SCHEDULE_STYLES[name])
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
    speed = drives.speed_profile(drives.SCHEDULE_STYLES[name])
    assert np.sum((speed[1:] > 0) & (speed[:-1] == 0)) == trips
    assert speed[0] == speed[-1] == 0


@pytest.mark.parametrize("name", [n for n in drives.SCHEDULES if n != "dst"])
def test_current_has_braking_and_the_stated_peak(name):
    time, current = drives.current_profile(name, RATING).T
    assert current.min() == pytest.approx(-14.0)
    assert current.max() > 1.0
    assert current[0] == current[-1] == 0
    assert (np.diff(time) == 1).all()


def test_a_van_brings_back_more_of_its_brakes_than_a_car():
    car, van = (drives.current_profile(name, RATING)[:, 1] for name in ("ftp72", "fuds"))
    assert van.clip(min=0).sum() > car.clip(min=0).sum()


def test_dynamic_stress_test_is_the_one_of_the_manual():
    second, power = drives.DYNAMIC_STRESS.T
    assert second.size == 20
    assert second.sum() == 360
    assert second @ power / 360 == pytest.approx(-1 / 8)
    assert (power.min(), power.max()) == (-1.0, 0.5)
    assert second[power == -1.0] == [8]


def test_dynamic_stress_test_holds_its_levels():
    time, current = drives.current_profile("dst", RATING).T
    assert time[-1] == 360
    assert (np.diff(time) > 0).all()
    middle = np.cumsum(drives.DYNAMIC_STRESS[:, 0]) - drives.DYNAMIC_STRESS[:, 0] / 2
    expected = 14.0 * drives.DYNAMIC_STRESS[:, 1]
    np.testing.assert_allclose(np.interp(middle, time, current), expected, atol=1e-3)
    assert np.trapezoid(current, time) == pytest.approx(-14.0 / 8 * 360, rel=1e-3)


def test_an_unknown_schedule_is_named_with_the_known_ones():
    with pytest.raises(ValueError, match=r"'nedc'.*udds.*dst"):
        drives.current_profile("nedc", RATING)


@pytest.mark.parametrize("name", drives.SCHEDULES)
def test_repetition_takes_out_what_was_asked(name):
    parts = drives.repeated(drives.current_profile(name, RATING), ampere_hour=3.5)
    drawn = sum(-np.trapezoid(part[:, 1], part[:, 0]) / 3600 for part in parts)
    # A rest of a schedule shorter than half a minute is left out: at 2.8C at most 0.117 Ah.
    assert drawn == pytest.approx(3.5, abs=0.05)
    assert all(part[-1, 1] == 0 for part in parts)
