"""A branch is its cell's whole model: the group steps it as the search of the cell does."""

import group_plant
import numpy as np
import pytest
from group_pair import TABLE, WHOLE, record, whole_cells
from quick import slow_but

from cellwright.effects import base
from cellwright.effects.groups import model
from cellwright.effects.groups.branch import Branch, branch_of, conditions, diffusion_of
from cellwright.effects.groups.finding import group_finding
from cellwright.effects.groups.model import group_fields, group_names, group_run
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import group_stacked, stacked
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

PLAIN = {"log_r0": -4.0, "log_r1": -5.0, "log_r2": -5.0, "log_tau1": 2.0, "log_tau2": 5.0}
PLAIN |= {"capacity": 0.0} | dict.fromkeys(base.OCV_NAMES, 0.0)
COURSE = {"step_to_35_percent": 0.1, "step_to_20_percent": 0.2, "step_to_65_percent": -0.1}
SIZES = {
    "resistance_temperature": {
        "activation_energy_joule_per_mole": 25e3,
        "polarisation_excess_joule_per_mole": 14e3,
        "growth_towards_cold": 0.1,
        "time_constant_exponent": 0.7,
    },
    "resistance_soc": COURSE,
    "polarisation_soc": COURSE | {"excess_of_quicker_pair": 0.3},
    "entropic_ocv": {"coefficient_volt_per_kelvin": 2e-4, "step_to_35_percent": 1e-4},
    "capacity_temperature": {"relative_per_kelvin": 2e-3},
    "capacity_error": {"relative": -0.02},
    "ocv_edge": {"empty_volt": 0.01},
    "ocv_shift": {"wave_1_volt": 2e-3},
    "slow_diffusion": {
        "resistance_ohm": 8e-3,
        "time_constant_second": 1500.0,
        "log_diffusivity_to_full": 0.5,
    },
}
FORMS = pytest.mark.parametrize("form", range(4))


def whole_model(form, *, without=()):
    """Model of a cell with all effects that a branch keeps over SoC and temperature."""
    values = dict(PLAIN)
    for key in SIZES.keys() - set(without):
        p = {one.name: one.neutral for one in LIBRARY[key].parameters} | SIZES[key]
        values |= {f"{key}.{name}": size for name, size in p.items()}
    if "slow_diffusion" not in without:
        values["slow_diffusion.finite_length"] = float(form)
    return {"capacity_ampere_hour": 2.0, "ocv_volt": TABLE.tolist(), "values": values}


def drive(celsius, branches=1):
    second = np.arange(0.0, 3600.0)
    ampere = np.repeat(np.random.default_rng(5).choice([-3.0, -2.0, -1.0, 0.0, 1.0], 120), 30)
    return record_of(second, branches * ampere, 0.0 * second, np.nan, celsius=celsius)


@FORMS
@pytest.mark.parametrize("celsius", [5.0, 40.0])
def test_two_alike_step_as_the_cell_does(form, celsius):
    found = whole_model(form)
    branch = branch_of("c", found)
    stack = group_stacked([drive(celsius, 2)], branches=2)
    fields = group_fields((branch,) * 2, [[0.95] * 2], dict.fromkeys(group_names(1, 2), 0.0))
    alone = stacked([drive(celsius)], capacity_ampere_hour=2.0, hold="zero_order")
    effects = [e for e in LIBRARY.values() if e.names[0] in found["values"]]
    values = found["values"] | {"soc0[0]": 0.95}
    volt = base.voltage(base.Cell(2.0, TABLE), alone, values, effects)
    away = group_run(fields, stack).voltage - volt
    # Courses lie on the grid of the OCV, and where the particles' surface leads, all of the OCV is
    # taken there, its errors and what temperature makes of it with it.
    assert np.abs(away).max() < 4e-4
    assert np.sqrt(np.mean(away**2)) < (2e-4 if form == 3 else 5e-5)


