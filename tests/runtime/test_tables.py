"""Tables from artefacts: who, facts, rows; what was left out; the summary; the manifest."""

from pathlib import Path

import pytest

from cellwright.refusal import Refusal
from runtime import artefact, provenance, tables

ROW = {
    "c_rate": 0.1,
    "peak": 1,
    "voltage_volt": 3.5,
    "voltage_std_volt": 0.001,
    "height_ampere_hour_per_volt": 4.0,
    "area_ampere_hour": 0.5,
}
GOOD, BAD, AFTER = (f"results/ica/A/{name}.parquet" for name in ("good", "bad", "after"))


@pytest.fixture
def campaign(snakemake):
    """One good artefact, one refused one, and one that only passes the refusal on."""
    with artefact.Job(snakemake(GOOD, wildcards={"cell": "A", "test": "good"})) as job:
        job.save([ROW])
    with artefact.Job(snakemake(BAD, wildcards={"cell": "A", "test": "bad"})):
        raise Refusal("empty file")
    with artefact.Job(snakemake(AFTER, wildcards={"cell": "A", "test": "bad"})) as job:
        job.load(BAD)


def test_rows_carry_cell_test_and_facts(campaign):
    facts = {"A/good": {"cycle": 100, "ambient_temperature_celsius": 25}}
    rows = tables.rows_of([GOOD, BAD], facts)
    assert rows == [{"cell": "A", "test": "good"} | facts["A/good"] | ROW]


def test_a_row_of_several_tests_has_blanks_where_others_have_their_test(snakemake):
    path = "results/ocv_laws/A.parquet"
    names = ("quantity", "law", "parameter", "unit")
    row = dict.fromkeys(names, "x") | dict.fromkeys(("value", "std", "r_squared"), 1.0)
    with artefact.Job(snakemake(path, wildcards={"cell": "A"})) as job:
        job.save([row | {"cross_validation_rmse": 0.1, "chosen": True}])
    (found,) = tables.rows_of([path], {})
    assert (found["cell"], found["test"], found["ambient_temperature_celsius"]) == ("A", "", None)


def test_excluded_names_each_refusal_once_where_it_arose(campaign):
    rows = tables.excluded([GOOD, BAD, AFTER], {"A/bad": ["raw/bad.csv"]})
    assert rows == [
        {"cell": "A", "test": "bad", "file": "raw/bad.csv", "stage": "ica", "reason": "empty file"}
    ]


def test_summary_pools_the_error_over_samples():
    found = {
        "capacity": [
            {"cell": "A", "direction": "discharge", "c_rate": "0.5", "capacity_ampere_hour": "4"}
        ],
        "resistance": [],
        "validation": [
            {"cell": "A", "chosen": "True", "samples": "3", "rmse_volt": "0.01"},
            {"cell": "A", "chosen": "True", "samples": "1", "rmse_volt": "0.03"},
            {"cell": "A", "chosen": "False", "samples": "9", "rmse_volt": "9"},
        ],
        "excluded": [{"cell": "A"}, {"cell": "B"}],
    }
    facts = {"cell": "A", "rated_capacity_ampere_hour": 5.0}
    row = tables.summary([facts], found, {})[0]
    assert row["soh"] == pytest.approx(0.8)
    assert row["validation_rmse_volt"] == pytest.approx((3e-4 / 4 + 9e-4 / 4) ** 0.5)
    assert row["exclusions"] == 1


def test_the_summary_says_what_is_missing():
    found = dict.fromkeys(["capacity", "resistance", "validation", "excluded"], ())
    rows = [{"cell": "A", "verdict": "named", "effect": name} for name in ("leakage", "time_skew")]
    found["missing_effect"] = [*rows, {"cell": "B", "verdict": "none", "effect": ""}]
    facts = [{"cell": cell, "rated_capacity_ampere_hour": None} for cell in "ABC"]
    summary = tables.summary(facts, found, {})
    assert [(row["verdict"], row["missing_effect"]) for row in summary] == [
        ("named", "leakage;time_skew"),
        ("none", ""),
        (None, ""),
    ]


def test_a_verdict_has_a_row_for_each_effect_and_one_where_there_is_none(snakemake):
    effect = {
        "effect": "leakage",
        "alternatives": ["current_offset", "coulombic_inefficiency"],
        "rmse_volt": {"before": 0.004, "after": 0.001},
        "validation_rmse_volt": {"before": 0.005, "after": 0.002},
        "gap_closed": 0.9,
    }
    facts = {"floor_volt": 0.001, "next_test": None}
    facts |= {"rmse_volt": {"before": 0.0011, "after": 0.0011}}
    facts |= {"validation_rmse_volt": {"before": 0.0012, "after": 0.0012}}
    none = facts | {"cell": "A", "verdict": "none", "effects": [], "gap_closed": None}
    named = facts | {"cell": "B", "verdict": "ambiguous", "next_test": "A rest."}
    named |= {"effects": [effect, effect | {"effect": "ocv_edge", "alternatives": []}]}
    path = "results/tables/missing_effect.csv"
    with artefact.Job(snakemake(path)) as job:
        job.save(tables.verdicts([none, named]))
    first, second, third = artefact.load_table(path)
    assert (first["verdict"], first["effect"], first["gap_closed"]) == ("none", "", "")
    assert (first["rmse_before_volt"], first["validation_after_volt"]) == ("0.0011", "0.0012")
    assert second["alternatives"] == "current_offset;coulombic_inefficiency"
    errors = ["rmse_before_volt", "rmse_after_volt"]
    errors += ["validation_before_volt", "validation_after_volt", "gap_closed", "floor_volt"]
    wanted = ["0.004", "0.001", "0.005", "0.002", "0.9", "0.001"]
    assert [second[name] for name in errors] == wanted
    assert (third["effect"], third["next_test"]) == ("ocv_edge", "A rest.")


def test_manifest_finds_what_was_edited_by_hand(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b", "c"):
        Path(name).write_text(name)
    Path("manifest.tsv").write_text(tables.manifest(["b", "a", "c"]))
    assert tables.changed("manifest.tsv") == []
    Path("b").write_text("edited")
    Path("c").unlink()
    provenance.sha256_of.cache_clear()
    assert tables.changed("manifest.tsv") == ["b: changed since the run that made it", "c: missing"]
