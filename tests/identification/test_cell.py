"""A cell's model from its own tests: the truth back, what displaces what, what is not fitted."""

import json

import numpy as np
import pytest
import truth
from sheets_facts import cell_facts, measured_test
from synthetic import diffusion

from cellwright.circuits.temperature import resistance_factor
from cellwright.identification import cell
from cellwright.identification.cell import identify
from cellwright.refusal import Refusal

CELL = cell_facts()
SETTINGS = {"members": ["1RC", "2RC"], "split_rest_second": 120.0}


def curve(volt=truth.OCV_VOLT, celsius=25.0, branches="both", discharge_ampere=None):
    return {
        "test": "ocv",
        "ambient_temperature_celsius": celsius,
        "soc": truth.OCV_SOC.tolist(),
        "ocv_volt": volt.tolist(),
        "branches": branches,
        "discharge_current_ampere": discharge_ampere,
    }


def basis(*curves):
    content = {"capacity_ampere_hour": truth.CAPACITY_AMPERE_HOUR, "borrowed_from": None}
    return content | {"ocv": [curve()] if not curves else list(curves)}


def pulses():
    """Set points 15 % apart with a long discharge, a rest and two pulses at each."""
    cycle = np.zeros(1900)
    cycle[:1080], cycle[1600:1630], cycle[1750:1780] = -1.0, -3.0, 2.0
    current = np.concatenate([np.zeros(60), np.tile(cycle, 6)])
    return np.arange(0.0, len(current)), current


def fit_test(
    name="hppc",
    kind="hppc",
    *,
    course=None,
    celsius=25.0,
    role="fit",
    cycle=None,
    scale=1.0,
    branches=(),
    seed=1,
):
    time, current = pulses() if course is None else course
    soc = truth.soc_of(time, current, 1.0)
    ocv = np.interp(soc, truth.OCV_SOC, truth.OCV_VOLT)
    noise = np.random.default_rng(seed).normal(0, 2e-4, len(time))
    volt = ocv + scale * (truth.voltage(time, current, soc, extra=branches) - ocv) + noise
    charge = (soc - soc[0]) * truth.CAPACITY_AMPERE_HOUR
    series = {"test_time_second": time, "current_ampere": current, "voltage_volt": volt}
    facts = {"celsius": celsius, "soc": 1.0, "role": role, "cycle": cycle}
    return measured_test(series | {"charge_ampere_hour": charge}, name, kind, **facts)


def drive(name="drive", **change):
    return fit_test(name, "drive", course=truth.drive(np.random.default_rng(3), 4500), **change)


def chosen(model):
    return next(member for member in model["members"] if member["model"] == model["chosen"])


@pytest.fixture(scope="module")
def hppc():
    return identify(CELL, basis(), [fit_test(), drive()], **SETTINGS).content


def test_pulses_give_the_true_cell(hppc):
    (entry,) = chosen(hppc)["conditions"]
    soc = np.array(entry["soc"])
    inner = (soc > 0.25) & (soc < 0.85)
    true = np.interp(soc, truth.KNOTS, truth.R0)
    np.testing.assert_allclose(np.array(entry["r0_ohm"])[inner], true[inner], rtol=0.05)
    total = np.sum([branch["r_ohm"] for branch in entry["branches"]], axis=0)
    true = np.interp(soc, truth.KNOTS, truth.R.sum(axis=0))
    np.testing.assert_allclose(total[inner], true[inner], rtol=0.25)
    assert hppc["chosen"] == "2RC"
    assert hppc["capacity_ampere_hour"] == truth.CAPACITY_AMPERE_HOUR


def test_pulses_displace_drives(hppc):
    (entry,) = chosen(hppc)["conditions"]
    assert entry["tests"] == ["hppc"]
    assert hppc["kind"] == "hppc"


def test_where_the_soc_is_counted_from_is_said_unless_stated(hppc):
    """The record starts at rest, full: its first voltage tells by the OCV table."""
    assert [note for note in hppc["notes"] if not note.startswith("longest time constant")] == []
    test = fit_test()
    unstated = test._replace(facts=test.facts._replace(soc=None))
    model = identify(CELL, basis(), [unstated], **SETTINGS | {"members": ["1RC"]}).content
    assert model["notes"][0] == "hppc: SoC by rest voltage at the start, by the OCV table"


def test_drives_serve_where_there_are_no_pulses():
    model = identify(CELL, basis(), [drive()], **SETTINGS | {"members": ["2RC"]}).content
    (entry,) = chosen(model)["conditions"]
    true = np.interp(entry["soc"], truth.KNOTS, truth.R0)
    np.testing.assert_allclose(entry["r0_ohm"], true, rtol=0.05)
    assert (model["kind"], model["chosen"]) == ("drive", "2RC")


