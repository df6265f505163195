"""A row that was sampled in the edge of a record's first load tells no rest."""

import numpy as np
import pytest

from cellwright.effects.preparing import _settled
from cellwright.records.record import record_of


def discharge(first_second):
    """A discharge of minutes whose first row is logged without current, so long before the load."""
    time = np.append(0.0, first_second + np.arange(0.0, 600.0, 10.0))
    current = np.append(0.0, np.full(60, -7.5))
    return record_of(time, current, np.full(61, 3.9), np.full(61, 0.9), kind="capacity")


@pytest.mark.parametrize(("first_second", "rest_rows"), [(0.04, 0), (0.5, 1), (30.0, 1)])
def test_a_first_row_that_was_sampled_in_the_edge_is_no_rest(first_second, rest_rows):
    """An LG M50 of a public data set: 4.054 V at no current, 0.04 s before 1.5C, of a full cell."""
    settled = _settled(discharge(first_second))
    assert int(np.argmax(settled.current_ampere != 0.0)) == rest_rows
    assert len(settled.soc) == 60 + rest_rows


def test_a_record_without_a_load_keeps_its_rows():
    rest = record_of(np.arange(9.0), np.zeros(9), np.full(9, 3.7), np.full(9, 0.5))
    assert len(_settled(rest).soc) == 9
