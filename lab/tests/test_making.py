"""From the plan to files: a small campaign that the pipeline can read, the same bytes each time."""

import csv
import hashlib
import json
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cellwright import formats
from cellwright.refusal import Refusal
from runtime import sheets as campaign
from virtual_lab import campaigns, fast
from virtual_lab.behaviour import Rating
from virtual_lab.campaigns import making
from virtual_lab.instruments import faults
from virtual_lab.instruments.chain import CHAIN
from virtual_lab.protocols import Step, discharge, rest
from virtual_lab.specimens import Behavioural, BehaviouralGroup
from virtual_lab.thesis_cells import Tabulated, circuit_at

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
RATING = Rating(1.0, 3.0, 4.0)
OCV_VOLT = np.linspace(3.0, 4.0, 11)
R_OHM, CAPACITY_AMPERE_HOUR = 0.05, 1.02
LOAD = [rest(60.0, period_second=5.0), Step("current", -0.5, 400.0, 1.0), rest(60.0)]
PULSES = [rest(60.0, period_second=5.0), Step("current", -1.0, 10.0, 0.5), rest(40.0)]


def _cell(r_ohm=R_OHM):
    return fast.Cell(RATING, OCV_VOLT, CAPACITY_AMPERE_HOUR, r_ohm)


GOOD, WORSE = Behavioural(_cell, (25.0,)), Behavioural(partial(_cell, 2 * R_OHM), (25.0,))
PAIR = BehaviouralGroup(("A", "B"), (GOOD, WORSE), (0.001, 0.001), (1.0, 1.0))


@pytest.fixture(scope="module")
def plan():
    cells = (
        campaigns.Cell("A", "NMC", RATING, GOOD, reference=True),
        campaigns.Cell("B", "NMC", RATING, WORSE, note="resistive"),
        campaigns.Cell("Z", "LMO", Rating(32.0, 2.5, 4.2), Tabulated()),
    )
    a = partial(campaigns.Test, "A", ambient_celsius=25.0, specimen=GOOD, batch="A")
    b = partial(
        campaigns.Test, "B", ambient_celsius=25.0, specimen=WORSE, batch="B", seed_of_campaign=1
    )
    empty = [discharge(RATING, 2.0, period_second=20.0), rest(60.0)]
    tests = (
        a("load", "drive", instrument="arbin", steps=LOAD, role="fit"),
        a("pulses", "hppc", instrument="bdf", steps=PULSES, discharge_positive=True),
        a("spiked", "drive", instrument="arbin", steps=LOAD,
          faults=(partial(faults.spikes, seed=3, count=4),)),
        b("capacity", "capacity", instrument="digatron", steps=empty),
        b("torn", "drive", instrument="parquet", steps=LOAD, damage=faults.cut_off),
        campaigns.Test("Z", "eis", "eis", 20.0, "eis", Tabulated(), soc=0.5, initial_soc=0.5,
                   batch="Z"),
        campaigns.Test("pair", "both", "group", 25.0, "bdf", PAIR, steps=LOAD, soc=None,
                   initial_soc=None, batch="pair"),
    )  # fmt: skip
    return campaigns.Plan(cells, tests, {"pair": PAIR}, "title: Small\n", "# About\n")


def _make(plan, folder, order=None):
    for batch in order or plan.batches():
        making.make_batch(plan, batch, folder)
    making.make_sheets(plan, folder)
    return folder


@pytest.fixture(scope="module")
def made(plan, tmp_path_factory):
    return _make(plan, tmp_path_factory.mktemp("made"))


def _bytes(folder):
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _rows(path, separator=","):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter=separator))


def _true(made, table, **wanted):
    return [r for r in _rows(made / "truth" / f"{table}.csv") if wanted.items() <= r.items()]


def _columns(made, file):
    return formats.read((made / file).read_bytes(), name=file).columns


def test_the_same_bytes_whatever_the_order_of_the_jobs(plan, made, tmp_path):
    again = _make(plan, tmp_path, order=["pair", "Z", "B", "A"])
    first, second = _bytes(made), _bytes(again)
    assert first.keys() == second.keys()
    assert [name for name, content in first.items() if second[name] != content] == []


def test_another_seed_is_another_noise_over_the_same_truth(plan, made):
    (test,) = [test for test in plan.tests if test.test == "load"]
    content, rows = making.made(test)
    assert content == (made / test.file).read_bytes()
    other, other_rows = making.made(test._replace(seed_of_campaign=5))
    assert other != content
    assert other_rows == rows


