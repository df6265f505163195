"""When a pulse began: rows missing at its edge are told, or what they leave open is stated."""

import numpy as np
import pytest
from counted import series_of

from cellwright.protocols.pulse_begin import begin_of, late_among_others
from cellwright.protocols.resistance import pulse_resistance
from cellwright.series.steps import segment

OHM, GROWS_OHM, RATED = 0.020, 0.004, 3.0


def pulse(rest_rows=60, lost=0, pace=0.1):
    """Rest of a row a second, then 10 s of 3 A; R grows by 4 mΩ an e-fold from 0.1 s on.

    lost : first rows of the pulse that are missing, the clock going on.
    """
    inside = np.arange(1, round(10 / pace) + 1) * pace
    time = np.r_[np.arange(rest_rows) - rest_rows + 1.0, inside[lost:]]
    current = np.r_[np.zeros(rest_rows), np.full(len(inside) - lost, -3.0)]
    ratio = OHM + GROWS_OHM * np.log(np.maximum(time, 0.1) / 0.1)
    return time - time[0], current, 3.7 + ratio * current


def rows_of(time, current, voltage):
    charge = np.cumsum(np.r_[0, np.diff(time)] * current) / 3600
    steps = segment(time, current, voltage, charge, rated_capacity_ampere_hour=RATED)
    soc = 0.5 + charge / RATED
    how = {"rated_capacity_ampere_hour": RATED, "delay_second": (0.0,)}
    return pulse_resistance(series_of(time, current, voltage), soc, steps, **how).rows


def test_a_whole_pulse_is_sure():
    rows = rows_of(*pulse())
    assert rows["resistance_ohm"][0] == pytest.approx(OHM, rel=0.01)
    assert rows["resistance_std_ohm"][0] < 0.01 * OHM
    assert rows["doubt"][0] == ""


def test_rows_missing_after_a_rest_of_one_row_are_in_the_interval():
    """Nothing tells that they are: the record begins with the pulse."""
    for lost in (5, 20, 40):
        rows = rows_of(*pulse(rest_rows=1, lost=lost))
        off = abs(rows["resistance_ohm"][0] - OHM)
        assert 0.2 * OHM < off < 2 * rows["resistance_std_ohm"][0]


def test_rows_missing_after_a_rest_of_many_rows_are_told():
    rows = rows_of(*pulse(lost=20))
    assert (
        "its first sample comes 2.1 s after the rest, where rows lie 1 s apart"
        in (rows["doubt"][0])
    )


def test_a_pulse_that_begins_later_than_all_others_of_its_record():
    assert late_among_others([0.1, 0.1, np.nan, 0.12]) == [""] * 4
    said = late_among_others([0.1, 0.1, np.nan, 2.0])
    assert said[:3] == [""] * 3
    assert "comes 2 s after the rest, in the record's other pulses 0.1 s" in said[3]


def test_after_a_load_nothing_is_said_of_the_begin():
    begun = begin_of(np.empty(0), 5.0, 0.1, np.array([0.1, 0.2]), np.array([0.02, 0.021]))
    assert (begun.from_rest, begun.unsure_ohm, begun.lacking) == (False, 0.0, "")


def test_what_the_ammeter_reads_at_rest_is_part_of_the_deviation():
    time, current, voltage = pulse()
    off = np.where(current == 0, 0.1, current)
    std = rows_of(time, off, voltage)["resistance_std_ohm"][0]
    assert std == pytest.approx(OHM * 0.1 / 3.1 / np.sqrt(3), rel=0.05)
