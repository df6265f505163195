"""Anchors of the state of charge, in their order, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellwright.records.anchor import contradiction, full_row, slow_soc, soc_series
from cellwright.refusal import Refusal

TABLE = {"curve": {"soc": np.array([0.0, 0.5, 1.0]), "ocv_volt": np.array([3.0, 3.6, 4.2])}}
LIMITS = {"lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.2}


def filled():
    """A charge to 4.2 V, held to C/50, then half the 2 Ah out: (charge, current, voltage)."""
    current = np.array([0.0, 1.0, 1.0, 0.4, 0.04, 0.0, -1.0, -1.0])
    voltage = np.array([3.3, 3.8, 4.2, 4.2, 4.2, 4.18, 3.9, 3.8])
    charge = np.array([0.0, 0.5, 1.0, 1.2, 1.3, 1.3, 0.8, 0.3])
    return charge, current, voltage


def test_stated_start_comes_first():
    anchored = soc_series(*filled(), capacity_ampere_hour=2.0, soc_at_start=0.3, **LIMITS, **TABLE)
    assert np.allclose(anchored.soc, 0.3 + filled()[0] / 2)
    assert (anchored.anchor, anchored.row) == ("stated at the start", 0)


def test_full_charge_in_the_record_is_one():
    anchored = soc_series(*filled(), capacity_ampere_hour=2.0, **LIMITS, **TABLE)
    assert np.allclose(anchored.soc[[4, -1]], [1.0, 0.5])
    assert anchored.row == 4


def test_a_slow_test_is_empty_where_its_discharge_ends():
    charge = np.array([0.0, -1.0, -1.98, -1.98, -0.5, 0.01])
    anchored = slow_soc(charge, capacity_ampere_hour=2.0)
    assert anchored.row == 2
    assert np.allclose(anchored.soc, (charge + 1.98) / 2)


def test_charge_pulse_that_touches_the_limit_is_not_full():
    rate = np.array([0.0, 0.7, 0.5, 0.0])
    assert full_row(rate, np.array([4.1, 4.2, 4.2, 4.15]), 4.2) is None
    assert full_row(rate, np.array([4.1, 4.2, 4.2, 4.15]), None) is None


def test_rest_voltage_is_looked_up_and_counting_is_not_clipped():
    charge, current, voltage = np.array([0.0, 0, -1.9]), np.array([0.0, -1, -1]), [3.9, 3.7, 3.0]
    anchored = soc_series(charge, current, voltage, capacity_ampere_hour=2.0, **LIMITS, **TABLE)
    assert np.allclose(anchored.soc, [0.75, 0.75, -0.2])
    assert "rest voltage" in anchored.anchor


@given(st.floats(2.0, 5.0))
def test_looked_up_start_stays_within_the_scale(volt):
    still = np.zeros(3)
    anchored = soc_series(still, still, still + volt, capacity_ampere_hour=2.0, **LIMITS, **TABLE)
    assert 0 <= anchored.soc[0] <= 1


def test_flat_table_is_allowed():
    still, table = np.zeros(3), {"soc": [0, 0.3, 0.6, 1], "ocv_volt": [3.0, 3.3, 3.3, 3.4]}
    about = {"capacity_ampere_hour": 2.0, "curve": table, **LIMITS}
    anchored = soc_series(still, still, still + 3.35, **about)
    assert np.isclose(anchored.soc[0], 0.8)


@pytest.mark.parametrize(("moved", "first"), [(1.9, 0.975), (2.0, 1.0), (2.1, 1.0), (1.79, None)])
def test_a_record_of_nearly_the_whole_scale_has_its_place(moved, first):
    """K2's pulse tests: from full, but under load, of a cell without an upper limit or an OCV."""
    charge = -np.linspace(0, moved, 5)
    settings = {"capacity_ampere_hour": 2.0, "lower_cutoff_volt": 3.0, "upper_cutoff_volt": None}
    if first is None:
        with pytest.raises(Refusal, match="no OCV table"):
            soc_series(charge, np.full(5, -1.0), np.full(5, 3.7), **settings)
        return
    anchored = soc_series(charge, np.full(5, -1.0), np.full(5, 3.7), **settings)
    assert np.allclose(anchored.soc, first + charge / 2)
    assert "moves" in anchored.anchor


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"capacity_ampere_hour": None}, "needs a positive one"),
        ({"soc_at_start": 1.2}, "allowed is 0 to 1"),
        ({}, "never ends a charge full at 4.2 V, and there is no OCV table"),
        ({"upper_cutoff_volt": None}, "upper cut-off is not stated"),
        (TABLE, "starts under a load of 0.5 C"),
    ],
)
def test_refusals_name_what_is_missing(change, reason):
    load = np.full(3, -1.0)
    settings = {"capacity_ampere_hour": 2.0, **LIMITS, **change}
    with pytest.raises(Refusal, match=reason):
        soc_series(np.zeros(3), load, np.full(3, 3.7), **settings)