def test_all_files_are_there_with_their_checksums(plan, made):
    sheet = _rows(made / "config" / "tests.tsv", "\t")
    assert [row["file"] for row in sheet] == [test.file for test in plan.tests]
    for row in sheet:
        content = (made / row["file"]).read_bytes()
        assert hashlib.sha256(content).hexdigest() == row["sha256"], row["file"]


def test_the_pipeline_takes_the_campaign(made):
    read = campaign.read(made, SCHEMAS)
    assert [row["cell"] for row in read.cells] == ["A", "B", "Z"]
    assert [row["reference"] for row in read.cells] == ["yes", None, None]
    assert [row["kind"] for row in read.tests][-2:] == ["eis", "group"]
    assert [(row["position"], row["cell"]) for row in read.groups] == [(1, "A"), (2, "B")]
    assert read.config["title"] == "Small"
    assert (made / "truth" / "README.md").read_text() == "# About\n"


def test_columns_stand_as_the_contract_lists_them(made):
    for name in ("cells", "tests", "groups"):
        known = campaign.settings.load(SCHEMAS, name)["properties"]
        header = (made / "config" / f"{name}.tsv").read_text().splitlines()[0].split("\t")
        assert header == [column for column in known if column in header], name


def test_a_record_shows_the_cell_by_ohms_law(made):
    """3 + z − R I, z from the charge; noise and resolution of the channel apart."""
    shown = _columns(made, "raw/A/load.csv.gz")
    second = shown["test_time_second"]
    taken = 0.5 * np.clip(second - 60.0, 0.0, 400.0) / 3600
    ampere = np.where((second > 60.0) & (second <= 460.0), -0.5, 0.0)
    expected = 4.0 - taken / CAPACITY_AMPERE_HOUR + R_OHM * ampere
    assert np.abs(shown["voltage_volt"] - expected).max() < 0.003
    assert np.abs(shown["current_ampere"] - ampere).max() < 0.003


def test_each_test_has_noise_of_its_own(plan):
    """The same cell at rest under two names."""
    (test,) = [test for test in plan.tests if test.test == "load"]
    named = [test, test._replace(test="other")]
    contents = [
        making.made(one._replace(steps=[rest(900.0, period_second=1.0)]))[0] for one in named
    ]
    shown = [formats.read(content, name="x").columns["voltage_volt"][-800:] for content in contents]
    assert abs(np.corrcoef(*shown)[0, 1]) < 0.15


def test_truth_about_a_test_is_what_its_steps_do(made):
    (row,) = _true(made, "soc", cell="A", test="load")
    moved = -0.5 * 400.0 / 3600 / CAPACITY_AMPERE_HOUR
    assert float(row["soc_end"]) == pytest.approx(1.0 + moved, abs=2e-6)
    pulses = _true(made, "resistance", cell="A", test="pulses")
    assert [float(row["delay_second"]) for row in pulses] == [0.0, 1.0, 10.0]
    # The open-circuit voltage, too, falls by 1 V over 1.02 Ah.
    fall = [R_OHM + s / 3600 / CAPACITY_AMPERE_HOUR for s in (0.01, 1.0, 10.0)]
    assert [float(row["resistance_ohm"]) for row in pulses] == pytest.approx(fall, rel=1e-4)


def test_truth_about_a_capacity_is_what_lies_above_the_cutoff(made):
    """2 A through 0.1 ohm end the discharge at an open-circuit voltage of 3.2 V."""
    (row,) = _true(made, "capacity", cell="B", test="capacity")
    assert (row["direction"], row["c_rate"], row["repeats"]) == ("discharge", "2.0", "1")
    assert float(row["capacity_ampere_hour"]) == pytest.approx(0.8 * CAPACITY_AMPERE_HOUR, rel=1e-4)
    shown = _columns(made, "raw/B/capacity.csv.gz")
    ampere_hour = np.trapezoid(shown["current_ampere"], shown["test_time_second"]) / 3600
    assert abs(ampere_hour) == pytest.approx(0.8 * CAPACITY_AMPERE_HOUR, rel=2e-3)


