"""Tests of one cell held against each other."""

import time

import numpy as np
import pytest

from cellwright.records import agreement
from cellwright.records.agreement import disagreements


def capacity(test, ampere_hour, c_rate, **more):
    row = {
        "cell": "A", "test": test, "cycle": None, "ambient_temperature_celsius": 25.0,
        "direction": "discharge", "c_rate": c_rate, "capacity_ampere_hour": ampere_hour,
        "capacity_std_ampere_hour": float("nan"), "temperature_mean_celsius": 26.0, "doubt": "",
    }  # fmt: skip
    return row | more


def doubts(rows, quantity="capacity"):
    return [row["doubt"] for row in disagreements(rows, quantity=quantity).rows]


def test_tests_that_agree_say_nothing_of_each_other():
    rows = [capacity("ocv", 3.02, 0.05), capacity("slow", 3.0, 0.5), capacity("fast", 2.9, 1.0)]
    assert doubts(rows) == ["", "", ""]


def of_sizes(*amperes):
    """Doubts of tests of a cell of 2.6 Ah at these currents [A]."""
    return doubts(
        [
            capacity(f"t{k}", 2.6 - 0.01 * a, a / 2.6, mean_current_ampere=-a)
            for k, a in enumerate(amperes)
        ]
    )


def test_a_current_cut_to_a_round_one_where_all_others_are_round_rates():
    """C/2 and 1C of 2.6 Ah are no round ampere: 5 A is 2C, 5.2 A, cut to half an ampere."""
    assert of_sizes(1.3, 2.6, 5.2) == ["", "", ""]
    said = of_sizes(1.3, 2.6, 5.0)
    assert said[:2] == ["", ""]
    assert "5 A (1.92C) is no round one" in said[2]


def test_a_rate_that_is_round_where_all_others_are_set_in_ampere():
    assert of_sizes(0.6, 3.0, 10.0) == ["", "", ""]
    assert "no round one" in of_sizes(2.0, 7.0, 2.6)[2]


def test_currents_that_are_round_either_way_tell_nothing():
    rows = [
        capacity(f"t{k}", 3.0, rate, mean_current_ampere=-3.0 * rate)
        for k, rate in enumerate((0.5, 1.0))
    ]
    assert doubts([*rows, capacity("odd", 2.9, 5.0 / 3.0, mean_current_ampere=-5.0)]) == [""] * 3


def test_a_faster_load_warms_a_cell_no_less():
    """As one beside another cell's thermometer seems to do; in another chamber it may."""
    slow = capacity("slow", 3.0, 1.0, temperature_mean_celsius=31.0)
    cold = capacity("fast", 2.9, 2.0, temperature_mean_celsius=26.0)
    assert "slow at 1C warms the cell to 31 °C" in doubts([slow, cold])[1]
    for fast in (
        capacity("fast", 2.9, 2.0, temperature_mean_celsius=36.0),
        capacity("fast", 2.9, 1.3, temperature_mean_celsius=26.0),
        capacity("fast", 2.9, 2.0, temperature_mean_celsius=float("nan")),
    ):
        assert doubts([slow, fast]) == ["", ""]
    little = capacity("slow", 3.0, 1.0, temperature_mean_celsius=27.0)
    assert doubts([little, capacity("fast", 2.9, 2.0, temperature_mean_celsius=25.5)]) == ["", ""]


def test_of_two_that_contradict_each_other_both_are_in_doubt():
    first, second = doubts([capacity("slow", 2.8, 0.05), capacity("fast", 3.0, 1.0)])
    assert first.startswith("fast gives 3 Ah at 1C: a slower load gives no less")
    assert second.startswith("slow gives 2.8 Ah")


def test_of_three_the_odd_one_out_is():
    rows = [capacity("a", 3.0, 0.5), capacity("b", 3.01, 0.5), capacity("odd", 2.6, 0.5)]
    said = doubts(rows)
    assert said[:2] == ["", ""]
    assert "the same rate (and 1 more test against it)" in said[2]


@pytest.mark.parametrize(
    "more",
    [
        {"ambient_temperature_celsius": 0.0},
        {"cell": "B"},
        {"temperature_mean_celsius": 35.0},
        {"capacity_std_ampere_hour": 0.2},
        {"direction": "charge"},
    ],
)
def test_what_was_not_made_alike_is_not_compared(more):
    assert doubts([capacity("slow", 2.8, 0.05), capacity("fast", 3.0, 1.0, **more)]) == ["", ""]


