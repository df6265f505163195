"""A cell has one OCV at a SoC, within 0 to 1 and beyond, by whichever room computes it."""

import numpy as np
import pytest
import truth

from cellwright.circuits.cell import (
    Tables,
    continued,
    ocv_and_slope,
    ocv_on_grid,
    simulate_counted,
)
from cellwright.circuits.model_file import simulate_model
from cellwright.effects import base
from cellwright.filters.bank import bank_of
from cellwright.packs.cells import pack_cells
from cellwright.packs.steps import ocv_volt

SOC = np.array([-0.08, -0.02, 0.0, 0.0031, 0.5, 0.9987, 1.0, 1.02, 1.08])
MODEL = truth.stated()
GRID = np.linspace(0.0, 1.0, 201)
TABLE = np.interp(GRID, MODEL["ocv"][0]["soc"], MODEL["ocv"][0]["ocv_volt"])
STILL = np.zeros(len(SOC))


def by_model_file():
    return simulate_model(MODEL, "2RC", np.arange(9.0), STILL, SOC, 25.0).voltage_volt


def by_tables():
    tables = Tables(TABLE, 0 * TABLE, np.empty((0, 201)), np.empty(0))
    still = {"hold": "first_order", "capacity_ampere_hour": 2.0}
    return [simulate_counted(tables, 1.0, [0.0], initial_soc=z, **still)[0][0] for z in SOC]


def by_packs():
    cells = pack_cells([MODEL] * len(SOC), temperature_celsius=25.0)
    return ocv_volt(cells, SOC, np.full(len(SOC), 25.0))


def by_filters():
    bank = bank_of(MODEL, "2RC", 25.0)
    return np.interp(SOC, bank.soc, bank.ocv_volt)


def by_search():
    return base.Cell(2.0, TABLE).ocv_at(SOC)


def by_search_compiled():
    return base._looked_up(base.Cell(2.0, TABLE), (0.0,) * base.OCV_KNOTS, SOC)


def by_groups():
    return ocv_and_slope(np.tile(TABLE, (len(SOC), 1)), SOC)[0]


@pytest.mark.parametrize(
    "volt", [by_tables, by_packs, by_filters, by_search, by_search_compiled, by_groups]
)
def test_all_rooms_agree(volt):
    np.testing.assert_allclose(volt(), by_model_file(), rtol=0, atol=1e-9)


def test_beyond_its_ends_a_table_goes_straight_on_by_its_last_half_percent():
    first, last = (TABLE[1] - TABLE[0]) / 0.005, (TABLE[-1] - TABLE[-2]) / 0.005
    wanted = [TABLE[0] - 0.08 * first, TABLE[-1] + 0.02 * last]
    np.testing.assert_allclose(ocv_on_grid(TABLE, SOC[[0, -2]]), wanted, rtol=0, atol=1e-12)
    found = continued(lambda soc, _of: np.interp(soc, GRID, TABLE), SOC[[0, -2]])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
