"""docs/recipes.md and docs/first-hour.md: recipes run as printed, and each message is one that is.

The files are the demo's, written as the recipes expect them.
"""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import strings
from page_blocks import ROOT, TEXTS, blocks, value_of

import cellwright as cw
from runtime import contract

COUNTER, PULSE, LIFE, PACK, DOUBT = blocks("docs/recipes.md")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of its own, with `raw/`."""
    monkeypatch.chdir(tmp_path)
    Path("raw").mkdir()
    return tmp_path


def as_neware(source, path):
    """A demo record as Neware's csv: milliampere, its clock, its two counters."""
    record = cw.clean(cw.read(ROOT / source)).to_frame()
    charge = np.diff(record["charge_ampere_hour"], prepend=record["charge_ampere_hour"].iloc[0])
    pd.DataFrame(
        {
            "DataPoint": np.arange(len(record)) + 1,
            "Cycle Index": 1,
            "Step Index": 1,
            "Total Time(s)": record["test_time_second"],
            "Current(mA)": 1e3 * record["current_ampere"],
            "Voltage(V)": record["voltage_volt"],
            "Chg. Cap.(Ah)": np.maximum(charge, 0).cumsum(),
            "DChg. Cap.(Ah)": np.maximum(-charge, 0).cumsum(),
        }
    ).to_csv(path, index=False)


def test_a_folder_of_neware_files_gives_its_capacities_and_says_what_has_none(folder):
    as_neware("data/C5/capacity_25C.bdf.csv.gz", "raw/a.csv")
    as_neware("data/C5/us06_25C.bdf.csv.gz", "raw/drive.csv")
    assert cw.read("raw/a.csv").content["instrument"][0] == "neware"
    names = {}
    table = value_of(COUNTER, names)
    assert set(table["file"]) == {"a.csv"}
    (size,) = table[table["direction"] == "discharge"]["capacity_ampere_hour"]
    assert size == pytest.approx(4.892, rel=2e-3)  # C5 of the tutorial
    assert list(names["refused"]) == ["drive.csv"]
    written = pd.read_csv("capacity.csv")["capacity_ampere_hour"]
    assert written.tolist() == pytest.approx(table["capacity_ampere_hour"].tolist())


@pytest.mark.slow
def test_a_pulse_test_gives_resistances_and_a_model_for_pybamm(folder):
    for source, name in (("ocv", "slow"), ("hppc", "hppc")):
        record = cw.clean(cw.read(ROOT / f"data/C5/{source}_25C.bdf.csv.gz")).to_frame()
        columns = {
            "Test Time / s": record["test_time_second"],
            "Current / A": record["current_ampere"],
            "Voltage / V": record["voltage_volt"],
        }
        pd.DataFrame(columns).to_csv(f"raw/{name}.csv", index=False)
    table = value_of(PULSE)
    middle = table[(table["delay_second"] == 10) & (table["direction"] == "discharge")]
    ohm = np.interp(0.5, *middle.sort_values("soc")[["soc", "resistance_ohm"]].to_numpy().T)
    assert ohm == pytest.approx(0.04427, rel=0.03)  # C5 of the tutorial
    document = json.loads(Path("pybamm_thevenin.json").read_text())
    assert (document["cell"], document["exported"]) == ("M1", "2RC")


def test_health_over_life_is_read_off_its_table(folder):
    columns = contract.stages()["tables/health"]["columns"]
    rows = [
        ("C1", "check-up", 0, 1.0),
        ("C2", "check-up", 600, 0.84),
        ("C2", "dQ/dV peaks", 600, 0.8),
    ]
    made = pd.DataFrame(rows, columns=["cell", "method", "cycle", "soh"]).reindex(columns=columns)
    Path("results/tables").mkdir(parents=True)
    made.to_csv("results/tables/health.csv", index=False)
    table = value_of(LIFE)
    assert table[["cycle", "soh"]].values.tolist() == [[600, 0.84]]


def test_twelve_cells_share_the_current_of_their_pack(folder):
    Path("results/models").mkdir(parents=True)
    for number in range(1, 13):
        model = strings.model(f"C{number}", resistance_factor=2.0 if number == 1 else 1.0)
        Path(f"results/models/C{number}.json").write_text(json.dumps(model))
    names = {}
    value_of(PACK, names)
    share = names["share"].to_numpy().reshape(3, 4)
    assert share.sum(axis=1) == pytest.approx([1.0] * 3)
    assert share[1:] == pytest.approx(np.full((2, 4), 0.25))
    assert share[0, 0] < 0.22  # twice the resistance


def test_model_or_data_is_read_off_two_tables(folder):
    Path("results/tables").mkdir(parents=True)
    for name, path in (
        ("summary", "summary.csv"),
        ("tables/missing_effect", "tables/missing_effect.csv"),
    ):
        columns = contract.stages()[name]["columns"]
        pd.DataFrame(columns=list(columns)).to_csv(f"results/{path}", index=False)
    names = {}
    assert list(value_of(DOUBT, names)) == ["cell", "effect", "sure", "doubts"]
    answers = re.findall(r"`(named|ambiguous|unknown|none)`", TEXTS["docs/recipes.md"])
    assert set(answers) == {"named", "ambiguous", "unknown", "none"}


def test_the_messages_of_the_first_hour_are_messages_of_the_program():
    """Each quoted part stands in a source as it is printed."""
    page = TEXTS["docs/first-hour.md"].partition("| message |")[2]
    first = [row.split("|")[1] for row in page.splitlines() if row.startswith("| `")]
    quoted = [part for cell in first for part in re.findall(r"`([^`]+)`", cell)]
    assert len(first) == 15
    kinds = (".py", ".toml")
    sources = [p for p in (ROOT / "scripts").rglob("*") if p.suffix in kinds]
    said = "\n".join(p.read_text(encoding="utf-8") for p in [ROOT / "run", *sources])
    import snakemake.exceptions

    said += Path(snakemake.exceptions.__file__).read_text(encoding="utf-8")
    assert not [part for part in quoted if part not in said]