def test_no_older_cell_gives_more_at_one_rate():
    ages = zip((0, 100, 200, 300), (4.4, 3.4, 4.2, 4.1), strict=True)
    rows = [capacity(f"cu{k}", ah, 1.0, cycle=k, direction="charge") for k, ah in ages]
    said = doubts(rows)
    assert said[0] == said[2] == said[3] == ""
    assert said[1] == (
        "cu200 gives 4.2 Ah at cycle 200: no older cell gives more (and 1 more test against it)"
    )
    rows[1] |= {"c_rate": 0.8}  # as a current that reads too low says
    assert doubts(rows) == said
    # Three per cent of it repeats do; a cell that its own larger resistance warms gives more.
    assert (
        doubts([capacity("a", 4.0, 1.0, cycle=0), capacity("b", 4.1, 1.0, cycle=100)]) == [""] * 2
    )
    warm = capacity("b", 4.4, 1.0, cycle=100, temperature_mean_celsius=35.0)
    assert doubts([capacity("a", 4.0, 1.0, cycle=0), warm]) == [""] * 2


def test_cycles_of_one_ageing_test_differ_because_the_cell_ages():
    rows = [capacity("life", 3.0 - 0.1 * k, 1.0, cycle=k) for k in range(4)]
    assert not any(doubts([*rows, capacity("check", 3.0, 1.0, cycle=0)]))


def test_a_resistance_half_as_large_again_as_others_at_its_soc():
    row = {
        "cell": "A", "cycle": None, "ambient_temperature_celsius": 25.0, "direction": "discharge",
        "delay_second": 0.0, "actual_delay_second": 0.1, "soc": 0.5, "resistance_std_ohm": 1e-4,
        "doubt": "said before",
    }  # fmt: skip
    rows = [
        row | {"test": k, "resistance_ohm": ohm}
        for k, ohm in zip("abc", (0.03, 0.031, 0.06), strict=True)
    ]
    said = doubts(rows, "resistance")
    assert said[:2] == ["said before"] * 2
    assert said[2].startswith("said before; a gives 30 mΩ at 50% SoC")
    # The first sample hardly hangs on the SoC, later ones do.
    apart = [r | {"soc": soc} for r, soc in zip(rows, (0.9, 0.6, 0.3), strict=True)]
    assert doubts(apart, "resistance") == ["said before"] * 3
    apart[2] |= {"resistance_ohm": 0.15, "soc": float("nan")}
    assert "b gives 31 mΩ at 60% SoC" in doubts(apart[1:], "resistance")[1]
    apart = [r | {"delay_second": 10.0} for r in apart]
    assert doubts(apart, "resistance") == ["said before"] * 3
    # Near empty, and after other times, it may be another.
    assert doubts([r | {"soc": 0.05} for r in rows], "resistance") == ["said before"] * 3


def set_to(test, ampere, **more):
    """A capacity at a current, of a cell rated 3 Ah."""
    of_current = {"mean_current_ampere": -ampere, "temperature_mean_celsius": 35.0}
    return capacity(test, 3.0, ampere / 3.0, capacity_std_ampere_hour=1.0, **(of_current | more))


def pulse(test, ampere, soc=0.5, **more):
    """A discharge pulse, its first sample, of a cell of 3 Ah."""
    row = {
        "cell": "A", "test": test, "cycle": None, "ambient_temperature_celsius": 25.0,
        "direction": "discharge", "soc": soc, "delay_second": 0.0, "actual_delay_second": 0.1,
        "resistance_ohm": 0.03, "resistance_std_ohm": 1e-4, "current_ampere": -ampere,
        "c_rate": ampere / 3.0, "doubt": "",
    }  # fmt: skip
    return row | more


def test_a_current_a_gain_off_those_of_the_same_rate_is_told():
    rows = [set_to("a", 6.0), set_to("b", 6.01), set_to("gain", 6.6)]
    said = doubts(rows)
    assert said[:2] == ["", ""]
    assert "its current is 6.6 A, in a 6 A: set to be the same?" in said[2]


@pytest.mark.parametrize(
    "third",
    [
        set_to("another rate", 9.0),
        set_to("held", 6.1),
        set_to("another cell", 6.6, cell="B"),
    ],
)
def test_currents_that_were_not_set_to_be_one_are_not_compared(third):
    assert doubts([set_to("a", 6.0), set_to("b", 6.0), third]) == ["", "", ""]


def test_a_current_that_goes_with_an_aged_cells_capacity_is_not_compared():
    rows = [set_to("a", 5.5), set_to("b", 5.5), set_to("older", 5.1, cycle=300)]
    assert doubts(rows) == ["", "", ""]


