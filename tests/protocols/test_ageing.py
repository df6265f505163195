"""Cycles of an ageing record: complete ones only, numbered, with their temperatures."""

import numpy as np
import pytest
from counted import NAMES, counted

from cellwright.protocols.ageing import ageing_cycles
from cellwright.records.facts import CellFacts, TestFacts
from cellwright.refusal import Refusal
from cellwright.series.steps import segment


def series(*parts, full=2.0, soc=1.0, step=10.0, pulses=False):
    """A cell whose voltage is 3 V + SoC; parts are (ampere, SoC where it ends), rests between."""
    current, voltage, room = [0.0] * 60, [3.0 + soc] * 60, [20.0] * 60
    for number, (ampere, end) in enumerate(parts):
        gain, k = ampere / full / 3600 * step, 0
        while (end - soc) * gain > 1e-12:
            on = not pulses or ampere > 0 or k % 2
            soc, k = soc + gain * on, k + 1
            current.append(ampere * on)
            voltage.append(3.0 + soc)
            room.append(20.0 + number)
        current += [0.0] * 60
        voltage += [3.0 + soc] * 60
        room += [20.0 + number] * 60
    time, current = np.arange(len(current)) * step, np.array(current)
    return {
        "test_time_second": time,
        "current_ampere": current,
        "voltage_volt": np.array(voltage),
        "charge_ampere_hour": counted(time, current),
        "ambient_temperature_celsius": np.array(room),
        "surface_temperature_celsius": np.array(room) + 1,
    }


def run(columns, *, lower=3.0, upper=4.0, first_cycle=None, state_before=""):
    steps = segment(*[columns[name] for name in NAMES], rated_capacity_ampere_hour=2.0)
    course = [{"test": "a", "state_at_begin": state_before}]
    test = TestFacts("a", "ageing", cycle=first_cycle)
    return ageing_cycles(columns, steps, test, CellFacts("A", 2.0, lower, upper), course)


def test_complete_cycles_are_numbered_and_counted():
    rows = run(series((-1.0, 0.0), (1.0, 1.0), (-2.0, 0.0)), first_cycle=100).rows
    assert rows["direction"].tolist() == ["discharge", "charge", "discharge"]
    assert rows["cycle"].tolist() == [101, 102, 102]
    assert rows["capacity_ampere_hour"] == pytest.approx(2.0, abs=0.02)
    assert rows["c_rate"] == pytest.approx([0.5, 0.5, 1.0])
    assert rows["energy_watt_hour"] == pytest.approx(7.0, rel=0.01)
    assert np.isnan(rows["coulombic_efficiency"][:2]).all()
    assert rows["coulombic_efficiency"][2] == pytest.approx(1, abs=0.01)


def losing_in_the_first_load(columns, share):
    """A record whose first load took 1/share of what it gives back."""
    current = columns["current_ampere"]
    first = np.flatnonzero(current)
    rows = first[: np.argmax(np.append(np.diff(first), 99) > 1) + 1]
    current[rows] /= share
    return columns | {"charge_ampere_hour": counted(columns["test_time_second"], current)}


@pytest.mark.parametrize(("first_cycle", "told"), [(0, 0.7), (100, np.nan)])
def test_the_efficiency_of_formation_is_told_of_a_new_cell(first_cycle, told):
    cycles = series((1.0, 1.0), (-1.0, 0.0), (1.0, 1.0), (-1.0, 0.0), soc=0.0)
    rows = run(losing_in_the_first_load(cycles, 0.7), first_cycle=first_cycle).rows
    found = rows["coulombic_efficiency"][rows["direction"] == "discharge"]
    np.testing.assert_allclose(found, [told, 1.0], rtol=0.02)


def test_a_negative_electrode_begins_its_cycles_with_a_discharge():
    columns = series((-1.0, 0.0), (1.0, 1.0), (-1.0, 0.0), (1.0, 1.0))
    columns = losing_in_the_first_load(columns, 0.9)
    columns["voltage_volt"] -= 2.99
    rows = run(columns, lower=0.01, upper=1.01, state_before="full").rows
    assert np.isnan(rows["coulombic_efficiency"][rows["direction"] == "discharge"]).all()
    found = rows["coulombic_efficiency"][rows["direction"] == "charge"]
    np.testing.assert_allclose(found, [0.9, 1.0], rtol=0.02)


