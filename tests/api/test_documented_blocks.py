"""Blocks of the pages: Python runs as printed, sheets and settings are valid, commands exist.

Of their own have docs/api.md (test_documented.py), docs/recipes.md (test_recipes.py) and PyBaMM's
example (test_exports.py).
"""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import strings
import truth
from page_blocks import ROOT, TEXTS, blocks, value_of
from small_cells import CELL

import cellwright as cw
from cellwright import formats
from cellwright.effects import base
from cellwright.effects.records import stacked
from cellwright.records.record import record_of
from first_look.__main__ import main
from runtime import contract, settings, sheets
from runtime.plan import Plan

SCHEMAS = ROOT / "workflow" / "schemas"
# How many blocks of Python of each page a test runs; a new one needs a test first.
RUN = {
    "README.md": 1,
    "docs/api.md": 10,
    "docs/architecture.md": 1,
    "docs/exports.md": 2,
    "docs/missing-effect-library.md": 1,
    "docs/recipes.md": 5,
    "docs/tutorial.md": 1,
    "lab/methods.md": 1,
    "plugins/cellwright-fmu/README.md": 1,
}
# Options of Snakemake, in commands of the pages, that a value follows.
WITH_VALUE = {"-s", "--cores", "--directory", "--workflow-profile", "--config", "--executor"}


def test_every_block_of_python_has_a_test_that_runs_it():
    assert {page: len(blocks(page)) for page in TEXTS if blocks(page)} == RUN


def test_the_readme_s_block_tells_capacities_of_the_demo(monkeypatch):
    monkeypatch.chdir(ROOT)
    table = value_of(blocks("README.md")[0])
    assert set(table["direction"]) == {"discharge", "charge"}
    assert table["capacity_ampere_hour"].between(4.5, 5.2).all()


def test_the_tutorial_s_block_simulates_a_model_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("data/C1", "results/models"):
        Path(folder).mkdir(parents=True)
    shutil.copy(ROOT / "data/C1/us06_25C.csv.gz", "data/C1")
    model = truth.model() | {"schema": "cellwright-model/2", "capacity_ampere_hour": 5.0}
    Path("results/models/C1.json").write_text(json.dumps(model))
    run = value_of(blocks("docs/tutorial.md")[0])
    assert list(run) == ["test_time_second", "soc", "voltage_volt"]
    assert run["soc"].iloc[0] == 1.0
    assert run["soc"].iloc[-1] < 0.5
    assert run["voltage_volt"].notna().all()


def _pair(name):
    """A pack model of two cells in parallel, the second a fifth smaller."""
    rows = [
        {"group": name, "position": k + 1, "cell": cell, "connection": "parallel"}
        | {"wire_resistance_ohm": 0.0003, "initial_soc": 0.9}
        for k, cell in enumerate("AB")
    ]
    models = [strings.model("A"), strings.model("B", 0.8)]
    return cw.assemble_pack(name, rows, models).content


def test_the_pack_of_the_exports_runs_from_its_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("results/pack_models").mkdir(parents=True)
    Path("results/pack_models/pair.json").write_text(json.dumps(_pair("pair")))
    run = value_of(blocks("docs/exports.md")[1])
    # The larger cell takes the larger part of the 5 A.
    assert -4.0 < run["cell_1_current_ampere"].iloc[-1] < -2.5


def test_the_new_instrument_is_recognised_and_read(monkeypatch):
    names = {}
    value_of(blocks("docs/architecture.md")[0], names)
    sample = re.search(r"This reads\n\n```\n(.*?)^```", TEXTS["docs/architecture.md"], re.M | re.S)
    monkeypatch.setitem(formats.TABLES, "maker", names["MAKER"])
    monkeypatch.setattr(formats, "READERS", (*formats.READERS, "maker"))
    reading = formats.read(sample[1].encode(), name="file")
    assert (reading.instrument, reading.kind) == ("maker", "series")
    columns = reading.columns
    np.testing.assert_array_equal(columns["test_time_second"], [0, 1800, 3600])
    np.testing.assert_array_equal(columns["current_ampere"], [0, 1, -0.5])
    np.testing.assert_array_equal(columns["net_capacity_ampere_hour"], [0, 0.5, 0.25])
    assert columns["unix_time_second"][-1] - columns["unix_time_second"][0] == 3600


def test_the_new_effect_acts_on_charge_alone():
    names = {}
    value_of(blocks("docs/missing-effect-library.md")[0], names)
    effect = names["POLARISATION_ON_CHARGE"]
    second = np.arange(0.0, 600.0)
    values = dict.fromkeys(base.base_names(1), 0.0) | {"soc0[0]": 0.5}
    values |= dict(zip(base.LOGARITHMS, np.log([0.025, 0.010, 8.0, 0.015, 130.0]), strict=True))

    def moved(ampere, size):
        record = record_of(second, ampere, np.zeros(600), 0.5, celsius=25.0, test="drive")
        stack = stacked([record], capacity_ampere_hour=CELL.capacity_ampere_hour)
        with_it = base.voltage(CELL, stack, values | {effect.names[0]: size}, (effect,))
        return with_it - base.voltage(CELL, stack, values, ())

    load = np.where(second > 60, 2.0, 0.0)
    plausible = effect.parameters[0].plausible
    assert np.abs(moved(load, effect.parameters[0].neutral)).max() < 1e-12
    assert np.abs(moved(-load, plausible)).max() < 1e-12
    # Half of (0.010 (1 - exp(-539/8)) + 0.015 (1 - exp(-539/130))) Ohm at 2 A.
    assert moved(load, plausible)[-1] == pytest.approx(0.0248, rel=0.02)


