"""Packs through the public interface: wiring by rows of groups.tsv, chosen members, phases."""

import numpy as np
import pytest
import truth

import cellwright as cw

MODELS = [truth.model(name) for name in "ABC"]
ROWS = [
    {"group": "pack", "position": 1, "cell": "pair", "connection": "series"},
    {"group": "pack", "position": 2, "cell": "C", "connection": "series"},
    {"group": "pair", "position": 1, "cell": "A", "wire_resistance_ohm": 0.001},
    {"group": "pair", "position": 2, "cell": "B", "wire_resistance_ohm": 0.004},
]
CURRENT = {"test_time_second": np.arange(0.0, 600.0, 5.0), "current_ampere": np.full(120, -1.5)}


def test_a_pack_of_a_group_and_a_cell():
    run = cw.simulate_pack(MODELS[::-1], ROWS, CURRENT, initial_soc=[0.9, 0.9, 0.8])
    frame = run.to_frame()
    assert run.cells == ("A", "B", "C")
    assert run.members == ("2RC", "2RC", "2RC")
    pair = frame["cell_1_current_ampere"] + frame["cell_2_current_ampere"]
    np.testing.assert_allclose(pair, CURRENT["current_ampere"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(frame["cell_3_current_ampere"], -1.5)
    assert (frame["cell_1_current_ampere"] < frame["cell_2_current_ampere"]).iloc[0]
    at_bar = frame["cell_1_voltage_volt"] + 0.001 * frame["cell_1_current_ampere"]
    np.testing.assert_allclose(frame["voltage_volt"], at_bar + frame["cell_3_voltage_volt"])
    assert (frame["cell_2_temperature_celsius"] == 25.0).all()


def test_cells_warm_where_their_constants_are_given():
    thermal = cw.Thermal(heat_capacity_joule_per_kelvin=40.0, resistance_kelvin_per_watt=10.0)
    run = cw.simulate_pack(MODELS, ROWS, CURRENT, initial_soc=0.9, thermal=thermal)
    assert run.columns["cell_3_temperature_celsius"][-1] > 25.5


def test_a_discharge_is_ended_by_the_weakest_cell():
    phases = [cw.Phase("current", -1.5, lowest_cell_volt=3.3), cw.Phase("rest", second=60.0)]
    run = cw.run_pack_phases(MODELS, ROWS, phases, initial_soc=[0.9, 0.9, 0.8])
    assert run.rows[0]["reason"] == "cell voltage"
    assert run.rows[0]["cell"] == "C"
    assert run.columns["cell_3_voltage_volt"][run.columns["phase"] == 0][-1] == pytest.approx(3.3)


def test_a_cell_without_a_model_is_named():
    with pytest.raises(cw.Refusal, match="found no model of C"):
        cw.simulate_pack(MODELS[:2], ROWS, CURRENT, initial_soc=0.9)
