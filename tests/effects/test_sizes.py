"""Sizes as people use them: arithmetic from the parameters, with units and deviations."""

from types import SimpleNamespace

import numpy as np
import pytest

from cellwright.effects.library import LIBRARY
from cellwright.effects.library.groups import GROUP_LIBRARY
from cellwright.effects.library.resistance import DIFFUSION_OHM
from cellwright.effects.story.sizes import Fitted, Size, has_size, sizes_as_used

POLARISATION = LIBRARY["polarisation_soc"]
VALUES = {"log_r0": np.log(0.020), "log_r1": np.log(0.010), "log_r2": np.log(0.005)}
VALUES |= {"log_tau1": np.log(10.0), "log_tau2": np.log(200.0), "capacity_ampere_hour": 4.0}


def sizes(effect, values=VALUES, **given):
    parameters = {
        p.name: {"value": given.get(p.name, p.neutral), "std": None, "unit": p.unit}
        for p in LIBRARY[effect].parameters
    }
    for name, std in given.pop("std", {}).items():
        parameters[name]["std"] = std
    return sizes_as_used(LIBRARY[effect], parameters, values)


@pytest.mark.parametrize(
    ("effect", "given", "words"),
    [
        (
            "resistance_temperature",
            {
                "activation_energy_joule_per_mole": 23558.0,
                "std": {"activation_energy_joule_per_mole": 1200.0},
            },
            ["activation energy from 0 to 25 °C 23.6 ± 1 kJ/mol"],
        ),
        (
            "resistance_asymmetry",
            {"charge_resistance_excess_relative": 0.5, "change_to_empty": 0.4, "change_to_full": 0},
            ["R0 on discharge 20 mΩ", "on charge at 10 % SoC 36.4 mΩ", "at 50 % SoC 30 mΩ"]
            + ["at 90 % SoC 30 mΩ"],
        ),
        ("lead_resistance", {"resistance_ohm": 0.0042}, ["4.2 mΩ"]),
        (
            "slow_diffusion",
            {"resistance_ohm": 0.0088, "time_constant_second": 2400.0},
            ["8.8 mΩ", "time constant 40 min"],
        ),
        (
            "hysteresis_one_state",
            {"amplitude_volt": 0.012, "rate_per_soc": 20.0},
            ["half the distance of charge and discharge 12 mV", "turned over within 5 % of SoC"],
        ),
        (
            "hysteresis_one_state",
            {"amplitude_volt": 0.012, "rate_per_soc": 50.0, "small_loops_close": 1.0},
            ["half the distance of charge and discharge 12 mV"]
            + ["small turns close their loop, turned over within 2 % of SoC"],
        ),
        (
            "self_heating",
            {"thermal_resistance_kelvin_per_watt": 4.0, "time_constant_second": 300.0},
            ["4 K for each watt", "time constant 5 min"],
        ),
        (
            "entropic_ocv",
            {"coefficient_volt_per_kelvin": 2e-4}
            | {"step_to_20_percent": 1e-4, "step_to_65_percent": -3e-4},
            ["at 10 % SoC 0.3 mV/K", "at 50 % SoC 0.2 mV/K", "at 90 % SoC −0.1 mV/K"],
        ),
        ("capacity_error", {"relative": -0.05}, ["−5 % of capacity", "−0.2 Ah"]),
        ("coulombic_inefficiency", {"lost_share_of_charge": 0.01}, ["1 % of what is charged"]),
        ("leakage", {"leak_ampere": 0.01}, ["at 10 % SoC 10 mA", "at 50 % SoC 10 mA"]),
        ("current_offset", {"offset_ampere": -0.02}, ["−20 mA", "12 % of SoC a day"]),
        ("current_gain", {"gain_relative": 0.01}, ["1 % of reading"]),
        ("voltage_offset", {"offset_volt": 0.005}, ["5 mV"]),
        ("ocv_edge", {"empty_volt": 0.02, "full_volt": -0.01}, ["when empty 20 mV"]),
        ("time_skew", {"voltage_delay_second": 0.3}, ["voltage behind current by 0.3 s"]),
    ],
)
def test_sizes_are_those_that_people_use(effect, given, words):
    found = [size.text.strip() for size in sizes(effect, **given)]
    assert found[: len(words)] == words


