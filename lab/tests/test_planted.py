"""Effects planted in the records of a small campaign that is written here."""

import json
from pathlib import Path

import numpy as np
import pytest

import cellwright as cw
from runtime import raw_files, sheets
from virtual_lab.zoo import plain_circuit, planted
from virtual_lab.zoo.equations import EFFECTS, linear_network, stop_operators, surface_excess
from virtual_lab.zoo.real_records import cell_of

SCHEMAS = Path(__file__).resolve().parents[2] / "workflow" / "schemas"
CAPACITY = 2.0
LABELS = ("Test Time / s", "Current / A", "Voltage / V", "Surface Temperature T1 / degC")


def ocv(soc):
    return 3.3 + 0.7 * soc + 0.15 * np.tanh(8 * (soc - 0.1)) - 0.05 * np.sin(6 * soc)


def recorded(second, ampere, celsius, seed):
    """Readings of a circuit with one RC pair whose R0 depends on the SoC, and noise."""
    step = np.diff(second, prepend=second[0])
    mean = 0.5 * (ampere + np.concatenate([ampere[:1], ampere[:-1]]))
    soc = 1 + np.cumsum(mean * step) / 3600 / CAPACITY
    volt = ocv(soc) + 0.03 * ampere * (1 + 0.4 * (soc - 0.5) ** 2)
    volt += 0.02 * plain_circuit.lag(step, mean, 35.0)
    noise = np.random.default_rng(seed).normal(0, 5e-4, volt.size)
    return np.column_stack([second, ampere, volt + noise, np.full(volt.size, celsius)])


def current(*parts):
    """(time, current) of steps (A, s) sampled each so many seconds."""
    amperes = np.concatenate([np.full(round(s / dt), a) for a, s, dt in parts])
    steps = np.concatenate([np.full(round(s / dt), float(dt)) for _, s, dt in parts])
    return np.cumsum(steps), amperes


def drive(seed, celsius):
    random = np.random.default_rng(seed)
    loads = [(x, 10, 1) for x in random.choice([-4, -2, -1.5, -0.5, 0, 1.5], 520)]
    return recorded(*current((0, 120, 1), *loads, (0, 600, 1)), celsius, seed)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("real")
    pulses = [part for _ in range(8) for part in [(-2, 400, 2), (0, 900, 2), (2, 20, 1)]]
    tests = {
        "slow": (
            "ocv",
            recorded(*current((-0.1, 71000, 60), (0, 3600, 60), (0.1, 71000, 60)), 25, 1),
        ),
        "pulses": ("hppc", recorded(*current((0, 60, 1), *pulses), 25, 2)),
        "cold": ("hppc", recorded(*current((0, 60, 1), *pulses), 5, 3)),
        "drive": ("drive", np.vstack([drive(4, 12)])),
    }
    (folder / "config").mkdir()
    rows = ["cell\ttest\tkind\tfile\tambient_temperature_celsius\tsoc"]
    for name, (kind, table) in tests.items():
        text = ",".join(LABELS) + "\n" + "\n".join(",".join(f"{x:.6f}" for x in r) for r in table)
        (folder / f"{name}.csv").write_text(text + "\n")
        rows.append(f"X1\t{name}\t{kind}\t{name}.csv\t{table[0, 3]:g}\t1")
    (folder / "config" / "tests.tsv").write_text("\n".join(rows) + "\n")
    head = "cell\tlower_cutoff_volt\tupper_cutoff_volt\trated_capacity_ampere_hour\n"
    (folder / "config" / "cells.tsv").write_text(head + "X1\t2.5\t4.3\t2\n")
    return folder


@pytest.fixture(scope="module")
def copies(campaign, tmp_path_factory):
    out = tmp_path_factory.mktemp("planted")
    rows = planted.make(campaign, ["X1"], out, seed=3, sizes=("6mV",))
    return out, {row["cell"]: row for row in rows}


def read(folder, row):
    files = [str(folder / file) for file in row["file"]]
    return cw.read(
        raw_files.contents(files, row["sha256"]), current_sign=row["current_sign"]
    ).columns


