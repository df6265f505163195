"""What a record's counter leaves open of its charge: right values by hand."""

import numpy as np
import pytest

from cellwright.records.counting import counted_std_share
from cellwright.records.record import record_of

CAPACITY = 2.0


def an_hour_at_rest_and_an_hour_of_load(zero_ampere=0.0, load_ampere=-1.0):
    time = np.arange(0.0, 7210.0, 10.0)
    current = np.where(time <= 3600.0, zero_ampere, load_ampere)
    soc = 0.9 + np.concatenate([[0.0], np.cumsum(current[1:])]) * 10.0 / 3600.0 / CAPACITY
    return record_of(time, current, np.full(len(time), 3.7), soc)


def share(record):
    return counted_std_share(record, capacity_ampere_hour=CAPACITY)


def test_under_load_the_range_counts_and_not_in_the_rest_that_shows_zero():
    """0.05 % of 1 A for an hour, uniform, of 1 Ah; the step between two rows is counted."""
    assert share(an_hour_at_rest_and_an_hour_of_load()) == pytest.approx(5e-4 / 3**0.5, rel=0.01)


def test_what_rests_read_may_be_read_all_the_while():
    """4 mA for two hours, beside the 0.5 mA of the range for one, of 1 Ah."""
    record = an_hour_at_rest_and_an_hour_of_load(0.004)
    assert share(record) == pytest.approx(np.hypot(8e-3, 5e-4) / 3**0.5, rel=0.01)


def test_a_step_between_two_rows_lies_anywhere_where_the_charge_does_not_tell():
    record = an_hour_at_rest_and_an_hour_of_load()
    middle = np.zeros(len(record.soc))
    middle[record.test_time_second > 3600.0] = 0.5 * 10.0 / 3600.0 / CAPACITY
    of_step = 10.0 / 3600.0 / 12**0.5  # 1 A within 10 s, in Ah of the 1 Ah that passes
    assert share(record._replace(soc=record.soc + middle)) == pytest.approx(
        np.hypot(5e-4 / 3**0.5, of_step), rel=0.01
    )


def test_where_no_charge_passes_nothing_is_known_of_it():
    assert share(an_hour_at_rest_and_an_hour_of_load(load_ampere=0.0)) == np.inf
