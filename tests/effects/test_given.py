"""A model whose voltage is given: what it lacks is named, and nothing where it lacks nothing."""

from functools import cache

import numpy as np
import pytest
from quick import slow_but
from small_plant import CAPACITY, CELL, HEALTHY, Truth, drive, laid, measured
from small_plant import simulated as plant

from cellwright.circuits.exports import pybamm_document
from cellwright.circuits.model_file import member_of, plain_member, simulate_model
from cellwright.circuits.parameters import parameter_rows
from cellwright.effects.finding import of_case
from cellwright.effects.given.case import own_case
from cellwright.effects.given.external import external_case
from cellwright.effects.given.member import name_with_effects, own_member, with_own_effects
from cellwright.effects.library import LIBRARY
from cellwright.effects.member import effect_member
from cellwright.effects.preparing import Prepared
from cellwright.filters.evaluate import _circuit_alone
from cellwright.refusal import Refusal

LACKING = {
    "resistance_temperature": Truth(activation=2.5e4),
    "self_heating": Truth(thermal=6.0),
    "resistance_asymmetry": Truth(asymmetry=0.3),
}
QUICK = "resistance_temperature"
# Two drives to fit and two for proof, at two temperatures; a short case, as each search is whole.
DRIVES = {"cold": (101, 8.0), "warm": (102, 34.0), "wild": (103, 8.0), "mild": (104, 34.0)}
ROWS = 1000


@cache
def records(truth, given=HEALTHY):
    """Records of a cell, each with the voltage of another that stands for a simulator."""
    made = []
    for number, (test, (seed, celsius)) in enumerate(DRIVES.items()):
        current = drive(seed, rows=ROWS)
        record = measured(test, current, celsius, 0.95, truth, seed=10 + number)
        warm = np.repeat(record.celsius, 4)
        volts = plant(np.repeat(current, 4), warm, 0.95, given)[::4]
        made.append(record._replace(simulated_volt=volts, soc=counted(record.current_ampere)))
    return tuple(made[:2]), tuple(made[2:])


def counted(current):
    """SoC by the current of the row before, from 95 % [1]."""
    return 0.95 + np.cumsum(np.r_[0.0, current[:-1]]) * 2.0 / 3600 / CAPACITY


def prepared(truth, given=HEALTHY):
    fitted, judging = records(truth, given)
    return Prepared(laid(fitted, judging), (fitted, judging), ())


@cache
def searched_external(truth, given=HEALTHY):
    case = external_case(prepared(truth, given))
    return of_case("A", case, LIBRARY, base_name="external").verdict


@pytest.mark.parametrize("effect", slow_but(QUICK, LACKING))
def test_what_a_simulator_lacks_is_named_alone(effect):
    verdict = searched_external(LACKING[effect])
    assert verdict["verdict"] == "named"
    assert [one["effect"] for one in verdict["effects"]] == [effect]
    errors = verdict["validation_rmse_volt"]
    assert errors["after"] < 0.6 * errors["before"]
    assert verdict["paragraph"].startswith("Your model lacks ")


def test_its_size_is_that_of_the_cell_and_not_of_the_companion():
    (found,) = searched_external(LACKING["resistance_temperature"])["effects"]
    size = found["parameters"]["activation_energy_joule_per_mole"]
    assert abs(size["value"] - 2.5e4) < max(3 * size["std"], 3e3)


@pytest.mark.parametrize("truth", [HEALTHY, *LACKING.values()], ids=["healthy", *LACKING])
def test_a_simulator_that_has_all_of_it_lacks_nothing(truth):
    verdict = searched_external(truth, truth)
    assert verdict["verdict"] == "none"
    assert "your model is off by" in verdict["paragraph"]
    assert verdict["validation_rmse_volt"]["before"] == pytest.approx(1.5e-3, rel=0.1)


def test_its_error_as_it_is_is_told_before_anything_is_freed():
    """Of a simulator that is off by a wave over the time, which no companion holds."""
    fitted, judging = (
        tuple(
            record._replace(simulated_volt=record.simulated_volt + wave(record)) for record in side
        )
        for side in records(HEALTHY)
    )
    case = external_case(Prepared(laid(fitted, judging), (fitted, judging), ()))
    told = of_case("A", case, {}, base_name="external").verdict
    for role, side in (("fit", fitted), ("validation", judging)):
        error = np.concatenate([record.voltage_volt - record.simulated_volt for record in side])
        wanted = np.sqrt(np.mean(error**2))
        assert told["as_given_rmse_volt"][role] == pytest.approx(wanted, rel=0.02)
    assert "As it is, with no parameter freed, it is off by 14" in told["paragraph"]