def test_the_unplanted_copy_has_the_rows_of_its_source(campaign, copies):
    out, _ = copies
    source = {row["test"]: row for row in sheets.read(campaign, SCHEMAS).tests}
    mine = [row for row in sheets.read(out, SCHEMAS).tests if row["cell"] == "X1_u"]
    assert {row["test"] for row in mine} == set(source)
    for row in mine:
        before, after = read(campaign, source[row["test"]]), read(out, row)
        assert set(before) == set(after)
        for name, values in before.items():
            np.testing.assert_array_equal(after[name], values, err_msg=name)
        kept = ("kind", "role", "soc", "ambient_temperature_celsius")
        assert [row[k] for k in kept] == [source[row["test"]][k] for k in kept]


def test_each_copy_is_in_sheets_and_truth(copies):
    out, truth = copies
    read_again = sheets.read(out, SCHEMAS)
    assert {row["cell"] for row in read_again.cells} == set(truth)
    assert json.loads((out / "truth" / "missing_effect.json").read_text()) == list(truth.values())
    control = truth["X1_u"]
    assert (control["kind"], control["effects"]) == ("unplanted", [])
    for name, row in truth.items():
        assert row["control"] == "X1_u" if name != "X1_u" else "control" not in row
        assert row["base_volt"] == control["base_volt"]


def test_what_is_planted_has_the_size_that_was_asked(campaign, copies):
    """Measured again from the files: what a circuit leaves of them beyond the unplanted copy."""
    out, truth = copies
    again = sheets.read(out, SCHEMAS)
    cells = {name: cell_of(again, name, out) for name in truth}
    control = cells["X1_u"]
    base = plain_circuit.fitted(control)
    assert plain_circuit.rms(base.judge_residual) == pytest.approx(
        truth["X1_u"]["base_volt"], rel=1e-5
    )
    wanted = {"X1_hysteresis_6", "X1_asymmetry_6", "X1_kinetics_6", "X1_heat_6", "X1_voltmeter_6"}
    assert wanted <= set(truth)
    for name in sorted(wanted):
        # The rows that are compared are those of the unplanted cell.
        pairs = zip(cells[name].records, control.records, strict=True)
        records = tuple(a._replace(fits=b.fits, judges=b.judges) for a, b in pairs)
        left = plain_circuit.fitted(cells[name]._replace(records=records), base.tau_second)
        volt = plain_circuit.rms(left.judge_residual - base.judge_residual)
        assert volt == pytest.approx(6e-3, rel=0.1), name
        told = truth[name]["effects"][0]
        assert told["visible_gap_millivolt"] == pytest.approx(1e3 * volt, abs=2e-3)
        assert told["accept"][0] == told["effect"]


def test_every_test_of_a_planted_cell_is_changed(campaign, copies):
    out, _ = copies
    rows = sheets.read(out, SCHEMAS).tests
    volts = {(r["cell"], r["test"]): read(out, r)["voltage_volt"] for r in rows}
    for test in ("slow", "pulses", "cold", "drive"):
        assert np.ptp(volts["X1_hysteresis_6", test] - volts["X1_u", test]) > 1e-3, test


def test_what_no_plausible_size_reaches_is_not_planted_but_told(campaign, tmp_path):
    effects = ("charge_transfer_nonlinearity", "time_skew")
    rows = planted.make(campaign, ["X1"], tmp_path, seed=3, effects=effects, sizes=("400mV",))
    assert [row["cell"] for row in rows] == ["X1_u"]
    about = (tmp_path / "truth" / "README.md").read_text()
    for effect in effects:
        assert f"X1, {effect}, 400mV" in about
        assert f"{EFFECTS[effect].parameter}" in about


def test_names_that_leave_the_same_are_accepted_and_no_others(copies):
    """A wrong capacity and a gain of all dynamic tests are one; kinetics are like neither."""
    _, truth = copies
    capacity = truth["X1_capacity_6"]["effects"][0]["accept"]
    assert capacity[0] == "capacity_error"
    assert "current_gain" in capacity
    assert "capacity_error" in truth["X1_gain_6"]["effects"][0]["accept"]
    for short in ("kinetics", "skew", "heat"):
        assert len(truth[f"X1_{short}_6"]["effects"][0]["accept"]) == 1, short


