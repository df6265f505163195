"""Tables from artefacts: who, facts, rows; what was left out; the summary; the manifest."""

from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from contract_rows import row_of

from cellwright.refusal import Refusal
from runtime import artefact, job_inputs, provenance, tables

ROW = row_of("ica", peak=1, doubt="it was paused")
GOOD, BAD, AFTER = (f"results/stages/ica/A/{name}.parquet" for name in ("good", "bad", "after"))


@pytest.fixture
def campaign(saved, snakemake):
    """One good artefact, one refused one, and one that only passes the refusal on."""
    saved(GOOD, [ROW])
    saved(BAD, "empty file")
    with artefact.Job(snakemake(AFTER, wildcards={"cell": "A", "test": "bad"})) as job:
        job.load(BAD)


def test_rows_carry_cell_test_and_facts(campaign):
    facts = {"A/good": {"cycle": 100, "ambient_temperature_celsius": 25}}
    rows = job_inputs.rows_of([GOOD, BAD], facts)
    told = {"doubt_codes": "ica"}  # it has none of its own
    assert rows == [{"cell": "A", "test": "good"} | facts["A/good"] | ROW | told]


def test_a_row_of_several_tests_has_blanks_where_others_have_their_test(saved):
    row = row_of("ocv_laws", quantity="x", law="x", parameter="x", unit="x", chosen=True)
    (found,) = job_inputs.rows_of([saved("results/stages/ocv_laws/A.parquet", [row])], {})
    assert (found["cell"], found["test"], found["ambient_temperature_celsius"]) == ("A", "", None)


def test_excluded_names_each_refusal_once_where_it_arose(campaign):
    table = tables.excluded([GOOD, BAD, AFTER], {"A/bad": ["raw/bad.csv"]})
    assert table.to_dict("records") == [
        {"cell": "A", "test": "bad", "file": "raw/bad.csv", "stage": "ica", "reason": "empty file"}
    ]


def test_two_steps_of_one_job_that_refuse_for_one_reason_are_two_rows(snakemake):
    paths = [
        f"results/stages/{stage}/A/drive.parquet" for stage in ("validation", "simulation", "soc")
    ]
    job = snakemake(*paths, wildcards={"cell": "A", "test": "drive"})
    for outputs in (paths[:2], paths[2:]):
        with artefact.Job(job, *outputs):
            raise Refusal("no row to compare")
    assert [row["stage"] for row in tables.excluded(paths, {}).to_dict("records")] == [
        "validation",
        "soc",
    ]


def test_a_table_that_could_not_be_made_is_told_as_what_is_left_out(snakemake):
    with artefact.Job(snakemake("results/tables/resistance.csv", wildcards={"table": "x"})):
        raise ZeroDivisionError("float division by zero")
    (row,) = tables.excluded(["results/tables/resistance.csv"], {}).to_dict("records")
    assert (row["cell"], row["test"], row["file"], row["stage"]) == ("", "", "", "tables")
    assert row["reason"].startswith("resistance.csv could not be made: Cellwright itself failed")


def test_what_a_record_lacks_is_excluded_too(saved):
    said = ["3 of 50 discharges left out (cycles 4, 9, 20): cycle 4: it ends at 3.5 V"]
    (row,) = tables.excluded([saved(GOOD, [ROW], left_out=said)], {}).to_dict("records")
    assert (row["test"], row["reason"]) == ("good", said[0])


COLUMNS = {
    "capacity": "cell direction c_rate cycle capacity_ampere_hour capacity_std_ampere_hour",
    "resistance": "cell direction delay_second soc c_rate cycle ambient_temperature_celsius "
    "resistance_ohm",
    "validation": "cell chosen samples rmse_volt test",
    "soc": "cell filter scenario rmse_soc reference_off_soc",
    "missing_effect": "cell verdict effect alternatives in_one_line lacks_nothing_above_volt",
    "excluded": "cell",
    "health": "cell cycle method soh",
    "protocols": "type first second",
    "fade": "cell knee_cycle remaining_cycles remaining_lower_cycles remaining_upper_cycles",
}


