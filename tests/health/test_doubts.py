"""On what a mode hangs: window, half cells, branch; and modes of a real cell held to marks."""

import csv
import gzip

import numpy as np
import pytest
from half_cell_lives import curve_of, life, nmc

import cellwright as cw
from cellwright.health.electrodes.alignment import Pair
from cellwright.health.electrodes.half_cells import half_cell
from cellwright.health.electrodes.mode_rows import mode_rows
from cellwright.health.electrodes.modes import BRANCH_POINTS, END_OF_LIFE, degradation_modes
from cellwright.health.electrodes.tables import from_table


@pytest.fixture(scope="module")
def exact():
    """A life whose half cells are exactly right, as charges and as means of both branches."""
    curves = life(0, common_volt=0.0, own_volt=0.0)
    both = [curve._replace(branches="both") for curve in curves]
    return {way: degradation_modes(c, nmc()[0]) for way, c in (("charge", curves), ("both", both))}


def test_a_charge_alone_leaves_what_a_discharge_may_tell(exact):
    """At the published end of life the 95 % interval holds the published 5.36 and 3.42 points."""
    curves = life(0, common_volt=0.0, own_volt=0.0)
    lost = 1 - curves[-1].capacity_ampere_hour / curves[0].capacity_ampere_hour
    for mode, column in (("lli", 0), ("lam_positive", 2)):
        points = BRANCH_POINTS[mode] * lost / END_OF_LIFE
        assert 1.96 * exact["charge"].doubts["branch"][-1, column] == pytest.approx(
            points, rel=1e-3
        )
        assert 1.96 * exact["charge"].joint_std[-1, column] >= 0.999 * points
    assert not exact["both"].doubts["branch"].any()
    assert exact["both"].joint_std[-1, 0] < 0.2 * exact["charge"].joint_std[-1, 0]
    assert exact["both"].joint[-1] == pytest.approx(exact["charge"].joint[-1], abs=0.003)


def test_graphite_of_the_library_alone_holds_no_silicon():
    pair = Pair(half_cell("graphite_mohtat"), half_cell("nmc811_chen"))
    found = degradation_modes(life(0)[:2], pair)
    assert not found.doubts["branch"].any()


def test_a_mode_that_hangs_on_the_branch_says_so(exact):
    curves = life(0, common_volt=0.0, own_volt=0.0)
    rows = mode_rows(exact["charge"], nmc()[0], curves)
    assert "hangs on the branch, a charge alone" in rows[-1]["doubt"]
    assert "lli ± 6.1, lam_negative ±" in rows[-1]["doubt"]
    assert rows[0]["doubt"] == ""
    assert all(row["doubt"] == "" for row in mode_rows(exact["both"], nmc()[0], curves))


def test_what_one_part_of_the_curve_decides_widens_the_interval():
    """A step of 8 mV in the aged curve alone, over 5 % of SoC beside the step of the graphite."""
    pair, curves = nmc()[0], [c._replace(branches="both") for c in life(1, own_volt=0.0)[:2]]
    bent = np.where(np.abs(curves[1].soc - 0.66) < 0.025, 0.008, 0.0)
    aged = curves[1]._replace(voltage_volt=curves[1].voltage_volt + bent)
    plain, found = (degradation_modes([curves[0], one], pair) for one in (curves[1], aged))
    assert np.all(found.single_std >= 0.999 * found.doubts["window"])
    apart = np.abs(found.single - plain.single)[1]
    assert np.all(apart < 1.96 * found.single_std[1])


def test_half_cells_that_fit_too_are_named(exact):
    curves = life(4)[:2]
    other = Pair(half_cell("graphite_safari"), half_cell("nmc811_chen"))
    found = degradation_modes(
        [curve._replace(branches="both") for curve in curves], nmc()[0], others=[other]
    )
    row = mode_rows(found, nmc()[0], curves)[1]
    assert "hangs on the half cells" in row["doubt"]


def series_of(curve):
    hours = 20.0 * curve.soc
    return {
        "test_time_second": 3600 * hours,
        "current_ampere": np.full(len(hours), curve.capacity_ampere_hour / 20),
        "voltage_volt": curve.voltage_volt,
        "charge_ampere_hour": curve.capacity_ampere_hour * curve.soc,
    }


