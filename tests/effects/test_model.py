"""A found model as a member of the cell's model: the same voltages, on records of its own."""

from copy import deepcopy
from functools import cache

import numpy as np
import pytest
from sheets_facts import cell_facts, measured_test

from cellwright.circuits.exports import pybamm_document
from cellwright.circuits.instrument import words_of
from cellwright.circuits.model_file import is_plain, simulate_model
from cellwright.circuits.parameters import parameter_rows
from cellwright.effects import base
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.member import (
    KNOTS,
    NAME,
    effect_member,
    finished,
    temperatures,
    with_effects,
)
from cellwright.effects.records import stacked
from cellwright.filters.bank import bank_of
from cellwright.identification.cell import identify
from cellwright.identification.in_use import fitted_records
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

CAPACITY = 2.0
TO_FULL = "log_diffusivity_to_full"
SOC = np.linspace(0.0, 1.0, 201)
OCV = 3.3 + 0.8 * SOC + 0.05 * np.sin(6 * SOC)
CELL = base.Cell(CAPACITY, OCV)
PLAIN = {"log_r0": np.log(0.03), "log_r1": np.log(0.01), "log_r2": np.log(0.015)}
PLAIN |= {"log_tau1": np.log(9.0), "log_tau2": np.log(150.0), "capacity": 0.002}
PLAIN |= {f"ocv[{k}]": 0.002 * np.sin(k) for k in range(base.OCV_KNOTS)}
CELSIUS = (10.0, 28.0)
GROUPS = {name for name in LIBRARY if LIBRARY[name].stage == "group"}
EFFECTS = sorted(LIBRARY.keys() - GROUPS)