def test_the_activation_energy_is_that_of_all_resistances_together():
    """The polarisation has 10 kJ/mol more: the sum of 20, 10 and 5 mΩ at 25 °C lies between."""
    given = {"activation_energy_joule_per_mole": 2e4, "polarisation_excess_joule_per_mole": 1e4}
    (size,) = sizes("resistance_temperature", **given)
    gas, inverse = 8.314462618, 1 / 273.15 - 1 / 298.15
    cold = 20 * np.exp(2e4 / gas * inverse) + 15 * np.exp(3e4 / gas * inverse)
    assert size.value == pytest.approx(gas * np.log(cold / 35) / inverse / 1e3, rel=1e-6)


def test_the_activation_energy_is_told_over_the_temperatures_that_were_fitted():
    given = {"activation_energy_joule_per_mole": {"value": 2e4, "std": 1e3}}
    shapes = ("polarisation_excess_joule_per_mole", "growth_towards_cold", "time_constant_exponent")
    given |= {name: {"value": 0.0, "std": 0.0} for name in shapes}
    values = VALUES | {"fitted_celsius": [19.7, 41.2]}
    (size,) = sizes_as_used(LIBRARY["resistance_temperature"], given, values)
    assert size.text == "activation energy from 20 to 41 °C 20 ± 1 kJ/mol"


@pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.9])
def test_what_is_sure_together_is_told_together(correlation):
    """Knots of one course that move against each other leave its end as sure as it is."""
    names = ("step_to_35_percent", "step_to_20_percent")
    given = {p.name: (0.0, None, "1") for p in LIBRARY["resistance_soc"].parameters}
    given = {n: dict(zip(("value", "std", "unit"), v, strict=True)) for n, v in given.items()}
    std = 1e-3
    matrix = std**2 * np.array([[1.0, correlation], [correlation, 1.0]])
    fitted = Fitted(tuple(f"resistance_soc.{name}" for name in names), (matrix,))
    empty, middle, full = sizes_as_used(LIBRARY["resistance_soc"], given, VALUES, fitted)
    both = std * np.sqrt(2 + 2 * correlation)
    assert empty.std == pytest.approx(20.0 * both, rel=1e-2)
    assert (middle.std, full.std) == (0.0, 0.0)


def test_of_several_covariances_the_larger_deviation_counts():
    given = {"offset_volt": {"value": 0.02, "std": 1e-3, "unit": "V"}}
    spreads = tuple(np.array([[std**2]]) for std in (1e-3, 4e-3, 2e-3))
    fitted = Fitted(("voltage_offset.offset_volt",), spreads)
    size = sizes_as_used(LIBRARY["voltage_offset"], given, VALUES, fitted)[0]
    assert size.std == pytest.approx(4.0)


def test_the_models_own_resistance_is_as_unsure_as_it_was_fitted():
    names = [p.name for p in LIBRARY["resistance_asymmetry"].parameters]
    sizes = dict.fromkeys(names, 0.0) | {"charge_resistance_excess_relative": 0.5}
    given = {name: {"value": size, "std": 0.0, "unit": "1"} for name, size in sizes.items()}
    fitted = Fitted(("log_r0",), (np.array([[0.01**2]]),))
    found = sizes_as_used(LIBRARY["resistance_asymmetry"], given, VALUES, fitted)
    assert [size.std for size in found] == pytest.approx([0.2, 0.3, 0.3, 0.3], rel=1e-2)


