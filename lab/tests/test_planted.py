"""Effects planted in records: what changes, what does not, and how the score judges a copy."""

import json

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("numba", reason="the virtual laboratory's environment is not installed")

from virtual_lab import fast, protocols
from virtual_lab.chamber import steady
from virtual_lab.hidden import planted
from virtual_lab.hidden.setup import RATING, healthy
from virtual_lab.score import files, verdicts

TESTS = {"drive": ("drive", 3, "split"), "other": ("drive", 5, "split")}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A cell of 2.5 Ah with two drives, as the pipeline has cleaned them."""
    folder = tmp_path_factory.mktemp("real")
    (folder / "config").mkdir()
    (folder / "results" / "stages" / "clean" / "A").mkdir(parents=True)
    columns = ("cell", "chemistry", "rated_capacity_ampere_hour", "reference")
    sheet = "\t".join(columns) + "\nA\tNMC\t2.5\tyes\n"
    (folder / "config" / "cells.tsv").write_text(sheet)
    rows = ["cell\ttest\tkind\tfile\tambient_temperature_celsius\tsoc\trole"]
    cell = healthy(np.random.default_rng(8)).cell
    for name, (kind, seed, role) in TESTS.items():
        steps = protocols.dynamic_load(RATING, style="soft", seed=seed)
        behaviours, begin, parts = fast.run(steps, cell, chamber=steady(25.0)), 0.0, []
        for one in behaviours:
            second = np.arange(1.0, one.duration_second, 1.0)
            parts.append((begin + second, one.current(second) / 2, one.voltage(second)))
            begin += one.duration_second
        names = ("test_time_second", "current_ampere", "voltage_volt")
        series = pd.DataFrame(
            dict(zip(names, map(np.concatenate, zip(*parts, strict=True)), strict=True))
        )
        series["charge_ampere_hour"] = np.cumsum(series["current_ampere"]) / 3600
        series.to_parquet(folder / "results" / "stages" / "clean" / "A" / f"{name}.parquet")
        rows.append(f"A\t{name}\t{kind}\traw/{name}\t25\t1\t{role}")
    (folder / "config" / "tests.tsv").write_text("\n".join(rows) + "\n")
    return folder


@pytest.fixture(scope="module")
def copies(campaign, tmp_path_factory):
    out = tmp_path_factory.mktemp("planted")
    made = planted.make(campaign, out, effects=("resistance_asymmetry", "time_skew"), seed=3)
    assert made == 3
    return out


def changed(campaign, copies, name, test="drive"):
    """The clean series, and how much of its voltage [V] a copy has changed."""
    series = pd.read_parquet(campaign / "results" / "stages" / "clean" / "A" / f"{test}.parquet")
    file = pd.read_parquet(copies / "raw" / name / f"{test}.bdf.parquet")
    np.testing.assert_array_equal(file["Current / A"], series["current_ampere"])
    return series, (file["Voltage / V"] - series["voltage_volt"]).to_numpy()


def test_the_unplanted_copy_is_the_record(campaign, copies):
    _, change = changed(campaign, copies, "A_u")
    assert not change.any()


def test_a_planted_effect_changes_what_it_is_about_and_no_more(campaign, copies):
    """A resistance that is larger on charge pulls up no voltage under a discharge from full."""
    series, change = changed(campaign, copies, "A_resistance_asymmetry_6")
    charging = series["current_ampere"].to_numpy() > 0.1
    assert change[charging].mean() > 5e-3
    first = int(np.argmax(charging))
    assert np.abs(change[: first - 1]).max() < 1e-9


def test_the_strength_is_the_one_asked_for(copies):
    truth = json.loads((copies / "truth" / "missing_effect.json").read_text())
    rows = {row["cell"]: row for row in truth}
    assert rows["A_u"]["kind"] == "unplanted"
    (effect,) = rows["A_resistance_asymmetry_6"]["effects"]
    assert effect["visible_gap_millivolt"] == pytest.approx(6.0, rel=0.03)
    assert effect["accept"][0] == "resistance_asymmetry"


def test_sheets_are_whole_and_name_no_reference(copies):
    cells, tests = (
        pd.read_csv(copies / "config" / f"{name}.tsv", sep="\t") for name in ("cells", "tests")
    )
    assert cells["reference"].isna().all()
    assert len(tests) == len(cells) * len(TESTS)
    assert tests["sha256"].str.len().eq(64).all()


def test_a_cell_without_a_test_to_judge_is_refused(campaign, tmp_path):
    sheet = (campaign / "config" / "tests.tsv").read_text().replace("split", "fit")
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "tests.tsv").write_text(sheet)
    (tmp_path / "config" / "cells.tsv").write_bytes(
        (campaign / "config" / "cells.tsv").read_bytes()
    )
    (tmp_path / "results").symlink_to(campaign / "results")
    with pytest.raises(ValueError, match="a test to fit and one to judge"):
        planted.make(tmp_path, tmp_path / "out", effects=("leakage",))


@pytest.mark.parametrize(
    ("in_control", "said", "outcome"),
    [
        ([], ["leakage"], "right"),
        (["ocv_edge"], ["ocv_edge", "leakage"], "right"),
        (["ocv_edge"], ["ocv_edge"], "missed"),
        (["leakage"], ["leakage"], "no verdict"),
    ],
)
def test_only_names_that_are_new_beside_the_unplanted_copy_are_judged(
    tmp_path, in_control, said, outcome
):
    place = files.campaign(tmp_path)
    place.truth.mkdir()
    effect = {"effect": "leakage", "accept": ["leakage"]}
    row = {"kind": "single", "visible": True, "control": "A_u", "effects": [effect]}
    truth = {"A_u": {"kind": "unplanted", "visible": False, "effects": []}, "A_leakage_6": row}
    (place.truth / "missing_effect.json").write_text(json.dumps(truth))
    for cell, names in (("A_u", in_control), ("A_leakage_6", said)):
        path = place.results / "missing_effect" / cell / "verdict.json"
        path.parent.mkdir(parents=True)
        word = "named" if names else "none"
        path.write_text(json.dumps({"verdict": word, "effects": [{"effect": n} for n in names]}))
    assert verdicts.compare(place)["outcome"].tolist() == [outcome]
