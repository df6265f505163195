"""The verdict on a group in plain language."""

import pytest

from cellwright.effects.groups.finding import group_paragraph
from cellwright.effects.library.groups import GROUP_LIBRARY

PARAMETERS = {
    "excess_ohm": {"value": 0.0081, "std": 2e-4, "unit": "Ohm", "at_bound": False},
    "branch": {"value": 2, "std": None, "unit": "1", "at_bound": False},
}
ENTRY = {
    "effect": "branch_wire_resistance",
    "alternatives": [],
    "branch": 2,
    "cell": "c2",
    "branch_alternatives": [],
    "parameters": PARAMETERS,
    "validation_rmse_volt": {"before": 3e-3, "after": 1.2e-4},
    "same_without_validation": True,
}
VERDICT = {
    "verdict": "named",
    "effects": [ENTRY],
    "partial": [],
    "located_at": None,
    "floor_volt": 1e-4,
    "validation_rmse_volt": {"before": 3e-3, "after": 1.2e-4},
    "branch_currents": True,
    "next_test": None,
}
PLACE = {"file": "drive", "branch": 1, "soc": [0.2, 0.4], "current": "rest", "share": 0.6}
PLACE |= {"temperature_celsius": [25.0]}


def said(**changed):
    return group_paragraph(VERDICT | changed, GROUP_LIBRARY)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ["In branch 2 (c2)", "0.0081 ± 0.0002 Ohm", "3.0 mV", "the branch takes less"]),
        ({"effects": [ENTRY]}, ["Shows wire resistance (branch 2)"]),
        ({"verdict": "none", "effects": []}, ["Nothing is missing that these data could show"]),
        ({"verdict": "unknown", "effects": []}, ["no effect of one branch explains it"]),
        ({"branch_currents": False}, ["were not logged", "in the group's voltage"]),
        ({"located_at": PLACE}, ["at 20–40 % SoC at rest in branch 1 in drive (25 °C)"]),
        ({"next_test": "log them"}, ["To test next: log them."]),
    ],
)
def test_what_is_said(changed, words):
    text = said(**changed)
    assert all(part in text for part in words)
    assert "  " not in text


def test_ties_of_name_and_branch_are_said():
    tied = ENTRY | {"alternatives": ["branch_capacity"], "branch_alternatives": [1]}
    text = said(verdict="ambiguous", effects=[tied])
    assert "cannot tell it from: one cell has another capacity" in text
    assert "could be branch 1" in text
