"""A test of a parallel group: branch currents in their order, starts, temperature, refusal."""

import numpy as np
import pytest
from sheets_facts import branch_facts, facts_of, measured_test

import cellwright as cw
from cellwright.records.record import branch_currents, group_record, stated_soc
from cellwright.refusal import Refusal

ROWS = np.arange(5.0)


def made(branches, soc=None, **more):
    series = {"test_time_second": ROWS, "current_ampere": -ROWS, "voltage_volt": 3.7 + 0 * ROWS}
    series |= {f"branch_{k}_current_ampere": k * ROWS for k in branches}
    return measured_test(series | more, "pair", "group", celsius=12.0, soc=soc)


def test_branches_stand_in_the_order_of_their_numbers():
    currents = branch_currents(made((10, 2, 1, 11, 3)).series)
    np.testing.assert_array_equal(currents[1], [1, 2, 3, 10, 11])
    assert branch_currents(made(()).series) is None


def test_a_test_of_a_group_as_a_record():
    record = group_record(made((1, 2)), branch_facts("AB", [0.9, 0.8]))
    assert record.test == "pair"
    np.testing.assert_array_equal(record.current_ampere, -ROWS)
    np.testing.assert_array_equal(record.branch_current_ampere, np.column_stack([ROWS, 2 * ROWS]))
    np.testing.assert_array_equal(record.celsius, 12.0)
    np.testing.assert_array_equal(record.initial_soc, [0.9, 0.8])
    warm = made((1, 2), surface_temperature_celsius=ROWS)
    np.testing.assert_array_equal(group_record(warm, branch_facts("AB", [1, 1])).celsius, ROWS)


def test_the_start_is_the_tests_else_the_branches_or_unknown():
    rows = branch_facts("AB", [0.9, None])
    assert stated_soc(facts_of(soc=0.5), rows) == [0.5, 0.5]
    assert stated_soc(facts_of(), rows) == [0.9, None]
    assert group_record(made((1, 2)), rows).initial_soc is None


def test_channels_beyond_the_wiring_are_refused_in_the_words_of_the_file():
    with pytest.raises(
        Refusal, match=r"pair: found Branch 3 Current / A; groups\.tsv wires 2 memb"
    ):
        group_record(made((1, 2, 3)), branch_facts("AB", [0.9, 0.8]))
    voltages = {"cell_5_voltage_volt": ROWS, "cell_0_voltage_volt": ROWS}
    found = "found Cell 0 Voltage / V, Cell 5 Voltage / V; groups.tsv wires 4 cells"
    with pytest.raises(Refusal, match=found):
        group_record(made((), **voltages), branch_facts("AB", [0.9, 0.8]), cells=4)


def test_any_subset_of_channels_is_a_record():
    more = {"cell_4_voltage_volt": 3.0 + ROWS, "cell_2_temperature_celsius": 20.0 + ROWS}
    record = group_record(made((2,), **more), branch_facts("AB", [0.9, 0.8]), cells=4)
    assert record.branch_current_ampere is None
    np.testing.assert_array_equal(record.member_current_ampere[:, 1], 2 * ROWS)
    assert np.isnan(record.member_current_ampere[:, 0]).all()
    np.testing.assert_array_equal(record.cell_voltage_volt[:, 3], 3.0 + ROWS)
    assert np.isnan(record.cell_voltage_volt[:, :3]).all()
    np.testing.assert_array_equal(record.cell_temperature_celsius[:, 1], 20.0 + ROWS)
    whole = group_record(made((1, 2)), branch_facts("AB", [0.9, 0.8]))
    assert whole.cell_voltage_volt is None
    np.testing.assert_array_equal(whole.member_current_ampere, whole.branch_current_ampere)


def test_channels_of_a_group_come_out_of_a_file():
    head = "Test Time / s,Current / A,Voltage / V,Branch 2 Current / mA,Cell 3 Voltage / mV"
    rows = [f"{k},{-2 * (k > 1)},7.4,{-900 * (k > 1)},3700,{295.15 + k}" for k in range(5)]
    text = "\n".join([f"{head},Cell 12 Temperature / K", *rows])
    name, data = "pack.csv", text.encode()
    raw = cw.read((name, data), members=2, cells=12, current_sign="charge_positive").columns
    np.testing.assert_allclose(raw["branch_2_current_ampere"], [0, 0, -0.9, -0.9, -0.9])
    np.testing.assert_allclose(raw["cell_3_voltage_volt"], 3.7)
    np.testing.assert_allclose(raw["cell_12_temperature_celsius"], 22.0 + np.arange(5))
    with pytest.raises(Refusal, match=r"found Cell 12 Temperature / degC; groups\.tsv wires 11"):
        cw.read((name, data), members=2, cells=11, current_sign="charge_positive")


def test_currents_of_branches_turn_with_the_current_and_voltages_of_cells_do_not():
    head = "Test Time / s,Current / A,Voltage / V,Branch 1 Current / A,Cell 1 Voltage / V"
    rows = [f"{k},{2 * (k > 1)},{7.4 - 0.1 * (k > 1)},{k > 1:d},3.7" for k in range(5)]
    data = "\n".join([head, *rows]).encode()
    raw = cw.read(("p.csv", data), current_sign="discharge_positive", members=2).columns
    assert raw["branch_1_current_ampere"][-1] == -1
    assert raw["cell_1_voltage_volt"][-1] == 3.7