def test_own_heat_is_no_surer_than_the_energy_it_is_told_by():
    (warm, minutes) = sizes("self_heating", thermal_resistance_kelvin_per_watt=4.0)
    assert np.isnan(warm.std), "nothing was fitted"
    stds = {"thermal_resistance_kelvin_per_watt": 0.1, "time_constant_second": 6.0}
    (warm, minutes) = sizes("self_heating", thermal_resistance_kelvin_per_watt=4.0, std=stds)
    assert warm.std == pytest.approx(np.hypot(1.6, 0.1))
    assert minutes.std == pytest.approx(0.1)


def test_a_course_over_soc_is_told_in_milliohm_of_the_model_itself():
    steps = {"step_to_35_percent": 0.3, "step_to_20_percent": 0.3, "step_to_10_percent": 0.4}
    steps |= {"step_to_65_percent": -0.1, "step_to_90_percent": -0.1}
    found = sizes("resistance_soc", **steps, std={"step_to_35_percent": 0.1})
    assert [size.unit for size in found] == ["mΩ"] * 3
    low, middle, high = (size.value for size in found)
    assert middle == pytest.approx(20.0)
    assert low == pytest.approx(20.0 * np.exp(1.0))
    assert high == pytest.approx(20.0 * np.exp(-0.2))
    assert found[0].std == pytest.approx(0.1 * low, rel=1e-3)
    assert found[2].std == 0.0, "what is not known below the middle moves nothing above it"
    relaxing = sizes("polarisation_soc", **steps)
    assert relaxing[1].value == pytest.approx(15.0)
    assert relaxing[0].value / relaxing[2].value == pytest.approx(np.exp(1.2))


def test_what_relaxes_does_so_in_diffusion_too():
    """As unsure as both are together: what one gives, the other takes."""
    given = {p.name: {"value": 0.0, "std": 0.0, "unit": "1"} for p in POLARISATION.parameters}
    values = VALUES | {DIFFUSION_OHM: 4e-3}
    names = ("log_r2", DIFFUSION_OHM)
    std = np.array([0.1, 0.1 * np.exp(VALUES["log_r2"])])
    fitted = Fitted(names, (np.outer(std, std) * [[1.0, -1.0], [-1.0, 1.0]],))
    found = sizes_as_used(POLARISATION, given, values, fitted)
    assert [size.value for size in found] == pytest.approx([19.0] * 3)
    assert [size.std for size in found] == pytest.approx([0.0] * 3, abs=1e-3)


@pytest.mark.parametrize("charge", [0.4, 0.5])
def test_charge_transfer_is_told_at_rates(charge):
    """A smaller coefficient of charge: the discharge is the easier way."""
    small, one, three, charging = sizes(
        "charge_transfer_nonlinearity",
        per_exchange_current_per_ampere=1.0,
        share_of_resistance=0.5,
        exchange_current_exponent=0.5,
        charge_coefficient=charge,
    )
    assert small.value == pytest.approx(20.0, rel=0.02)
    assert 10.0 < three.value < one.value < small.value
    assert (charging.value > 1.1 * three.value) == (charge < 0.5)


def test_capacity_over_temperature_is_told_between_the_temperatures_fitted():
    values = VALUES | {"fitted_celsius": [5.0, 35.0]}
    (found,) = sizes("capacity_temperature", values, relative_per_kelvin=1e-3)
    assert found.name == "from 5 to 35 °C"
    assert found.value == pytest.approx(3.0, rel=1e-3)


def test_without_the_model_a_course_is_told_by_its_parameters():
    step = "step_to_20_percent"
    found = sizes("resistance_soc", None, **{step: 1.0}, std={step: 0.1})
    assert [size.text.strip() for size in found] == ["step to 20 percent 1 ± 0.1"]


@pytest.mark.parametrize("effect", sorted(LIBRARY))
def test_every_effect_has_sizes_that_are_numbers(effect):
    given = {p.name: p.plausible or p.neutral for p in LIBRARY[effect].parameters}
    found = sizes(effect, **given, std=dict.fromkeys(given, 0.001))
    assert found
    assert all(np.isfinite([size.value, size.std]).all() for size in found)