@pytest.mark.parametrize("blank", ["lower_cutoff_volt", "upper_cutoff_volt"])
def test_a_blank_cut_off_is_the_end_of_the_tests_and_said(blank):
    curves = [
        curve_of(c.soc, np.sort(c.voltage_volt), c.capacity_ampere_hour, cycle=c.cycle)
        for c in life(0, own_volt=0.0)[:2]
    ]
    tests = [({"test": c.test, "kind": "ica", "cycle": c.cycle}, series_of(c)) for c in curves]
    cell = {"cell": "C1", "lower_cutoff_volt": 3.0, "upper_cutoff_volt": 4.15} | {blank: None}
    names = ("graphite_siox_chen", "nmc811_chen")
    modes = cw.degradation_modes(tests, cell, half_cells=names)
    losses = cw.plateau_losses(tests, cell)
    for found in (modes, losses):
        assert any(f"{blank} is blank in cells.tsv: taken is" in note for note in found.notes)
        assert found.rows


# Recomputed by another program (PyDMA 0.1.0) with the same half cells, in percent.
MARKS = {200: (5.36, 0.43, 1.36), 400: (9.92, 3.61, 2.08), 800: (18.15, 12.75, 2.89)}


def read(path, *names):
    opened = gzip.open if path.suffix == ".gz" else open
    with opened(path, "rt", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [np.array([float(row[name]) for row in rows]) for name in names]


@pytest.fixture(scope="module")
def p45b(shared):
    """Nine C/30 charges of a Molicel P45B over 800 cycles, and the folder of its half cells."""
    folder = shared / "campaigns/tum_p45b"
    if not folder.is_dir():
        pytest.skip("the campaign tum_p45b is not on this machine")
    tests = []
    for k in (0, 2, 4, 8):
        path = folder / f"raw/FR23_pOCV_CH_entry0{k + 1}.csv.gz"
        time, current, volt = read(path, "Test Time / s", "Current / A", "Voltage / V")
        moved = np.diff(time) * (current[1:] + current[:-1]) / 7200
        series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
        series["charge_ampere_hour"] = np.append(0.0, np.cumsum(moved))
        tests.append(({"test": f"CU{k + 1}", "kind": "ica", "cycle": 100.0 * k}, series))
    return tests, folder


def modes_of(p45b, change=lambda table: table, cathode=None):
    tests, folder = p45b
    names = ("lithiation", "potential_volt")
    anode = read(folder / "half_cells/P45B_anode_lithiation_C50.csv", *names)
    cathode = cathode or read(folder / "half_cells/P45B_cathode_GITT.csv", *names)
    own = [from_table(*change(table), name="own.csv") for table in (anode, cathode)]
    cell = {"cell": "P45B23", "lower_cutoff_volt": 2.5, "upper_cutoff_volt": 4.2}
    return cw.degradation_modes(tests, cell, half_cells=tuple(own)).rows


def apart(row, other, mode):
    """How far two answers on a mode are apart, over the first one's standard deviation."""
    return abs(row[mode] - other) / row[f"{mode}_std"]


@pytest.fixture(scope="module")
def p45b_modes(p45b):
    return modes_of(p45b)


@pytest.mark.slow
@pytest.mark.parametrize("rows", [100, 1600])
def test_modes_of_a_real_cell_do_not_depend_on_the_rows_of_its_tables(p45b, p45b_modes, rows):
    def averaged(table):
        return [np.array([p.mean() for p in np.array_split(column, rows)]) for column in table]

    for all_rows, few in zip(p45b_modes[1:], modes_of(p45b, averaged)[1:], strict=True):
        assert abs(few["lam_negative"] - all_rows["lam_negative"]) < 0.005
        assert all(apart(all_rows, few[mode], mode) < 0.7 for mode in ("lli", "lam_positive"))


def test_modes_of_a_real_cell_hold_another_programs(p45b_modes):
    for row in p45b_modes[1:]:
        marks = zip(("lli", "lam_negative", "lam_positive"), MARKS[row["cycle"]], strict=True)
        assert all(apart(row, mark / 100, mode) < 1.96 for mode, mark in marks)
    assert "hangs on the branch, a charge alone" in p45b_modes[-1]["doubt"]
    assert "hangs on the window: lam_negative" in p45b_modes[-1]["doubt"]


@pytest.mark.slow
def test_modes_of_a_real_cell_hold_those_of_another_cathode_table(p45b, p45b_modes):
    path = p45b[1] / "reference/P45B_Cathode_Delithiation_0C02.csv.gz"
    emptied, volt = read(path, "normalizedCapacity", "voltage")
    found = modes_of(p45b, cathode=[1 - emptied, volt])
    for row, other in zip(p45b_modes[1:], found[1:], strict=True):
        modes = ("lli", "lam_negative", "lam_positive")
        assert all(apart(row, other[mode], mode) < 1.96 for mode in modes)
