"""Functional mock-up units as archives: the same bytes, a whole description, sources that build.

FMPy runs them in test_fmpy.py.
"""

import io
import json
import shutil
import subprocess
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
import truth
from one_particle import in_use
from wirings import parallel

import cellwright_fmu
from cellwright import native
from cellwright.packs.artefact import CellInPack, pack_document
from cellwright.refusal import Refusal
from cellwright_fmu.description import identifier_of
from cellwright_fmu.unit import unit_temperatures


def unpacked(unit):
    with zipfile.ZipFile(io.BytesIO(unit.content)) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def description(unit):
    return ElementTree.fromstring(unpacked(unit)["modelDescription.xml"])


@pytest.fixture(scope="module")
def cell():
    return cellwright_fmu.cell_fmu(truth.stated(), initial_soc=0.7, points=101)


@pytest.fixture(scope="module")
def pack():
    cells = {name: CellInPack(truth.stated(name=name), 0.6) for name in "AB"}
    return cellwright_fmu.pack_fmu(pack_document(parallel(*"AB", link=1e-3), cells), points=101)


def test_the_same_model_gives_the_same_bytes_and_another_one_another_token(cell):
    again = cellwright_fmu.cell_fmu(truth.stated(), initial_soc=0.7, points=101)
    other = cellwright_fmu.cell_fmu(truth.stated(scale=1.001), initial_soc=0.7, points=101)
    assert again.content == cell.content
    assert other.token != cell.token
    assert len(cell.token) == 64


def test_the_description_states_every_variable_with_unit_and_start(cell, pack):
    for unit, scalars in ((cell, 8), (pack, 9)):
        root = description(unit)
        variables = root.find("ModelVariables")
        units = {u.get("name") for u in root.find("UnitDefinitions")}
        assert {v.get("unit") for v in variables} <= units
        assert all(v.get("description") for v in variables)
        set_by_user = [v for v in variables if v.get("causality") in ("input", "parameter")]
        assert all(v.get("start") for v in set_by_user)
        outputs = [v.get("valueReference") for v in variables if v.get("causality") == "output"]
        for kind in ("Output", "InitialUnknown"):
            listed = root.findall(f"ModelStructure/{kind}")
            assert [entry.get("valueReference") for entry in listed] == outputs
        assert len([v for v in variables if v.find("Dimension") is None]) == scalars
    assert "positive on charge" in description(cell).get("description")


def test_arrays_of_a_pack_have_a_value_for_each_cell(pack):
    arrays = [v for v in description(pack).find("ModelVariables") if len(v)]
    assert {v.find("Dimension").get("start") for v in arrays} == {"2"}
    start = next(v for v in arrays if v.get("name") == "initial_soc")
    assert start.get("start") == "0.6 0.6"


def test_errors_of_the_model_stand_in_the_documentation():
    score = {"test": "us06", "role": "validation", "model": "2RC", "rmse_volt": 0.0042}
    score |= {"max_abs_volt": 0.031, "samples": 100}
    page = unpacked(cellwright_fmu.cell_fmu(truth.stated(), validation=[score], points=51))
    assert b"us06: 4.2, 31" in page["documentation/index.html"]
    without = unpacked(cellwright_fmu.cell_fmu(truth.stated(), points=51))[
        "documentation/index.html"
    ]
    assert b"not validated: it has no test" in without


def test_errors_of_each_kind_of_group_test_stand_in_the_documentation():
    cells = {name: CellInPack(truth.stated(name=name), 0.6) for name in "AB"}
    about = {"role": "validation", "ambient_temperature_celsius": 25.0}
    rows = [
        about | {"test": "one", "branch": 1, "cell": "A", "current_rmse_ampere": 0.0123},
        about | {"test": "two", "cell": "B", "rmse_volt": 0.0045, "model": "2RC"},
        about | {"test": "three", "channel": "pack voltage", "of": "p", "rmse": 0.007, "unit": "V"},
        about | {"test": "four", "cell": "A", "rmse_volt": np.nan},
    ]
    page = unpacked(cellwright_fmu.pack_fmu(pack_document(parallel(*"AB"), cells, rows), points=51))
    text = page["documentation/index.html"].decode()
    for said in (
        *("<td>1 A</td><td>current_rmse_ampere 0.0123</td>", "<td>B</td><td>rmse_volt 0.0045</td>"),
        *("<td>pack voltage p</td><td>rmse 0.007 V</td>", "<td>A</td><td>not logged</td>"),
    ):
        assert said in text


def test_what_is_named_is_there(cell):
    files = unpacked(cell)
    build = ElementTree.fromstring(files["sources/buildDescription.xml"])
    named = [f"sources/{file.get('name')}" for file in build.iter("SourceFile")]
    assert set(named) <= set(files)
    assert build.find("BuildConfiguration").get("modelIdentifier") == identifier_of("A")
    assert description(cell).find("CoSimulation").get("modelIdentifier") == identifier_of("A")
    if cell.platform:
        assert any(name.startswith(f"binaries/{cell.platform}/cellwright_A") for name in files)


