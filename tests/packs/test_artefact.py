"""Pack models as documents: what is written is read back whole, and says what nobody tested."""

import json

import jsonschema
import numpy as np
import pytest
import truth
from wirings import WIRINGS, parallel, series

import cellwright as cw
from cellwright.packs.artefact import (
    CellInPack,
    pack_document,
    pack_lookup,
    read_pack,
    tree_of,
    wiring_of_tree,
)
from cellwright.packs.cells import pack_cells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.thermal import Thermal
from cellwright.packs.wiring import charge_of
from cellwright.refusal import Refusal
from runtime import artefact, contract, settings

SCHEMA = settings.load(contract.CONTRACT.parent, "pack_model")
TIME = 10.0 * np.arange(200)
LOAD = np.repeat(np.random.default_rng(4).uniform(-4, 3, 20), 10)
SCORE = {"role": "validation", "kind": "drive", "ambient_temperature_celsius": 25.0}
SCORE |= {"rmse_volt_soc_5_95": 0.004, "max_abs_volt": 0.02, "mean_volt": 0.001, "samples": 900}


def model(name, factor=1.0, **changes):
    """A true cell of its own size, with a member that was not chosen beside the chosen one."""
    document = truth.stated(name=name, scale=factor)
    other = dict(document["members"][0], model="1RC", left_out_rmse_volt=0.009)
    for member in (document["members"][0], other):
        for entry in member["conditions"]:
            entry["r0_std_ohm"] = [1e-4] * len(entry["soc"])
            entry["branches"] = [{"kind": "RC"} | branch for branch in entry["branches"]]
    document["members"].append(other)
    own = {"schema": "cellwright-model/2", "capacity_ampere_hour": 2.0 / factor}
    return document | own | {"borrowed_from": None, "kind": "hppc"} | changes


def cells(names="AB", **changes):
    return {n: CellInPack(model(n, 1.0 + 0.1 * k), 0.5, **changes) for k, n in enumerate(names)}


def group_rows(**changes):
    about = {"test": "group_1C", "role": "validation", "kind": "group"}
    about |= {"ambient_temperature_celsius": 25.0, "group": "p"}
    errors = {"current_rmse_ampere": 0.02, "voltage_rmse_volt": 0.003, "model": "2RC"}
    branches = [{"branch": 1, "cell": "A"}, {"branch": 2, "cell": "B"}]
    return [about | branch | errors | changes for branch in branches]


def written(document):
    """A document as a reader finds it: through JSON, held against the schema."""
    plain = json.loads(json.dumps(artefact.plain(document)))
    jsonschema.validate(plain, SCHEMA)
    return plain


def test_the_schema_itself_is_valid_and_forbids_what_is_not_known():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    document = written(pack_document(parallel("A", "B"), cells()))
    for path, value in [
        (("cells", 0, "capacity_ampere_hour"), 0.0),
        (("wiring", "connection"), "crossed"),
        (("wiring", "members", 0, "contact_ohm"), -1.0),
        (("cells", 0, "model", "members"), []),
        (("validated",), None),
    ]:
        broken = json.loads(json.dumps(document))
        place = broken
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(broken, SCHEMA)


@pytest.mark.parametrize("shape", sorted(WIRINGS))
def test_a_wiring_is_read_back_as_it_was(shape):
    tree = json.loads(json.dumps(tree_of(WIRINGS[shape])))
    assert wiring_of_tree(tree) == WIRINGS[shape]


def test_what_is_read_back_runs_to_the_same_voltages():
    wiring = series(parallel("A", "B", link=1e-3, contact=1e-3), "C", contact=2e-3)
    given = cells("ABC", thermal=Thermal(60.0, 4.0))
    pack = read_pack(written(pack_document(wiring, given)))
    runs = [
        simulate_pack(TIME, LOAD, pack_cells(models), wired, initial_soc=0.5)
        for models, wired in (
            ([given[name].model for name in "ABC"], wiring),
            (pack.models, pack.wiring),
        )
    ]
    assert pack.cells == ("A", "B", "C")
    assert pack.thermal == (Thermal(60.0, 4.0),) * 3
    for one, other in zip(runs[0][:4], runs[1][:4], strict=True):
        np.testing.assert_array_equal(one, other)


