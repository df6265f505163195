"""Protocols that people reported to give wrong numbers: right, refused, or their doubt told."""

import json

import numpy as np
import pandas as pd
import pytest

import cellwright as cw
from cellwright.refusal import Refusal


def measured(folder, name=None, cell=None):
    """Series, steps, cell and facts of a test of a case; the first one of this name and cell."""
    cells = pd.read_csv(folder / "config/cells.tsv", sep="\t").set_index("cell")
    tests = pd.read_csv(folder / "config/tests.tsv", sep="\t")
    tests = tests[(tests.test == (name or tests.test)) & (tests.cell == (cell or tests.cell))]
    row = tests.iloc[0]
    facts = row.dropna().to_dict()
    cell = cells.loc[row.cell].dropna().to_dict() | {"cell": row.cell}
    series = cw.clean(cw.read([folder / file for file in facts.pop("file").split(";")]).columns)
    return series, cw.segment(series, cell), cell, facts


@pytest.fixture
def case(shared):
    return lambda name: shared / "cases" / name


def test_coarse_rows_count_the_edges_of_their_steps(case):
    """Twenty rows a half cycle: half of the first interval was missing, 2.5 % of the capacity."""
    series, steps, cell, facts = measured(case("models/knee_recovery"))
    rows = pd.DataFrame(cw.ageing_cycles(series, steps, facts, cell).rows)
    first = rows[rows.cycle <= 20]
    true = 5.0 - 0.001 * first.cycle
    # Each cycle scatters by 4 mAh.
    np.testing.assert_allclose(first.capacity_ampere_hour, true, atol=0.02)
    assert np.mean(first.capacity_ampere_hour - true) == pytest.approx(0.0, abs=0.003)


def test_pulses_after_a_short_rest_have_one_resistance(case):
    """25.05 mohm after 10 s, 25.5 with the drift of the open-circuit voltage, both directions."""
    folder = case("models/hppc_short_rest")
    series, steps, cell, facts = measured(folder, "hppc")
    basis = {"cell": "M1", "capacity_ampere_hour": 5.0, "ocv": [], "borrowed_from": None}
    rows = pd.DataFrame(cw.resistance(series, steps, basis, facts, cell).rows)
    rows = rows[(rows.delay_second == 10) & (rows.soc > 0.15)]
    means = rows.groupby("direction")[["resistance_ohm", "resistance_std_ohm"]].mean()
    for _, (ohm, std) in means.iterrows():
        assert 0.02505 - 2 * std < ohm < 0.0255 + 2 * std
    assert abs(np.diff(means.resistance_ohm)[0]) < 3e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hppc_unequal_sampling", "hppc_short_rest"])
def test_steps_of_current_between_rows_are_no_kinetics(case, name):
    folder = case(f"models/{name}")
    slow, _, cell, facts = measured(folder, "ocv")
    basis = cw.basis(cell, [(facts, cw.ocv(slow, cell, test=facts))]).content
    tests = [
        (dict(facts, role="fit"), series)
        for series, _, _, facts in (measured(folder, test) for test in ("hppc", "cap"))
    ]
    model = cw.identify(cell, basis, tests, members=("2RC", "DRT", "DRT+K", "DRT+H+K+D"))
    assert model.content["chosen"] == "2RC"
    assert any("the later current flowed from the row before" in note for note in model.notes)
    of_chosen = model.content["members"][0]["conditions"][0]
    r0 = np.interp(0.5, of_chosen["soc"], of_chosen["r0_ohm"])
    assert r0 == pytest.approx(0.020, abs=2e-4)


def test_a_slow_test_that_is_not_full_is_no_scale(case):
    series, _, cell, facts = measured(case("models/ocv_not_full"))
    with pytest.raises(Refusal, match=r"may not start full.*4\.100 V it may lack 11%"):
        cw.ocv(series, cell, test=facts)


def test_the_complete_branch_is_the_scale(case):
    series, steps, cell, facts = measured(case("files/l02_ocv_starts_at_85"))
    curve = cw.ocv(series, cell, test=facts)
    assert curve.curve.branches == "charge"
    assert curve.curve.capacity_ampere_hour == pytest.approx(2.998, abs=0.002)
    assert "it lacked 15.0%" in curve.notes[0]
    rows = pd.DataFrame(cw.capacity(series, steps, cell, whole_swing=True, test=facts).rows)
    assert rows.direction.tolist() == ["charge"]


