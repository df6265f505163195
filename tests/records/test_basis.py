"""What SoC refers to: a cell's own slow test, else a lender's curve and the cell's own capacity."""

import numpy as np
import pytest
from sheets_facts import cell_facts, facts_of

from cellwright.records.basis import (
    Lender,
    basis_of_one_age,
    scale_in_words,
    soc_of,
    state_of_charge,
)
from cellwright.refusal import Refusal

SOC = np.linspace(0, 1, 201)
GAP = 0.006  # V, at 1 V a SoC between 3 and 4 V: a discharge ends 0.3 % before empty


def curve(celsius=25.0, out=2.0, back=None, test="ocv", cycle=None, closed=None):
    return {
        "test": test,
        "ambient_temperature_celsius": celsius,
        "cycle": cycle,
        "capacity_ampere_hour": out,
        "charge_capacity_ampere_hour": back,
        "closed_capacity_ampere_hour": closed or out,
        "soc": SOC.tolist(),
        "ocv_volt": (3 + SOC + 0.001 * (25 if celsius is None else celsius)).tolist(),
        "discharge_volt": (3 + SOC - GAP / 2).tolist(),
        "charge_volt": (3 + SOC + GAP / 2).tolist(),
    }


def row(size, rate=1.0, celsius=25.0, cycle=None, direction="discharge", test="capacity"):
    return {
        "test": test,
        "ambient_temperature_celsius": celsius,
        "cycle": cycle,
        "direction": direction,
        "c_rate": rate,
        "capacity_ampere_hour": size,
    }


def test_an_own_slow_test_goes_before_everything():
    lender = Lender("R", True, [curve(out=9.0)], [])
    curves = [curve(0, 1.7, test="cold"), curve(23, 1.95), curve(None, 3.0, test="unstated")]
    content = basis_of_one_age("A", curves, [row(1.8)], [lender], rated_capacity_ampere_hour=2.2)
    assert content["capacity_ampere_hour"] == 1.95
    assert content["capacity_source"] == "slow test ocv"
    assert content["borrowed_from"] is None
    assert content["ocv"] == curves


def test_of_slow_tests_at_one_temperature_the_earliest_counts():
    curves = [curve(out=1.5, cycle=300), curve(out=2.0), curve(out=1.8, cycle=100)]
    assert basis_of_one_age("A", curves, [], [])["capacity_ampere_hour"] == 2.0


@pytest.mark.parametrize(("back", "closed"), [(2.05, None), (2.2, 2.1), (1.8, 1.92)])
def test_slow_directions_that_part_are_closed(back, closed):
    """A drift adds to one direction what it takes from the other: the curve says what is left."""
    content = basis_of_one_age("A", [curve(out=2.0, back=back, closed=closed)], [], [])
    assert content["capacity_ampere_hour"] == (closed or 2.0)
    said = "slow test ocv, between 2 Ah discharged and "
    assert content["capacity_source"].startswith(said) == (closed is not None)


@pytest.mark.parametrize(
    ("back", "rest_volt", "unexplained"),
    [
        (1.97, 4.010, 0.0),  # rests 1.5 % below full, and returned 1.5 % less
        (1.97, 4.020, 0.02),  # 0.5 % below full: 1 % are left
        (1.97, np.nan, 0.03),
        (2.03, 4.010, 0.03),  # it returned more: no end explains that
    ],
)
def test_what_a_slow_test_may_lack_at_its_ends(back, rest_volt, unexplained):
    rows = [
        row(2.0, test="ocv") | {"capacity_std_ampere_hour": 0.001},
        row(back, test="ocv", direction="charge") | {"rest_after_volt": rest_volt},
    ]
    found = basis_of_one_age("A", [curve(out=2.0, back=back)], rows, [])["capacity_std_ampere_hour"]
    terms = [0.001, unexplained / 3**0.5, GAP * 2.0 / 3**0.5]
    assert found == pytest.approx(np.linalg.norm(terms), rel=0.02)


