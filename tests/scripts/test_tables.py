"""Tables from artefacts: who, facts, rows; what was left out; the summary; the manifest."""

from pathlib import Path

import pytest

import artefact
import provenance
import tables
from cellwright.refusal import Refusal

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
