"""A pack of groups in groups through its record: no error for the truth, starts, what is logged."""

import numpy as np
import pytest
import truth

import cellwright as cw
from cellwright.bias.scaled import scaled_reference
from cellwright.refusal import Refusal

SHARES = {"A": (2.0, 1.0), "B": (1.9, 1.1), "C": (2.1, 0.9), "D": (1.7, 1.3), "E": (1.8, 1.2)}
MODELS = [
    scaled_reference(truth.model(), cell=name, capacity=capacity, resistance_ratio=ratio)
    for name, (capacity, ratio) in SHARES.items()
]
# Two groups in series, one of them with a string beside a cell: (A || B) + ((C + D) || E).
ROWS = [
    ("pack", 1, "left", "series", 0.002),
    ("pack", 2, "right", "series", 0.001),
    ("left", 1, "A", "parallel", 0.001),
    ("left", 2, "B", "parallel", 0.002),
    ("right", 1, "chain", "parallel", 0.0),
    ("right", 2, "pile", "parallel", 0.0),
    ("chain", 1, "C", "series", 0.0),
    ("chain", 2, "D", "series", 0.0),
    ("pile", 1, "E", "series", 0.0),
    ("pile", 2, "F", "series", 0.0),
]
MODELS.append(scaled_reference(truth.model(), cell="F", capacity=1.95, resistance_ratio=1.0))
NAMES = ("group", "position", "cell", "connection", "wire_resistance_ohm")
MEMBERS = [dict(zip(NAMES, row, strict=True)) for row in ROWS]
TIME = np.arange(0.0, 4000.0, 10.0)
TOTAL = np.where(TIME < 200, 0.0, np.where(TIME % 1000 < 700, -2.0, 1.0))
TEST = {"test": "drive", "kind": "group", "ambient_temperature_celsius": 25.0}
START = 0.9


def members(soc=START):
    groups = {row["group"] for row in MEMBERS}
    return [row | {"initial_soc": None if row["cell"] in groups else soc} for row in MEMBERS]


def recorded(start=START, rows=MEMBERS):
    load = {"test_time_second": TIME, "current_ampere": TOTAL}
    run = cw.simulate_pack(MODELS, rows, load, initial_soc=start).columns
    series = load | {"voltage_volt": run["voltage_volt"]}
    series |= {"charge_ampere_hour": np.cumsum(TOTAL) / 360.0}
    return series | {f"cell_{k}_voltage_volt": run[f"cell_{k}_voltage_volt"] for k in (1, 4)}


def test_the_truth_has_no_error_in_any_channel_that_was_logged():
    series = recorded() | {"branch_2_current_ampere": TOTAL}
    found = cw.nested_pack(MODELS, members(), series, TEST)
    assert [(row["channel"], row["number"], row["of"]) for row in found.rows] == [
        ("pack voltage", None, "pack"),
        ("branch current", 2, "right"),
        ("cell voltage", 1, "A"),
        ("cell voltage", 4, "D"),
    ]
    assert max(row["max_abs"] for row in found.rows) < 1e-8
    assert found.notes == ()


def test_currents_of_strings_in_parallel_are_those_of_the_branches():
    inner = [row for row in MEMBERS if row["group"] in ("right", "chain", "pile")]
    load = {"test_time_second": TIME, "current_ampere": TOTAL}
    models = MODELS[2:]
    run = cw.simulate_pack(models, inner, load, initial_soc=START).columns
    series = load | {"voltage_volt": run["voltage_volt"], "charge_ampere_hour": 0 * TIME}
    for branch, cell in ((1, 1), (2, 3)):
        series[f"branch_{branch}_current_ampere"] = run[f"cell_{cell}_current_ampere"]
    rows = [row for row in members() if row["group"] in ("right", "chain", "pile")]
    found = cw.nested_pack(models, rows, series, TEST)
    errors = [row["max_abs"] for row in found.rows if row["channel"] == "branch current"]
    assert len(errors) == 2
    assert max(errors) < 1e-8
    turned = series | {"branch_1_current_ampere": -series["branch_1_current_ampere"]}
    with pytest.raises(Refusal, match="branch 1 alone explains"):
        cw.nested_pack(models, rows, turned, TEST)


def test_the_start_is_found_from_the_first_voltage_where_it_is_not_stated():
    found = cw.nested_pack(MODELS, members(soc=None), recorded(start=0.83), TEST)
    (note,) = found.notes
    assert abs(float(note.split(": ")[1].split(" ")[0]) - 0.83) < 2e-3
    assert found.rows[0]["rmse"] < 5e-3
    loaded = recorded() | {"current_ampere": TOTAL - 2.0}
    with pytest.raises(Refusal, match=r"not stated for every cell of \(A \|\| B\) \+ "):
        cw.nested_pack(MODELS, members(soc=None), loaded, TEST)


def test_a_stated_start_of_the_test_is_that_of_all_cells():
    found = cw.nested_pack(MODELS, members(soc=None), recorded(), TEST | {"soc": START})
    assert found.rows[0]["max_abs"] < 1e-8


def test_a_cell_without_a_model_is_named():
    with pytest.raises(Refusal, match="pack is not simulated: found no model of C"):
        cw.nested_pack([m for m in MODELS if m["cell"] != "C"], members(), recorded(), TEST)


def test_a_wrong_resistance_shows_in_its_own_cell():
    wrong = [m for m in MODELS if m["cell"] != "D"]
    wrong.append(scaled_reference(truth.model(), cell="D", capacity=1.7, resistance_ratio=2.0))
    rows = {row["of"]: row for row in cw.nested_pack(wrong, members(), recorded(), TEST).rows}
    assert rows["D"]["rmse"] > 5 * rows["A"]["rmse"]