def test_only_the_chosen_member_is_kept_with_its_deviations():
    entry = written(pack_document(parallel("A", "B"), cells()))["cells"][0]
    assert [member["model"] for member in entry["model"]["members"]] == ["2RC"]
    assert entry["model"]["members"][0]["conditions"][0]["r0_std_ohm"][0] == 1e-4
    assert "notes" not in entry["model"]


def test_a_cell_with_own_heat_runs_without_its_effects_and_says_so():
    found = model("A")
    chosen = dict(found["members"][0], model="2RC+effects", own_heat={})
    best = dict(found["members"][0], left_out_rmse_volt=0.004)
    found = found | {"members": [best, found["members"][1], chosen], "chosen": "2RC+effects"}
    given = cells() | {"A": CellInPack(found, 0.5)}
    first, second = written(pack_document(parallel("A", "B"), given))["cells"]
    assert (first["model"]["chosen"], first["instead_of"]) == ("2RC", "2RC+effects")
    assert second["instead_of"] is None
    assert pack_cells([found]).members == ("2RC",)


def test_every_number_has_its_error_beside_it():
    rows = [SCORE | {"test": "drive", "cell": "A", "model": m, "rmse_volt": e}
            for m, e in (("2RC", 0.005), ("1RC", 0.050))]  # fmt: skip
    known = {"capacity_std_ampere_hour": 0.003, "validation": tuple(rows)}
    entry = written(pack_document(parallel("A", "B"), cells(**known)))["cells"][0]
    assert entry["capacity_std_ampere_hour"] == 0.003
    assert entry["fit"] == [{"ambient_temperature_celsius": 25.0, "fit_rmse_volt": 0.01}]
    assert [row["rmse_volt"] for row in entry["validation"]] == [0.005]
    assert (entry["validated"], entry["why_not_validated"]) == (True, None)


@pytest.mark.parametrize(
    ("rows", "fitted", "validated", "why"),
    [
        (group_rows(), None, True, None),
        (group_rows(role="fit"), None, True, None),
        ([], None, False, "the group has no test"),
        (
            group_rows(current_rmse_ampere=np.nan, voltage_rmse_volt=None),
            *(None, False, "group_1C logged no branch current or voltage"),
        ),
        (group_rows(), "group_1C", False, "fitted to part of group_1C"),
        (group_rows(model="1RC"), None, False, "another model of A, B than the one given here"),
    ],
)
def test_a_pack_is_validated_by_a_test_that_no_model_was_fitted_to(rows, fitted, validated, why):
    given = cells()
    if fitted:
        part = {"test": fitted, "from_second": 0.0, "to_second": 100.0}
        given = {n: c._replace(model=c.model | {"fitted": part}) for n, c in given.items()}
    document = written(pack_document(parallel("A", "B"), given, rows))
    assert document["validated"] is validated
    assert (
        (document["why_not_validated"] is None)
        if why is None
        else (why in document["why_not_validated"])
    )
    assert [test["role"] for test in document["tests"]] == [row["role"] for row in rows[:1]]


def test_a_cell_without_tests_says_so():
    entry = written(pack_document(parallel("A", "B"), cells()))["cells"][0]
    assert not entry["validated"]
    assert "no test that took no part" in entry["why_not_validated"]
    other = cells(validation=(SCORE | {"test": "d", "model": "1RC", "rmse_volt": 0.01},))
    entry = written(pack_document(parallel("A", "B"), other))["cells"][0]
    assert "not simulated with 2RC" in entry["why_not_validated"]


def test_capacity_adds_in_parallel_and_is_the_least_in_series():
    assert charge_of(series(parallel("A", "B"), "C"), [2.0, 3.0, 4.0]) == 4.0
    assert charge_of(parallel(series("A", "B"), "C"), [2.0, 3.0, 4.0]) == 6.0


def test_the_long_table_holds_every_value_of_the_models():
    document = written(pack_document(parallel("A", "B"), cells()))
    rows = pack_lookup(document)
    for entry in document["cells"]:
        own = [row for row in rows if row["cell"] == entry["cell"]]
        (condition,) = entry["model"]["members"][0]["conditions"]
        assert [r["value"] for r in own if r["parameter"] == "r0"] == condition["r0_ohm"]
        assert [r["value"] for r in own if r["parameter"] == "tau2"] == (
            condition["branches"][1]["tau_second"]
        )
        assert [r["soc"] for r in own if r["parameter"] == "ocv"] == entry["model"]["ocv"][0]["soc"]
        (size,) = [r["value"] for r in own if r["parameter"] == "capacity"]
        assert size == entry["capacity_ampere_hour"]
    assert {row["std"] for row in rows if row["parameter"] == "r0"} == {1e-4}


