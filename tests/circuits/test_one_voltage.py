"""A cell has one OCV at a SoC and one voltage under a load, by whichever room computes them."""

import numpy as np
import pytest
import truth

from cellwright.circuits.cell import (
    continued,
    held_on_grid,
    ocv_and_slope,
    ocv_on_grid,
    place,
    simulate,
    usual_slope,
)
from cellwright.circuits.circuit import rc_circuit
from cellwright.circuits.model_file import simulate_model
from cellwright.effects import base
from cellwright.effects.groups.branch import Branch
from cellwright.effects.groups.model import group_fields, group_names, group_run
from cellwright.effects.records import group_stacked, stacked
from cellwright.filters.bank import bank_of
from cellwright.numerics.lags import HOLDS, mean_over_steps
from cellwright.packs.cells import pack_cells, rc_cells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.steps import ocv_volt
from cellwright.packs.wiring import Wiring
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

SOC = np.array([-0.08, -0.02, 0.0, 0.0031, 0.5, 0.9987, 1.0, 1.02, 1.08, np.nan])
MODEL = truth.stated()
GRID = np.linspace(0.0, 1.0, 201)
TABLE = np.interp(GRID, MODEL["ocv"][0]["soc"], MODEL["ocv"][0]["ocv_volt"])
KNOWN = np.isfinite(SOC)


def by_model_file():
    """The last SoC is no number: a record with it is refused, a look-up gives NaN."""
    still = np.zeros(KNOWN.sum())
    run = simulate_model(MODEL, "2RC", np.arange(9.0), still, SOC[KNOWN], 25.0)
    return np.append(run.voltage_volt, np.nan)


def by_table():
    return ocv_on_grid(TABLE, SOC)


def by_packs():
    cells = pack_cells([MODEL] * len(SOC), temperature_celsius=25.0)
    return ocv_volt(cells, SOC, np.full(len(SOC), 25.0))


def by_filters():
    bank = bank_of(MODEL, "2RC", 25.0)
    return np.interp(SOC, bank.soc, bank.ocv_volt)


def by_search():
    return base.Cell(2.0, TABLE).ocv_at(SOC)


def by_search_compiled():
    return base.looked_up(base.Cell(2.0, TABLE), (0.0,) * base.OCV_KNOTS, SOC)


def by_groups():
    return ocv_and_slope(np.tile(TABLE, (len(SOC), 1)), SOC)[0]


@pytest.mark.parametrize(
    "volt", [by_table, by_packs, by_filters, by_search, by_search_compiled, by_groups]
)
def test_all_rooms_agree(volt):
    np.testing.assert_allclose(volt(), by_model_file(), rtol=0, atol=1e-9)


def test_a_record_whose_soc_is_no_number_is_refused():
    time = np.arange(len(SOC), dtype=float)
    with pytest.raises(Refusal, match="not finite"):
        simulate_model(MODEL, "2RC", time, 0.0 * time, SOC, 25.0)


def test_beyond_its_ends_a_table_goes_straight_on_by_its_last_half_percent():
    first, last = (TABLE[1] - TABLE[0]) / 0.005, (TABLE[-1] - TABLE[-2]) / 0.005
    wanted = [TABLE[0] - 0.08 * first, TABLE[-1] + 0.02 * last]
    np.testing.assert_allclose(ocv_on_grid(TABLE, SOC[[0, -3]]), wanted, rtol=0, atol=1e-12)
    found = continued(lambda soc, _of: np.interp(soc, GRID, TABLE), SOC[[0, -3]])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def test_an_ocv_without_its_slope_is_the_same_number():
    soc = np.append(np.linspace(-0.5, 1.5, 4001), np.nan)
    np.testing.assert_array_equal(ocv_on_grid(TABLE, soc), ocv_and_slope(TABLE, soc)[0])
    assert ocv_on_grid(TABLE, 0.437) == ocv_and_slope(TABLE, 0.437)[0]