@pytest.mark.parametrize(("ampere", "in_doubt"), [(0.1, False), (0.1006, False), (0.102, True)])
def test_a_slow_current_that_the_check_ups_of_all_other_ages_agree_on(ampere, in_doubt):
    rows = [set_to(f"cu{k}", 0.1, cycle=100 * k) for k in range(3)]
    said = doubts([*rows, set_to("odd", ampere, cycle=300)])
    assert said[:3] == ["", "", ""]
    assert ("in 3 other tests 0.1 A" in said[3]) == in_doubt


def test_two_ammeters_may_differ_by_their_offset_at_a_slow_rate():
    assert doubts([set_to("a", 0.143), set_to("b", 0.153)]) == ["", ""]


def test_a_single_pulse_that_a_limit_cut_short_is_not_compared():
    first = [pulse("a", 1.5, soc) for soc in (0.9, 0.5)]
    other = [pulse("b", size, soc) for size, soc in ((1.4, 0.9), (1.5, 0.5))]
    assert doubts(first + other, "resistance") == [""] * 4


def test_a_current_that_nobody_sets_beside_round_ones_is_told():
    said = doubts([pulse("a", 3.0), pulse("b", 1.5), pulse("clipped", 2.34)], "resistance")
    assert said[:2] == ["", ""]
    assert said[2] == (
        "its current of 2.34 A (0.78C) is no round one, as those of 2 other tests of the cell are"
    )


@pytest.mark.parametrize(
    ("ampere", "others", "in_doubt"),
    [
        (4.5, (3.0, 1.5, 6.0), False),
        (4.507, (3.0, 1.5, 6.0), False),
        (4.44, (3.0, 1.5, 6.0), True),  # a coarse rounding of 4.5 A
        (4.44, (3.0, 1.5), False),
        (4.44, (2.975, 1.5, 6.0), False),  # a tester that is off by 0.8 %
        (0.99, (3.0, 1.5, 6.0), False),  # 0.33C
    ],
)
def test_a_tester_comes_as_near_to_a_round_current_in_one_test_as_in_others(
    ampere, others, in_doubt
):
    rows = [pulse(f"other {size}", size) for size in others]
    said = doubts([*rows, pulse("odd", ampere)], "resistance")
    assert not any(said[:-1])
    assert ("is no round one" in said[-1]) == in_doubt


@pytest.mark.parametrize(("ampere", "in_doubt"), [(0.0652, True), (0.06, False), (0.3, False)])
def test_check_ups_at_one_slow_current_and_one_at_another(ampere, in_doubt):
    """What two thirds of a C/30 are nobody sets; a C/50 and a C/10 may have been meant."""
    rows = [set_to(f"cu{k}", 0.1, cycle=100 * k) for k in range(3)]
    said = doubts([*rows, set_to("odd", ampere, cycle=300)])
    assert not any(said[:3])
    assert ("in 3 other tests 0.1 A" in said[3]) == in_doubt


@pytest.mark.parametrize(
    ("volt", "ampere", "in_doubt"), [(3.6, 3.0, True), (3.9, 3.0, False), (3.6, 1.0, False)]
)
def test_no_cell_rests_lower_at_a_higher_soc(volt, ampere, in_doubt):
    """A gain of the voltage; a pulse out of a running load (1 A, a step of 3 A) is not at rest."""
    rests = [(0.9, volt), (0.8, 3.95), (0.7, 3.85), (0.2, 3.5)]
    rows = [pulse(f"soc{100 * soc:.0f}", 3.0, soc, voltage_before_volt=v) for soc, v in rests]
    rows[0]["current_ampere"] = -ampere
    said = doubts(rows, "resistance")
    assert ("rests at 3.950 V at 80% SoC (and 1 more test" in said[0]) == in_doubt
    assert said[1:] == ["", "", ""]


def test_where_a_cells_currents_are_not_round_none_is_odd():
    said = doubts([pulse("a", 3.0), pulse("b", 1.37), pulse("c", 2.34)], "resistance")
    assert said == ["", "", ""]


