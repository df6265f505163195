"""A model whose voltage is given: what it lacks is named, and nothing where it lacks nothing."""

from functools import cache

import numpy as np
import pytest
from one_particle import a_particle, in_use
from quick import slow_but
from small_plant import CAPACITY, CELL, HEALTHY, Truth, drive, laid, measured
from small_plant import simulated as plant

from cellwright.effects import base
from cellwright.effects.finding import of_case
from cellwright.effects.given.case import own_case
from cellwright.effects.given.external import external_case
from cellwright.effects.library import LIBRARY
from cellwright.effects.member import effect_member
from cellwright.effects.preparing import Prepared
from cellwright.identification.intervals import simulated
from cellwright.numerics.statistics import rms

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
    assert "your model errs by" in verdict["paragraph"]
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
    assert "With none of its parameters changed it errs by 14" in told["paragraph"]


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


def searched_own(truth):
    """Verdict on what the member lacks."""
    case = own_case(prepared(truth), family())
    return of_case("A", case, LIBRARY, base_name="own").verdict


@pytest.mark.parametrize("effect", slow_but(QUICK, LACKING))
def test_what_the_member_lacks_is_named(effect):
    verdict = searched_own(LACKING[effect])
    assert [one["effect"] for one in verdict["effects"]] == [effect]
    errors = verdict["validation_rmse_volt"]
    assert errors["after"] < 0.7 * errors["before"]


@pytest.mark.slow
def test_a_member_that_lacks_nothing_is_told_so():
    assert searched_own(HEALTHY)["verdict"] == "none"


def test_of_a_particle_in_use_its_voltage_is_searched_and_not_that_of_the_member():
    ready, circuit = prepared(HEALTHY), family()
    model = in_use(circuit, a_particle())
    case = own_case(ready, model)
    as_it_is = base.voltage(case.cell, case.fit, case.start | base.stated_starts(case.fit))
    (fitted, _) = ready.records
    by_particle, by_circuit = (
        np.concatenate([simulated(model, name, one).voltage_volt for one in fitted])
        for name in ("P", "2RC")
    )
    assert as_it_is == pytest.approx(by_particle, abs=1e-9)
    assert rms(as_it_is - by_circuit) > 0.01
