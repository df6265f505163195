"""A model file as rows of a table; one cell's model out of a group's."""

import pytest
import truth

from cellwright.models.rows import model_of, parameter_rows
from cellwright.refusal import Refusal


def model():
    found = truth.model()
    entry = found["members"][0]["conditions"][0]
    entry |= {"r0_std_ohm": [1e-4] * 5, "at_bound": ["tau2", "R1 at SoC 0.300"]}
    for branch in entry["branches"]:
        branch |= {"r_std_ohm": [2e-4] * 5, "tau_std_second": [0.5] * 5}
    return found


def test_a_group_hands_out_its_cells():
    assert model_of({"cell": "A", "chosen": "1RC"}, "A")["chosen"] == "1RC"
    assert model_of({"models": {"A": 1, "B": 2}}, "B") == 2
    with pytest.raises(Refusal, match="no model of C; it has A, B"):
        model_of({"models": {"A": 1, "B": 2}}, "C")


def test_every_parameter_at_every_soc_is_a_row():
    rows = parameter_rows(model())
    assert len(rows) == 5 * 5
    assert [row["parameter"] for row in rows[::5]] == ["r0", "r1", "tau1", "r2", "tau2"]
    assert {row["unit"] for row in rows if row["parameter"].startswith("tau")} == {"s"}
    assert [row["value"] for row in rows[:5]] == truth.R0.tolist()
    assert rows[5]["std"] == 2e-4
    assert all(row["model"] == "2RC" for row in rows)
    assert all(row["ambient_temperature_celsius"] == 25.0 for row in rows)


def test_bounds_are_marked_for_a_whole_parameter_or_at_one_soc():
    bound = [(row["parameter"], row["soc"]) for row in parameter_rows(model()) if row["at_bound"]]
    assert bound[0] == ("r1", pytest.approx(0.3))
    assert [name for name, _ in bound[1:]] == ["tau2"] * 5