def test_temperatures_are_of_the_half_cycle():
    rows = run(series((-1.0, 0.0), (1.0, 1.0), (-1.0, 0.0))).rows
    assert rows["room_temperature_celsius"] == pytest.approx([20, 21, 22], abs=0.05)
    assert rows["temperature_start_celsius"] == pytest.approx([21, 21, 22], abs=0.1)
    assert rows["temperature_mean_celsius"] == pytest.approx([21, 22, 23], abs=0.05)


def test_without_temperatures_they_are_not_known():
    bare = {k: v for k, v in series((-1.0, 0.0), (1.0, 1.0)).items() if "temperature" not in k}
    rows = run(bare).rows
    assert np.isnan(rows["room_temperature_celsius"]).all()
    assert np.isnan(rows["temperature_start_celsius"]).all()


def test_a_cut_cycle_takes_the_next_half_with_it():
    ageing = run(series((-1.0, 0.0), (1.0, 1.0), (-1.0, 0.5), (1.0, 1.0), (-1.0, 0.0)))
    assert ageing.rows["cycle"].tolist() == [1, 2, 3]
    assert ageing.rows["direction"].tolist() == ["discharge", "charge", "discharge"]
    discharge, charge = ageing.left_out
    assert "1 of 3 discharges left out (cycles 2)" in discharge
    assert "cycle 2: it ends at 3.500 V, before the cut-off of 3 V" in discharge
    assert "cycle 3: it does not start empty: what came before was cut short" in charge
    assert np.isnan(ageing.rows["coulombic_efficiency"][2])


def test_a_pulsed_discharge_counts():
    rows = run(series((-4.0, 0.0), (1.0, 1.0), (-4.0, 0.0), pulses=True)).rows
    assert rows["direction"].tolist() == ["discharge", "charge", "discharge"]
    assert rows["c_rate"][[0, 2]] == pytest.approx(2.0)


def test_a_hold_after_a_pause_is_part_of_the_charge():
    """As Arbin schedules have it: constant current, a pause of two minutes, then the hold."""
    columns = series((-1.0, 0.0), (1.0, 1.0), (-1.0, 0.0))
    time, begin = (
        columns["test_time_second"],
        np.flatnonzero(columns["current_ampere"] > 0)[-1] + 12,
    )
    current, voltage = columns["current_ampere"].copy(), columns["voltage_volt"].copy()
    current[begin : begin + 40] = 0.5 * np.exp(-np.arange(40) / 20)
    voltage[begin : begin + 40] = 4.0
    voltage[begin - 12 : begin] = 3.95
    changed = {"current_ampere": current, "voltage_volt": voltage}
    rows = run(columns | changed | {"charge_ampere_hour": counted(time, current)}).rows
    held = current[begin : begin + 40].sum() * 10 / 3600
    assert rows["capacity_ampere_hour"][1] == pytest.approx(2.0 + held, abs=0.01)


def test_a_record_from_an_unknown_start_begins_with_the_next_half():
    ageing = run(series((1.0, 1.0), (-1.0, 0.0), soc=0.4))
    assert ageing.rows["direction"].tolist() == ["discharge"]
    assert "already held 40.0%, for the discharge after it moves 1.999 Ah" in ageing.left_out[0]


def test_nothing_complete_and_no_cut_off_are_refused():
    with pytest.raises(Refusal, match="no complete cycle"):
        run(series((-1.0, 0.5)))
    with pytest.raises(Refusal, match="a cut-off is not stated"):
        run(series((-1.0, 0.0)), upper=None)


def test_what_an_offset_counts_at_rest_is_no_half_cycle():
    """A rest of weeks at an offset of C/500 turns the counted charge, but holds no cycle."""
    columns = series((-1.0, 0.0), (1.0, 1.0))
    rest = np.arange(1, 60 * 360) * 50.0
    longer = {
        name: np.append(values, np.full(len(rest), values[-1])) for name, values in columns.items()
    }
    longer["test_time_second"][len(columns["voltage_volt"]) :] += rest
    longer["current_ampere"] = longer["current_ampere"] - 0.004
    time, current = longer["test_time_second"], longer["current_ampere"]
    longer["charge_ampere_hour"] = counted(time, current)
    ageing = run(longer)
    assert ageing.rows["cycle"].tolist() == [1, 2]
    assert "it has no load: only -0.004 A read at rest was counted" in ageing.left_out[0]