@pytest.mark.parametrize("back", [None, np.nan])
def test_a_slow_test_of_one_direction_has_the_capacity_of_that_direction(back):
    content = basis_of_one_age("A", [curve(out=2.0, back=back)], [], [])
    assert content["capacity_ampere_hour"] == 2.0


def test_the_first_marked_reference_lends_else_the_largest():
    small, large = Lender("S", True, [curve(out=1.9)], []), Lender("L", False, [curve(out=2.1)], [])
    without = Lender("W", True, [], [row(2.5)])
    assert basis_of_one_age("A", [], [row(1.8)], [large, small, without])["borrowed_from"] == "S"
    both = [small, large._replace(marked=True)]
    assert (
        basis_of_one_age("A", [], [row(1.8)], both)["borrowed_from"] == "S"
    )  # the first of the sheet
    plain = small._replace(marked=False)
    content = basis_of_one_age("A", [], [row(1.8)], [plain, large])
    assert content["borrowed_from"] == "L"
    assert content["ocv"] == large.curves


def test_own_capacity_is_carried_by_the_lenders_ratio():
    """The lender gives 2.0 Ah slowly and 1.9 Ah at 1C; the cell 1.71 Ah at 1C, so 1.8 Ah slowly."""
    lent = [
        row(1.5, celsius=0.0),
        row(1.95, rate=0.5),
        row(1.99, direction="charge"),
        row(1.9, 1.02),
    ]
    content = basis_of_one_age("A", [], [row(1.71)], [Lender("R", True, [curve()], lent)])
    assert content["capacity_ampere_hour"] == pytest.approx(1.8)
    assert "carried to the slow rate as in R" in content["capacity_source"]


def test_a_lender_measured_as_far_on_the_other_side_of_25_celsius_is_not_alike():
    lender = Lender("R", True, [curve()], [row(1.9, celsius=40.0)])
    content = basis_of_one_age("A", [], [row(1.71, celsius=10.0)], [lender])
    assert content["capacity_ampere_hour"] == 1.71


def test_two_tests_without_a_temperature_are_alike():
    lender = Lender("R", True, [curve()], [row(1.9, celsius=None)])
    content = basis_of_one_age("A", [], [row(1.71, celsius=None)], [lender])
    assert content["capacity_ampere_hour"] == pytest.approx(1.8)


def test_of_several_capacity_tests_the_nearest_freshest_slowest_counts():
    rows = [
        row(1.5, celsius=0),
        row(1.6, cycle=300),
        row(1.8),
        row(1.9, 0.5),
        row(2.0, 0.5, cycle=9),
    ]
    content = basis_of_one_age("A", [], [*rows, row(3.0, 0.2, direction="charge")], [])
    assert content["capacity_ampere_hour"] == 1.9
    assert content["capacity_source"] == "discharge of capacity at 0.5C"
    assert content["ocv"] == []


@pytest.mark.parametrize("slow", [True, False])
def test_a_scale_that_stands_on_a_record_in_doubt_says_by_how_much(slow):
    """0.2 of 2 Ah are 10 %: 5 % of SoC at half charge, 50 mV where the OCV rises by 1 V."""
    row_of = row(2.0, test="ocv") | {"capacity_std_ampere_hour": 0.2, "doubt": "its clock jumps"}
    lender = Lender("R", True, [curve()], [])
    content = basis_of_one_age(
        "A", [curve(out=2.0)] if slow else [], [row_of], [] if slow else [lender]
    )
    said = scale_in_words(content)
    assert said.startswith("its SoC scale stands on a record in doubt (")
    assert f"{content['capacity_source']}: its clock jumps" in said
    assert "by 0.2 Ah (10.0%): at half charge 5.0% of SoC and 50 mV of open-circuit" in said
    without = row_of | {"doubt": ""}
    content = basis_of_one_age(
        "A", [curve(out=2.0)] if slow else [], [without], [] if slow else [lender]
    )
    assert scale_in_words(content) == ""


