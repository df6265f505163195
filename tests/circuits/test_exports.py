"""Exports: what is read back runs to the same voltage; what cannot be exported says why.

PyBaMM itself runs the exported set in lab/tests/test_thevenin.py.
"""

import csv
import json
import re
import runpy
import sys
import warnings
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import truth
from one_particle import in_use

from cellwright.circuits.exports import lookup_table, pybamm_document, pybamm_parameters
from cellwright.circuits.model_file import simulate_model
from cellwright.identification.export import export_model
from cellwright.refusal import Refusal
from runtime import artefact

ROOT = Path(__file__).resolve().parents[2]


def family(*more, chosen="2RC"):
    """The true cell at two temperatures, with further members of these (name, branches)."""
    model, cold = truth.model(celsius=25.0), truth.model(celsius=0.0, scale=2.5)
    model["members"][0]["conditions"] += cold["members"][0]["conditions"]
    for name, branches in more:
        entry = dict(model["members"][0]["conditions"][0], branches=branches)
        model["members"].append({"model": name, "conditions": [entry]})
    return model | {"chosen": chosen}


def branch(kind, **parameters):
    return {"kind": kind} | {name: [value] * 5 for name, value in parameters.items()}


UNITS = {"r": "ohm", "tau": "second", "c": "farad"}
HYSTERESIS = branch("hysteresis", m_volt=0.01, charge_ampere_hour=0.05)
SWITCH = branch("switch", m_volt=0.01)
RC = branch("RC", r_ohm=0.01, tau_second=10.0)


def read_back(rows, like):
    """A model file made of nothing but the rows of a look-up table."""

    def column(celsius, name):
        one = [row for row in rows if float(row["ambient_temperature_celsius"]) == celsius]
        return [float(row[name]) for row in one]

    known = sorted({float(row["ambient_temperature_celsius"]) for row in rows})
    pairs = range(1, 1 + sum(name.startswith("tau") for name in rows[0]))
    conditions, curves = [], []
    for celsius in known:
        r = [(column(celsius, f"r{k}_ohm"), column(celsius, f"tau{k}_second")) for k in pairs]
        about = {"ambient_temperature_celsius": celsius, "soc": column(celsius, "soc")}
        rcs = [{"r_ohm": one, "tau_second": tau} for one, tau in r]
        conditions.append(about | {"r0_ohm": column(celsius, "r0_ohm"), "branches": rcs})
        curves.append(about | {"ocv_volt": column(celsius, "ocv_volt")})
    return like | {"ocv": curves, "members": [{"model": "2RC", "conditions": conditions}]}


@pytest.fixture
def exported(tmp_path, monkeypatch):
    """Runs the rule's script on a model; gives the paths of its two outputs."""
    monkeypatch.chdir(tmp_path)

    def run(model, validation=()):
        source = Path("results/models/A.json")
        source.parent.mkdir(parents=True)
        about = {"reason": None, "origin": None, "notes": [], "facts": {}}
        source.write_text(json.dumps(model | {"provenance": about}))
        folder = "results/models/A"
        outputs = {"pybamm": f"{folder}/pybamm_thevenin.json", "lookup": f"{folder}/lookup.csv"}
        outputs["temperature"] = f"{folder}/over_temperature.csv"
        names = ("input", "output", "params", "wildcards", "log")
        lists = [_Named(), _Named(outputs), _Named(code="x"), _Named(cell="A"), ["job.log"]]
        tests = scores(model, validation)
        lists[0] = _Inputs([str(source), *tests], model=str(source), validation=tests)
        job = SimpleNamespace(rule="export", **dict(zip(names, lists, strict=True)))
        runpy.run_path(
            str(ROOT / "scripts" / "models" / "export.py"), init_globals={"snakemake": job}
        )
        return outputs["pybamm"], outputs["lookup"]

    return run


def scores(model, errors):
    """Paths of validation artefacts, one a test, of (rmse_volt of each member, samples)."""
    paths = []
    for number, (rmse, samples) in enumerate(errors):
        path = f"results/stages/validation/A/t{number}.parquet"
        names = [member["model"] for member in model["members"]]
        many = {"soc_anchor": [""], "extrapolated": [0.0], "soc_start": [1.0], "mean_volt": [0.0]}
        many["beyond_volt"] = [0.0]
        columns = {name: values * len(names) for name, values in many.items()}
        columns |= {"model": names, "chosen": [name == model["chosen"] for name in names]}
        columns |= {"rmse_volt": rmse, "rmse_volt_soc_5_95": rmse, "max_abs_volt": rmse}
        columns["samples"] = [samples] * len(names)
        about = {"reason": None, "origin": None, "notes": [], "facts": {}, "params": {}}
        artefact.write(path, columns, about | {"wildcards": {"cell": "A", "test": f"t{number}"}})
        paths.append(path)
    return paths


