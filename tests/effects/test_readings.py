"""Errors of reading in one test alone: found, told, taken off, and only there."""

import numpy as np
import pytest
from small_plant import CAPACITY, HEALTHY, Truth, case, drive, measured

from cellwright.effects.finding import of_case
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import stacked
from cellwright.effects.stated.readings import Misread, corrected, tolerances
from cellwright.effects.verdict import searched

NAMES = "voltage_offset", "voltage_drift", "current_offset", "current_gain", "voltage_delay"


def with_wild(truth=HEALTHY, *, celsius=8.0, gain=0.0, drift=0.0):
    """A healthy cell of whose two tests for proof one, "wild", is read wrongly.

    gain : of its current's reading. drift : of its voltage's until the end [V].
    """
    wild = measured("wild", drive(103, highest=1.6), celsius, 0.95, truth, seed=13)
    mild = measured("mild", drive(104, highest=0.9), 34.0, 0.95, HEALTHY, seed=14)
    course = wild.test_time_second / wild.test_time_second[-1]
    wild = wild._replace(
        current_ampere=wild.current_ampere * (1 + gain),
        voltage_volt=wild.voltage_volt + drift * course,
    )
    return case(HEALTHY)._replace(validation=stacked([wild, mild], capacity_ampere_hour=CAPACITY))


@pytest.mark.parametrize(
    ("made", "name", "value"),
    [
        (with_wild(gain=0.03), "current_gain", 0.03),
        (with_wild(Truth(offset=0.06)), "current_offset", 0.06),
        (with_wild(drift=0.012), "voltage_drift", 0.012),
        (with_wild(Truth(delay=1.0)), "voltage_delay", 1.0),
    ],
    ids=["gain", "offset", "drift", "delay"],
)
def test_a_test_that_is_read_wrongly_by_itself_is_told_and_nothing_else(made, name, value):
    verdict = of_case("cell", made, LIBRARY).verdict
    (found,) = (one for one in verdict["nuisances"] if one["name"] in NAMES)
    assert (found["test"], found["name"]) == ("wild", name)
    assert found["value"] == pytest.approx(value, rel=0.25)
    assert 0 < found["std"] < abs(found["value"]) / 3
    assert found["prior_std"] == pytest.approx(tolerances(made)[name])
    assert verdict["verdict"] == "none"
    assert "Read wrongly in one test alone" in verdict["paragraph"]
    assert verdict["validation_rmse_volt"]["after"] < 3e-3


def test_a_test_without_its_like_is_not_told_for_its_temperature_may_be_what_differs():
    assert searched(with_wild(gain=0.03, celsius=-8.0), LIBRARY).case.misread == ()


@pytest.mark.parametrize("truth", [HEALTHY, Truth(delay=1.0), Truth(ripple=0.008)])
def test_what_all_tests_show_is_no_error_of_one(truth):
    assert searched(case(truth), LIBRARY).case.misread == ()


@pytest.mark.parametrize("name", NAMES)
def test_an_error_taken_off_leaves_other_tests_as_they_were(name):
    made = case(HEALTHY)
    there = corrected(made, Misread("wild", name, 0.01, 0.001, "V"))
    columns = "current_ampere", "held_ampere", "voltage_volt", "late_second"
    wild = made.validation.file == made.validation.tests.index("wild")
    assert there.fit.voltage_volt is made.fit.voltage_volt
    changed = 0
    for column in columns:
        old, new = (getattr(one.validation, column) for one in (made, there))
        old = np.zeros(len(wild)) if old is None else old
        new = np.zeros(len(wild)) if new is None else new
        np.testing.assert_array_equal(old[~wild], new[~wild])
        changed += not np.array_equal(old[wild], new[wild])
    assert changed >= 1
    assert there.misread[0].name == name
    assert made.misread == ()
    again = corrected(there, Misread("wild", name, 0.002, 0.001, "V"))
    assert [one.value for one in again.misread] == pytest.approx([0.012])
