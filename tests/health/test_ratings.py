"""Ratings of check-ups: arithmetic on rows whose answers are known, and what is not known."""

import numpy as np
import pytest
from pulse_rows import pulse

from cellwright.health.ratings import ratings_of, resistance_growth
from cellwright.records.facts import CellFacts
from cellwright.refusal import Refusal

LIMITS = {
    "rated_capacity_ampere_hour": 2.0,
    "lower_cutoff_volt": 3.0,
    "upper_cutoff_volt": 4.2,
}


def capacity(cycle, size, *, direction="discharge", rate=0.5, celsius=25.0, volt=3.7, **more):
    return {
        "test": f"capacity_{cycle}_{rate}",
        "cycle": cycle,
        "ambient_temperature_celsius": celsius,
        "direction": direction,
        "c_rate": rate,
        "capacity_ampere_hour": size,
        "capacity_std_ampere_hour": np.nan,
        "repeats": 1,
        "energy_watt_hour": volt * size,
    } | more


def check_ups(capacities, resistances, *, throughputs=(), **sheet):
    return ratings_of(capacities, resistances, CellFacts("A", **sheet), throughputs)


def pulses(cycle, ohm, **more):
    return [pulse(soc, ohm, cycle=cycle, **more) for soc in np.arange(0.1, 0.95, 0.1)]


def test_state_of_health_and_changes_are_over_the_first_check_up():
    rows, notes = check_ups(
        [capacity(None, 2.0), capacity(300, 1.8), capacity(600, 1.5)],
        [*pulses(None, 0.05), *pulses(600, 0.1)],
        **LIMITS,
    )
    assert [row["cycle"] for row in rows] == [0, 300, 600]
    assert [row["soh"] for row in rows] == pytest.approx([1, 0.9, 0.75])
    assert rows[0]["soh_std"] == 0
    assert rows[2]["soh_std"] == pytest.approx(0.75 * 0.002 * np.sqrt(2))
    assert rows[2]["capacity_change"] == pytest.approx(-0.25)
    assert rows[2]["resistance_change"] == pytest.approx(1.0)
    assert rows[2]["discharge_power_change"] == pytest.approx(-0.5)
    assert np.isnan(rows[1]["resistance_change"])
    assert not notes


def test_power_is_what_the_limits_allow():
    """3 V · (3.7 − 3) V / 0.05 Ω = 42 W; 4.2 V · (4.2 − 3.7) V / 0.04 Ω = 52.5 W."""
    both = [*pulses(0, 0.05), *pulses(0, 0.04, direction="charge")]
    (row,), _ = check_ups([capacity(0, 2.0)], both, **LIMITS)
    assert row["discharge_power_50_watt"] == pytest.approx(42)
    assert row["charge_power_20_watt"] == pytest.approx(52.5)
    (bare,), _ = check_ups([capacity(0, 2.0)], both, **LIMITS | {"lower_cutoff_volt": None})
    assert np.isnan(bare["discharge_power_50_watt"])


def test_no_power_is_told_beyond_the_pulses():
    few = [pulse(soc, 0.05, cycle=0) for soc in (0.4, 0.6)]
    (row,), _ = check_ups([capacity(0, 2.0)], few, **LIMITS)
    assert row["discharge_power_50_watt"] == pytest.approx(42)
    assert np.isnan(row["discharge_power_80_watt"])
    assert np.isnan(row["discharge_power_20_watt"])
    far = [pulse(soc, 0.05, cycle=0) for soc in (0.1, 0.9)]
    assert np.isnan(check_ups([capacity(0, 2.0)], far, **LIMITS)[0][0]["discharge_power_50_watt"])


def test_round_trip_is_at_equal_charge():
    """A charge that puts in more than came out before is no loss of energy."""
    pair = [capacity(0, 2.0, volt=3.6), capacity(0, 2.1, volt=3.8, direction="charge")]
    assert check_ups(pair, [], **LIMITS)[0][0]["round_trip_efficiency"] == pytest.approx(3.6 / 3.8)


