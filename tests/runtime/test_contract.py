"""What of the contract makes an artefact anew: what it is held against, and nothing else."""

import pytest
import yaml

from runtime import contract

CAPACITY = "results/stages/capacity/A/C20.parquet"
TABLE = "results/tables/capacity.csv"
STAGES = {
    "capacity": {"columns": {"cell_ampere_hour": {"unit": "Ah", "range": [0, None]}}},
    "tables/capacity": {"columns": {"cell": {}, "cell_ampere_hour": {"required": False}}},
    "health": {"columns": {"knee": {}}},
}


@pytest.fixture
def fingerprint(monkeypatch):
    """Hash of the files under a contract in which one column of one entry is another."""

    def hashed(*paths, **changed):
        stages = {stage: {"columns": dict(one["columns"])} for stage, one in STAGES.items()}
        for stage, columns in changed.items():
            stages[stage]["columns"].update(columns)
        monkeypatch.setattr(contract, "stages", lambda: stages)
        contract.fingerprint.cache_clear()
        return contract.fingerprint(*paths)

    yield hashed
    contract.fingerprint.cache_clear()


@pytest.mark.parametrize(
    "column",
    [
        {"cell_ampere_hour": {"unit": "Ah", "range": [0, 9]}},
        {"cell_ampere_hour": {"unit": "Ah", "range": [0, None], "required": False}},
        {"more": {"unit": "1"}},
    ],
)
def test_a_range_a_column_and_its_need_count(fingerprint, column):
    assert fingerprint(CAPACITY, capacity=column) != fingerprint(CAPACITY)


def test_words_and_other_entries_do_not(fingerprint):
    words = {"cell_ampere_hour": {"unit": "A h", "meaning": "charge", "range": [0, None]}}
    assert fingerprint(CAPACITY, capacity=words) == fingerprint(CAPACITY)
    assert fingerprint(CAPACITY, health={"more": {}}) == fingerprint(CAPACITY)
    assert fingerprint(CAPACITY) != fingerprint(TABLE)


def test_an_edited_contract_is_read_again(tmp_path, monkeypatch):
    """A forked job has the contract from before; an edit within the run has to reach it."""
    file = tmp_path / "artefacts.yaml"
    monkeypatch.setattr(contract, "CONTRACT", file)
    file.write_text("capacity: {columns: {cell: {}}}")
    assert list(contract.stages()["capacity"]["columns"]) == ["cell"]
    file.write_text("capacity: {columns: {cell: {}, test: {}}}")
    assert list(contract.stages()["capacity"]["columns"]) == ["cell", "test"]


def test_what_an_earlier_entry_says_is_in_full_where_it_stands():
    told = {"unit": "Ah", "range": [0, None]}
    written = {
        "capacity": {"columns": {"cell": {"meaning": "a"}, "rate": {}, "charge": told}},
        "health": {"columns": {"soh": {}, "same_as capacity": ["charge", "cell"]}},
        "fade": {"columns": {"same_as health": "all", "lost": {"same_as": "capacity.charge"}}},
    }
    stages = contract.expanded(written)
    assert stages["health"]["columns"] == {"soh": {}, "charge": told, "cell": {"meaning": "a"}}
    assert list(stages["fade"]["columns"]) == ["soh", "charge", "cell", "lost"]
    assert stages["fade"]["columns"]["lost"] == told


@pytest.mark.parametrize(
    "columns",
    [{"same_as later": "all"}, {"same_as capacity": ["rate"]}, {"x": {"same_as": "capacity.rate"}}],
)
def test_the_same_as_what_no_earlier_entry_has_is_refused(columns):
    written = {"capacity": {"columns": {"cell": {}}}, "health": {"columns": columns}}
    with pytest.raises(ValueError, match="health: same as column"):
        contract.expanded(written | {"later": {"columns": {"cell": {}}}})


def test_no_column_of_the_contract_is_described_twice():
    written = yaml.safe_load(contract.CONTRACT.read_text(encoding="utf-8"))
    seen, twice = {}, []
    for stage, spec in written.items():
        for name, about in spec["columns"].items():
            if (
                "meaning" in about
                and (first := seen.setdefault((name, str(about)), stage)) != stage
            ):
                twice.append(f"{stage}.{name}: write {{same_as: {first}.{name}}}")
    assert not twice


def test_what_has_no_entry_has_no_hash(fingerprint):
    assert fingerprint("results/models/A.json", "logs/capacity/A.log") == ""


@pytest.mark.parametrize(
    ("path", "entry"),
    [
        (CAPACITY, "capacity"),
        (TABLE, "tables/capacity"),
        ("results/summary.csv", "summary"),
        ("results/figures/A.svg", None),
        ("somewhere/else.csv", None),
    ],
)
def test_the_entry_of_a_file(path, entry):
    assert contract.entry_of(path) == entry