def wave(record):
    return 0.02 * np.sin(record.test_time_second / 40.0)


def family():
    """A model file of one member of the family, the plain circuit as the simulator has it."""
    logs = {"log_r0": 0.026, "log_r1": 0.011, "log_r2": 0.013, "log_tau1": 9.0, "log_tau2": 150.0}
    values = {name: float(np.log(value)) for name, value in logs.items()} | {"capacity": 0.0}
    values |= {f"ocv[{k}]": 0.0 for k in range(16)}
    grid = np.linspace(0.0, 1.0, len(CELL.ocv_volt))
    plain = {"capacity_ampere_hour": CAPACITY, "ocv_soc": grid.tolist(), "values": values}
    plain |= {
        "ocv_volt": CELL.ocv_volt.tolist(),
        "hold": "zero_order",
        "effects": [],
        "start_shift_soc": 0.0,
    }
    table = {"soc": grid.tolist(), "ocv_volt": plain["ocv_volt"]}
    model = {"cell": "A", "capacity_ampere_hour": CAPACITY, "kind": "drive", "notes": []}
    model |= {"ocv": [table | {"ambient_temperature_celsius": 25.0}], "chosen": "2RC"}
    member = effect_member(plain, model, [8.0, 34.0])
    for condition in member["conditions"]:
        condition |= {"fit_rmse_volt": 2e-3, "samples": 10}
    member = {name: member[name] for name in ("conditions", "hold")} | {"model": "2RC"}
    return model | {"choice": "the only one", "members": [member | {"left_out_rmse_volt": 2e-3}]}


ROWS_OF_CHOICE = [{"model": "2RC", "chosen": True, "reason": "the only one"}]


@cache
def found_own(effect):
    """(Finding, its model) of what the member lacks."""
    case, given = own_case(prepared(LACKING[effect]), family())
    finding = of_case("A", case, LIBRARY, base_name="own", split_rest_second=120.0)
    return finding, finding.model | {"given": given}


@pytest.mark.parametrize("effect", slow_but(QUICK, LACKING))
def test_what_the_member_lacks_is_named_and_used(effect):
    finding, found = found_own(effect)
    assert [one["effect"] for one in finding.verdict["effects"]] == [effect]
    model, rows = with_own_effects(family(), ROWS_OF_CHOICE, found)
    assert model["chosen"] == "2RC+own_effects"
    assert [row["chosen"] for row in rows] == [False] + [True] * (len(rows) - 1)
    assert "chosen: better beyond chance" in model["choice"]


@pytest.mark.parametrize("effect", slow_but(QUICK, LACKING))
def test_the_model_file_has_the_voltage_that_the_search_found(effect):
    """On the drives for proof, which neither was fitted to, from the stated SoC."""
    finding, found = found_own(effect)
    model, _ = with_own_effects(family(), ROWS_OF_CHOICE, found)
    errors = {}
    for record in records(LACKING[effect])[1]:
        columns = record.test_time_second, record.current_ampere, record.soc, record.celsius
        for name in ("2RC", "2RC+own_effects"):
            volt = simulate_model(model, name, *columns, kind="drive").voltage_volt
            errors.setdefault(name, []).append(record.voltage_volt - volt)
    rms = {name: np.sqrt(np.mean(np.square(parts))) for name, parts in errors.items()}
    after = finding.verdict["validation_rmse_volt"]["after"]
    assert rms["2RC+own_effects"] == pytest.approx(after, abs=0.7e-3)
    assert rms["2RC+own_effects"] < 0.7 * rms["2RC"]


@pytest.mark.slow
def test_a_member_that_lacks_nothing_stays_as_it_is():
    case, given = own_case(prepared(HEALTHY), family())
    finding = of_case("A", case, LIBRARY, base_name="own", split_rest_second=120.0)
    assert finding.verdict["verdict"] == "none"
    model, rows = with_own_effects(family(), ROWS_OF_CHOICE, finding.model | {"given": given})
    assert (model, rows) == (family(), ROWS_OF_CHOICE)
    assert with_own_effects(family(), ROWS_OF_CHOICE, None) == (family(), ROWS_OF_CHOICE)
    # Nor does what is in the model without a name, too small for anyone to act on.
    small = finding.model | {"given": given, "effects": ["resistance_soc"]}
    assert with_own_effects(family(), ROWS_OF_CHOICE, small) == (family(), ROWS_OF_CHOICE)


