"""A model or basis given as the path of its file is read; another file is named for what it is."""

import inspect
import json
from importlib import import_module

import numpy as np
import pytest
import truth

import cellwright as cw

TIME = np.arange(0.0, 1200.0)
AMPERE = np.where(TIME < 300, 0.0, -1.0)
CURRENT = {"test_time_second": TIME, "current_ampere": AMPERE}
SERIES = cw.clean(CURRENT | {"voltage_volt": truth.ocv_at(0.9) + 0.05 * AMPERE})
STEPS = cw.segment(SERIES)
CELL = cw.CellFacts("A", truth.CAPACITY_AMPERE_HOUR, 2.5, 4.2)
TEST = {"test": "t", "kind": "drive", "soc": 0.9, "role": "validation"}
ROWS = [{"group": "g", "position": k, "cell": cell} for k, cell in ((1, "A"), (2, "B"))]
SECOND = truth.model("B")
TESTS = [(TEST, SERIES)]
_, RECORD = cw.held_out(truth.model(), SERIES, TEST, CELL)
# Each public step that takes a model (or several), with all else that it needs.
OF_MODEL = {
    "identify_without": lambda m: cw.identify_without(CELL, m, truth.model(), TESTS, celsius=0),
    "predict_left_out": lambda m: cw.predict_left_out(CELL, truth.model(), {0.0: m}, TESTS),
    "finish_model": lambda m: cw.finish_model(CELL, m),
    "export_model": cw.export_model,
    "simulate": lambda m: cw.simulate(m, CURRENT, initial_soc=0.9),
    "held_out": lambda m: cw.held_out(m, SERIES, TEST, CELL),
    "validate": lambda m: cw.validate(m, RECORD),
    "estimate_soc": lambda m: cw.estimate_soc(m, RECORD, filters=("ekf",)),
    "thermal_constants": lambda m: cw.thermal_constants(CELL, m, TESTS),
    "missing_effect": lambda m: cw.missing_effect(CELL, truth.model(), TESTS, model=m),
    "assemble_pack": lambda m: cw.assemble_pack("g", ROWS, [m, SECOND]),
    "simulate_group": lambda m: cw.simulate_group([m, m], CURRENT, initial_soc=0.9),
    "simulate_pack": lambda m: cw.simulate_pack([m, SECOND], ROWS, CURRENT, initial_soc=0.9),
    "run_pack_phases": lambda m: cw.run_pack_phases([m, SECOND], ROWS, [], initial_soc=0.9),
    "series_pack": lambda m: cw.series_pack([m, SECOND], ROWS, [CELL], SERIES, TEST),
    "validate_group": lambda m: cw.validate_group([m, SECOND], ROWS, SERIES, TEST),
    "nested_pack": lambda m: cw.nested_pack([m, SECOND], ROWS, SERIES, TEST),
    "pack_decisions": lambda m: cw.pack_decisions([m, SECOND], ROWS, [CELL]),
    "match_cells": lambda m: cw.match_cells([m, SECOND], [CELL]),
}
OF_BASIS = {
    "basis_at": lambda b: cw.basis_at(b, 0),
    "state_of_charge": lambda b: cw.state_of_charge(SERIES, b, TEST, CELL),
    "missing_effect": lambda b: cw.missing_effect(CELL, b, TESTS),
    "witnesses": lambda b: cw.witnesses({}, {}, b, {}),
    "prepared_case": lambda b: cw.prepared_case(CELL, b, TESTS),
    "identify": lambda b: cw.identify(CELL, b, TESTS),
    "identify_without": lambda b: cw.identify_without(CELL, truth.model(), b, TESTS, celsius=0),
    "finish_model": lambda b: cw.finish_model(CELL, truth.model(), b),
    "chamber_steps": lambda b: cw.chamber_steps(SERIES, STEPS, b, TEST, CELL),
    "resistance": lambda b: cw.resistance(SERIES, STEPS, b, TEST, CELL),
    "relaxation": lambda b: cw.relaxation(SERIES, STEPS, b, TEST, CELL),
    "capacity_between_rests": lambda b: cw.capacity_between_rests([(TEST, SERIES, STEPS)], b),
}
NO_BASIS_IN_IT = {"fast_charge"}  # a result of `fast_charge` is read first


def with_argument(*names):
    """Public steps that have an argument of one of these names."""
    functions = {name: getattr(import_module(room), name) for name, room in cw.MODULE_OF.items()}
    return {
        name
        for name, function in functions.items()
        if inspect.isfunction(function) and {*names} & {*inspect.signature(function).parameters}
    }


def test_every_step_that_takes_a_model_or_a_basis_is_tried_here():
    assert with_argument("model", "models", "whole") - {"witnesses"} == {*OF_MODEL}
    assert with_argument("basis") - NO_BASIS_IN_IT == {*OF_BASIS}


def file_of(folder, document):
    path = folder / "A.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", OF_MODEL)
def test_another_file_than_a_models_is_named_for_what_it_is(tmp_path, name):
    basis = file_of(tmp_path, {"cell": "A", "ocv": [], "capacity_ampere_hour": 2.0})
    call = OF_MODEL[name]
    said = r"A\.json: found a document of cell, ocv, capacity_ampere_hour, wanted a model"
    for path in (basis, str(basis)):
        with pytest.raises(cw.Refusal, match=said):
            call(path)
    with pytest.raises(cw.Refusal, match="there is no such file"):
        call(str(tmp_path / "B.json"))
    with pytest.raises(cw.Refusal, match=r"A\.json holds nothing: no pulses"):
        call(file_of(tmp_path, {"provenance": {"reason": "no pulses"}}))
    with pytest.raises(cw.Refusal, match="found a list, wanted a model"):
        call(file_of(tmp_path, [1, 2]))


@pytest.mark.parametrize("name", OF_BASIS)
def test_another_file_than_a_basis_is_named_for_what_it_is(tmp_path, name):
    path = file_of(tmp_path, {"schema": "cellwright-pack/1"})
    said = r"A\.json: found a document of schema cellwright-pack/1, wanted a result of `basis`"
    with pytest.raises(cw.Refusal, match=said):
        OF_BASIS[name](path)


@pytest.mark.parametrize("name", ["simulate", "validate", "simulate_pack", "export_model"])
@pytest.mark.parametrize("as_path", [str, lambda path: path])
def test_the_path_of_a_model_gives_what_the_model_gives(tmp_path, name, as_path):
    """What an artefact carries beside its content, its provenance, changes nothing."""
    model = truth.model()
    path = file_of(tmp_path, model | {"provenance": {"reason": None}})
    by_path, by_content = OF_MODEL[name](as_path(path)), OF_MODEL[name](model)
    assert repr(by_path) == repr(by_content)


def test_one_model_is_no_list_of_models(tmp_path):
    with pytest.raises(cw.Refusal, match="found a str, wanted a list of models"):
        cw.simulate_pack(str(tmp_path / "A.json"), ROWS, CURRENT, initial_soc=0.9)
    with pytest.raises(cw.Refusal, match="wanted a list of models, one a cell"):
        cw.match_cells(truth.model(), [CELL])