def test_what_hangs_on_a_parameter_on_its_bound_states_no_deviation():
    given = {p.name: {"value": p.neutral, "std": 0.1} for p in LIBRARY["slow_diffusion"].parameters}
    given["resistance_ohm"] = {"value": 0.002, "std": 4e-4}
    given["time_constant_second"] = {"value": 1e5, "std": 3.0, "at_bound": True}
    fitted = Fitted(("slow_diffusion.resistance_ohm",), (np.array([[4e-4**2]]),))
    resistance, time_constant = sizes_as_used(LIBRARY["slow_diffusion"], given, VALUES, fitted)
    assert resistance.std == pytest.approx(0.4)
    assert np.isnan(time_constant.std)


def test_an_effect_of_a_group_is_told_by_its_parameters():
    effect = GROUP_LIBRARY["branch_wire_resistance"]
    parameters = {
        "excess_ohm": {"value": 0.0081, "std": 2e-4, "unit": "Ohm"},
        "branch": {"value": 2, "std": None, "unit": "1"},
    }
    (found,) = sizes_as_used(effect, parameters)
    assert found.text == "excess 8.1 ± 0.2 mΩ"


@pytest.mark.parametrize(("step", "std", "sized"), [(0.08, 0.05, False), (0.3, 0.05, True)])
def test_a_course_whose_told_resistances_are_the_same_within_their_intervals_is_no_size(
    step, std, sized
):
    """Its steps may each be sure, up by one and down by the next: what people read is the same."""
    effect = LIBRARY["polarisation_soc"]
    steps = {"step_to_65_percent": step, "step_to_80_percent": 0.25, "step_to_90_percent": -0.25}
    own = {p.name: steps.get(p.name, p.neutral) for p in effect.parameters}
    values = VALUES | {f"{effect.id}.{name}": size for name, size in own.items()}
    names = tuple(f"{effect.id}.{name}" for name in steps)
    fitted = Fitted(names, (np.diag([std**2, 1e-6, 1e-6]),))
    solution = SimpleNamespace(values=values, at_bound=())
    assert has_size(effect, solution, values, fitted) is sized


@pytest.mark.parametrize(("unsure", "sized"), [(0.1, True), (3.5, False)])
def test_what_differs_from_a_resistance_that_is_not_known_differs_by_nothing(unsure, sized):
    """A charge that meets two thirds less of a quicker pair of 0.05 ± 0.2 mΩ."""
    effect = LIBRARY["resistance_asymmetry"]
    given = {"charge_resistance_excess_relative": -0.64, "in_quicker_pair": 1.0}
    own = {f"{effect.id}.{p.name}": given.get(p.name, p.neutral) for p in effect.parameters}
    values = VALUES | {"log_r1": np.log(5e-5)} | own
    fitted = Fitted(("log_r1", effect.names[0]), (np.diag([unsure**2, 0.05**2]),))
    assert has_size(effect, SimpleNamespace(values=values, at_bound=()), values, fitted) is sized


def test_an_energy_counts_whole_though_its_share_of_the_polarisation_is_fitted_beside_it():
    effect = LIBRARY["resistance_temperature"]
    given = {"activation_energy_joule_per_mole": 1.5e3, "polarisation_excess_joule_per_mole": 3e4}
    own = {f"{effect.id}.{p.name}": given.get(p.name, p.neutral) for p in effect.parameters}
    fitted = Fitted(effect.names[:2], (np.diag([1e3**2, 1e2**2]),))
    values = VALUES | own
    assert has_size(effect, SimpleNamespace(values=values, at_bound=()), values, fitted)


def test_a_size_without_a_deviation_is_told_without_one_as_a_file_has_it_too():
    for std in (np.nan, None):
        assert Size("time constant", 21.5, std, "min").text == "time constant 21.5 min"