def frames(**text):
    """Tables as they are read: those named from rows of text, the others without a row."""
    return {
        name: tables.load_frame(
            StringIO("\n".join([",".join(columns.split()), *text.get(name, [])]))
        )
        for name, columns in COLUMNS.items()
    }


def summary_of_a(**text):
    facts = {"cell": "A", "rated_capacity_ampere_hour": 5.0}
    return tables.summary([facts], frames(**text), {}).to_dict("records")[0]


def test_summary_pools_the_error_over_samples():
    row = summary_of_a(
        capacity=["A,discharge,0.5,,4"],
        validation=["A,True,3,0.01", "A,True,1,0.03", "A,False,9,9"],
        soc=[
            *("A,aekf,nominal,0.03,0", "A,aekf,nominal,0.04,", "A,aekf,offset,9,0"),
            *("A,ekf,nominal,9,0", "A,aekf,nominal,0.00001,0.08"),
        ],
        excluded=["A", "B"],
    )
    assert row["soh"] == pytest.approx(0.8)
    assert row["validation_rmse_volt"] == pytest.approx((3e-4 / 4 + 9e-4 / 4) ** 0.5)
    assert row["soc_rmse"] == pytest.approx((0.0025 / 2) ** 0.5)
    assert row["exclusions"] == 1


def test_a_cell_that_cannot_be_summed_up_costs_no_other_its_row():
    logged = []
    cells = [{"cell": name, "rated_capacity_ampere_hour": 5.0} for name in "AB"]
    # A rating that no cell has: rates and states of health are beyond all numbers.
    cells.append({"cell": "C", "rated_capacity_ampere_hour": 1e-308})
    read = frames(
        capacity=["A,discharge,0.5,,4", "B,discharge,0.5,,4", "C,discharge,1e308,,4"],
        excluded=["A", "A"],
    )
    broken = {"A": {"capacity_ampere_hour": "4 Ah"}}
    a, b, c = tables.summary(cells, read, broken, logged.append).to_dict("records")
    assert a["notes"].startswith("Cellwright itself failed to sum up this cell (TypeError")
    assert a["exclusions"] == 2
    assert (b["soh"], b["capacity_ampere_hour"]) == (0.8, 4.0)
    assert (c["capacity_ampere_hour"], c["soh"]) == (4.0, None)
    assert c["notes"] == (
        "no state of health: 4 Ah over a rating of 1e-308 Ah is beyond all numbers"
    )
    assert "Traceback" in logged[0]


def test_the_summary_has_the_latest_state_of_health():
    """A check-up goes before the ageing cycles of the same cycle; what is fresh is no ageing."""
    row = summary_of_a(
        capacity=["A,discharge,0.5,,4"],
        health=[
            "A,0,check-up,1",
            "A,300,ageing cycles,0.8",
            "A,300,check-up,0.9",
            "B,900,check-up,0.5",
        ],
        fade=["A,250,120,30,"],
    )
    assert (row["soh"], row["soh_cycle"]) == (0.9, 300)
    assert (row["knee_cycle"], row["remaining_lower_cycles"]) == (250, 30)
    assert np.isnan(row["remaining_upper_cycles"])
    fresh = summary_of_a(capacity=["A,discharge,0.5,,4,0.05"], health=["A,0,check-up,1"])
    assert (fresh["soh"], fresh["soh_std"]) == pytest.approx((0.8, 0.01))
    assert fresh["knee_cycle"] is None


