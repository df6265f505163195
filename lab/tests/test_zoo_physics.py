"""The zoo's cells by physics: plan, truth, strengths."""

import json

import numpy as np
import pytest

from virtual_lab import campaigns, electrodes
from virtual_lab.behaviour import Rating
from virtual_lab.score import verdicts
from virtual_lab.zoo import physics_cells, physics_strength
from virtual_lab.zoo.physics_circuit import SOC, Drive, residuals_volt, rms_volt
from virtual_lab.zoo.physics_forms import FORMS

PLAN = physics_cells.plan(seed=3, forms=13, healthy=3)
BY_FORM = {(row.specimen.type, row.specimen.form): row.specimen for row in PLAN.cells}


def test_each_type_has_references_healthy_cells_and_every_form_once():
    kinds = [(row.chemistry, row.specimen.kind) for row in PLAN.cells]
    for chemistry in ("NMC", "LFP"):
        assert kinds.count((chemistry, "reference")) == 3
        assert kinds.count((chemistry, "none")) == 3
        assert kinds.count((chemistry, "unknown")) == 2
        assert kinds.count((chemistry, "sheet")) == 1
    used = {form for _, form in BY_FORM if form}
    assert used == set(FORMS)


def test_a_third_of_the_cells_is_judged_at_one_temperature_and_references_at_all():
    hidden = [row.specimen for row in PLAN.cells if not row.reference]
    alone = [one for one in hidden if one.proof_celsius == (25.0,)]
    assert len(alone) == len(hidden) // 3
    assert all(len(row.specimen.tasks) == 9 for row in PLAN.cells if row.reference)


def test_sizes_follow_from_the_seed_and_lie_within_their_limits():
    for specimen in BY_FORM.values():
        if specimen.form:
            form = FORMS[specimen.form]
            assert form.low * 0.999 <= abs(specimen.size) <= form.high * 1.001
    other = physics_cells.plan(seed=4, forms=13, healthy=3)
    mine = [row.specimen.size for row in PLAN.cells]
    assert mine != [row.specimen.size for row in other.cells]


def test_losses_come_after_the_checkups_and_ageing_goes_on_from_test_to_test():
    lost = BY_FORM["NMC", "lost_lithium"]
    lli = {task.test: lost.setup(task).cell.lli for task in lost.tasks}
    assert lli["slow_25C"] == lli["capacity_25C"] == pytest.approx(lli["hppc_25C"] - lost.size)
    aged = BY_FORM["NMC", "ageing"]
    ohm = [aged.setup(task).cell.contact_resistance_ohm for task in aged.tasks]
    assert (np.diff(ohm) > 0).all()


def test_a_wrong_sheet_hides_the_temperature_and_a_wrong_thermometer_the_reading():
    sheet = BY_FORM["NMC", "wrong_sheet"]
    meter = BY_FORM["LFP", "wrong_thermometer"]
    for one, shown in ((sheet, 0.0), (meter, -meter.size)):
        cold = next(task for task in one.tasks if task.celsius == 10.0)
        setup = one.setup(cold)
        assert setup.warmer_kelvin == one.size
        assert setup.chain.surface_offset_celsius == shown
        assert one.chamber(cold, setup.warmer_kelvin).celsius.mean() == pytest.approx(
            10.0 + one.size, abs=0.2
        )
        assert one.setup(one.tasks[0]).warmer_kelvin == 0.0


def test_an_offset_is_no_leak_when_it_shows_too_little_charge():
    offset = BY_FORM["NMC", "shunt_offset"]
    cells = [offset._replace(name=f"x{k}") for k in range(20)]
    assert {one.size > 0 for one in cells} == {True, False}
    for one in cells:
        assert ("leakage" in one.names) == (one.size > 0)


def test_a_drive_asks_for_more_charge_than_a_cell_holds():
    for type_name, plain in physics_cells.TYPES.items():
        most = electrodes.window(type_name, plain.rating).capacity_ampere_hour
        for task in physics_cells.tasks(plain.rating):
            if task.is_drive:
                load = task.steps[1]
                second, ampere = load.value.T
                assert -np.trapezoid(ampere, second) / 3600 > most
                assert load.until_volt == plain.rating.lower_cutoff_volt


RATING = Rating(5.0, 2.5, 4.2)
OCV = electrodes.open_circuit_volt("NMC", electrodes.window("NMC", RATING), SOC)


def _drive(*, proof, start=1.0, asymmetry=0.0):
    """A drive of a circuit with constant resistances, more on charge by a share."""
    random = np.random.default_rng(5 + proof)
    current = np.repeat(random.normal(-3.0, 4.0, 600), 6)
    kept = np.exp(-1.0 / np.array([6.0, 200.0]))
    over, lag = np.zeros(current.size), np.zeros(2)
    for k, ampere in enumerate(current):
        lag = kept * lag + (1 - kept) * ampere
        over[k] = 0.02 * ampere * (1 + asymmetry * (ampere > 0)) + lag @ [0.01, 0.012]
    soc = start + np.cumsum(current) / 3600 / 5.0
    return Drive(current, np.interp(soc, SOC, OCV) + over, 1.0, proof)