class _Named(list):
    """Values by position and by name, as Snakemake's are."""

    def __init__(self, values=(), **named):
        named = dict(values, **named)
        super().__init__(named.values())
        self.__dict__.update(named)

    def items(self):
        return self.__dict__.items()

    def get(self, key, default=None):
        return self.__dict__.get(key, default)


class _Inputs(_Named):
    """Inputs of which one name holds several."""

    def __init__(self, paths, **named):
        super().__init__()
        self.extend(paths)
        self.__dict__.update(named)


@pytest.mark.parametrize("celsius", [25.0, 0.0, 12.0])
def test_the_table_read_back_runs_to_the_same_voltage(exported, celsius):
    """At the measured temperatures and between: the file's nine digits are all that is lost."""
    model = family()
    model["members"][0]["conditions"][0]["ocv_shift_volt"] = [0.01, 0.0, -0.01, 0.0, 0.005]
    rows = artefact.load_table(exported(model)[1])
    time, current = truth.drive(np.random.default_rng(1), 4000)
    run = (None, time, current, truth.soc_of(time, current, 0.9), celsius)
    again = simulate_model(read_back(rows, model), *run).voltage_volt
    # Between two temperatures logarithms run straight, and between two knots they do not.
    tolerance = 2e-8 if celsius in (0.0, 25.0) else 1e-4
    np.testing.assert_allclose(again, simulate_model(model, *run).voltage_volt, atol=tolerance)


def distribution():
    """Ten pairs, of which some are nothing at some SoC, and OCV tables read on a scale."""
    model = family()
    rng = np.random.default_rng(7)
    for condition, missing in zip(model["members"][0]["conditions"], (0.0, 0.04), strict=True):
        r = np.maximum(rng.normal(0.002, 0.003, (10, 5)), 0.0)
        condition["branches"] = [
            {"kind": "RC", "r_ohm": one.tolist(), "tau_second": [tau] * 5}
            for one, tau in zip(r, np.geomspace(0.2, 5e3, 10), strict=True)
        ]
        condition["ocv_scale"] = {"missing": missing, "stretch": 0.013}
    return model


@pytest.mark.parametrize("celsius", [25.0, 0.0])
def test_a_distribution_of_relaxation_times_is_read_back_too(exported, celsius):
    model = distribution()
    rows = artefact.load_table(exported(model)[1])
    time, current = truth.drive(np.random.default_rng(1), 4000)
    run = (None, time, current, truth.soc_of(time, current), celsius)
    again = simulate_model(read_back(rows, model), *run).voltage_volt
    np.testing.assert_allclose(again, simulate_model(model, *run).voltage_volt, atol=5e-8)
    capacitances = [float(row[f"c{k}_farad"]) for row in rows for k in range(1, 11)]
    assert np.isfinite(capacitances).all()


def test_pybamm_reads_the_ocv_where_the_model_does():
    """Between its knots too: they are those of the tables, on the scale of the condition."""
    model, soc = distribution(), np.linspace(0.001, 0.999, 777)
    pybamm_tables = pybamm_parameters(model, None, 0.0)
    rested = simulate_model(model, None, 60.0 * np.arange(777), 0 * soc, soc, 0.0).ocv_volt
    volt = np.interp(soc, pybamm_tables["soc"], pybamm_tables["ocv_volt"])
    np.testing.assert_allclose(volt, rested, rtol=0, atol=1e-9)
    assert np.abs(rested - np.interp(soc, truth.OCV_SOC, truth.OCV_VOLT)).max() > 0.01
    assert min(np.min(one["r_ohm"]) for one in pybamm_tables["elements"]) > 0


def test_the_table_holds_units_and_says_where_it_extrapolates(exported):
    path = exported(family())[1]
    header = next(csv.reader(Path(path).read_text().splitlines()))
    assert header[:4] == [
        *("model", "chosen", "validation_rmse_volt", "chosen_validation_rmse_volt")
    ]
    assert header[4:9] == [
        *("ambient_temperature_celsius", "soc", "ocv_volt", "extrapolated", "r0_ohm")
    ]
    assert header[9:] == [f"{name}{k}_{unit}" for k in (1, 2) for name, unit in UNITS.items()]
    for row in artefact.load_table(path):
        outside = not 0.1 <= float(row["soc"]) <= 0.9
        assert row["extrapolated"] == str(outside)
        tau = float(row["r2_ohm"]) * float(row["c2_farad"])
        assert tau == pytest.approx(float(row["tau2_second"]), rel=1e-7)