def test_a_capacity_has_the_deviation_of_what_it_is_from():
    """Of the model what that states, whatever a test near it has; without one that of the test."""
    rows, facts = ["A,discharge,0.1,,2.969,0.075"], {"cell": "A", "rated_capacity_ampere_hour": 3.0}
    carried = {"capacity_ampere_hour": 2.965, "capacity_std_ampere_hour": 0.02}
    pairs = (({"A": carried}, (2.965, 0.02)), ({}, (2.969, 0.075)))
    for models, expected in pairs:
        row = tables.summary([facts], frames(capacity=rows), models).to_dict("records")[0]
        assert (row["capacity_ampere_hour"], row["capacity_std_ampere_hour"]) == expected


def test_the_capacity_of_a_cell_is_that_of_its_slowest_discharge_of_the_first_cycle():
    rows = ["A,charge,0.1,,9", "A,discharge,0.5,40,3.5", "A,discharge,0.51,,4", "A,discharge,1,,3"]
    assert summary_of_a(capacity=rows)["capacity_ampere_hour"] == 4


def test_the_resistance_of_a_cell_is_that_near_half_charge_at_room_temperature():
    rows = [
        "A,charge,0,0.5,1,,25,1",
        "A,discharge,10,0.5,1,,25,2",
        "A,discharge,0,0.5,1,,0,3",
        "A,discharge,0,0.58,1,,25,4",
        "A,discharge,0,0.52,3,,25,5",
        "A,discharge,0,0.52,1.5,,25,6",
        "A,discharge,0,0.5,1,90,25,7",
        "A,discharge,0,,1,,25,8",
    ]
    assert summary_of_a(resistance=rows)["r0_50_25_ohm"] == 6


def test_the_summary_says_what_is_missing():
    said = ["A,ambiguous,leakage,current_offset;ocv_edge,shows two"]
    said += ["A,ambiguous,time_skew,,shows two", "B,none,,,shows nothing"]
    found = frames(missing_effect=said)
    facts = [{"cell": cell, "rated_capacity_ampere_hour": None} for cell in "ABC"]
    summary = tables.summary(facts, found, {}).to_dict("records")
    assert [(row["verdict"], row["missing_effect"]) for row in summary] == [
        ("ambiguous", "leakage or current_offset or ocv_edge;time_skew"),
        ("none", ""),
        (None, ""),
    ]
    assert [row["in_one_line"] for row in summary] == ["shows two", "shows nothing", None]
    assert summary[2]["validation_rmse_volt"] is None
    assert summary[2]["r0_50_25_ohm"] is None


def test_names_that_look_like_numbers_or_like_nothing_stay_names():
    frame = tables.load_frame(StringIO("cell,test,soc\n007,NA,\n8,x,0.5"))
    assert frame["cell"].tolist() == ["007", "8"]
    assert frame["test"].tolist() == ["NA", "x"]
    assert frame["soc"].isna().tolist() == [True, False]


WITNESSES = [
    {"cell": "B", "effect": effect, "named": named, "says": says, "name": name, "shown": False}
    for effect, named, says, name in (
        ("leakage", True, "silent", "current at rest"),
        ("ocv_edge", True, "agrees", "slow test"),
        ("ocv_edge", True, "contradicts", "relaxations"),
        ("resistance_soc", False, "contradicts", "pulses"),
    )
]


