"""Which effects no records tell apart, and what the log of rests adds."""

import numpy as np
import pytest
import small_cells as small

from cellwright.effects.library import LIBRARY
from cellwright.effects.records import stacked
from cellwright.effects.ties import (
    RestCurrent,
    at_one_temperature,
    is_in_rest_log,
    rest_current,
    structural_ties,
    with_partners,
)
from cellwright.numerics.noise import least_digit


def test_partners_are_added_where_their_bounds_allow_them():
    offset = {"current_offset.offset_ampere": 0.01}
    assert with_partners("current_offset", (), LIBRARY, offset) == ("leakage",)
    charging = {"current_offset.offset_ampere": -0.01}
    assert with_partners("current_offset", (), LIBRARY, charging) == ()
    assert with_partners("leakage", ("slow_diffusion",), LIBRARY, {}) == (
        "slow_diffusion",
        "current_offset",
    )
    assert with_partners("capacity_error", (), LIBRARY, {}) == ("current_gain",)
    assert with_partners("self_heating", (), LIBRARY, {}) == ()
    rest = {name: LIBRARY[name] for name in LIBRARY if name != "leakage"}
    assert with_partners("current_offset", (), rest, offset) == ()


def test_every_tie_is_of_known_effects_and_says_what_separates():
    for _, tie in structural_ties():
        assert tie.partner in LIBRARY or " " in tie.partner
        assert tie.check
    assert LIBRARY["lead_resistance"].invisible
    assert not LIBRARY["self_heating"].invisible


def warming(*rises, ambient=(25.0,)):
    """Stack of drives whose logged temperature rises from that of a room by so many kelvin."""
    records = []
    for number, (rise, celsius) in enumerate(zip(rises, ambient, strict=True)):
        one = small.drive(f"drive_{number}", celsius=celsius)
        warmer = celsius + rise * np.linspace(0.0, 1.0, len(one.current_ampere))
        records.append(one._replace(celsius=warmer))
    return stacked(records, capacity_ampere_hour=small.CAPACITY)


def test_own_heat_is_tied_where_the_logged_temperature_rises_and_no_other_is_there():
    """At one temperature resistances may follow the log, or a core that is warmer than it."""
    ampere_hour = small.CAPACITY
    heating, diffusion = LIBRARY["self_heating"], LIBRARY["slow_diffusion"]
    tied = at_one_temperature(heating, warming(3.0), ampere_hour)
    assert tied == ("resistance_temperature",)
    assert at_one_temperature(diffusion, warming(3.0), ampere_hour) == ()
    assert at_one_temperature(heating, warming(0.2), ampere_hour) == ()
    both = warming(3.0, 3.0, ambient=(25.0, 5.0))
    assert at_one_temperature(heating, both, ampere_hour) == ()
    (tie,) = heating.ties
    assert (tie.partner, "colder" in tie.check) == ("resistance_temperature", True)


def logged(offset, *, noise=0.002, step=0.001, seed=5):
    """A drive as its ammeter logs it."""
    record = small.drive()
    reading = record.current_ampere + offset
    reading = reading + noise * np.random.default_rng(seed).standard_normal(len(reading))
    reading = np.round(reading / step) * step
    record = record._replace(current_ampere=reading, least_digit_ampere=least_digit(reading))
    stack = stacked([record], capacity_ampere_hour=small.CAPACITY)
    return rest_current(stack, capacity_ampere_hour=small.CAPACITY)


@pytest.mark.parametrize("offset", [0.02, -0.02, 0.004])
def test_an_offset_stands_in_the_log_of_a_rest(offset):
    rest = logged(offset)
    assert rest.informative
    assert abs(rest.mean_ampere - offset) < 3 * rest.std_ampere
    assert is_in_rest_log(rest, size_ampere=offset, std_ampere=0.1 * abs(offset)) is True
    assert LIBRARY["current_offset"].in_rest_log is True


def test_a_leak_does_not():
    assert is_in_rest_log(logged(0.0), size_ampere=0.01, std_ampere=0.001) is False
    assert LIBRARY["leakage"].in_rest_log is False


def test_half_an_offset_settles_nothing():
    assert is_in_rest_log(logged(0.01), size_ampere=0.02, std_ampere=0.001) is None


def test_an_offset_below_the_uncertainty_of_the_log_settles_nothing():
    rest = RestCurrent(1e-4, 4e-4, 10, informative=True)
    assert is_in_rest_log(rest, size_ampere=5e-4, std_ampere=5e-5) is None


def test_a_reading_forced_to_zero_cannot_tell():
    rest = logged(0.0, noise=0.0)
    assert not rest.informative
    assert rest.rests > 0
    assert is_in_rest_log(rest, size_ampere=0.01, std_ampere=0.001) is None


def test_a_coarse_log_is_as_uncertain_as_its_steps():
    assert not logged(0.004, noise=0.0, step=0.01).informative
    rest = logged(0.02, noise=0.0, step=0.01)
    assert rest.std_ampere >= 0.01 / np.sqrt(12) * 0.99


def test_records_without_a_rest_cannot_tell():
    record = small.record("load", np.full(600, -1.0))
    stack = stacked([record], capacity_ampere_hour=small.CAPACITY)
    rest = rest_current(stack, capacity_ampere_hour=small.CAPACITY)
    assert not rest.informative
    assert rest.rests == 0
