"""Degradation modes and plateaus by the public interface, from clean series to rows."""

import numpy as np
import pytest
from half_cell_lives import LOSSES, NMC_LITHIUM, nmc, window

import cellwright as cw
from cellwright.health.electrodes.alignment import cell_volt

CELL = {"cell": "C1", "lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.15}


def slow_charge(losses, cycle):
    """A clean series of one C/20 charge from empty to full, and its test."""
    pair, (lower, upper, negative, positive) = nmc()
    sizes = (negative * (1 - losses[1]), positive * (1 - losses[2]))
    limits, charge = window(pair, NMC_LITHIUM * (1 - losses[0]), *sizes, lower, upper)
    soc = np.linspace(0.0, 1.0, 4000)
    volt = cell_volt(pair, np.array([*limits, 0.004, 0.0]), soc)
    reached = volt <= upper
    series = {
        "test_time_second": 20 * 3600 * soc,
        "current_ampere": np.full(len(soc), charge / 20),
        "voltage_volt": volt,
        "charge_ampere_hour": charge * soc,
    }
    test = {"test": f"ica_{cycle}", "kind": "ica", "cycle": cycle}
    test["ambient_temperature_celsius"] = 25.0
    return test, {name: values[reached] for name, values in series.items()}


@pytest.fixture(scope="module")
def tests():
    return [slow_charge(losses, 100.0 * k) for k, losses in enumerate(LOSSES[:3])]


@pytest.fixture(scope="module")
def modes(tests):
    return cw.degradation_modes(tests[::-1], CELL, "NMC")


def test_known_losses_are_found_from_series_in_any_order(modes):
    frame = modes.to_frame()
    assert frame["cycle"].tolist() == [0.0, 100.0, 200.0]
    found = frame[["lli", "lam_negative", "lam_positive"]].to_numpy(float)
    assert found == pytest.approx(LOSSES[:3], abs=0.008)
    assert frame["identifiable"].all()


def test_half_cells_that_nobody_gave_are_said(modes):
    assert any("not measured on this cell" in note for note in modes.notes)
    assert any("Chen et al." in note for note in modes.notes)


def test_half_cells_that_are_given_are_used(tests):
    names = ("graphite_siox_chen", "nmc811_chen")
    found = cw.degradation_modes(tests[:2], CELL, half_cells=names)
    assert not any("not measured on this cell" in note for note in found.notes)
    assert {row["positive_half_cell"] for row in found.rows} == {"nmc811_chen"}


@pytest.mark.slow
def test_a_cell_with_one_check_up_is_held_against_a_fresh_one(tests):
    aged = tests[2][0] | {"cycle": None}, tests[2][1]
    fresh = (CELL | {"cell": "REF"}, tests[:1])
    found = cw.degradation_modes([aged], CELL, "NMC", fresh=fresh)
    (row,) = found.rows
    assert row["fresh_state"] == "REF/ica_0.0"
    assert row["lli"] == pytest.approx(LOSSES[2, 0], abs=0.008)
    assert any("REF, not this cell's own" in note for note in found.notes)


def test_without_chemistry_and_half_cells_it_says_what_is_wanted(tests):
    with pytest.raises(cw.Refusal, match=r"found chemistry LTO, wanted one of NMC.*cells\.tsv"):
        cw.degradation_modes(tests, CELL, "LTO")


def test_one_check_up_alone_is_refused(tests):
    with pytest.raises(cw.Refusal, match="losses need two"):
        cw.degradation_modes(tests[:1], CELL, "NMC")


@pytest.mark.slow
def test_another_chemistry_is_refused_with_the_misfit(tests):
    with pytest.raises(cw.Refusal, match=r"misfit of \d+ mV, at most 5 mV; is the chemistry"):
        cw.degradation_modes(tests, CELL, "LFP")


def test_plateaus_lose_what_the_curve_loses(tests):
    rows = cw.plateau_losses(tests, CELL).rows
    by_cycle = {}
    for row in rows:
        by_cycle.setdefault(row["cycle"], []).append(row["loss_ampere_hour"])
    charges = [series["charge_ampere_hour"][-1] for _, series in tests]
    assert np.isfinite(by_cycle[100.0]).all()
    assert sum(by_cycle[100.0]) == pytest.approx(charges[0] - charges[1], abs=2e-3)
    assert set(by_cycle) == {100.0, 200.0}
