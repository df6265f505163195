"""The laboratory's cells in series: one current, the sum of voltages, the first cell's cut-off."""

import numpy as np
import pytest

from cellwright import formats
from virtual_lab import campaigns, instruments, protocols, truth
from virtual_lab.campaigns import making, thesis, thesis_packs
from virtual_lab.chamber import steady
from virtual_lab.instruments import measurement

SEED = 0
CELLS = 4


@pytest.fixture(scope="module")
def string():
    return thesis_packs.pack_string(SEED, cells=CELLS)


@pytest.fixture(scope="module")
def discharged(string):
    steps = [protocols.rest(60.0), protocols.discharge(thesis_packs.RATING, 1 / 2)]
    return steps, string.run(steps, chamber=steady(25.0)), string.run_cells(steps)


def test_the_pack_is_in_the_plan_with_its_cells_in_order():
    plan = thesis.plan(seed=SEED)
    of_pack = [test for test in plan.tests if test.cell == thesis_packs.PACK]
    assert [test.test for test in of_pack] == ["series_fuds_25C", "discharge_C2"]
    assert {test.role for test in of_pack} == {"validation"}
    rows = plan.groups[thesis_packs.PACK].facts(thesis_packs.PACK)["groups"]
    assert [row["cell"] for row in rows] == [f"P{k:02d}" for k in range(1, 51)]
    assert {row["connection"] for row in rows} == {"series"}
    # The very drive of the single cells.
    alone = next(t for t in plan.tests if (t.cell, t.test) == ("P07", "series_fuds_25C"))
    assert len(alone.steps) == len(of_pack[0].steps)
    for one, other in zip(alone.steps, of_pack[0].steps, strict=True):
        np.testing.assert_array_equal(one.value, other.value)


def test_voltages_add_up_and_the_current_is_one(discharged):
    _, pack, cells = discharged
    for k, behaviour in enumerate(pack):
        second = np.linspace(0.0, behaviour.duration_second, 50)
        volts = [one[k].voltage(second) for one in cells]
        np.testing.assert_allclose(behaviour.voltage(second), np.sum(volts, axis=0), atol=1e-12)
        for one in cells:
            np.testing.assert_allclose(one[k].current(second), behaviour.current(second))


def test_the_first_cell_at_its_cut_off_ends_the_discharge(discharged):
    _, pack, _ = discharged
    end = pack[-1].duration_second
    volts = [float(volt(end)) for volt in pack[-1].cell_voltages]
    assert min(volts) == pytest.approx(thesis_packs.RATING.lower_cutoff_volt, abs=2e-4)
    assert sum(volt < thesis_packs.RATING.lower_cutoff_volt + 0.01 for volt in volts) == 1


def test_truth_says_the_charge_and_who_ended_it(string, discharged):
    steps, pack, _ = discharged
    test = campaigns.Test(thesis_packs.PACK, "t", "group", 25.0, "parquet", string, steps=steps)
    rows = truth.rows(test, pack)["series_packs"]
    assert len(rows) == CELLS
    charge = 15.0 * pack[-1].duration_second / 3600
    assert rows[0]["discharged_ampere_hour"] == pytest.approx(charge, rel=1e-5)
    lowest = min(rows, key=lambda row: row["volt_at_end_of_discharge"])
    assert lowest["cell"] == rows[0]["lowest_at_end"]
    for row in rows:
        drop = row["soc_begin"] - row["soc_at_end_of_discharge"]
        assert drop * row["capacity_ampere_hour"] == pytest.approx(charge, rel=1e-4)


def test_a_record_has_every_cells_voltage_and_some_temperatures(string):
    steps = [protocols.rest(30.0, period_second=1.0)]
    test = campaigns.Test(
        thesis_packs.PACK, "t", "group", 25.0, "parquet", string, steps=steps, initial_soc=None
    )
    content, _ = making.made(test)
    columns = formats.read(content, name="t.bdf.parquet").columns
    volts = [columns[f"cell_{k}_voltage_volt"] for k in range(1, CELLS + 1)]
    np.testing.assert_allclose(np.sum(volts, axis=0), columns["voltage_volt"], atol=5e-3)
    assert "cell_1_temperature_celsius" in columns
    assert "cell_2_temperature_celsius" not in columns


def test_noise_of_the_first_channels_is_that_without_cells(string):
    """More channels must not change what other campaigns record."""
    steps = [protocols.rest(30.0, period_second=1.0)]
    pack = string.run(steps, chamber=steady(25.0))
    plain = [behaviour._replace(cell_voltages=(), cell_temperatures=None) for behaviour in pack]
    shown = []
    for behaviours in (pack, plain):
        ideal = measurement.record(behaviours, periods_second=[1.0], seed=5, chamber=steady(25.0))
        shown.append(measurement.measured(ideal, seed=6))
    for name in shown[1]:
        np.testing.assert_array_equal(shown[0][name], shown[1][name])
    assert instruments.WRITERS["parquet"](shown[0])