@pytest.mark.parametrize(
    ("name", "cell", "volts", "interrupted"),
    [
        ("models/ica_one_pause", "whole", (3.646, 4.061), False),
        ("models/ica_one_pause", "one_pause", (3.646, 4.061), True),
        ("files/k01_ica_control_and_5mV", "S04ctl", (3.5605, 3.7605, 3.9605), False),
        ("files/k02_ica_pause", "S04pause", (3.5605, 3.7605, 3.9605), True),
    ],
)
def test_a_pause_adds_no_peak_and_takes_none_away(case, name, cell, volts, interrupted):
    series, steps, *_ = measured(case(name), cell=cell)
    found = cw.ica(series, steps)
    rows = cw.ica_peaks(found).rows
    np.testing.assert_allclose(rows["voltage_volt"], volts, atol=0.006)
    assert all(("was interrupted 1 ×" in doubt) == interrupted for doubt in rows["doubt"])


@pytest.mark.parametrize("name", ["right", "rl_tail"])
def test_an_inductive_tail_that_bends_is_part_of_the_circuit(case, name):
    path = case("models/spectra_rl_tail") / f"raw/{name}.csv"
    row = cw.impedance(cw.read(path, kind="impedance").columns).rows[0]
    assert row["circuit"].startswith("(L|R)-" if name == "rl_tail" else "L-")
    assert row["doubt"] == ""
    for parameter, true in (("r_ohmic_ohm", 0.020), ("r_charge_transfer_ohm", 0.015)):
        assert row[parameter] == pytest.approx(true, rel=0.01)
        assert abs(row[parameter] - true) < 3 * row[f"{parameter}_std"]


def capacities(folder, **chosen):
    series, steps, cell, facts = measured(folder, **chosen)
    rows = pd.DataFrame(cw.capacity(series, steps, cell, test=facts).rows)
    return rows.set_index("direction")


def test_a_negative_electrode_loses_charge_in_its_first_cycle(case):
    rows = capacities(case("files/f02_graphite_half_cell"), cell="F05half")
    assert rows.first_coulombic_efficiency.to_numpy() == pytest.approx([0.896, 0.896], abs=5e-4)
    assert rows.coulombic_efficiency.to_numpy() == pytest.approx([0.9654, 0.9654], abs=5e-4)


def test_a_looped_clock_is_within_the_deviation(case):
    folder = case("files/d01_looped_step_clock")
    expected = json.loads((folder / "expected.json").read_text())["F03loop/t"]
    rows = capacities(folder)
    for direction, letter in (("discharge", "D"), ("charge", "C")):
        row = rows.loc[direction]
        error = row.capacity_ampere_hour - np.mean(expected[letter])
        assert abs(error) < 2 * row.capacity_std_ampere_hour < 0.015


def test_rows_of_cycles_that_stand_twice_count_once(case):
    folder = case("files/i05_ageing_block_twice")
    series, steps, cell, facts = measured(folder)
    rows = pd.DataFrame(cw.ageing_cycles(series, steps, facts, cell).rows)
    wanted = json.loads((folder / "expected.json").read_text())["T15age/t"]["D"]
    found = rows[rows.direction == "discharge"].capacity_ampere_hour
    np.testing.assert_allclose(found, wanted, atol=0.0012)


def test_a_stated_state_that_the_rest_contradicts_is_not_used(case):
    folder = case("models/soc_reference")
    slow, _, cell, facts = measured(folder, "ocv")
    basis = cw.basis(cell, [(facts, cw.ocv(slow, cell, test=facts))]).content
    series, _, _, facts = measured(folder, "drive_from_80")
    anchored = cw.state_of_charge(series, basis, facts, cell)
    assert "the stated SoC of 1 is not used" in anchored.anchor
    assert anchored.soc[0] == pytest.approx(0.80, abs=0.01)
    assert anchored.soc[-1] == pytest.approx(0.444, abs=0.01)