def test_pybamm_tables_are_our_look_up_at_their_knots():
    pybamm_tables = pybamm_parameters(family(), None, 0.0)
    soc = pybamm_tables["soc"]
    np.testing.assert_allclose(pybamm_tables["r0_ohm"], 2.5 * np.interp(soc, truth.KNOTS, truth.R0))
    np.testing.assert_allclose(
        pybamm_tables["ocv_volt"], np.interp(soc, truth.OCV_SOC, truth.OCV_VOLT), rtol=1e-12
    )
    assert pybamm_tables["identified_soc"] == [0.1, 0.9]
    assert [one["kind"] for one in pybamm_tables["elements"]] == ["RC", "RC"]
    np.testing.assert_allclose(pybamm_tables["elements"][1]["tau_second"], 150.0)


def test_linear_kinds_become_rc_pairs_with_the_same_voltage():
    from cellwright.circuits.cell import simulate
    from cellwright.circuits.circuit import Branch, rc_circuit

    warburg = branch("warburg", r_ohm=0.02, tau_second=300.0)
    pybamm_tables = pybamm_parameters(family(("w", [RC, warburg])), "w", 25.0)
    pairs = [(one["r_ohm"][0], one["tau_second"][0]) for one in pybamm_tables["elements"]]
    time = np.cumsum(np.geomspace(1e-2, 1e3, 60))
    current = np.random.default_rng(1).normal(size=60)
    circuit = (
        *rc_circuit(pybamm_tables["r0_ohm"][0], [0.01], [10.0]),
        Branch("warburg", {"r_ohm": 0.02, "tau_second": 300.0}),
    )
    plain = rc_circuit(pybamm_tables["r0_ohm"][0], *zip(*pairs, strict=True))
    one, other = (simulate(c, time, current, 3.7, hold="first_order") for c in (plain, circuit))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_what_pybamm_cannot_run_is_named_and_the_others_are_exported(exported):
    more = [("h", [RC, HYSTERESIS]), ("s", [RC, SWITCH]), ("d", [DIFFUSION])]
    document = artefact.load(exported(family(*more, chosen="s"))[0])
    assert [member["model"] for member in document["members"]] == ["2RC", "h"]
    assert [t["temperature_celsius"] for t in document["members"][0]["tables"]] == [0.0, 25.0]
    assert "remembers at rest" in document["refused"]["s"]
    assert "plane sheet" in document["refused"]["d"]
    log = Path("job.log").read_text()
    assert "s is not exported" in log
    assert "the look-up table holds 2RC: s is more than RC pairs" in log


DIFFUSION = branch("diffusion", soc_per_ampere=0.01, tau_second=900.0)


def test_who_stands_for_the_chosen_member_is_said_with_the_validation_error_of_both(exported):
    """Over all tests together: 10 and 20 mV of 300 and 100 samples are 13.2 mV."""
    model = family(("h", [RC, HYSTERESIS]), ("d", [DIFFUSION]), chosen="d")
    for member, left_out in zip(model["members"], (3e-3, 1e-3, 5e-4), strict=True):
        member["left_out_rmse_volt"] = left_out
    errors = [([0.010, 0.004, 0.002], 300), ([0.020, 0.004, 0.002], 100)]
    pybamm, lookup = exported(model, errors)
    row = artefact.load_table(lookup)[0]
    assert (row["model"], row["chosen"]) == ("2RC", "d")
    plain = float(np.sqrt((300 * 0.01**2 + 100 * 0.02**2) / 400))
    assert float(row["validation_rmse_volt"]) == pytest.approx(plain)
    assert float(row["chosen_validation_rmse_volt"]) == pytest.approx(0.002)
    document = artefact.load(pybamm)
    assert (document["exported"], document["chosen"]) == ("h", "d")
    assert document["members"][1]["validation_rmse_volt"] == pytest.approx(0.004)
    assert document["refused_validation_rmse_volt"]["d"] == pytest.approx(0.002)
    log = Path("job.log").read_text()
    assert "is more than RC pairs (validation error: 2RC 13.2 mV, d 2 mV)" in log
    assert "PyBaMM's loader takes h: d is refused (validation error: h 4 mV, d 2 mV)" in log