def test_capacities_are_compared_at_one_rate_direction_and_temperature():
    rows, notes = check_ups(
        [
            capacity(0, 2.0),
            capacity(0, 2.1, rate=0.05, direction="charge"),
            capacity(0, 1.2, celsius=0.0),
            capacity(500, 1.7, rate=0.51),
            capacity(500, 1.9, rate=0.05, direction="charge"),
        ],
        [],
        **LIMITS,
    )
    assert [row["capacity_ampere_hour"] for row in rows] == [2.0, 1.7]
    assert "tests at 0 °C are left out" in notes[0]


def test_capacities_without_a_stated_temperature_count_beside_pulses_at_several():
    sizes = [capacity(0, 30.3, celsius=None, rate=0.9), capacity(0, 29.9, celsius=None, rate=1.9)]
    at = [*pulses(0, 0.002, celsius=10.0), *pulses(0, 0.001, celsius=25.0)]
    (row,), _ = check_ups(sizes, at, **LIMITS)
    assert row["capacity_ampere_hour"] == 30.3
    assert np.isnan(row["ambient_temperature_celsius"])
    assert row["resistance_10s_ohm"] == pytest.approx(0.001)


def test_without_a_fresh_check_up_the_rating_serves():
    (row,), _ = check_ups([capacity(400, 1.7)], [], **LIMITS)
    assert row["soh"] == pytest.approx(0.85)
    assert row["soh_reference"] == "rating"
    (row,), _ = check_ups([capacity(400, 1.7)], [], **LIMITS | {"rated_capacity_ampere_hour": None})
    assert np.isnan(row["soh"])
    assert "not knowable" in row["reason"]


def test_a_stated_state_of_health_serves_where_no_test_tells_one():
    (row,), notes = check_ups([], pulses(0, 0.02), state_of_health=0.75, **LIMITS)
    assert (row["capacity_ampere_hour"], row["soh"]) == (1.5, 0.75)
    assert row["soh_reference"] == "stated in cells.tsv"
    assert np.isnan(row["capacity_std_ampere_hour"])
    assert "1.5 Ah, rating times the stated state of health, 0.75; no test" in notes[0]


def test_a_measured_capacity_goes_before_a_stated_one_and_a_contradiction_is_told():
    rows, notes = check_ups([capacity(0, 1.8)], [], state_of_health=0.75, **LIMITS)
    assert (rows[0]["capacity_ampere_hour"], rows[0]["soh_reference"]) == (1.8, "first check-up")
    assert "states a state of health of 0.75, 1.5 Ah; the first check-up measures 1.8" in notes[0]
    assert check_ups([capacity(0, 1.52)], [], state_of_health=0.75, **LIMITS)[1] == []


def test_after_a_stated_state_of_health_later_ones_are_over_the_rating():
    capacities = [capacity(500, 1.2)]
    rows, _ = check_ups(capacities, pulses(0, 0.02), state_of_health=0.75, **LIMITS)
    assert [row["soh"] for row in rows] == [0.75, 0.6]
    assert rows[1]["soh_reference"] == "rating"


def test_throughput_is_known_as_far_as_records_reach():
    more = [(1.0, 2.0), (300.0, 590.0)]
    rows, _ = check_ups([capacity(c, 2.0) for c in (0, 300, 600)], [], throughputs=more, **LIMITS)
    assert [row["throughput_ampere_hour"] for row in rows[:2]] == [0, 590]
    assert np.isnan(rows[2]["throughput_ampere_hour"])