CURVE = {"soc": np.linspace(0, 1, 101), "ocv_volt": 3.0 + 1.2 * np.linspace(0, 1, 101)}


@pytest.mark.parametrize(
    ("stated", "rest", "gap", "used"),
    [(1.0, 4.2, 0.0, True), (1.0, 3.96, 0.0, False), (0.8, 3.96, 0.0, True), (0.8, 3.93, 0.0, True)]
    + [(0.5, 3.96, 0.0, False), (0.5, 3.96, 0.3, True)],
)
def test_a_stated_soc_counts_unless_the_first_rest_contradicts_it(stated, rest, gap, used):
    still = np.zeros(3)
    about = {"capacity_ampere_hour": 2.0, "soc_at_start": stated, **LIMITS}
    about["curve"] = CURVE | {"half_gap_volt": np.full(101, gap)}
    about["test_time_second"] = np.array([0.0, 300.0, 700.0])
    anchored = soc_series(still, still, still + rest, **about)
    assert anchored.soc[0] == pytest.approx(stated if used else (rest - 3.0) / 1.2, abs=1e-6)
    assert ("is not used: a rest at" in anchored.anchor) is not used


def test_a_stated_soc_counts_under_load_and_without_a_curve():
    load = np.full(3, -1.0)
    about = {"capacity_ampere_hour": 2.0, "soc_at_start": 1.0, **LIMITS}
    assert soc_series(load * 0, load, load * 0 + 3.9, **about, curve=CURVE).soc[0] == 1.0
    still = soc_series(load * 0, load * 0, load * 0 + 3.9, **about)
    assert (still.soc[0], still.anchor) == (1.0, "stated at the start")


def test_a_rest_of_a_minute_after_a_load_does_not_overrule_what_is_stated():
    """A lithium iron phosphate cell at 50 %, still 40 mV below where its load will leave it."""
    soc = np.linspace(0, 1, 101)
    flat = {"soc": soc, "ocv_volt": 3.27 + 0.03 * soc + 0.1 * (1 - np.exp(-soc / 0.02)) - 0.1}
    about = {"capacity_ampere_hour": 2.0, "soc_at_start": 0.5, "curve": flat}
    about |= {"lower_cutoff_volt": 2.5, "upper_cutoff_volt": 3.65}
    volt, still = float(np.interp(0.5, soc, flat["ocv_volt"])) - 0.04, np.zeros(3)
    for second, stated in ((30.0, True), (900.0, False)):
        time = np.array([0.0, second / 2, second])
        found = soc_series(still, still, still + volt, **about, test_time_second=time)
        assert (found.anchor == "stated at the start") is stated


def test_without_a_curve_an_empty_cell_may_rest_on_its_plateau():
    limits = (2.0, 3.65)
    assert contradiction(0.0, 2.95, limits) == ""
    assert contradiction(0.0, 3.1, (2.5, 3.65)) == ""
    assert "tells no such cell" in contradiction(0.0, 3.45, limits)
    assert "tells no such cell" in contradiction(1.0, 2.6, limits)