def test_a_particle_in_use_is_what_pybamm_gets_and_every_table_names_it():
    errors = [{"model": "2RC", "rmse_volt": 0.012}, {"model": "P", "rmse_volt": 0.005}]
    found = export_model(in_use(family()), validation=[row | {"samples": 9} for row in errors])
    document = found.pybamm
    assert (document["chosen"], document["exported"]) == ("P", "P")
    held = {member["model"]: member for member in document["members"]}
    assert held["P"]["validation_rmse_volt"] == pytest.approx(0.005)
    (tables,) = held["P"]["tables"]
    assert tables["numbers"]["transfer_scale"] == pytest.approx(2.0)
    assert tables["courses"]["r0_ohm"]["value"] == pytest.approx([0.02] * 4)
    assert (tables["shell_faces"][0], tables["shell_faces"][-1]) == (0.0, 1.0)
    assert set(found.lookup["chosen"]) == {"P"}
    assert set(found.lookup["model"]) == set(found.temperature["model"]) == {"2RC"}
    assert found.lookup["chosen_validation_rmse_volt"][0] == pytest.approx(0.005)
    text = "\n".join(found.notes)
    both = "validation error: 2RC 12 mV, P 5 mV"
    assert f"the look-up table holds 2RC: P is more than RC pairs ({both})" in text
    assert f"the table over temperature holds 2RC: P is no circuit ({both})" in text
    assert "PyBaMM discretises the sphere of P itself" in text
    assert "P is refused" not in text


def test_a_particle_that_is_not_in_use_is_there_but_not_taken():
    model = in_use(family())
    model["particle"]["in_use"] = False
    document = export_model(model).pybamm
    assert (document["chosen"], document["exported"]) == ("2RC", "2RC")
    assert [member["model"] for member in document["members"]] == ["2RC", "P"]


PAGE = (ROOT / "docs" / "exports.md").read_text(encoding="utf-8")
(EXAMPLE,) = re.findall(r"^```python\n(import pybamm\n.*?)^```", PAGE, re.M | re.S)


PYBAMM = find_spec("pybamm") is not None


class _Stand(SimpleNamespace):
    """What the example needs of PyBaMM where it is not installed: values are numbers."""

    def __init__(self):
        super().__init__(Interpolant=lambda soc, values, at: np.interp(at, soc, values))
        self.BaseModel = object
        self.sqrt, self.arcsinh, self.Simulation = np.sqrt, np.arcsinh, self.simulation
        self.equivalent_circuit = SimpleNamespace(Thevenin=self.thevenin)

    def thevenin(self, options):
        return SimpleNamespace(options=options, default_parameter_values=_Values())

    def simulation(self, model, parameter_values):
        return SimpleNamespace(solve=lambda span: (model, parameter_values))


class _Values(dict):
    def update(self, new, *, check_already_exists):
        super().update(new)


@pytest.mark.parametrize(
    "chosen",
    ["2RC", "d", pytest.param("P", marks=pytest.mark.skipif(not PYBAMM, reason="no PyBaMM here"))],
)
def test_the_example_of_the_page_runs_as_printed_on_what_is_exported(exported, monkeypatch, chosen):
    """By PyBaMM where it is installed, else by a stand-in that reads the same keys."""
    particle = chosen == "P"
    model = family(("d", [DIFFUSION]), chosen="2RC" if particle else chosen)
    path = Path(exported(in_use(model) if particle else model)[0])
    named = Path(re.search(r'load\("(.*?)"', EXAMPLE)[1])
    named.parent.mkdir(parents=True)
    named.write_bytes(path.read_bytes())
    if not PYBAMM:
        monkeypatch.setitem(sys.modules, "pybamm", _Stand())
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "examples"))
    monkeypatch.delitem(sys.modules, "thevenin", raising=False)
    names = {}
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        exec(compile(EXAMPLE, "docs/exports.md", "exec"), names)
    said = [str(one.message) for one in warned if "in place of" in str(one.message)]
    assert [one[:31] for one in said] == (
        ["2RC in place of d (not validate"] if chosen == "d" else []
    )
    values = names["values"]
    assert values["Cell capacity [A.h]"] == truth.CAPACITY_AMPERE_HOUR
    if not PYBAMM:
        ohm = values["R1 [Ohm]"](25.0, -1.0, truth.KNOTS)
        np.testing.assert_allclose(ohm, truth.R[0])
    else:
        assert names["solution"].t[-1] == 1800


def test_a_condition_of_unknown_temperature_is_exported_as_such(exported):
    model = truth.model()
    for entry in (model["ocv"][0], model["members"][0]["conditions"][0]):
        entry["ambient_temperature_celsius"] = None
    document, table = exported(model)
    assert artefact.load(document)["members"][0]["tables"][0]["temperature_celsius"] is None
    assert artefact.load_table(table)[0]["ambient_temperature_celsius"] == ""


def test_refusals():
    only = family(("h", [HYSTERESIS]), chosen="h")
    only["members"] = only["members"][1:]
    with pytest.raises(Refusal, match="h holds more than RC pairs"):
        lookup_table(only, "h")
    with pytest.raises(Refusal, match="cannot run switch: none of its elements remembers"):
        pybamm_parameters(family(("s", [SWITCH])), "s", 25.0)
    assert pybamm_document(only)["refused"] == {}
