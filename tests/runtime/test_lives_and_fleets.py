"""Lives and fleets as jobs read them: what is refused in one cell takes no other down."""

import numpy as np
import pytest
from contract_rows import row_of

import cellwright as cw
from cellwright.health.ratings import check_ups
from runtime import artefact, contract, job_inputs, type_inputs


def rating(size, ohm, cycle=0.0):
    blank = dict.fromkeys(contract.stages()["checkups"]["columns"], np.nan)
    blank = {name: value for name, value in blank.items() if not name.startswith("sheet_")}
    words = dict.fromkeys(("direction", "soh_reference", "reason", "doubt", "doubt_codes"), "")
    known = {"cycle": cycle, "capacity_ampere_hour": size, "first_delay_second": 0.01}
    means = dict.fromkeys(("resistance_mean_ohm", "resistance_mean_1s_ohm"), ohm)
    return blank | words | known | means


@pytest.fixture
def checked(saved):
    """Check-ups of nine cells of one pack, of which one was refused, and their pulses."""
    rated, pulsed = [], []
    for place in range(9):
        ohm = 4e-3 - 1e-4 * place + 1e-6 * (place % 3)
        about = {"cycle": 0.0, "direction": "discharge", "delay_second": 0.0}
        about |= {
            "resistance_ohm": ohm,
            "factor": 1.0,
            "factor_std": 0.0,
            "doubt": "",
            "doubt_codes": "",
        }
        growth = [about | {"soc": soc} for soc in (0.2, 0.5, 0.8)]
        refused = "no capacity and no resistance" if place == 8 else None
        found = refused or [rating(20.0 + place, ohm)]
        rated.append(saved(f"results/stages/checkups/P{place}.parquet", found))
        pulsed.append(
            saved(f"results/stages/resistance_growth/P{place}.parquet", refused or growth)
        )
    return rated, pulsed


def test_a_fleet_is_compared_without_the_refused_cell(checked):
    types = {"NMC, 30 Ah": [f"P{place}" for place in range(9)], "LFP": ["P8", "X"]}
    cells, lines = type_inputs.fleet_tables(*checked, types, cw.fleet_resistance)
    assert [row["cell"] for row in cells] == [f"P{place}" for place in range(8)]
    assert lines[0]["cells"] == 8
    assert lines[0]["correlation"] < -0.99
    assert lines[1]["verdict"].endswith(
        "6 cells with capacity and pulse tests, 0 of its cells have them"
    )
    assert lines[1]["slope_ohm_per_ampere_hour"] is None


def test_what_no_method_tells_keeps_its_reason(checked):
    with pytest.raises(artefact.Passed, match="no capacity and no resistance"):
        job_inputs.told_of_health({"check_ups": checked[0][8]})
    (row,) = job_inputs.told_of_health({"check_ups": checked[0][0]})["check_ups"]
    assert row["capacity_ampere_hour"] == 20.0


def test_the_sheet_of_check_ups_comes_along():
    sheet = [{"cell": "A", "cycle": 900.0, "thickness_millimetre": 7.67}]
    rows = job_inputs.with_sheet([rating(20.0, 1e-3), rating(18.0, 1e-3, 900.0)], sheet)
    assert [row["sheet_thickness_millimetre"] for row in rows] == [None, 7.67]
    assert "sheet_thickness_millimetre" not in job_inputs.with_sheet([rating(20.0, 1e-3)], [])[0]


def test_ratings_fit_their_contract(saved):
    capacity = row_of("capacity", direction="discharge", capacity_std_ampere_hour=np.nan)
    capacity |= {"test": "c", "cycle": None, "ambient_temperature_celsius": None}
    rows = check_ups([capacity], [], {"cell": "A"}).rows
    path = saved("results/stages/checkups/A.parquet", job_inputs.with_sheet(rows, []))
    assert artefact.load(path)["soh"].tolist() == [1.0]