def test_the_rating_serves_last():
    content = basis_of_one_age("A", [], [], [], rated_capacity_ampere_hour=2.2)
    assert (content["capacity_ampere_hour"], content["capacity_source"]) == (2.2, "rating")
    with pytest.raises(Refusal, match="no complete discharge, no slow test and no rating"):
        basis_of_one_age("A", [], [row(1.9, direction="charge")], [])


def test_what_nobody_measured_is_as_unsure_as_cells_of_a_rating_differ():
    """A worn cell holds 0.85 of its rating: within two deviations; a stated health says more."""
    content = basis_of_one_age("A", [], [], [], rated_capacity_ampere_hour=5.0)
    assert content["capacity_std_ampere_hour"] == pytest.approx(5.0 * 0.65 / np.sqrt(12))
    known = basis_of_one_age("A", [], [], [], rated_capacity_ampere_hour=5.0, state_of_health=0.85)
    assert known["capacity_std_ampere_hour"] == pytest.approx(4.25 * 0.1 / np.sqrt(12))


def test_a_stated_state_of_health_makes_the_rating_smaller_where_no_test_tells_the_capacity():
    stated = {"rated_capacity_ampere_hour": 2.0, "state_of_health": 0.7}
    content = basis_of_one_age("A", [], [], [], **stated)
    assert content["capacity_ampere_hour"] == pytest.approx(1.4)
    assert "stated state of health, 0.7" in content["capacity_source"]
    assert basis_of_one_age("A", [], [row(1.9)], [], **stated)["capacity_ampere_hour"] == 1.9


CELL = cell_facts()


def series(volt, amperes=0.0):
    time = np.arange(0.0, 3601.0, 60.0)
    current = np.full(len(time), amperes)
    charge = amperes * time / 3600
    return {
        "charge_ampere_hour": charge,
        "current_ampere": current,
        "voltage_volt": volt + 0 * time,
    }


def test_soc_is_looked_up_in_the_curve_nearest_in_temperature():
    known = basis_of_one_age("A", [curve(0), curve(40), curve(25)], [], [])
    for celsius in (0, 25, 40):
        facts = facts_of(soc=None, celsius=celsius)
        anchored = soc_of(series(3.5 + 0.001 * celsius), known, facts, CELL)
        assert anchored.soc[0] == pytest.approx(0.5, abs=1e-9)
    unstated = soc_of(series(3.525), known, facts._replace(ambient_temperature_celsius=None), CELL)
    assert unstated.soc[0] == pytest.approx(0.5, abs=1e-9)


def test_soc_is_counted_over_the_capacity_of_the_basis():
    known = basis_of_one_age("A", [], [row(1.6)], [])
    facts = facts_of(soc=0.9, celsius=25)
    anchored = soc_of(series(3.5, -0.8), known, facts, CELL)
    assert anchored.soc[-1] == pytest.approx(0.4)
    with pytest.raises(Refusal, match="there is no OCV table"):
        soc_of(series(3.5, -0.8), known, facts._replace(soc=None), CELL)


def test_without_any_anchor_soc_is_not_known_and_says_why():
    columns = {
        name: np.zeros(3)
        for name in ("test_time_second", "charge_ampere_hour", "current_ampere", "voltage_volt")
    }
    facts = facts_of(soc=None, celsius=25.0)
    bare = {"capacity_ampere_hour": 2.0, "ocv": []}
    anchored = state_of_charge(columns, bare, facts, CELL)
    assert np.isnan(anchored.soc).all()
    assert anchored.anchor.startswith("not known: no state of charge")
    assert state_of_charge(columns, bare, facts._replace(soc=0.5), CELL).soc[0] == 0.5