def test_check_ups_without_a_cycle_number_are_not_taken_for_one():
    """Two capacities of a fresh cell that differ by 10 % are two check-ups: neither is told."""
    blank = [capacity(None, 2.0, test="a"), capacity(None, 1.8, test="b")]
    (row,), _ = check_ups(blank, [], **LIMITS)
    assert np.isnan(row["soh"])
    assert np.isnan(row["capacity_ampere_hour"])
    assert "a, b stand at cycle 0 and give 2, 1.8 Ah" in row["reason"]
    repeats = [capacity(None, 2.0, test="a"), capacity(None, 1.99, test="b")]
    assert check_ups(repeats, [], **LIMITS)[0][0]["soh"] == 1


def test_tests_of_neighbouring_cycles_are_one_check_up():
    rows, _ = check_ups([capacity(0, 2.0), capacity(300, 1.8)], pulses(303, 0.1), **LIMITS)
    assert [row["cycle"] for row in rows] == [0, 300]
    assert rows[1]["resistance_10s_ohm"] == pytest.approx(0.1)


def test_nothing_at_all_is_refused():
    with pytest.raises(Refusal, match="no capacity and no resistance"):
        check_ups([], [], **LIMITS)
    with pytest.raises(Refusal, match="known state of charge"):
        resistance_growth([pulse(np.nan, 0.05)])


def test_growth_is_read_at_equal_soc_and_no_further():
    fresh = [pulse(soc, 0.05 + 0.1 * soc, cycle=0) for soc in (0.2, 0.4, 0.6)]
    aged = [pulse(soc, 4 * (0.05 + 0.1 * soc), cycle=900) for soc in (0.3, 0.5, 0.8)]
    rows = [row for row in resistance_growth([*fresh, *aged]) if row["cycle"] == 900]
    assert [row["factor"] for row in rows[:2]] == pytest.approx([4, 4])
    assert rows[0]["factor_std"] == pytest.approx(4 * 0.01 * np.sqrt(2), rel=0.01)
    assert np.isnan(rows[2]["factor"])


def test_growth_has_the_check_ups_and_the_temperature_of_the_ratings():
    """A capacity at cycle 0 beside pulses at cycle 2, and pulses in the cold that others lack."""
    sizes = [capacity(0, 2.0), capacity(300, 1.8)]
    warm = [*pulses(2, 0.031), *pulses(302, 0.04)]
    cold = [*pulses(2, 0.093, celsius=0.0), *pulses(302, 0.12, celsius=0.0)]
    rows, _ = check_ups(sizes, [*warm, *cold], **LIMITS)
    growth = resistance_growth([*warm, *cold], sizes)
    assert {row["cycle"] for row in growth} == {row["cycle"] for row in rows} == {0, 300}
    assert {row["resistance_ohm"] for row in growth if row["cycle"] == 0} == {0.031}


def test_a_rating_is_in_doubt_for_what_it_is_from_and_compared_with_alone():
    """Of three check-ups the second one's capacity is in doubt; a C/20 test of the first one, that
    no rating is from, is in doubt as well."""
    sizes = [capacity(0, 2.0), capacity(300, 1.9) | {"doubt": "odd"}, capacity(600, 1.8)]
    slow = capacity(0, 2.1) | {"c_rate": 0.05, "test": "slow", "doubt": "wrong"}
    rows, _ = check_ups([*sizes, slow], [], **LIMITS)
    odd = f"{sizes[1]['test']}: odd"
    assert [row["doubt"] for row in rows] == ["", odd, ""]
    sizes[0]["doubt"] = "far off"
    rows, _ = check_ups([*sizes, slow], [], **LIMITS)
    far = f"{sizes[0]['test']}: far off"
    assert [row["doubt"] for row in rows] == [far, f"{odd}; {far}", far]


def test_growth_is_in_doubt_for_its_pulse_and_the_first_ones():
    fresh, aged = pulses(0, 0.02), [row | {"doubt": "coarse"} for row in pulses(300, 0.03)]
    found = resistance_growth([*fresh, *aged])
    told = {(row["cycle"], row["doubt"]) for row in found}
    assert told == {(0, ""), (300, f"{aged[0]['test']}: coarse")}