@pytest.mark.parametrize(("ohm", "in_doubt"), [(0.05, False), (0.15, True), (0.01, True)])
def test_a_first_sample_that_comes_later_is_larger_within_reason(ohm, in_doubt):
    row = {
        "cell": "A", "cycle": None, "ambient_temperature_celsius": 25.0, "direction": "discharge",
        "delay_second": 0.0, "soc": float("nan"), "resistance_std_ohm": 1e-4, "doubt": "",
        "c_rate": 1.0, "current_ampere": float("nan"),
    }  # fmt: skip
    early = row | {"test": "pulses", "actual_delay_second": 0.1, "resistance_ohm": 0.03}
    late = row | {"test": "capacity", "actual_delay_second": 1.0, "resistance_ohm": ohm}
    assert bool(doubts([early, late], "resistance")[1]) == in_doubt
    # A sample with the time of the step itself is the earliest there is.
    at_once = early | {"actual_delay_second": 0.0}
    assert len(doubts([at_once, at_once | {"test": "again"}, late], "resistance")) == 3


def pair_by_pair(rows, quantity):
    """The same from its definition: each two rows of different tests held against each other."""
    against = [{} for _ in rows]
    were_set = agreement._were_set(rows)
    for members in agreement._comparable(rows):
        group = [rows[number] for number in members]
        compared = agreement._columns(group, were_set[members])
        for k, first in enumerate(members):
            for j in range(k + 1, len(members)):
                if rows[first]["test"] == rows[members[j]]["test"]:
                    continue
                here, there = compared.at(k), compared.at(j)
                said = [broken_rule(*pair, quantity) for pair in ((here, there), (there, here))]
                if agreement.CURRENTS in said:
                    said = [rule if rule is agreement.CURRENTS else None for rule in said]
                if any(said):
                    against[first][members[j]], against[members[j]][first] = said
    words = []
    for row, found in zip(rows, against, strict=True):
        kept = [(o, rule) for o, rule in found.items() if len(against[o]) <= len(found)]
        first = kept[0][1].words(row, rows[kept[0][0]]) if kept and kept[0][1] else ""
        words.append((first, len(kept)))
    return words


def broken_rule(here, there, quantity):
    same_age = here.age == there.age
    with np.errstate(all="ignore"):
        if same_age and agreement.CURRENTS.broken(here, there):
            return agreement.CURRENTS
        for rule in agreement.RULES[quantity]:
            alike = abs(here.reference_celsius - there.reference_celsius) <= 2.5
            if rule.same_age == same_age and alike and rule.broken(here, there):
                return rule
    return None


def some_pulses(random, count, tests):
    """Pulses of tests at two temperatures, some of them with a wrong current or resistance."""
    names = [f"t{k}" for k in random.integers(0, tests, count)]
    return [
        pulse(
            name,
            random.choice([3.0, 3.0, 3.2, 1.5]) * random.uniform(0.99, 1.01),
            random.choice([0.03, 0.5, 0.52, 0.9, np.nan]),
            direction=random.choice(["charge", "discharge"]),
            ambient_temperature_celsius=random.choice([None, 25.0, 0.0]),
            cycle=random.choice([None, 3, 200]) if name == "t0" else int(name[1:]) % 3 * 100,
            resistance_ohm=0.03 * np.exp(0.3 * random.normal()),
            voltage_before_volt=random.uniform(3.3, 3.9),
        )
        for name in names
    ]


@pytest.mark.parametrize("seed", range(8))
def test_rows_held_against_all_at_once_are_those_of_each_pair(seed):
    random = np.random.default_rng(seed)
    pulses = some_pulses(random, 40, 6)
    sizes = random.uniform(2.2, 3.0, 30), random.choice([0.5, 1.0, 1.04, 2.0], 30)
    tests = [
        capacity(f"t{k % 9}", size, rate, cycle=k % 9 // 3 * 100, mean_current_ampere=-3.0 * rate)
        for k, (size, rate) in enumerate(zip(*sizes, strict=True))
    ]
    for rows, quantity in ((pulses, "resistance"), (tests, "capacity")):
        wanted, said = pair_by_pair(rows, quantity), doubts(rows, quantity)
        assert any(words for words, _ in wanted)
        for (words, many), doubt in zip(wanted, said, strict=True):
            assert doubt.startswith(words)
            assert ("against it" in doubt) == (many > 1)
            assert many < 2 or f"and {many - 1} more test" in doubt


def test_thousands_of_pulses_take_seconds_and_the_odd_test_is_found():
    """Their pairs one by one take minutes."""
    rows = [
        pulse(f"t{k // 40}", 3.0, 0.1 + 0.8 * (k % 40) / 40, delay_second=10.0) for k in range(2000)
    ]
    for row in rows[400:440]:
        row["resistance_ohm"] *= 2.0
    start = time.process_time()
    said = doubts(rows, "resistance")
    assert time.process_time() - start < 10.0
    assert all("t0 gives 30 mΩ" in doubt for doubt in said[400:440])
    assert not any(said[:400] + said[440:])