def test_of_a_split_drive_only_odd_blocks_are_fitted():
    """The even blocks may hold anything: the fit does not see them."""
    settings = SETTINGS | {"members": ["1RC", "DRT+H+K"]}
    clean = drive(role="split")
    volt = clean.series["voltage_volt"].copy()
    volt[(clean.series["test_time_second"] // 1500) % 2 == 1] += 0.3
    spoiled = clean._replace(series=clean.series | {"voltage_volt": volt})
    first, second = (
        identify(CELL, basis(), [test], **settings).content for test in (clean, spoiled)
    )
    assert json.dumps(first) == json.dumps(second)
    whole = spoiled._replace(facts=spoiled.facts._replace(role="fit"))
    assert identify(CELL, basis(), [whole], **settings).content["members"] != first["members"]


def test_each_temperature_is_a_condition_of_its_own():
    tests = [
        fit_test("cold", celsius=0.0, scale=3.0),
        fit_test("warm", seed=2),
        fit_test("lab", celsius=24),
    ]
    model = identify(CELL, basis(), tests, **SETTINGS | {"members": ["1RC"]}).content
    cold, warm = chosen(model)["conditions"]
    assert (cold["tests"], warm["tests"]) == (["cold"], ["lab", "warm"])
    ratio = np.mean(cold["r0_ohm"]) / np.mean(warm["r0_ohm"])
    assert ratio == pytest.approx(3.0, rel=0.05)
    assert [table["ambient_temperature_celsius"] for table in model["ocv"]] == [0.0, 24.0]


def test_later_check_ups_are_not_mixed_into_the_fit():
    """A drive of the first check-up goes before pulses of the second, and it is said."""
    tests = [fit_test("aged", cycle=500, scale=2.0), drive("young", cycle=0)]
    of_scale = {"capacity_std_ampere_hour": 0.1, "capacity_source": "slow test ocv"}
    doubted = basis() | of_scale | {"capacity_doubt": "its clock jumps"}
    model = identify(CELL, doubted, tests, **SETTINGS | {"members": ["1RC"]}).content
    assert chosen(model)["conditions"][0]["tests"] == ["young"]
    assert model["kind"] == "drive"
    assert model["notes"][0] == "not fitted, of a later check-up: aged"
    said = "its SoC scale stands on a record in doubt (slow test ocv: its clock jumps), by 0.1 Ah"
    assert model["notes"][1].startswith(said)


def test_without_a_chamber_temperature_the_surface_tells():
    test = fit_test(celsius=None)
    surface = np.full(len(test.series["voltage_volt"]), 37.0)
    warm = test._replace(series=test.series | {"surface_temperature_celsius": surface})
    settings = SETTINGS | {"members": ["1RC"]}
    for tests, celsius in (([warm], 37.0), ([test], 25.0)):
        model = identify(CELL, basis(curve(celsius=None)), tests, **settings).content
        assert chosen(model)["conditions"][0]["ambient_temperature_celsius"] == celsius


def test_the_drop_of_a_single_slow_branch_is_put_back():
    resistance = np.interp(truth.OCV_SOC, truth.KNOTS, truth.R0 + truth.R.sum(axis=0))
    slow = curve(truth.OCV_VOLT - 0.1 * resistance, branches="discharge", discharge_ampere=-0.1)
    model = identify(CELL, basis(slow), [fit_test()], **SETTINGS).content
    soc, ocv_volt = (np.array(model["ocv"][0][name]) for name in ("soc", "ocv_volt"))
    inner = (soc > 0.25) & (soc < 0.85)
    np.testing.assert_allclose(
        ocv_volt[inner], np.interp(soc, truth.OCV_SOC, truth.OCV_VOLT)[inner], atol=1.5e-3
    )


def test_a_curve_from_rests_is_taken_as_it_is():
    """No current flowed: there is no drop to put back."""
    rests = curve(truth.OCV_VOLT, branches="rests", discharge_ampere=-0.1)
    model = identify(CELL, basis(rests), [fit_test()], **SETTINGS | {"members": ["1RC"]}).content
    assert model["ocv"][0]["branches"] == "rests"
    soc, ocv_volt = (np.array(model["ocv"][0][name]) for name in ("soc", "ocv_volt"))
    np.testing.assert_allclose(ocv_volt, np.interp(soc, truth.OCV_SOC, truth.OCV_VOLT), atol=1e-9)


def still(name="still", *, celsius=0.0):
    rest = np.arange(0.0, 3000.0), np.zeros(3000)
    return fit_test(name, course=rest, celsius=celsius)


def test_a_condition_that_cannot_be_identified_costs_only_itself():
    settings = SETTINGS | {"members": ["1RC"]}
    model = identify(CELL, basis(), [fit_test(), still()], **settings).content
    assert len(chosen(model)["conditions"]) == 1
    assert any(note.startswith("not identified at 0 °C: the current") for note in model["notes"])
    with pytest.raises(Refusal, match="not identified at 0 °C: the current never changes"):
        identify(CELL, basis(), [still()], **SETTINGS)


def test_a_condition_of_a_few_rows_costs_only_itself():
    """It excites the cell, but carries no model: neither it nor its activation energy counts."""
    short = np.arange(0.0, 8.0), np.array([0, 0, -1.0, -1.0, 0, 0, 0, 0])
    tests = [fit_test(), fit_test("short", course=short, celsius=0.0)]
    model = identify(CELL, basis(), tests, **SETTINGS).content
    alone = identify(CELL, basis(), tests[:1], **SETTINGS).content
    assert model["members"] == alone["members"]
    assert any(note.startswith("1RC not identified at 0 °C: ") for note in model["notes"])


def test_a_member_that_cannot_be_fitted_costs_only_itself(hppc):
    names = ["1RC", "7RC", "2RC"]
    model = identify(CELL, basis(), [fit_test(), drive()], **SETTINGS | {"members": names}).content
    assert model["members"] == hppc["members"]
    assert any("7RC not identified at 25 °C: model '7RC'" in note for note in model["notes"])
    with pytest.raises(Refusal, match="model 'ESC' is unknown"):
        identify(CELL, basis(), [fit_test()], **SETTINGS | {"members": ["ESC"]})


def test_the_file_holds_what_its_schema_says(hppc):
    assert json.loads(json.dumps(hppc, allow_nan=False)) == hppc
    assert hppc["schema"] == "cellwright-model/2"
    assert [member["model"] for member in hppc["members"]] == ["1RC", "2RC"]
    errors = [member["left_out_rmse_volt"] for member in hppc["members"]]
    assert 0 < errors[1] < errors[0]
    (entry,) = chosen(hppc)["conditions"]
    assert entry["activation_energy_joule_per_mole"] is None  # no cell warmed
    assert [branch["kind"] for branch in entry["branches"]] == ["RC", "RC"]


def test_that_warming_changes_nothing_is_known_and_not_unknown(monkeypatch):
    monkeypatch.setattr(cell, "activation_of", lambda *a, **b: ([0.0], "told"))
    model = identify(CELL, basis(), [fit_test()], **SETTINGS | {"members": ["1RC"]}).content
    (entry,) = chosen(model)["conditions"]
    assert entry["activation_energy_joule_per_mole"] == 0.0


def test_every_member_has_the_same_branches_at_every_temperature():
    """So that a look-up can mix them: time constants of a distribution, and the diffusion time."""
    tests = [
        fit_test("cold", celsius=0.0, scale=2.0, branches=(diffusion(2000.0),)),
        fit_test("warm", branches=(diffusion(2000.0),)),
    ]
    model = identify(CELL, basis(), tests, **SETTINGS | {"members": ["DRT+H+K+D"]}).content
    cold, warm = chosen(model)["conditions"]
    kinds = [[branch["kind"] for branch in entry["branches"]] for entry in (cold, warm)]
    assert kinds[0] == kinds[1]
    assert {"kinetic", "RC", "diffusion", "hysteresis"} == set(kinds[0])
    for one, other in zip(cold["branches"], warm["branches"], strict=True):
        if one["kind"] in ("RC", "kinetic"):
            assert one["tau_second"][0] == pytest.approx(other["tau_second"][0])
    energy = warm["activation_energy_joule_per_mole"]
    assert energy == pytest.approx(8.314 * np.log(2) / (1 / 273.15 - 1 / 298.15), rel=0.1)
    times = [
        next(b["tau_second"][0] for b in entry["branches"] if b["kind"] == "diffusion")
        for entry in (cold, warm)
    ]
    if times[1] > 1.0:
        assert times[0] / times[1] == pytest.approx(resistance_factor(0.0, 25.0, energy), rel=0.01)


def test_without_an_ocv_there_is_no_model():
    with pytest.raises(Refusal, match="no OCV curve"):
        identify(CELL, basis() | {"ocv": []}, [fit_test()], **SETTINGS)


def test_the_same_record_under_two_names_is_fitted_once():
    one, again = fit_test("one"), fit_test("again")
    model = identify(CELL, basis(), [one, again], **SETTINGS).content
    (entry,) = model["members"][0]["conditions"]
    assert entry["tests"] == ["one"]
    assert any("again" in note and "same measurement as one" in note for note in model["notes"])
