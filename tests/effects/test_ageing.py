"""Ageing between tests: found with its size, tied where temperature goes with the date, or silent.

The cells are simulated by a few lines of their own, which share nothing with the searched model.
"""

from functools import cache

import numpy as np
import pytest
import small_cells as small

from cellwright.effects.case import Case
from cellwright.effects.finding import of_case
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import DAY_SECOND, ages_of, lacking, stacked

AGEING = "ageing_between_tests"
RIVALS = ("capacity_temperature", "resistance_temperature", "capacity_error", "leakage")
SEARCHED = {name: effect for name, effect in LIBRARY.items() if name in (AGEING, *RIVALS)}
FIT_DAYS, JUDGING_DAYS = (0.0, 20.0, 40.0, 60.0), (10.0, 50.0)
MIDDLE_DAY, LAST_DAY = 30.0, 60.0  # the mean date, to which the model belongs, and the last
LOSS, GROWTH = 0.08, 0.3  # of what the cell has at the mean date, straight in time
# From the first to the last test, as a verdict tells them.
LOST = 1.0 - (1.0 - LOSS / 2) / (1.0 + LOSS / 2)
GROWN = (1.0 + GROWTH / 2) / (1.0 - GROWTH / 2) - 1.0


def voltage(second, ampere, soc, *, aged):
    """Two RC pairs and a resistance; `aged`: of all loss and growth, less that at the mean date."""
    capacity = small.CAPACITY * (1.0 - LOSS * aged)
    r0, r1, r2 = (r * (1.0 + GROWTH * aged) for r in (0.025, 0.01, 0.012))
    u1 = u2 = 0.0
    volt = np.empty(len(second))
    for k, now in enumerate(ampere):
        if k:
            step, before = second[k] - second[k - 1], ampere[k - 1]
            soc += before * step / 3600.0 / capacity
            u1 += (before * r1 - u1) * -np.expm1(-step / 8.0)
            u2 += (before * r2 - u2) * -np.expm1(-step / 130.0)
        ocv = np.interp(soc, small.SOC, small.CELL.ocv_volt)
        volt[k] = ocv + r0 * now + u1 + u2
    return volt


def record(day, *, aged=True, celsius=25.0, dated=True):
    """A drive from 95 % to near empty on one day, read with .5 mV of noise."""
    made = small.drive(f"day_{day:.0f}", seed=int(day) + 1, seconds=7200, celsius=celsius)
    age = (day - MIDDLE_DAY) / LAST_DAY if aged else 0.0
    volt = voltage(made.test_time_second, made.current_ampere, 0.95, aged=age)
    noise = np.random.default_rng(int(day)).normal(0.0, 5e-4, len(volt))
    date = day * DAY_SECOND if dated else None
    return made._replace(voltage_volt=volt + noise, started_second=date)


def case(celsius_of_day=lambda day: 25.0, **about):
    sides = [
        [record(day, celsius=celsius_of_day(day), **about) for day in days]
        for days in (FIT_DAYS, JUDGING_DAYS)
    ]
    ages = ages_of([*sides[0], *sides[1]])
    laid = {"capacity_ampere_hour": small.CAPACITY, "ages": ages}
    return Case(small.CELL, *(stacked(side, **laid) for side in sides))


@cache
def aged():
    return of_case("cell", case(), SEARCHED)


def test_loss_and_growth_are_found_with_their_sizes():
    verdict = aged().verdict
    assert verdict["verdict"] == "named"
    (entry,) = verdict["effects"]
    assert entry["effect"] == AGEING
    sizes = entry["parameters"]
    for name, truth in (("capacity_loss_relative", LOST), ("resistance_growth_relative", GROWN)):
        # Straight in time is not the same share each day: two hundredths of the size apart.
        assert abs(sizes[name]["value"] - truth) < 3 * sizes[name]["std"] + 0.02 * truth
    assert verdict["validation_rmse_volt"]["after"] < 1e-3


def test_sizes_are_told_with_the_days_between_the_tests():
    (entry,) = aged().verdict["effects"]
    lost, grown = entry["sizes"]
    assert lost["name"] == "capacity lost in the 60 days between the first and the last test"
    assert (lost["value"], lost["unit"]) == (pytest.approx(100 * LOST, rel=0.05), "%")
    assert grown["value"] == pytest.approx(100 * GROWN, rel=0.05)


def test_it_is_tied_where_tests_were_made_in_the_order_of_their_temperatures():
    """Each later test is colder: what the cell lost with the days it may lack in the cold."""
    finding = of_case("cell", case(lambda day: 25.0 - day / 3.0), SEARCHED)
    names = [{one["effect"], *one["alternatives"]} for one in finding.verdict["effects"]]
    assert finding.verdict["verdict"] == "ambiguous"
    assert any({AGEING, "capacity_temperature"} <= name for name in names)


def test_it_is_told_from_temperature_where_the_order_is_another():
    """25, 5, 25, 5 °C: the date decides."""
    finding = of_case("cell", case(lambda day: 25.0 - (day % 40.0)), SEARCHED)
    (entry,) = finding.verdict["effects"]
    assert (entry["effect"], entry["alternatives"]) == (AGEING, [])


def test_without_dates_it_cannot_be_tested():
    undated = case(dated=False)
    assert undated.fit.age is None
    assert lacking(LIBRARY[AGEING], undated.fit, small.CAPACITY) == (
        "dates of all tests, the first and the last 7 days apart",
    )
    finding = of_case("cell", undated, SEARCHED)
    assert AGEING in finding.verdict["not_testable"]
    assert AGEING not in [one["effect"] for one in finding.verdict["effects"]]


def test_a_cell_that_did_not_age_has_no_such_name():
    verdict = of_case("cell", case(aged=False), SEARCHED).verdict
    assert (verdict["verdict"], verdict["effects"]) == ("none", [])


def test_tests_of_one_week_are_of_one_age():
    days = [record(day)._replace(started_second=day * DAY_SECOND / 10) for day in FIT_DAYS]
    assert ages_of(days) is None


def test_the_model_is_that_of_the_test_its_ocv_is_from():
    records = [record(day) for day in FIT_DAYS]
    ages = ages_of(records, reference="day_40")
    assert [ages.of(one) for one in records] == pytest.approx([-2 / 3, -1 / 3, 0.0, 1 / 3])
    assert ages.day == 60.0