def rests(celsius, size, load, test, cycle=None):
    """A curve from rests: straight from 3 to 4 V over its own capacity."""
    rest_curve = curve(celsius, size, test=test, cycle=cycle) | {"branches": "rests"}
    rest_curve |= {"discharge_current_ampere": -load, "charge_current_ampere": None}
    rest_curve |= {"capacity_source": "taken out", "measured_soc": [0.1, 1.0]}
    return rest_curve | {"ocv_volt": (3 + SOC).tolist()}


def test_own_rests_go_behind_a_slow_test_and_a_lender():
    own = [rests(25.0, 1.9, 1.0, "hppc")]
    assert basis_of_one_age("A", [curve()], [row(1.8)], [], rests=own)["ocv"] == [curve()]
    lender = Lender("R", True, [curve()], [])
    assert basis_of_one_age("A", [], [row(1.8)], [lender], rests=own)["borrowed_from"] == "R"
    content = basis_of_one_age("A", [], [row(1.8)], [Lender("W", True, [], [row(2.5)])], rests=own)
    assert content["ocv"] == own
    assert content["borrowed_from"] is None
    assert content["capacity_ampere_hour"] == 1.9
    assert content["capacity_source"] == "taken out (rests of hppc)"
    rated = [own[0] | {"capacity_source": "rating"}]
    assert basis_of_one_age("A", [], [], [], rests=rated)["capacity_source"] == "rating"


def test_of_several_pulse_tests_the_slowest_of_each_temperature_counts():
    tests = [
        rests(20.0, 1.8, 1.0, "cold fast"),
        rests(20.0, 1.85, 0.501, "cold slow"),
        rests(30.0, 1.9, 0.5, "warm slow"),
        rests(30.0, 1.95, 0.502, "warm as slow"),
        rests(30.0, 1.7, 0.3, "warm, aged", cycle=200),
    ]
    content = basis_of_one_age("A", [], [], [], rests=tests, lower_cutoff_volt=2.9)
    assert [c["test"] for c in content["ocv"]] == ["warm slow", "cold slow"]
    assert content["capacity_ampere_hour"] == 1.9


def test_curves_from_rests_share_charge_from_full():
    """1 Ah taken out is the same voltage in both, whatever each record's own capacity is."""
    tests = [rests(25.0, 2.0, 1.0, "warm"), rests(0.0, 1.6, 1.0, "cold")]
    content = basis_of_one_age("A", [], [], [], rests=tests, lower_cutoff_volt=2.9)
    cold = content["ocv"][1]
    assert np.interp(0.5, cold["soc"], cold["ocv_volt"]) == pytest.approx(4 - 1 / 1.6)
    assert min(cold["ocv_volt"]) == pytest.approx(2.9, abs=1e-5)  # straight on, to the cut-off
    assert (np.diff(cold["ocv_volt"]) > 0).all()
    assert cold["measured_soc"] == pytest.approx([0.28, 1.0])


@pytest.mark.parametrize(
    ("stated", "ampere", "run"), [(0.2, -1.0, "-0.800 to 0.200"), (0.8, 1.0, "0.800 to 1.800")]
)
def test_a_stated_soc_that_the_charge_contradicts_is_not_known_and_all_three_are_named(
    stated, ampere, run
):
    hours = np.linspace(0.0, 2.0, 200)
    columns = {"test_time_second": 3600 * hours, "voltage_volt": np.full(200, 3.7)}
    columns |= {"current_ampere": np.full(200, ampere), "charge_ampere_hour": ampere * hours}
    known = {"capacity_ampere_hour": 2.0, "capacity_source": "rating", "ocv": []}
    facts = facts_of(soc=stated)
    anchored = state_of_charge(columns, known, facts, CELL)
    assert np.isnan(anchored.soc).all()
    for part in (run, "stated at the start", "charge (2 Ah", "capacity of 2 Ah (rating)"):
        assert part in anchored.anchor
    within = state_of_charge(columns, known | {"capacity_ampere_hour": 20.0}, facts, CELL)
    np.testing.assert_allclose(within.soc[[0, -1]], [stated, stated + 0.1 * ampere])