@pytest.mark.parametrize("points", [2, 3, 201])
def test_a_soc_that_is_no_number_has_no_value(points):
    """NaN, beside numbers that keep theirs; nothing is raised and no interval is left."""
    table, soc = np.linspace(3.0, 4.0, points), np.array([0.25, np.nan, 0.75])
    below, share = place(soc, points)
    assert ((below >= 0) & (below <= points - 2)).all()
    for values in (share, *ocv_and_slope(table, soc), held_on_grid(table, soc)):
        assert np.isnan(values).tolist() == [False, True, False]
    assert np.isnan(ocv_and_slope(table, np.nan)).all()
    assert np.isnan(usual_slope(table, np.nan))


def test_all_but_the_ocv_is_flat_beyond_the_ends():
    wanted = [TABLE[0], TABLE[0], TABLE[-1]]
    np.testing.assert_allclose(held_on_grid(TABLE, np.array([-0.2, 0.0, 1.3])), wanted, rtol=1e-15)


OHM, TAU, CAPACITY_AMPERE_HOUR = (0.03, 0.01, 0.015), (9.0, 150.0), 2.0
SECOND = np.cumsum([0.0, *np.random.default_rng(3).choice([1.0, 2.0, 30.0], 400)])
AMPERE = np.random.default_rng(4).uniform(-3.0, 2.0, len(SECOND))  # a drive: new at every row


def loaded_by_circuit(hold):
    passed = mean_over_steps(AMPERE, hold) * np.diff(SECOND) / 3600.0 / CAPACITY_AMPERE_HOUR
    soc = 0.98 + np.append(0.0, np.cumsum(passed))
    circuit = rc_circuit(OHM[0], OHM[1:], TAU)
    return simulate(circuit, SECOND, AMPERE, ocv_on_grid(TABLE, soc), hold=hold)


def loaded_by_pack(hold):
    course = np.ones((1, 201))
    r, tau = (np.array(pair)[None, :, None] * course for pair in (OHM[1:], TAU))
    cells = rc_cells(TABLE[None], OHM[0] * course, r, tau, [CAPACITY_AMPERE_HOUR])
    alone = Wiring("one", "series", ("cell",), (0.0,), (0.0,))
    run = simulate_pack(SECOND, AMPERE, cells, alone, initial_soc=0.98, hold=hold)
    return run.voltage_volt


def loaded_by_search(hold):
    record = record_of(SECOND, AMPERE, 0.0 * SECOND, 0.98)
    stack = stacked([record], capacity_ampere_hour=CAPACITY_AMPERE_HOUR, hold=hold)
    values = dict(zip(base.LOGARITHMS, np.log([*OHM[:2], TAU[0], OHM[2], TAU[1]]), strict=True))
    values |= dict.fromkeys(base.OCV_NAMES, 0.0) | {"capacity": 0.0, "soc0[0]": 0.98}
    return base.voltage(base.Cell(CAPACITY_AMPERE_HOUR, TABLE), stack, values)


def loaded_by_group(hold):
    """Of two alike, each with half of the current."""
    cells = [Branch("cell", CAPACITY_AMPERE_HOUR, TABLE, OHM, TAU)] * 2
    record = record_of(SECOND, 2 * AMPERE, 0.0 * SECOND, np.nan)
    stack = group_stacked([record], branches=2, hold=hold)
    fields = group_fields(cells, [[0.98, 0.98]], dict.fromkeys(group_names(1, 2), 0.0))
    return group_run(fields, stack).voltage


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("volt", [loaded_by_pack, loaded_by_search, loaded_by_group])
def test_all_rooms_step_a_cell_alike(volt, hold):
    """A cell alone under one load, sampled unevenly: to rounding, in whichever room."""
    np.testing.assert_allclose(volt(hold), loaded_by_circuit(hold), rtol=0, atol=1e-9)
