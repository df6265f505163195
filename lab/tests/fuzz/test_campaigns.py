"""A campaign of records made wrong: its sheets and files are an input, its tables are read back."""

import csv

import pytest

from fuzz import campaigns
from fuzz.published import file_of
from fuzz.records import HERE, entries, record_of


@pytest.fixture(scope="module")
def record():
    """The demo's capacity test of C1."""
    return record_of(next(e for e in entries() if e[0] == HERE and e[2]["kind"] == "capacity"))


def test_a_campaign_is_written_as_the_contract_says(record, tmp_path):
    data = file_of(record)
    campaigns.write_campaign(tmp_path, {"F0000": (record, data), "F0001": (record, data)})
    assert (tmp_path / "raw" / "F0001.bdf.csv").read_bytes() == data
    with open(tmp_path / "config" / "tests.tsv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    assert [row["cell"] for row in rows] == ["F0000", "F0001"]
    assert {row["kind"] for row in rows} == {"capacity"}


def test_tables_are_read_back_and_a_fault_of_the_program_is_a_crash(tmp_path):
    folder = tmp_path / "results" / "tables"
    folder.mkdir(parents=True)
    (folder / "capacity.csv").write_text(
        "cell,direction,c_rate,capacity_ampere_hour,cycle,doubt\nA,charge,0.5,2.96,,\n"
    )
    (folder / "resistance.csv").write_text("cell,doubt\n")
    (folder / "excluded.csv").write_text(
        "cell,test,file,stage,reason\nB,t,f,ingest,no voltage\nC,t,f,x,Cellwright itself failed\n"
    )
    found = campaigns.outcomes(tmp_path, ["A", "B", "C"])
    row = found["A"].rows["capacity"][0]
    assert (row["c_rate"], row["cycle"], row["doubt"]) == (0.5, None, "")
    assert "resistance" not in found["A"].rows
    assert (found["B"].refused, found["B"].crash) == ("no voltage", "")
    assert found["C"].crash