def test_a_plain_circuit_leaves_nothing_of_itself():
    drives = [_drive(proof=False), _drive(proof=True, start=0.995)]
    left = residuals_volt(drives, OCV, capacity_ampere_hour=5.0)
    assert rms_volt(left[:1]) < 2e-5
    # A start 0.5 % lower moves along a bent OCV; a refit of the start follows its slope.
    assert rms_volt(left[1:]) < 5e-4


def test_a_plain_circuit_leaves_what_it_cannot_have():
    plain = [_drive(proof=False), _drive(proof=True)]
    other = [_drive(proof=proof, asymmetry=0.5) for proof in (False, True)]
    left = [residuals_volt(drives, OCV, capacity_ampere_hour=5.0) for drives in (plain, other)]
    assert rms_volt(left[0]) < 1e-4
    assert 2e-3 < rms_volt(left[1]) < 2e-2


def _row(name, kind, effects=()):
    return {"cell": name, "kind": kind, "type": "NMC", "floor_volt": 1e-3, "effects": list(effects)}


def _residual(name, test, without, with_it):
    proof = test.startswith("proof")
    return {"cell": name, "test": test, "proof": proof, "without": without, "with": with_it}


def test_visible_is_what_shows_beside_the_references():
    wave = (1e4 * np.sin(np.arange(400))).tolist()  # 7 mV that any circuit leaves, in µV
    more = (np.array(wave) + 5e3 * np.sign(np.sin(np.arange(400) / 9))).tolist()
    effect = {"effect": "slow_diffusion", "accept": ["slow_diffusion"]}
    rows = [_row(f"r{k}", "reference") for k in range(3)]
    rows += [_row("h", "none"), _row("e", "single", [effect]), _row("f", "single", [effect])]
    residuals = []
    for row in rows:
        shown = {"e": {"proof_25C": more}, "f": {"drive_10C": more}}.get(row["cell"], {})
        for test in ("drive_10C", "proof_25C"):
            end = 400 - 7 * len(residuals)  # records are never equally long
            with_it = shown.get(test, wave)[:end]
            residuals.append(_residual(row["cell"], test, wave[:end], [None, *with_it[1:]]))
    tables = physics_strength.compared({"missing_effect": rows, "residual": residuals})
    assert "residual" not in tables
    found = {row["cell"]: row for row in tables["missing_effect"]}
    assert not found["h"]["visible"]
    assert found["h"]["none_acceptable"]
    assert found["h"]["base_volt"] == pytest.approx(7.1e-3, rel=0.02)
    assert found["h"]["beside_references_volt"] < 1e-6
    assert found["e"]["visible"]
    assert not found["e"]["unproven"]
    assert found["e"]["effects"][0]["validation_gap_millivolt"] == pytest.approx(5.0, rel=0.02)
    assert found["f"]["visible"]
    assert found["f"]["unproven"]


def test_a_campaign_of_one_short_drive_is_written_with_its_truth(tmp_path, monkeypatch):
    pytest.importorskip("pybamm", reason="the virtual laboratory's environment is not installed")
    steps = [step._replace(duration_second=60.0) for step in physics_cells.tasks(RATING)[3].steps]
    short = (
        physics_cells.Task("drive_25C", "drive", 25.0, steps, "fit"),
        physics_cells.Task("proof_25C", "drive", 25.0, steps, "validation"),
    )
    monkeypatch.setattr(physics_cells, "tasks", lambda rating: short)
    monkeypatch.setattr(physics_cells, "ORDER", {"NMC": ("late_voltage",)})
    physics_cells.make(tmp_path, seed=1, forms=1, healthy=0)
    truth = json.loads((tmp_path / "truth" / "missing_effect.json").read_text())
    (hidden,) = [row for row in truth if row["kind"] == "single"]
    assert hidden["effects"][0]["accept"] == ["time_skew"]
    assert hidden["effects"][0]["visible_gap_millivolt"] > 0.5
    verdict = {"verdict": "named", "effects": [{"effect": "time_skew"}]}
    assert verdicts.outcome(hidden, verdict) == "right"
    sheet = (tmp_path / "config" / "tests.tsv").read_text().splitlines()
    assert len(sheet) == 1 + 4 * 2
    assert all((tmp_path / line.split("\t")[3]).exists() for line in sheet[1:])


def test_the_campaign_is_one_of_the_laboratorys_with_a_job_a_cell():
    planned = campaigns.plan("zoo_physics", seed=3)
    assert set(planned.batches()) == {row.name for row in planned.cells}
    assert planned.compared is physics_strength.compared