ENTRY = ("cells", 0)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("wiring",), None, "wiring is None, wanted keys with values"),
        (("wiring", "members"), [1], "members of group 'p'\\[0\\] is 1, wanted keys"),
        (("cells",), "A", "cells is 'A', wanted a list"),
        (ENTRY, {}, "cells\\[0\\] lacks cell, model, initial_soc"),
        ((*ENTRY, "model"), [], "model of A is \\[\\], wanted keys"),
        ((*ENTRY, "model"), {}, "model of A lacks cell, capacity_ampere_hour"),
        ((*ENTRY, "initial_soc"), float("nan"), "initial_soc is nan, wanted a number of 0 or more"),
        (
            (*ENTRY, "initial_soc"),
            1.5,
            "is 1.5, wanted a number of 0 or more, 1 at most",
        ),
        ((*ENTRY, "thermal"), {"mass": 1}, "thermal lacks heat_capacity_joule_per_kelvin"),
    ],
)
def test_a_broken_document_is_refused_where_it_is_broken(path, value, said):
    document = written(pack_document(parallel("A", "B"), cells()))
    *above, last = path
    place = document
    for step in above:
        place = place[step]
    place[last] = value
    with pytest.raises(Refusal, match=said):
        read_pack(document)


def test_refusals_name_what_was_found():
    with pytest.raises(Refusal, match="no model of C"):
        pack_document(parallel("A", "C"), cells())
    with pytest.raises(Refusal, match="given for B is of A"):
        pack_document(parallel("A", "B"), cells() | {"B": cells()["A"]})
    document = written(pack_document(parallel("A", "B"), cells()))
    with pytest.raises(Refusal, match="schema is 'cellwright-model/2'"):
        read_pack(document["cells"][0]["model"])
    with pytest.raises(Refusal, match="cells are A, wanted those of the wiring"):
        read_pack(document | {"cells": document["cells"][:1]})
    tree = document["wiring"]
    with pytest.raises(Refusal, match="connection 'crossed'"):
        read_pack(document | {"wiring": tree | {"connection": "crossed"}})
    broken = [tree["members"][0] | {"contact_ohm": -1.0}, tree["members"][1]]
    with pytest.raises(Refusal, match="contact_ohm of A is -1"):
        read_pack(document | {"wiring": tree | {"members": broken}})
    with pytest.raises(Refusal, match="group 'p' has no members"):
        read_pack(document | {"wiring": tree | {"members": []}})
    empty = dict(document["cells"][0], model=dict(document["cells"][0]["model"]))
    empty["model"]["capacity_ampere_hour"] = 0.0
    with pytest.raises(Refusal, match="model of A: capacity_ampere_hour is 0"):
        read_pack(document | {"cells": [empty, document["cells"][1]]})


def test_a_file_is_read_by_its_path(tmp_path):
    path = tmp_path / "results" / "pack_models" / "p.json"
    about = {"reason": None}
    artefact.write(path, pack_document(parallel("A", "B"), cells()), about)
    assert cw.pack_model(path).cells == ("A", "B")
    assert cw.pack_model(str(path)).initial_soc == (0.5, 0.5)
    artefact.write(path, {}, {"reason": "no model of B"})
    with pytest.raises(Refusal, match="no model of B"):
        cw.pack_model(path)
    path.write_text("{")
    with pytest.raises(Refusal, match="wanted a JSON document"):
        cw.pack_model(path)


def test_a_pack_is_put_together_from_the_sheet_and_the_results_of_its_tests():
    rows = [
        {"group": "p", "position": k + 1, "cell": name, "initial_soc": 0.4, "connection": None}
        for k, name in enumerate("AB")
    ]
    capacity = {"cell": "A", "direction": "discharge", "capacity_ampere_hour": 2.0}
    capacities = [capacity | {"capacity_std_ampere_hour": 0.01}]
    found = cw.assemble_pack("p", rows, [model("B"), model("A")], capacities=capacities)
    first, second = written(found.content)["cells"]
    assert (first["cell"], first["initial_soc"]) == ("A", 0.4)
    assert first["capacity_std_ampere_hour"] == pytest.approx(0.01)
    assert second["capacity_std_ampere_hour"] is None
    assert any("pack p is not validated" in note for note in found.notes)
    assert len(found.to_frame()) == len(found.lookup)