def drive(seconds, seed=1):
    """A random drive of 3 A out and 1.5 A back with rests, one row a second."""
    rng = np.random.default_rng(seed)
    current = np.repeat(rng.uniform(-3.0, 1.5, seconds // 20), 20)
    time = np.arange(float(seconds))
    current[(time % 1800 > 1500) | (time < 60)] = 0.0
    return time, current


def sizes(*effects):
    """Plausible sizes of effects, by name."""
    parameters = [(e, p) for e in effects for p in LIBRARY[e].parameters]
    return {f"{e}.{p.name}": p.neutral if p.shape else p.plausible for e, p in parameters}


def effect_model(*effects, hold="zero_order", **changed):
    values = PLAIN | {"soc0[0]": 0.5} | sizes(*effects) | changed
    return {
        "capacity_ampere_hour": CAPACITY,
        "ocv_soc": SOC.tolist(),
        "ocv_volt": OCV.tolist(),
        "hold": hold,
        "values": {name: float(value) for name, value in values.items()},
        "std": {"log_r0": 0.01},
        "effects": list(effects),
        "start_shift_soc": 0.0,
    }


def family(scale=1.0):
    """A model of the family: the plain circuit at one temperature, its resistances off."""
    return deepcopy(_family(scale))


@cache
def _family(scale):
    wrong = effect_model()
    wrong["values"] |= {name: PLAIN[name] + np.log(scale) for name in ("log_r0", "log_r1")}
    table = {"soc": SOC.tolist(), "ocv_volt": OCV.tolist(), "ambient_temperature_celsius": 25.0}
    model = {"cell": "A", "capacity_ampere_hour": CAPACITY, "ocv": [table], "members": []}
    member = effect_member(wrong, model, [25.0]) | {"model": "2RC"}
    member["conditions"][0] |= {"fit_rmse_volt": 0.01, "samples": 10}
    about = {"chosen": "2RC", "choice": "the only one", "notes": [], "kind": "drive"}
    return model | about | {"members": [member]}


def records(given, celsius, soc=0.95, kind="drive", seed=1, seconds=1800):
    """(stack of one record by the found model's own voltage, the SoC counted from what is read)."""
    time, current = drive(seconds, seed)
    course = celsius + 2.0 * np.sin(time / 900.0)
    record = record_of(time, current, 0.0 * time, soc, test="t", kind=kind, celsius=course)
    stack = stacked([record], capacity_ampere_hour=CAPACITY, hold=given["hold"])
    effects = in_order([LIBRARY[name] for name in given["effects"]], LIBRARY)
    volt = base.voltage(CELL, stack, given["values"] | {"soc0[0]": soc}, effects)
    counted = soc + np.cumsum(stack.held_ampere * stack.step_second) / 3600.0 / CAPACITY
    return stack._replace(voltage_volt=volt), counted


def largest(given, celsius, **record):
    """Largest difference of the member's voltage from the found model's own [V]."""
    model = family()
    model["members"] += [effect_member(given, model, temperatures_of(given))]
    stack, soc = records(given, celsius, **record)
    run = simulate_model(
        *(model, NAME, stack.second, stack.current_ampere, soc, stack.celsius),
        kind=record.get("kind", "drive"),
    )
    return np.abs(run.voltage_volt - stack.voltage_volt).max()


def temperatures_of(given):
    courses = [np.full(3, c) + [0.0, 2.5, -2.5] for c in CELSIUS]
    return temperatures(courses, CELSIUS, given["effects"])


@pytest.mark.parametrize(("celsius", "hold"), [(10.0, "zero_order"), (28.0, "first_order")])
@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_gives_the_same_voltage_as_a_member(effect, celsius, hold):
    assert largest(effect_model(effect, hold=hold), celsius) < 1e-4


@pytest.mark.parametrize(
    ("effect", "changed"),
    [
        ("slow_diffusion", {"slow_diffusion.finite_length": 1.0}),
        ("slow_diffusion", {"slow_diffusion.finite_length": 2.0}),
        ("slow_diffusion", {"slow_diffusion.finite_length": 3.0}),
        ("slow_diffusion", {f"slow_diffusion.{TO_FULL}": 2.0, "slow_diffusion.finite_length": 3.0}),
        ("slow_diffusion", {"slow_diffusion.log_diffusivity_to_full": 1.2}),
        ("hysteresis_one_state", {"hysteresis_one_state.small_loops_close": 1.0}),
        ("resistance_asymmetry", {"resistance_asymmetry.charge_resistance_excess_relative": -0.4}),
        ("resistance_asymmetry", {"resistance_asymmetry.change_to_empty": 0.7}),
        ("resistance_asymmetry", {"resistance_asymmetry.in_quicker_pair": 1.0}),
        ("leakage", {"leakage.log_leak_to_full": 2.0}),
        ("time_skew", {"time_skew.voltage_delay_second": -0.4}),
        ("time_skew", {"time_skew.voltage_delay_second": 1.7}),
    ],
)
def test_other_forms_and_signs_too(effect, changed):
    assert largest(effect_model(effect, **changed), 10.0) < 1e-4


@pytest.mark.parametrize("record", [{"soc": 0.6}, {"soc": 1.0, "kind": "capacity"}, {"soc": 0.97}])
@pytest.mark.parametrize("effect", ["capacity_error", "leakage", "hysteresis_one_state"])
def test_wherever_a_record_begins_and_of_whatever_kind(effect, record):
    assert largest(effect_model(effect), 10.0, **record) < 1e-4


def test_several_effects_at_once():
    several = ["resistance_temperature", "resistance_soc", "hysteresis_one_state"]
    several += ["current_gain", "current_offset", "capacity_temperature", "voltage_offset"]
    assert largest(effect_model(*several), 10.0) < 2e-4
    several = ["resistance_temperature", "self_heating", "slow_diffusion"]
    assert largest(effect_model(*several), 10.0) < 3e-4
    several = ["resistance_temperature", "charge_transfer_nonlinearity"]
    assert max(largest(effect_model(*several), celsius) for celsius in CELSIUS) < 3e-4
    particles = {"slow_diffusion.finite_length": 3.0}
    several = ["resistance_temperature", "entropic_ocv", "ocv_edge", "slow_diffusion"]
    assert largest(effect_model(*several, **particles), 10.0) < 3e-4


def test_an_exchange_current_falls_in_the_cold_as_its_resistance_grows():
    """Their product is the thermal voltage: in the cold charge transfer bends sooner."""
    given = effect_model("resistance_temperature", "charge_transfer_nonlinearity")
    stack, _ = records(given, -15.0)
    effects = [LIBRARY[name] for name in given["effects"]]
    values = given["values"] | {"soc0[0]": 0.95}
    fields = base.fields_of(CELL, stack, values, in_order(effects, LIBRARY))
    kinetics = LIBRARY["charge_transfer_nonlinearity"].sizes_of(values)
    warm_ampere = 1.0 / kinetics["per_exchange_current_per_ampere"]
    colder = fields.r0 / np.exp(PLAIN["log_r0"])
    assert colder.min() > 2.0
    ampere = warm_ampere / colder * (stack.celsius + 273.15) / 298.15
    share, half = kinetics["share_of_resistance"], stack.current_ampere / (2.0 * ampere)
    volt = fields.r0 * (1.0 - share) * stack.current_ampere
    volt += fields.r0 * share * 2.0 * ampere * np.arcsinh(half)
    np.testing.assert_allclose(fields.ohmic, volt, atol=1e-9)


# What a look-up over SoC and temperature cannot hold: a sum of resistances of which only some
# change with temperature; of two ways of charge transfer, the share of one only.
APPROXIMATE = {
    ("lead_resistance", "resistance_temperature"): 4e-4,
    ("resistance_asymmetry", "charge_transfer_nonlinearity"): 5e-4,
    ("resistance_temperature", "slow_diffusion"): 2e-4,
}


# Each effect beside its next and its fifth in the list, and those that meet in one resistance.
NAMES = list(LIBRARY)
NEAR = {pair for step in (1, 5) for pair in zip(NAMES, NAMES[step:], strict=False)}


@pytest.mark.parametrize("pair", sorted(NEAR | set(APPROXIMATE)), ids="-".join)
def test_two_effects_give_the_same_voltage_as_a_member(pair):
    """In whichever order they were found."""
    assert largest(effect_model(*reversed(pair)), 12.0) < APPROXIMATE.get(pair, 1.5e-4)


def test_a_member_holds_what_was_found_and_no_more():
    model = family()
    member = effect_member(effect_model("current_offset", "leakage"), model, [25.0])
    assert member["reading"] == {"current_offset_ampere": 0.02}
    assert member["counting"].keys() == {
        *("leak_ampere", "log_leak_to_full", "capacity_relative", "capacity_test_relative")
    }
    assert "own_heat" not in member
    assert "history" not in member
    assert [b["kind"] for b in member["conditions"][0]["branches"]] == ["RC", "RC"]
    assert member["conditions"][0]["r0_std_ohm"][0] == pytest.approx(0.01 * 0.03)
    assert len(words_of(member)) == 2
    assert is_plain(member)
    assert not is_plain(effect_member(effect_model("self_heating"), model, [25.0]))
    energy = effect_member(effect_model("resistance_temperature"), model, [5.0])["conditions"][0]
    assert energy["activation_energy_joule_per_mole"] == pytest.approx(2e4)


def test_temperatures_are_those_tested_and_close_enough_for_the_ocv():
    courses = [np.array([4.8, 8.2]), np.array([44.0, 46.0]), np.array([24.0, 26.0])]
    assert temperatures(courses, [5.0, None, 25.0], []) == [5.0, 25.0, 45.0]
    close = temperatures(courses, [5.0, 45.0, 25.0], ["entropic_ocv"])
    assert close == [4.0, 14.5, 25.0, 35.0, 45.0]


def test_what_is_not_known_is_refused():
    with pytest.raises(Refusal, match="gremlins are not in the library"):
        effect_member(effect_model() | {"effects": ["gremlins"]}, family(), [25.0])
    uneven = effect_model() | {"ocv_soc": (SOC**2).tolist()}
    with pytest.raises(Refusal, match="wanted even"):
        effect_member(uneven, family(), [25.0])


def series_of(given):
    """Both temperatures as clean series of a cell."""
    made = []
    for celsius in CELSIUS:
        stack, soc = records(given, celsius, seed=int(celsius), seconds=5400)
        series = {
            "test_time_second": stack.second,
            "current_ampere": stack.current_ampere,
            "voltage_volt": stack.voltage_volt,
            "surface_temperature_celsius": stack.celsius,
            "charge_ampere_hour": (soc - soc[0]) * CAPACITY,
        }
        made.append(measured_test(series, f"D{celsius:g}", celsius=celsius, soc=0.95))
    return made


SHEET = cell_facts(2.5, 4.4)


BASIS = {"capacity_ampere_hour": CAPACITY, "borrowed_from": None}
CURVE = {"test": "ocv", "ambient_temperature_celsius": 25.0, "branches": "both"}
BASIS |= {"ocv": [CURVE | {"soc": SOC.tolist(), "ocv_volt": OCV.tolist()}]}
MEMBERS = {"members": ["0RC", "1RC"], "split_rest_second": 200.0}
SPANS = [(0.0, 1799.0), (1800.0, 3599.0), (3600.0, 5399.0)]  # a load and the rest behind it


def folds_of(given, *changes):
    """Folds that leave out the blocks of both tests in turn; `changes` : of the values of each."""
    changes = changes or ({},) * len(SPANS)
    tests = [f"D{celsius:g}" for celsius in CELSIUS]
    return [
        {"values": given["values"] | change, "blocks": [[test, *span] for test in tests]}
        for change, span in zip(changes, SPANS, strict=True)
    ]


def searched(given, folds, shift_soc=0.0):
    """What a search would say that fitted both tests."""
    starts = {"start_soc": {f"D{celsius:g}": 0.95 for celsius in CELSIUS}}
    starts |= {"start_shift_soc": shift_soc}
    return given | starts | {"folds": [fold | starts for fold in folds]}


def family_of(tests):
    """A model of the family identified from the tests, with its scores."""
    return identify(SHEET, BASIS, tests, **MEMBERS).content


def finished_of(given, tests, folds=None):
    effect_model = searched(given, folds_of(given) if folds is None else folds)
    return finished(family_of(tests), BASIS, SHEET, tests, effect_model, split_rest_second=200.0)


def test_the_better_of_both_is_chosen_by_blocks_that_were_left_out():
    given = effect_model("resistance_asymmetry", "current_gain")
    model, rows = finished_of(given, series_of(given))
    assert model["chosen"] == NAME
    assert f"{NAME} chosen by blocks left out of the fit, clearly before 1RC" in model["choice"]
    assert model["members"][-1]["conditions"][0]["fit_rmse_volt"] < 2e-4
    assert {row["model"] for row in rows} == {"0RC", "1RC", NAME}
    assert [row["ambient_temperature_celsius"] for row in rows[:2]] == list(CELSIUS)
    (reason,) = {row["reason"] for row in rows if row["model"] == "1RC"}
    assert reason == f"{NAME} is better beyond chance"
    assert all(row["chosen"] == (row["model"] == NAME) for row in rows)


@pytest.mark.slow
def test_a_member_that_simulates_badly_is_not_chosen_and_told_so():
    given = effect_model("resistance_asymmetry", "current_gain")
    worse = effect_model("resistance_asymmetry", "current_gain", log_r0=np.log(0.09))
    model, rows = finished_of(worse, series_of(given))
    assert model["chosen"] == "1RC"
    (reason,) = {row["reason"] for row in rows if row["model"] == NAME}
    assert "on the training records; 1RC errs by" in reason


def test_what_is_good_only_where_it_was_fitted_is_not_chosen():
    """A model that without a block would have been off by 30 mV there has not understood it."""
    given = effect_model("resistance_asymmetry", "current_gain")
    folds = folds_of(given, *({"ocv[20]": 0.3, "ocv[40]": -0.3, "log_r0": np.log(0.08)},) * 3)
    model, rows = finished_of(given, series_of(given), folds)
    assert model["chosen"] == "1RC"
    (reason,) = {row["reason"] for row in rows if row["model"] == NAME}
    assert reason.startswith("not better than 1RC beyond chance")


@pytest.mark.slow
def test_each_block_is_predicted_by_the_model_fitted_without_it():
    given = effect_model("voltage_offset")
    name = "voltage_offset.offset_volt"
    off = [{name: given["values"][name] + volt} for volt in (0.01, 0.02, 0.04)]
    tests = series_of(given)
    conditions = fitted_records(family_of(tests), BASIS, SHEET, tests, split_rest_second=200.0)
    model = family_of(tests)
    _, judged = with_effects(model, searched(given, folds_of(given, *off)), tests, conditions)
    for score in judged.scores:
        np.testing.assert_allclose(np.sqrt(score.square_volt2), [0.01, 0.02, 0.04], atol=2e-4)
    _, judged = with_effects(model, searched(given, []), tests, conditions)
    assert max(score.square_volt2.max() for score in judged.scores) < 1e-7
    assert judged.fit_rmse_volt.max() < 3e-4


@pytest.mark.slow
def test_a_record_begins_at_the_soc_that_was_found_with_the_rest_of_it():
    given = effect_model("resistance_asymmetry")
    tests = series_of(given)
    tests = [test._replace(facts=test.facts._replace(soc=0.94)) for test in tests]
    model = family_of(tests)
    conditions = fitted_records(model, BASIS, SHEET, tests, split_rest_second=200.0)
    _, judged = with_effects(model, searched(given, folds_of(given)), tests, conditions)
    assert judged.fit_rmse_volt.max() < 3e-4
    unknown = searched(given, []) | {"start_soc": {}}
    _, judged = with_effects(model, unknown, tests, conditions)
    assert judged.fit_rmse_volt.min() > 5e-3
    # What every record begins above the counted SoC is in the member, also for one it never saw.
    for known in (searched(given, folds_of(given), 0.01), unknown | {"start_shift_soc": 0.01}):
        _, judged = with_effects(model, known, tests, conditions)
        assert judged.fit_rmse_volt.max() < 3e-4


def test_of_one_temperature_resistances_are_as_they_were_as_far_as_its_records_went():
    given = effect_model("resistance_asymmetry", "current_gain")
    for tests, kelvin in ((series_of(given)[-1:], 2.0), (series_of(given), None)):
        model = family_of(tests)
        conditions = fitted_records(model, BASIS, SHEET, tests, split_rest_second=200.0)
        found, judged = with_effects(model, searched(given, []), tests, conditions)
        assert judged.fit_rmse_volt.max() < 3e-4
        reach = found["members"][-1]["conditions"][0].get("activation_energy_kelvin")
        assert reach == (kelvin and pytest.approx(kelvin, abs=0.01))


def test_without_effects_the_family_is_judged_alone():
    tests = series_of(effect_model("resistance_temperature"))
    model, rows = finished_of(effect_model(), tests)
    assert model["chosen"] == "1RC"
    assert {row["model"] for row in rows} == {"0RC", "1RC"}


def test_effects_too_small_for_a_name_make_no_member():
    given = effect_model("resistance_temperature")
    tests, small = series_of(given), searched(given, [])
    del small["folds"]  # made of names alone
    model, rows = finished(family_of(tests), BASIS, SHEET, tests, small, split_rest_second=200.0)
    assert (model, rows) == finished_of(effect_model(), tests)
    assert NAME not in {row["model"] for row in rows}


def test_a_borrowed_model_is_left_as_it_is():
    model = family()
    again = finished(model, BASIS, SHEET, [], effect_model("leakage"), split_rest_second=200.0)
    assert again == (model, [])


def test_effects_that_no_model_file_holds_cost_the_cell_only_that_member():
    tests = series_of(effect_model("resistance_temperature"))
    model, _ = finished_of(effect_model() | {"effects": ["gremlins"]}, tests)
    assert model["chosen"] == "1RC"
    assert any("not made: effects gremlins" in note for note in model["notes"])


def test_records_that_are_gone_are_a_refusal():
    tests = series_of(effect_model("resistance_temperature"))
    with pytest.raises(Refusal, match="D28 cannot be read again"):
        fitted_records(family_of(tests), BASIS, SHEET, tests[:1], split_rest_second=200.0)


def holding(given):
    """A model of the family beside the member of the effects found."""
    model = family()
    member = effect_member(given, model, temperatures_of(given))
    for condition in member["conditions"]:
        condition |= {"fit_rmse_volt": 1e-3, "samples": 10}
    return model | {"members": [*model["members"], member]}


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_member_is_a_bank_and_rows_and_an_export_or_a_reason(effect):
    model = holding(effect_model(effect))
    bank = bank_of(model, NAME, 20.0)
    assert np.isfinite(bank.ocv_volt).all()
    assert len(bank.elements) >= 3
    rows = [row for row in parameter_rows(model) if row["model"] == NAME]
    assert {row["soc"] for row in rows if row["parameter"] == "r0"} == set(KNOTS)
    document = pybamm_document(model)
    assert NAME in document["refused"] or NAME in [m["model"] for m in document["members"]]