@pytest.fixture(scope="module")
def particle():
    """A cell whose particle predicts better than its circuit, with a test of each."""
    rows = [{"test": "us06", "role": "validation", "samples": 100, "max_abs_volt": 0.02}]
    rows = [rows[0] | {"model": name, "rmse_volt": v} for name, v in (("2RC", 0.03), ("P", 0.007))]
    return cellwright_fmu.cell_fmu(in_use(truth.stated()), initial_soc=0.7, validation=rows)


def test_a_cell_whose_particle_is_in_use_runs_as_that_and_says_so(particle):
    files = unpacked(particle)
    assert "one particle with charge transfer, P" in description(particle).get("description")
    assert "it runs as P, one particle" in particle.notes[0]
    text = files["documentation/index.html"].decode()
    assert "<td>P</td>" in text
    assert "us06: 7, 20" in text
    assert "<td>0, 25</td><td>not known</td><td>4</td>" in text
    assert "40 K" not in text
    assert "sources/particle.c" in files
    assert "sources/pack.c" not in files


def test_a_particle_that_is_not_in_use_leaves_the_unit_as_it_was(cell):
    model = in_use(truth.stated())
    model["particle"]["in_use"] = False
    assert cellwright_fmu.cell_fmu(model, initial_soc=0.7, points=101).token == cell.token


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler on this machine")
@pytest.mark.parametrize("kind", ["cell", "particle"])
def test_the_sources_build_by_themselves_without_a_warning(kind, request, tmp_path):
    files = unpacked(request.getfixturevalue(kind))
    for name, content in files.items():
        (tmp_path / name.rpartition("/")[2]).write_bytes(content)
    build = ElementTree.fromstring(files["sources/buildDescription.xml"])
    named = [file.get("name") for file in build.iter("SourceFile")]
    command = ["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function"]
    command += ["-shared", "-fPIC", "-O1", *named, "-o", "unit.so", "-lm"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_without_a_compiler_the_unit_holds_sources_only(monkeypatch):
    monkeypatch.setenv("CELLWRIGHT_NATIVE", "0")
    native._library.cache_clear()
    unit = cellwright_fmu.cell_fmu(truth.stated(), points=51)
    monkeypatch.undo()
    native._library.cache_clear()
    assert unit.platform is None
    assert not [name for name in unpacked(unit) if name.startswith("binaries/")]
    assert "no C compiler was found: the unit holds sources only" in unit.notes


def test_names_become_identifiers():
    assert identifier_of("cell-1.b") == "cellwright_cell_1_b"


def two_temperatures(*, energy=0.0):
    warm, cold = truth.stated(), truth.stated(celsius=0.0, scale=2.5)
    conditions = [m["members"][0]["conditions"][0] for m in (cold, warm)]
    for condition in conditions:
        condition["activation_energy_joule_per_mole"] = energy
    return warm | {"members": [warm["members"][0] | {"conditions": conditions}]}


def test_tables_reach_where_the_model_reaches():
    one = truth.stated()
    one["members"][0]["conditions"][0]["activation_energy_joule_per_mole"] = 0.0
    assert unit_temperatures([one]) == [25.0]
    # Nothing over 8 K of its own warming, and what cells usually have beyond.
    one["members"][0]["conditions"][0]["activation_energy_kelvin"] = 8.0
    assert {17.0, 33.0} <= set(unit_temperatures([one]))
    known = unit_temperatures([two_temperatures(energy=2e4)])
    assert {0.0, 25.0} <= set(known)
    assert known[0] < -30.0
    assert known[-1] > 60.0
    inner = [value for value in known if 0.0 <= value <= 25.0]
    assert np.diff(inner).max() <= 2.0


def test_a_start_that_is_not_stated_is_said():
    cells = {name: CellInPack(truth.stated(name=name), None) for name in "AB"}
    unit = cellwright_fmu.pack_fmu(pack_document(parallel(*"AB"), cells), points=51)
    assert "no start is stated of A, B: initial_soc is 0.5, set it" in unit.notes


def test_a_cell_with_own_heat_runs_without_its_effects_and_says_so():
    found = truth.stated()
    chosen = dict(found["members"][0], model="2RC+effects", own_heat={})
    found = found | {"members": [*found["members"], chosen], "chosen": "2RC+effects"}
    unit = cellwright_fmu.cell_fmu(found, points=51)
    assert unit.notes[-1] == "it runs as 2RC instead of 2RC+effects"


def test_the_path_of_a_model_gives_what_the_model_gives(cell, tmp_path):
    path = tmp_path / "A.json"
    path.write_text(json.dumps(truth.stated() | {"provenance": {"reason": None}}))
    unit = cellwright_fmu.cell_fmu(path, initial_soc=0.7, points=101)
    assert unit.content == cell.content
    assert len(unit.to_frame()) == len(unit.variables)
    path.write_text(json.dumps({"cell": "A", "ocv": []}))
    with pytest.raises(Refusal, match=r"A\.json: found a document of cell, ocv, wanted a model"):
        cellwright_fmu.cell_fmu(path)


def test_refusals():
    with pytest.raises(Refusal, match="SoC at the start is"):
        cellwright_fmu.cell_fmu(truth.stated(), initial_soc=1.2)
    with pytest.raises(Refusal, match="longest internal step is 0 s"):
        cellwright_fmu.cell_fmu(truth.stated(), largest_step_second=0.0)
