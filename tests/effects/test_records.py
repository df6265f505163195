"""Records laid one after the other: clocks, holds, directions, and what is refused."""

import numpy as np
import pytest

from cellwright.effects.preparing import _thinned
from cellwright.effects.records import stacked
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

CAPACITY = 2.0


def record(current, *, test="one", soc=0.5, every=2.0, **changes):
    blank = np.zeros(len(current))
    clock = every * np.arange(len(current))
    made = record_of(clock, current, blank + 3.7, soc, test=test)
    return made._replace(**changes)


def laid(*records, **options):
    return stacked(records, capacity_ampere_hour=CAPACITY, **options)


def test_two_records_lie_one_after_the_other_and_each_begins_anew():
    stack = laid(record([0, -1, -1]), record([0, 2], test="two", every=5.0))
    assert stack.tests == ("one", "two")
    assert stack.first.tolist() == [0, 3]
    assert stack.file.tolist() == [0, 0, 0, 1, 1]
    assert stack.fresh.tolist() == [1, 0, 0, 1, 0]
    assert stack.step_second.tolist() == [0, 2, 2, 0, 5]
    assert stack.part([1]).tolist() == [False, False, False, True, True]
    assert stack.used.all()


def test_the_current_of_a_row_flows_until_the_next():
    assert laid(record([1, -1, 3])).held_ampere.tolist() == [0, 1, -1]


def test_a_straight_current_is_held_at_its_mean():
    stack = laid(record([0, 1, 3, 2, -1, 2, 0, 1]), hold="first_order")
    assert stack.linear[1:].all()
    assert stack.held_ampere.tolist() == [0, 0.5, 2, 2.5, 0.5, 0.5, 1, 0.5]


def test_a_record_that_steps_between_steady_stretches_is_held_even_then():
    stack = laid(record([0, 0, 0, -2, -2, -2, 0, 0, 0]), hold="first_order")
    assert not stack.linear.any()
    assert stack.held_ampere[3] == 0.0
    assert stack.held_ampere[6] == -2.0


def falling(every):
    """A charge whose last hour is at a held voltage, a rest on both sides: (clock, current)."""
    clock = np.arange(0.0, 9000.0, every)
    load = np.where(clock < 4000, 1.0, np.exp(-(clock - 4000) / 600))
    return clock, np.where((clock >= 600) & (clock < 7600), load, 0.0)


@pytest.mark.parametrize("hold", ["zero_order", "first_order"])
@pytest.mark.parametrize("every", [5.0, 20.0, 30.0])
def test_a_current_that_falls_while_the_voltage_is_held_is_counted_right(hold, every):
    clock, current = falling(every)
    stack = laid(record(current, test_time_second=clock), hold=hold)
    true = 3400.0 + 600.0 * (1 - np.exp(-6))
    assert (stack.held_ampere * stack.step_second).sum() == pytest.approx(true, rel=1e-3)


def test_between_rows_that_were_thinned_out_the_counter_counts():
    clock, current = falling(1.0)
    counted = np.r_[0, np.cumsum(np.diff(clock) * (current[1:] + current[:-1]) / 2)] / 7200.0
    fine = record(current, test_time_second=clock, soc=counted)
    (thin,) = _thinned([fine], CAPACITY)
    stack = laid(thin)
    moved = np.cumsum(stack.held_ampere * stack.step_second / 3600.0)
    assert len(moved) < len(clock) / 20
    falls = (thin.test_time_second > 700) & (thin.test_time_second < 7500)
    known = (thin.soc - thin.soc[falls][0])[falls] * CAPACITY
    assert moved[falls] - moved[falls][0] == pytest.approx(known, abs=1e-6)
    assert not stack.unseen_ampere_hour.any()


@pytest.mark.parametrize(("soc", "before"), [(1.0, 1), (0.5, 0), (0.02, -1)])
def test_the_direction_is_that_of_the_last_load(soc, before):
    stack = laid(record([0, 0.001, -1, 0, 0.006, 2, 0], soc=soc))
    assert stack.direction.tolist() == [before, before, -1, -1, -1, 1, 1]


def test_no_record_is_refused():
    with pytest.raises(Refusal, match="no record"):
        laid()


@pytest.mark.parametrize("name", ["test_time_second", "current_ampere", "voltage_volt", "celsius"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_refused_with_test_and_row(name, value):
    wrong = np.array([0.0, 1.0, value, 3.0])
    with pytest.raises(Refusal, match=rf"bad: row 2 of {name}"):
        laid(record([0] * 4), record([0] * 4, test="bad", **{name: wrong}))


def test_a_clock_that_runs_back_is_refused_with_test_and_row():
    clock = np.array([0.0, 1.0, 0.5, 2.0])
    with pytest.raises(Refusal, match="bad: the clock runs back after row 1"):
        laid(record([0] * 4, test="bad", test_time_second=clock))