def test_the_readme_s_sheets_are_a_campaign(tmp_path):
    tables = [block for block in blocks("README.md", "") if "\t" in block]
    assert len(tables) == 2
    (tmp_path / "config").mkdir()
    (tmp_path / "raw").mkdir()
    for name, text in zip(("cells", "tests"), tables, strict=True):
        (tmp_path / f"config/{name}.tsv").write_text(text)
    for file in re.findall(r"raw/[\w.]+", tables[1]):
        (tmp_path / file).write_text("a file")
    campaign = sheets.read(tmp_path, SCHEMAS)
    assert [test["kind"] for test in campaign.tests] == ["capacity", "ocv", "hppc", "drive"]
    assert campaign.tests[-1]["role"] == "validation"


@pytest.mark.parametrize("page", [p for p in TEXTS if blocks(p, "yaml") and "warm" not in p])
def test_settings_of_the_pages_are_settings(page, tmp_path):
    schema = settings.load(SCHEMAS, "config")
    for block in blocks(page, "yaml"):
        (tmp_path / "config").mkdir(exist_ok=True)
        (tmp_path / "config/config.yaml").write_text(block)
        assert settings.read(tmp_path, schema, {})[1] == []


def test_settings_that_the_pages_name_exist():
    """`section.key` in code font, where the section is one of the settings."""
    schema = settings.load(SCHEMAS, "config")
    keys = {
        section: {path for path, _ in settings.keys(part)}
        for section, part in schema["properties"].items()
        if part.get("properties")
    }
    named = [
        (page, section, key)
        for page, text in TEXTS.items()
        for section, key in re.findall(r"`(\w+)\.([\w.]+)`", text)
        if section in keys and key not in ("csv", "py", "json", "parquet")
    ]
    assert len(named) > 5
    assert not [one for one in named if one[2] not in keys[one[1]]]


def test_the_groups_of_the_campaign_page_are_a_sheet(tmp_path):
    (sheet,) = [block for block in blocks("docs/campaign.md", "") if "\t" in block]
    (tmp_path / "config").mkdir()
    rows = "".join(f"C{number}\t2.5\t4.2\n" for number in range(1, 5))
    cells = f"cell\tlower_cutoff_volt\tupper_cutoff_volt\n{rows}"
    tests = "cell\ttest\tkind\tfile\tsoc\npack\trun\tgroup\trun.csv\t1\n"
    for name, text in (("cells", cells), ("tests", tests), ("groups", sheet)):
        (tmp_path / f"config/{name}.tsv").write_text(text)
    plan = Plan(sheets.read(tmp_path, SCHEMAS))
    assert plan.leaves["pack"] == ("C1", "C2", "C3", "C4")


@pytest.mark.slow
def test_the_units_of_the_plugin_s_page_are_made(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("models", "pack_models"):
        Path("results", folder).mkdir(parents=True)
    Path("results/models/C1.json").write_text(json.dumps(strings.model("C1")))
    Path("results/pack_models/P1.json").write_text(json.dumps(_pair("P1")))
    assert value_of(blocks("plugins/cellwright-fmu/README.md")[0])[:2] == b"PK"


def test_targets_and_rows_of_the_pages_exist():
    """Rules that commands of Snakemake ask for; columns by which `explain` is asked for a row."""
    folders = (ROOT / "workflow", ROOT / "lab")
    files = [p for folder in folders for p in (*folder.rglob("*.smk"), *folder.glob("Snakefile"))]
    rules = {rule for p in files for rule in re.findall(r"^rule (\w+):", p.read_text(), re.M)}
    asked = set()
    for text in TEXTS.values():
        for line in re.findall(r"\./run [^`\n#]*?snakemake ([^`\n#]*)", text):
            words = line.split()
            before = [None, *words]
            asked |= {
                word
                for last, word in zip(before, words, strict=False)
                if last not in WITH_VALUE and re.fullmatch(r"[a-z_]+", word)
            }
    assert {"fmu", "verify", "missing_effect"} <= asked
    assert not asked - rules
    rows = re.findall(r"explain results/([\w/]+)\.csv((?: \w+=\w+)+)", "".join(TEXTS.values()))
    assert rows
    for table, conditions in rows:
        columns = contract.stages()[table]["columns"]
        assert not set(re.findall(r"(\w+)=", conditions)) - set(columns)


def test_commands_of_the_pages_exist():
    named = {one for text in TEXTS.values() for one in re.findall(r"run cellwright (\w+)", text)}
    assert len(named) >= 4
    for command in sorted(named):
        with pytest.raises(SystemExit) as end:
            main([command, "--help"])
        assert end.value.code == 0, command