def test_the_same_seed_makes_the_same_files(campaign, copies, tmp_path):
    out, _ = copies
    planted.make(campaign, ["X1"], tmp_path, seed=3, sizes=("6mV",), effects=("time_skew",))
    files = list((tmp_path / "raw" / "X1_skew_6").iterdir())
    assert len(files) == 4
    for file in files:
        assert file.read_bytes() == (out / "raw" / "X1_skew_6" / file.name).read_bytes()


def test_a_campaign_without_proof_is_refused(campaign, tmp_path):
    folder = tmp_path / "fit_only"
    (folder / "config").mkdir(parents=True)
    sheet = (campaign / "config" / "tests.tsv").read_text().splitlines()
    lines = [line for line in sheet if "\tdrive\t" not in line]
    (folder / "config" / "tests.tsv").write_text("\n".join(lines) + "\n")
    for name in ("slow.csv", "pulses.csv", "cold.csv", "config/cells.tsv"):
        (folder / name).write_text((campaign / name).read_text())
    with pytest.raises(ValueError, match=r"X1 has no proof record.*tests are slow, pulses, cold"):
        planted.make(folder, ["X1"], tmp_path / "out", seed=0)
    with pytest.raises(ValueError, match="X1 has no proof record"):
        planted.make(folder, (), tmp_path / "out", seed=0)
    rows = planted.make(
        folder, (), tmp_path / "out", seed=0, proof=("cold",), effects=("slow_diffusion",)
    )
    roles = {r["role"] for r in sheets.read(tmp_path / "out", SCHEMAS).tests if r["test"] == "cold"}
    assert roles == {"validation"}
    assert rows[0]["kind"] == "unplanted"


def test_of_sizes_that_are_nearly_the_same_one_is_planted(campaign, tmp_path):
    rows = planted.make(
        campaign,
        (),
        tmp_path,
        seed=3,
        effects=("hysteresis_instant",),
        sizes=("6mV", "6.2mV", "3mV"),
    )
    assert [row.get("size") for row in rows] == [None, "6mV", "3mV"]


@pytest.mark.parametrize("size", ["6", "0mV", "-1base", "6 mV"])
def test_a_size_that_says_nothing_is_refused(size):
    with pytest.raises(ValueError, match="allowed are millivolts"):
        planted.volt_of(size, 0.01)


def test_a_lag_over_uneven_steps_is_exact():
    """Two unequal steps of a held current, and a pause far longer than the time constant."""
    step, value = np.array([0.0, 3.0, 5e4, 2.0]), np.array([9.0, 2.0, 1.0, -1.0])
    got = plain_circuit.lag(step, value, 10.0)
    first = 2.0 * (1 - np.exp(-0.3))
    assert got[:3] == pytest.approx([0.0, first, 1.0])
    assert got[3] == pytest.approx(1.0 * np.exp(-0.2) - (1 - np.exp(-0.2)))


def test_a_stop_stays_within_its_radius_and_keeps_what_lies_within():
    soc = np.array([0.5, 0.6, 0.58, 0.7])
    stops = stop_operators(soc, [0.05], np.array([0.0]))[:, 0]
    assert stops == pytest.approx([0.0, 0.05, 0.03, 0.05])


def test_a_sphere_settles_at_a_fifteenth_of_its_time():
    """Flux into a sphere for long: surface minus mean is R²/(15 D) times the rise of the mean."""

    class Long:
        step_second = np.full(4000, 20.0)
        mean_ampere = np.ones(4000)

    assert surface_excess(Long, 8e3)[-1] == pytest.approx(8e3 / 15, rel=0.02)


def test_heat_settles_at_the_sum_of_its_resistances():
    conductance = np.array([[2.0, -2.0], [-2.0, 2.5]])
    steps, watt = np.full(3000, 10.0), np.full(3000, 3.0)
    states = linear_network(steps, watt, conductance, np.array([50.0, 90.0]), np.array([1.0, 0.0]))
    assert states[-1] == pytest.approx([3 * (0.5 + 2.0), 3 * 2.0], rel=1e-6)