def test_a_verdict_has_a_row_for_each_effect_and_one_where_there_is_none(snakemake):
    effect = {
        "effect": "leakage",
        "alternatives": ["current_offset", "coulombic_inefficiency"],
        "rmse_volt": {"before": 0.004, "after": 0.001},
        "validation_rmse_volt": {"before": 0.005, "after": 0.002},
        "gap_closed": 0.9,
        "parameters": {},
    }
    facts = {"located_at": None, "partial": []} | {"floor_volt": 0.001, "next_test": None}
    facts |= {"rmse_volt": {"before": 0.0011, "after": 0.0011}}
    facts |= {"validation_rmse_volt": {"before": 0.0012, "after": 0.0012}}
    none = facts | {"cell": "A", "verdict": "none", "effects": [], "gap_closed": None}
    named = facts | {"cell": "B", "verdict": "ambiguous", "next_test": "A rest."}
    named |= {"effects": [effect, effect | {"effect": "ocv_edge", "alternatives": []}]}
    path = "results/tables/missing_effect.csv"
    with artefact.Job(snakemake(path)) as job:
        job.save(tables.verdicts([none, named], WITNESSES))
    first, second, third = artefact.load_table(path)
    assert (first["verdict"], first["effect"], first["gap_closed"]) == ("none", "", "")
    assert (first["rmse_before_volt"], first["validation_after_volt"]) == ("0.0011", "0.0012")
    assert second["alternatives"] == "current_offset;coulombic_inefficiency"
    errors = ["rmse_before_volt", "rmse_after_volt"]
    errors += ["validation_before_volt", "validation_after_volt", "gap_closed", "floor_volt"]
    wanted = ["0.004", "0.001", "0.005", "0.002", "0.9", "0.001"]
    assert [second[name] for name in errors] == wanted
    assert (third["effect"], third["next_test"]) == ("ocv_edge", "A rest.")
    names = ("witnesses_agree", "witnesses_contradict", "witnesses_silent")
    counts = [[row[name] for name in names] for row in (first, second, third)]
    # What pulses show and the verdict does not name is counted once, in the first row.
    assert counts == [["0", "0", "0"], ["0", "1", "1"], ["1", "1", "0"]]
    assert [row["sure"] for row in (first, second, third)] == ["", "False", "False"]
    assert second["doubts"] == "another explains it as well"
    assert third["doubts"] == "contradicted by relaxations"
    assert [row["doubt_codes"] for row in (first, second, third)] == ["", "tied", "witness"]
    assert {row["in_one_line"] for row in (second, third)} == {
        "shows self-discharge or an offset of the current reading or charge lost in charging and "
        "an OCV that differs near empty or full"
    }


def test_a_name_that_nothing_speaks_against_is_sure():
    effect = {"effect": "leakage", "alternatives": [], "parameters": {}, "gap_closed": 0.9}
    effect |= {"validation_rmse_volt": {"before": 0.005, "after": 0.002}, "rmse_volt": {}}
    verdict = {
        "cell": "A",
        "verdict": "named",
        "effects": [effect],
    }
    verdict |= {"located_at": None, "floor_volt": 0.001, "next_test": None, "partial": []}
    own = verdict | {"verdict": "none", "effects": []}
    own |= {"validation_rmse_volt": {"before": 0.003, "after": 0.003}}
    (row,) = tables.verdicts([verdict], own={"A": own})
    assert (row["sure"], row["doubts"], row["doubt_codes"]) == (True, "", "")
    assert row["lacks_nothing_above_volt"] == 0.003
    assert row["in_one_line"] == "shows self-discharge; its model lacks nothing above 3 mV"


def test_the_fleet_has_a_row_for_each_cell_and_effect_or_one_for_a_type_without():
    effect = {"effect": "leakage", "alternatives": [], "parameters": {}, "gap_closed": 0.9}
    effect |= {"validation_rmse_volt": {"before": 0.005, "after": 0.003}, "rmse_volt": {}}
    none = {"verdict": "none", "effects": [], "not_testable": []}
    named = none | {"verdict": "named", "effects": [effect]}
    found = [named | {"cell": "A"}, *(none | {"cell": cell} for cell in "BCD")]
    types = {"A": "NMC, 5 Ah", "B": "NMC, 5 Ah", "C": "LFP, 2 Ah", "D": "LFP, 2 Ah"}
    first, second, silent = tables.fleet_rows(found, types)
    assert (first["cell"], first["shown"], first["size_volt"]) == ("A", "sure", 0.004)
    assert (second["cell"], second["shown"]) == ("B", "no")
    assert (silent["type"], silent["cell"]) == ("LFP, 2 Ah", None)
    assert silent["sentence"] == "none of 2 cells shows an effect"


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
