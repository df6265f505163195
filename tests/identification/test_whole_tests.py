"""A member with effects is chosen where whole tests left out show the effect, and there alone."""

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test

from cellwright.circuits.model_file import simulate_model
from cellwright.identification.in_use import proved

PLAIN, NAME = "2RC", "2RC+effects"
ROWS = [
    {"model": PLAIN, "chosen": False, "reason": f"{NAME} is better beyond chance"},
    {"model": NAME, "chosen": True, "reason": f"{NAME} chosen, clearly before {PLAIN}"},
]


def searched_model():
    """The plain cell, and what a search made of it: 5 mohm more on discharge, chosen by blocks."""
    plain = truth.model()
    (condition,) = plain["members"][0]["conditions"]
    zero, more = [0.0] * len(truth.KNOTS), [0.005] * len(truth.KNOTS)
    branch = {"kind": "R_two_way", "r_charge_ohm": zero, "r_discharge_ohm": more}
    condition = condition | {"branches": [*condition["branches"], branch]}
    member = {"model": NAME, "effects": ["resistance_asymmetry"], "in_place_of": PLAIN}
    members = [*plain["members"], member | {"conditions": [condition]}]
    return plain | {"members": members, "chosen": NAME, "choice": f"{NAME} chosen"}


def drive(true_member, *, noise_volt=3e-4, seed=1, **facts):
    """A drive of the cell that `true_member` describes, as an instrument logs it."""
    rng = np.random.default_rng(seed)
    time, current = truth.drive(rng)
    soc = truth.soc_of(time, current)
    run = simulate_model(searched_model(), true_member, time, current, soc, np.full(len(time), 25))
    columns = {
        "test_time_second": time,
        "current_ampere": current,
        "voltage_volt": run.voltage_volt + rng.normal(0, noise_volt, len(time)),
        "charge_ampere_hour": (soc - soc[0]) * truth.CAPACITY_AMPERE_HOUR,
    }
    facts = {"role": "validation", "soc": 1.0} | facts
    return measured_test(columns, f"drive_{seed}", "drive", **facts)


def chosen_after(*tests):
    facts = cell_facts(2.5, 4.4)
    model, rows = proved(searched_model(), ROWS, tests, facts, split_rest_second=200.0)
    assert [row["model"] for row in rows if row["chosen"]] == [model["chosen"]]
    return model, {row["model"]: row["reason"] for row in rows}


@pytest.mark.parametrize("true_member", [PLAIN, NAME])
def test_the_truth_is_chosen_be_it_simple_or_with_an_effect(true_member):
    model, reasons = chosen_after(drive(true_member), drive(true_member, seed=2))
    assert model["chosen"] == true_member
    assert "whole tests left out (drive_1, drive_2)" in reasons[NAME]
    assert "whole tests left out (drive_1, drive_2)" in model["choice"]


def test_a_gain_in_one_test_does_not_pay_for_harm_in_another():
    model, _ = chosen_after(drive(NAME), drive(PLAIN, seed=2))
    assert model["chosen"] == PLAIN


def test_a_gain_within_chance_proves_nothing():
    model, reasons = chosen_after(drive(NAME, noise_volt=0.3))
    assert model["chosen"] == PLAIN
    assert "beyond chance" in reasons[NAME] or "mV RMS" in reasons[NAME]


def test_without_a_whole_test_the_simpler_is_chosen_and_it_is_said():
    """Nor do blocks of a test that the effects were searched in count."""
    for tests in ([], [drive(NAME, role="split")], [drive(NAME, role="fit")]):
        model, reasons = chosen_after(*tests)
        assert model["chosen"] == PLAIN
        assert "no whole test was left out" in reasons[NAME]


def test_a_test_that_cannot_be_laid_out_is_named():
    cut = drive(NAME, seed=3)
    cut = cut._replace(series={name: column[:1] for name, column in cut.series.items()})
    model, _ = chosen_after(drive(NAME), cut)
    assert model["chosen"] == NAME
    (note,) = [words for words in model["notes"] if "drive_3" in words]
    assert "1 sample" in note


def test_a_member_of_the_family_is_not_asked_for_it():
    plain = truth.model() | {"choice": ""}
    how = {"split_rest_second": 200.0}
    assert proved(plain, ROWS, [drive(PLAIN)], cell_facts(), **how) == (plain, ROWS)