def by(monkeypatch, cells, records, *, compiled):
    with monkeypatch.context() as patch:
        if not compiled:
            patch.setattr(model, "function", lambda *_, **__: None)
        stack = group_stacked(records, branches=len(cells), hold="first_order")
        starts = np.full((len(records), len(cells)), 0.9)
        values = dict.fromkeys(group_names(len(records), len(cells)), 0.0)
        values |= {"1.soc": 0.02, "0.celsius": 3.0, "log_diffusion": 0.2, "energy": 2e3}
        return group_run(group_fields(cells, starts, values), stack)


@pytest.mark.parametrize("form", slow_but({3}, range(4)))
def test_kernel_and_twin_agree_on_all_that_a_branch_has(monkeypatch, form):
    cells = branch_of("a", whole_model(form)), Branch("b", 2.1, TABLE, (0.02, 0.01, 0.01), (9, 90))
    records = [record("a", 1), record("b", 2, celsius=5.0)]
    runs = [by(monkeypatch, cells, records, compiled=one) for one in (True, False)]
    for compiled, twin in zip(*runs, strict=True):
        assert compiled == pytest.approx(twin, abs=1e-9)


def test_what_healthy_cells_of_the_type_have_acts_beside_the_cells_own():
    energy = {"activation_energy_joule_per_mole": 10e3, "time_constant_exponent": 0.0}
    p = {one.name: one.neutral for one in LIBRARY["resistance_temperature"].parameters} | energy
    found = whole_model(0, without=SIZES.keys() - {"resistance_temperature"})
    stack = group_stacked([drive(5.0, 2)], branches=2)
    own, both = (
        conditions(branch_of("c", one), stack, 0.5, 0.0, 0.0)
        for one in (found, found | {"healthy": [["resistance_temperature", p]]})
    )
    more = group_plant.resistance_factor(5.0, 10e3)
    assert both[:, :3] == pytest.approx(own[:, :3] * more)
    assert both[:, 3] == pytest.approx(own[:, 3])


def test_what_joined_a_model_that_lacks_nothing_is_the_branchs_too():
    found = whole_model(0)
    plain = found | {"values": PLAIN, "joined": found["values"]}
    assert branch_of("c", plain).effects == branch_of("c", found).effects
    assert diffusion_of(branch_of("c", plain)).r_ohm == pytest.approx([8e-3])


def test_an_effect_that_no_branch_keeps_is_refused():
    spoiled = whole_model(0) | {"healthy": [["time_skew", {"delay_second": 0.1}]]}
    with pytest.raises(Refusal, match="time_skew"):
        branch_of("c", spoiled)


HIDDEN = {
    "branch_wire_resistance": ("wire", 0.004),
    "branch_temperature": ("warmer", 6.0),
    "branch_cell_resistance": ("resistance", 0.2),
}


@pytest.mark.parametrize("effect", slow_but("branch_temperature", HIDDEN))
def test_a_branch_with_slow_diffusion_and_two_energies_has_its_fault_named(effect):
    name, size = HIDDEN[effect]
    about = {"whole": WHOLE, name: size}
    fits = [("fit", record(f"fit{t:g}", 1, celsius=t, **about)) for t in (25.0, 5.0)]
    judge = ("validation", record("judge", 2, **about))
    verdict = group_finding("pair", whole_cells(), [*fits, judge], initial_soc=(0.9, 0.9)).verdict
    assert [(e["effect"], e["branch"]) for e in verdict["effects"]] == [(effect, 2)]
    first = next(iter(verdict["effects"][0]["parameters"].values()))
    assert first["value"] == pytest.approx(size, rel=0.1)


@pytest.mark.slow
def test_the_same_whole_group_lacks_nothing():
    fits = [("fit", record(f"fit{t:g}", 1, celsius=t, whole=WHOLE)) for t in (25.0, 5.0)]
    judge = ("validation", record("judge", 2, whole=WHOLE))
    found = group_finding("pair", whole_cells(), [*fits, judge], initial_soc=(0.9, 0.9))
    assert found.verdict["verdict"] == "none"