def worse(found, factor):
    """The same effects, whose errors on blocks left out are those of the member times a factor."""
    blocks = [
        block | {"square_volt2": block["square_volt2"] | {"left_out": factor * member}}
        for block in found["blocks"]
        for member in [block["square_volt2"]["member"]]
    ]
    return found | {"blocks": blocks}


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 1.2, 9.0])
def test_effects_that_help_no_block_left_out_are_never_used(factor):
    model, rows = with_own_effects(
        family(), ROWS_OF_CHOICE, worse(found_own("self_heating")[1], factor)
    )
    assert model["chosen"] == "2RC"
    assert [row["model"] for row in rows if row["chosen"]] == ["2RC"]
    assert "2RC+own_effects not chosen: not better than 2RC beyond chance" in model["choice"]
    assert member_of(model, "2RC+own_effects")["of"] == "2RC"


@pytest.mark.slow
def test_one_bad_temperature_keeps_them_out():
    found = worse(found_own("self_heating")[1], 0.2)
    cold = [block for block in found["blocks"] if block["test"] == "cold"]
    for block in cold:
        block["square_volt2"]["left_out"] = 1.6 * block["square_volt2"]["member"]
    model, _ = with_own_effects(family(), ROWS_OF_CHOICE, found)
    assert model["chosen"] == "2RC"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"chosen": "1RC"}, "effects of 2RC were found, the chosen member is another"),
        ({"effects": ["leakage"]}, "2RC holds the effects of another search already"),
        ({"blocks": []}, "the records fitted are one block"),
    ],
)
def test_what_cannot_be_added_is_refused_with_a_note(change, words):
    model, found = family(), found_own("self_heating")[1]
    found = found | {"blocks": change.get("blocks", found["blocks"])}
    model["chosen"] = change.get("chosen", "2RC")
    if "effects" in change:
        model["members"][0]["effects"] = change["effects"]
    with pytest.raises(Refusal, match=words):
        own_member(found, model)
    model, rows = with_own_effects(model, ROWS_OF_CHOICE, found)
    assert words in model["notes"][-1]
    assert rows == ROWS_OF_CHOICE


def test_names_of_plain_and_own_searches_never_clash():
    assert name_with_effects("DRT+H") == "DRT+H+effects"
    assert name_with_effects("2RC") == "2RC+own_effects"


def test_tables_filters_and_packs_know_what_stands_beside_the_circuit():
    model, _ = with_own_effects(family(), ROWS_OF_CHOICE, found_own("resistance_temperature")[1])
    rows = [row for row in parameter_rows(model) if row["model"] == model["chosen"]]
    sizes = {row["parameter"]: row for row in rows if row["soc"] is None}
    energy = sizes["resistance_temperature.activation_energy_joule_per_mole"]
    assert (energy["unit"], energy["at_bound"]) == ("J/mol", False)
    assert energy["value"] == pytest.approx(2.5e4, rel=0.3)
    assert plain_member(model) == "2RC"
    alone, notes = _circuit_alone(model)
    assert alone["chosen"] == "2RC"
    assert "filters run 2RC" in notes[0]


@pytest.mark.parametrize("effect", slow_but(QUICK, [QUICK, "resistance_asymmetry"]))
def test_pybamm_gets_the_sum_of_the_three_circuits(effect):
    """A constant discharge, run by hand on the exported elements."""
    model, _ = with_own_effects(family(), ROWS_OF_CHOICE, found_own(effect)[1])
    document = pybamm_document(model)
    assert document["refused"] == {}
    tables = {t["temperature_celsius"]: t for t in document["members"][-1]["tables"]}[8.0]
    time, current = np.arange(0.0, 600.0, 1.0), np.full(600, -CAPACITY)
    moved = np.cumsum(np.r_[0.0, current[:-1]]) / 3600
    soc = 0.8 + moved / tables["capacity_ampere_hour"]
    volt = np.interp(soc, tables["soc"], tables["ocv_volt"])
    volt += np.interp(soc, tables["soc"], tables["r0_ohm"]) * current
    for element in tables["elements"]:
        volt += run_by_hand(element, tables["soc"], soc, current)
    run = simulate_model(model, None, time, current, 0.8 + moved / CAPACITY, 8.0, kind="drive")
    assert np.abs(run.voltage_volt - volt)[5:].max() < 1.5e-3


def run_by_hand(element, grid, soc, current):
    """Voltage over an exported element in steps of a second [V]."""
    at = {n: np.interp(soc, grid, v) for n, v in element.items() if n != "kind"}
    if element["kind"] == "R_two_way":
        return current * np.where(current > 0, at["r_charge_ohm"], at["r_discharge_ohm"])
    volt = np.zeros(len(soc))
    for k in range(1, len(soc)):
        share = -np.expm1(-1.0 / at["tau_second"][k])
        volt[k] = volt[k - 1] + share * (at["r_ohm"][k] * current[k - 1] - volt[k - 1])
    return volt