def test_truth_about_cells_is_told_once(made):
    for name, r_ohm in (("A", R_OHM), ("B", 2 * R_OHM)):
        curve = _true(made, "ocv", cell=name)
        assert len(curve) == 101
        volt = [float(row["ocv_volt"]) for row in curve]
        np.testing.assert_allclose(volt, np.linspace(3.0, 4.0, 101), atol=1e-6)
        parameters = _true(made, "models", cell=name, parameter="r0")
        assert {float(row["value"]) for row in parameters} == {r_ohm}
    (row,) = _true(made, "eis")
    assert float(row["r_charge_transfer_ohm"]) == circuit_at(0.5, 20.0).r_charge_transfer_ohm


def test_branches_share_the_current_as_their_resistances_say(made):
    """At first, from equal states of charge: in inverse proportion, the wires counted."""
    shown = _columns(made, "raw/pair/both.bdf.csv.gz")
    first = np.flatnonzero(shown["test_time_second"] > 60.0)[:5]
    good, worse = (shown[f"branch_{k}_current_ampere"][first].mean() for k in (1, 2))
    assert good / worse == pytest.approx((2 * R_OHM + 0.001) / (R_OHM + 0.001), rel=0.02)
    rows = _true(made, "packs")
    assert [row["cell"] for row in rows] == ["A", "B"]
    assert {row["group"] for row in rows} == {"pair"}
    charges = [float(row["charge_ampere_hour"]) for row in rows]
    assert sum(charges) == pytest.approx(0.5 * 400 / 3600, rel=1e-4)
    assert charges[0] > charges[1]


def test_discharge_is_positive_where_the_file_says_so(made):
    shown = _columns(made, "raw/A/pulses.bdf.csv.gz")
    assert shown["current_ampere"].max() == pytest.approx(1.0, abs=0.003)
    assert shown["current_ampere"].min() > -0.003
    pulse = shown["current_ampere"] > 0.5
    assert shown["voltage_volt"][pulse].max() < shown["voltage_volt"][~pulse].min()


def test_a_spoiled_sample_is_listed_where_it_stands(made):
    spikes = _true(made, "faults", cell="A", test="spiked", fault="spike")
    shown = _columns(made, "raw/A/spiked.csv.gz")["voltage_volt"]
    assert len(spikes) == 4
    for row in spikes:
        place = int(row["row"])
        assert shown[place] == pytest.approx(float(row["value"]), abs=1e-4)
        assert abs(shown[place] - shown[[place - 1, place + 1]].mean()) > 0.05
    jumps = np.abs(shown[1:-1] - 0.5 * (shown[:-2] + shown[2:])) > 0.05
    assert set(np.flatnonzero(jumps) + 1) == {int(row["row"]) for row in spikes}


def test_a_damaged_file_is_listed_and_nothing_else_is_told_about_its_test(made):
    """Nothing can be asked of the pipeline about a file that it cannot read."""
    rows = _true(made, "excluded")
    assert [(r["cell"], r["test"], r["reason"]) for r in rows] == [("B", "torn", "cut_off")]
    (row,) = rows
    with pytest.raises(Refusal, match="torn"):
        _columns(made, row["file"])
    assert _true(made, "soc", cell="B", test="torn") == []


def test_jobs_leave_what_is_true_in_plain_text(plan, made):
    left = {path.stem for path in (made / making.PARTS).glob("*.json")}
    assert left == set(plan.batches())
    part = json.loads((made / making.PARTS / "B.json").read_text())
    assert set(part) == {"files", "truth"}
    assert set(part["files"]) == {"raw/B/capacity.csv.gz", "raw/B/torn.bdf.parquet"}


def test_sheets_wait_for_all_jobs(plan, tmp_path):
    making.make_batch(plan, "Z", tmp_path)
    with pytest.raises(FileNotFoundError):
        making.make_sheets(plan, tmp_path)


def test_without_a_chain_a_test_has_its_specimens(plan):
    (test,) = [test for test in plan.tests if test.test == "load"]
    chain = CHAIN._replace(voltage_offset_volt=0.2)
    own = SimpleNamespace(
        run=GOOD.run, full_ampere_hour=GOOD.full_ampere_hour, rating=RATING, chain=chain
    )
    volts = [
        formats.read(making.made(one)[0], name="x").columns["voltage_volt"].mean()
        for one in (test, test._replace(specimen=own, chain=None))
    ]
    assert volts[1] - volts[0] == pytest.approx(0.2, abs=1e-4)
