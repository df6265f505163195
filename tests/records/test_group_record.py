"""A test of a parallel group: branch currents in their order, starts, temperature, refusal."""

import numpy as np
import pytest
from sheets_facts import branch_facts, facts_of, measured_test

from cellwright.records.record import branch_currents, group_record, stated_soc
from cellwright.refusal import Refusal

ROWS = np.arange(5.0)


def made(branches, soc=None, **more):
    series = {"test_time_second": ROWS, "current_ampere": -ROWS, "voltage_volt": 3.7 + 0 * ROWS}
    series |= {f"branch_{k}_current_ampere": k * ROWS for k in branches}
    return measured_test(series | more, "pair", "group", celsius=12.0, soc=soc)


def test_branches_stand_in_the_order_of_their_numbers():
    currents = branch_currents(made((10, 2, 1, 11, 3)).series)
    np.testing.assert_array_equal(currents[1], [1, 2, 3, 10, 11])
    assert branch_currents(made(()).series) is None


def test_a_test_of_a_group_as_a_record():
    record = group_record(made((1, 2)), branch_facts("AB", [0.9, 0.8]))
    assert record.test == "pair"
    np.testing.assert_array_equal(record.current_ampere, -ROWS)
    np.testing.assert_array_equal(record.branch_current_ampere, np.column_stack([ROWS, 2 * ROWS]))
    np.testing.assert_array_equal(record.celsius, 12.0)
    np.testing.assert_array_equal(record.initial_soc, [0.9, 0.8])
    warm = made((1, 2), surface_temperature_celsius=ROWS)
    np.testing.assert_array_equal(group_record(warm, branch_facts("AB", [1, 1])).celsius, ROWS)


def test_the_start_is_the_tests_else_the_branches_or_unknown():
    rows = branch_facts("AB", [0.9, None])
    assert stated_soc(facts_of(soc=0.5), rows) == [0.5, 0.5]
    assert stated_soc(facts_of(), rows) == [0.9, None]
    assert group_record(made((1, 2)), rows).initial_soc is None


def test_another_number_of_branch_currents_is_refused():
    with pytest.raises(Refusal, match=r"pair has 3 branch currents for 2 branches of groups\.tsv"):
        group_record(made((1, 2, 3)), branch_facts("AB", [0.9, 0.8]))
