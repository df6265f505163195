"""Records of one cell joined into a life; what is not comparable is left out, and said."""

import numpy as np
import pytest
from lives_made import life, record, smooth

from cellwright.health import lives
from cellwright.refusal import Refusal

STRAIGHT = smooth("straight", 40)


def joined(*records, rated=3.0):
    return lives.life_of(list(records), rated_capacity_ampere_hour=rated)


def test_records_are_joined_in_order_of_their_cycles():
    first = record(np.arange(1, 21), STRAIGHT[:20], test="a")
    second = record(np.arange(31, 51), STRAIGHT[20:], test="b", first=30)
    found = joined(second, first)
    assert found.test.tolist() == ["a"] * 20 + ["b"] * 20
    assert np.all(np.diff(found.cycle) > 0)
    assert np.isnan(found.pause_hour[20])
    assert found.pause_hour[0] == 0
    assert found.throughput_ampere_hour[-1] == pytest.approx(3 * STRAIGHT.sum())


def test_counts_that_overtake_the_next_record_are_equivalent_full_cycles():
    """Discharges of 60 % of the rating: 20 of them are 12 equivalent full cycles."""
    worn = np.full(20, 0.6)
    found = joined(
        record(np.arange(1, 21), worn, test="a"), record(14 + np.arange(1, 21), worn, first=14)
    )
    assert found.cycle[19] == pytest.approx(12.0)
    assert found.cycle[20] == pytest.approx(14.6)
    assert "equivalent full cycles" in found.notes[0]


def test_records_that_overlap_are_refused():
    with pytest.raises(
        Refusal, match=r"cycles out of order: a ends at cycle 18.9.*b begins with 5"
    ):
        joined(
            record(np.arange(1, 21), STRAIGHT[:20], test="a"),
            record(np.arange(5, 25), STRAIGHT[:20], test="b", first=4),
        )


def test_two_records_without_a_cycle_number_are_refused():
    with pytest.raises(Refusal, match="without a cycle number: a, b"):
        joined(record([1, 2], [1, 1], test="a"), record([1, 2], [1, 1], test="b"))


def test_mixed_temperatures_are_one_life_only_at_the_usual_one():
    found = joined(
        record(np.arange(1, 21), STRAIGHT[:20], celsius=25),
        record(np.arange(31, 36), STRAIGHT[20:25], test="cold", first=30, celsius=0),
        record(np.arange(41, 51), STRAIGHT[25:35], test="late", first=40, celsius=26),
    )
    assert "cold" not in found.test
    assert "late" in found.test
    assert "mixed temperatures (0, 25, 26 °C)" in found.notes[0]
    assert "left out cold" in found.notes[0]


@pytest.mark.parametrize("place", [0, 7, 20, 38])
@pytest.mark.parametrize("wrong", [0.5, 0.9])
def test_a_discharge_unlike_its_neighbours_is_left_out(place, wrong):
    share = STRAIGHT.copy()
    share[place] *= wrong
    found = life(share)
    assert not found.used[place]
    assert found.reason[place]
    assert found.used.sum() >= 38


def test_a_collapse_and_a_jump_after_a_pause_are_no_outliers():
    collapse = np.concatenate([STRAIGHT, STRAIGHT[-1] - 0.03 * np.arange(1, 11)])
    assert life(collapse).used[1:].all()
    saw = STRAIGHT - 0.004 * (np.arange(40) % 10)
    assert life(saw).used[1:].all()


def test_discharges_at_another_rate_are_left_out():
    columns = record(np.arange(1, 41), STRAIGHT)
    columns.columns["c_rate"][5::10] = 0.05
    found = joined(columns)
    assert not found.used[5::10].any()
    assert "usual rate" in found.reason[5]


def test_pauses_are_seen():
    hours = 3.0 * np.arange(40)
    hours[25:] += 48
    assert np.flatnonzero(life(STRAIGHT, hours=hours).pause_hour).tolist() == [25]


def test_an_empty_record_is_refused():
    empty = record([1.0], [1.0])
    empty.columns["direction"][0] = "charge"
    with pytest.raises(Refusal, match="no complete discharge"):
        joined(empty)


def test_temperature_is_taken_out_only_where_its_slope_is_told():
    cycles = {
        "start_time_second": np.array([0.0, 1.0]),
        "capacity_ampere_hour": np.array([3.0, 3.1]),
        "capacity_at_reference_ampere_hour": np.array([3.0, 3.0]),
    }
    slope = {"slope_percent_per_kelvin": 0.2, "slope_std_percent_per_kelvin": 0.05}
    assert lives.temperature_shift(slope, cycles) == pytest.approx({0.0: 0.0, 1.0: 0.1})
    assert lives.temperature_shift(slope | {"slope_std_percent_per_kelvin": 0.2}, cycles) == {}
    assert lives.temperature_shift(slope | {"slope_percent_per_kelvin": np.nan}, cycles) == {}