def test_a_capacity_whose_start_is_unsure_counts_only_where_no_sure_one_does():
    unsure = row(2.5, rate=0.2, test="C5") | {"capacity_std_ampere_hour": 0.41}
    sure = row(2.885, rate=0.5, test="C2") | {"capacity_std_ampere_hour": np.nan}
    found = basis_of_one_age("A", [], [unsure, sure], [], rated_capacity_ampere_hour=3.0)
    assert found["capacity_ampere_hour"] == 2.885
    alone = basis_of_one_age("A", [], [unsure], [], rated_capacity_ampere_hour=3.0)
    assert alone["capacity_source"] == "discharge of C5 at 0.2C, ± 0.41 Ah"


def test_a_sure_capacity_of_an_aged_cell_or_of_the_cold_is_no_better_than_an_unsure_one():
    unsure = row(2.9, test="fresh") | {"capacity_std_ampere_hour": 0.2}
    others = [row(2.1, cycle=800, test="aged"), row(2.2, celsius=-10.0, test="cold")]
    found = basis_of_one_age("A", [], [*others, unsure], [], rated_capacity_ampere_hour=3.0)
    assert found["capacity_source"] == "discharge of fresh at 1C, ± 0.2 Ah"


OPEN_VOLT = curve()["ocv_volt"]
AMPERE = 1.0


def between_rests(slow_ampere_hour, ohm):
    """A discharge at 1 A of a cell held at 4.025 V until 0.05 A before it, and down to 3.025 V."""
    full, empty = 4.025 - 0.05 * ohm, 3.025 + AMPERE * ohm
    charge = (full - empty) * slow_ampere_hour
    rests = {"rest_before_volt": full, "rest_after_volt": empty}
    rests |= {"rested_ampere_hour": charge, "rested_std_ampere_hour": 1e-3}
    return row(charge) | rests | {"capacity_std_ampere_hour": 1e-3}


def carried_from_lender(own):
    slow = row(2.0, 0.05, test="ocv") | {"capacity_std_ampere_hour": 0.0}
    lender = Lender("R", True, [curve(out=2.0, back=1.99)], [slow, between_rests(2.0, 0.02)])
    return basis_of_one_age("A", [], [own], [lender])


@pytest.mark.parametrize("ohm", [0.01, 0.02, 0.03])
def test_what_a_worn_cell_keeps_from_a_fast_discharge_its_own_rests_tell(ohm):
    """One of half or 1.5 times the lender's resistance: its ratio alone would be off by 1 %."""
    content = carried_from_lender(between_rests(1.6, ohm))
    assert content["capacity_ampere_hour"] == pytest.approx(1.6, rel=1e-6)
    assert "by the rests of both" in content["capacity_source"]
    # As of even odds between none and all of what the rests changed, and of the slow test's ends.
    change = 1 - (1 - 1.05 * 0.02) / (1 - 1.05 * ohm)
    parts = [change / 3**0.5, 0.01 / 2.0 / 3**0.5, GAP / 3**0.5, 1e-3 / 1.6, 1e-3 / 2.0]
    share = content["capacity_std_ampere_hour"] / 1.6
    assert share == pytest.approx(np.linalg.norm(parts), rel=0.1)


@pytest.mark.parametrize("rest", [np.nan, 3.4])
def test_rests_that_are_not_there_or_on_a_plateau_tell_nothing(rest):
    own = between_rests(1.6, 0.03) | {"rest_after_volt": rest}
    content = carried_from_lender(own)
    assert content["capacity_ampere_hour"] == pytest.approx(1.6, rel=0.02)
    assert abs(content["capacity_ampere_hour"] - 1.6) < 1.96 * content["capacity_std_ampere_hour"]
    assert "rests" not in content["capacity_source"]
