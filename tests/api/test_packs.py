"""Packs through the public interface: rows of sheets and models in, tables out."""

import numpy as np
import pytest
import strings

import cellwright as cw
from cellwright.packs.series.string import simulate_string

MODELS = strings.models([1.0, 0.8, 0.9, 0.95])
MEMBERS = [
    {"group": "s", "position": k + 1, "cell": model["cell"], "connection": "series"}
    | {"wire_resistance_ohm": None, "initial_soc": 1.0}
    for k, model in enumerate(MODELS)
]
CELLS = [
    {"cell": m["cell"], "lower_cutoff_volt": strings.LOWER_VOLT, "upper_cutoff_volt": 4.2}
    for m in MODELS
]
FEW = {"draws": 20, "string_length": 2}
CAPACITIES = [
    {"cell": "A", "direction": "discharge", "c_rate": rate, "capacity_std_ampere_hour": std}
    | {"repeats": 4, "temperature_mean_celsius": celsius, "ambient_temperature_celsius": around}
    for rate, std, celsius, around in ((1.0, 9.0, 31.0, 25.0), (0.5, 3.0, 27.0, 25.0),
                                       (0.5, 3.0, 1.0, 0.0))
]  # fmt: skip


def test_a_series_pack_from_rows_in_any_order():
    time = np.arange(0.0, 1200.0, 5.0)
    load = np.where(time < 300, 0.0, -15.0)
    run = simulate_string(MODELS, time, load, initial_soc=1.0)
    series = {"test_time_second": time, "current_ampere": load}
    series["voltage_volt"] = run.cell_voltage_volt.sum(axis=1)
    series |= {f"cell_{k + 1}_voltage_volt": v for k, v in enumerate(run.cell_voltage_volt.T)}
    test = {"test": "t", "kind": "group", "role": "validation"}
    found = cw.series_pack(MODELS[::-1], MEMBERS[::-1], CELLS[::-1], series, test)
    assert found.to_frame()["cell"].tolist() == ["A", "B", "C", "D"]
    assert found.pack[0]["ended_by"] == "B"
    assert found.pack[0]["voltage_rmse_volt"] < 1e-9
    parallel = [row | {"connection": "parallel"} for row in MEMBERS]
    with pytest.raises(cw.Refusal, match="wanted cells in series"):
        cw.series_pack(MODELS, parallel, CELLS, series, test)


def test_decisions_take_the_slowest_repeats_and_the_warmth_of_that_chamber():
    sure, unsure = (
        cw.pack_decisions(MODELS, MEMBERS, CELLS, rows, **FEW) for rows in ((), CAPACITIES)
    )
    assert sure.notes == ("cells at 25.0 °C",)
    assert unsure.notes == ("cells at 31.0 °C",)
    # 3 Ah of four repeats: 5 % of A, which then ends the string in some of the draws.
    busy = unsure.to_frame().query("quantity == 'probability: weakest cell'")["cell"]
    assert set(busy) == {"A", "B"} or set(busy) == {"B"}
    assert sure.to_frame()["quantity"].str.startswith("best").sum() == 1


def test_matching_says_who_goes_where():
    found = cw.match_cells(MODELS, CELLS, **FEW)
    assert {"parallel groups of 2", "strings of 2"} <= set(found.to_frame()["decision"])
    strung = [row for row in found.assembly if row["decision"] == "strings of 2"]
    assert {row["cell"] for row in strung if row["group"] == 1} == {"A", "D"}
    with pytest.raises(cw.Refusal, match="1 cells of one type with a model"):
        cw.match_cells(MODELS[:1], CELLS, **FEW)


def test_models_that_are_not_a_cells_own_are_said():
    borrowed = [MODELS[0] | {"kind": "bias"}, MODELS[1] | {"kind": "group"}, *MODELS[2:]]
    notes = cw.pack_decisions(borrowed, MEMBERS, CELLS, **FEW).notes
    assert "models of A: the reference's, corrected by what was measured of the cell" in notes
    assert any(note.startswith("models of B: known from one slow record") for note in notes)


def test_a_cell_of_which_no_facts_are_given_is_named():
    with pytest.raises(cw.Refusal, match=r"no facts of B; there are A, C, D"):
        cw.pack_decisions(MODELS, MEMBERS, [CELLS[0], *CELLS[2:]], **FEW)
