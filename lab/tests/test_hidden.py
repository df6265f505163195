"""Hidden effects: none where there is none, as strong as asked, and of the contract's names.

Short loads of a small cell, so that they run without machine code too; what needs the campaign's
own protocols is in `test_hidden_strength`.
"""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from virtual_lab import fast
from virtual_lab.chamber import steady
from virtual_lab.hidden import specimens
from virtual_lab.hidden.groups import GROUP_EFFECTS, deviation, healthy_group, with_group_effect
from virtual_lab.hidden.setup import NOISE_VOLT, RATING, File, healthy, noise_free_record
from virtual_lab.hidden.specimens import HiddenCell, HiddenPhysics
from virtual_lab.hidden.strength import accepted, file_gaps, gap, with_effect
from virtual_lab.hidden.vocabulary import EFFECTS, INVISIBLE, OUTSIDE
from virtual_lab.protocols import Step, rest

# The closed vocabulary of the contract.
OF_CELLS = {
    "hysteresis_instant", "hysteresis_one_state", "resistance_asymmetry", "resistance_soc",
    "polarisation_soc", "slow_diffusion", "charge_transfer_nonlinearity", "resistance_temperature",
    "entropic_ocv", "self_heating", "capacity_temperature", "coulombic_inefficiency", "leakage",
    "capacity_error", "ocv_shift", "ocv_edge",
}  # fmt: skip
OF_SENSORS = {
    "current_offset", "current_gain", "voltage_offset", "voltage_gain", "time_skew",
    "lead_resistance",
}  # fmt: skip
OF_GROUPS = {
    "branch_wire_resistance", "branch_initial_soc", "branch_capacity", "branch_cell_resistance",
    "branch_temperature", "branch_current_offset", "branch_current_gain",
}  # fmt: skip
POINT_SECOND, SMALL_AMPERE_HOUR, INVISIBLE_VOLT = 10.0, 0.35, 1e-4


def _load(seed, second=300.0):
    """Straight lines between random currents of both directions, from 0 to 0 as drives have it."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, second + 1, POINT_SECOND)
    ampere = random.uniform(-5.0, 1.8, time.size)
    ampere[[0, 1, 2, -1]] = (0.0, -4.0, -4.0, 0.0)  # never above full
    profile = Step("profile", np.column_stack([time, ampere]), time[-1], 2.0)
    return [rest(20.0, period_second=5.0), profile, rest(60.0, period_second=5.0)]


SHORT = [File(_load(1), 25.0)]
WITH_REST = [File([*_load(1, second=150.0), rest(1800.0, period_second=120.0)], 25.0)]
WARM_AND_COLD = [*SHORT, File(_load(1), 10.0)]
GROUP_FILES = [File(_load(2, second=100.0), celsius) for celsius in (25.0, 5.0)]


@pytest.fixture
def plain():
    return _plain()


def _plain(seed=3):
    return healthy(np.random.default_rng(seed)).with_cell(capacity_ampere_hour=SMALL_AMPERE_HOUR)


def _hidden(effect, volt, files=WARM_AND_COLD, seed=7, plain=None):
    return with_effect(plain or _plain(), effect, volt, files, np.random.default_rng(seed))


def test_vocabulary_is_that_of_the_contract():
    assert set(EFFECTS) == OF_CELLS | OF_SENSORS
    assert set(GROUP_EFFECTS) == OF_GROUPS
    assert not set(OUTSIDE) & set(EFFECTS)


def test_a_healthy_cell_leaves_no_gap(plain):
    found = gap(file_gaps(plain, plain, WARM_AND_COLD))
    assert found.visible_volt < 1e-6
    assert found.base_volt < 1e-6


@pytest.mark.parametrize(
    "other",
    [{"r0_ohm": 1.1}, {"pair_r_ohm": 0.95}, {"pair_tau_second": 1.04}, {"ocv_volt": 1.0}],
    ids=lambda change: next(iter(change)),
)
def test_a_healthy_cell_with_other_parameters_leaves_none_either(plain, other):
    """Resistances and time constants are refitted; what is one voltage is one cell."""
    ((field, factor),) = other.items()
    changed = plain.with_cell(**{field: factor * np.asarray(getattr(plain.cell, field))})
    changed = changed.with_cell(
        **{field: tuple(value) for field in ("pair_r_ohm", "pair_tau_second")
           if np.ndim(value := getattr(changed.cell, field))}
    )  # fmt: skip
    assert gap(file_gaps(changed, plain, SHORT)).visible_volt < INVISIBLE_VOLT


def _two_pairs(second, ampere, parameters, ocv, capacity):
    """A plain circuit on its own feet: exact for currents that run straight between instants."""
    r0, r1, tau1, r2, tau2 = np.exp(parameters[:5])
    width = np.diff(second)
    moved = np.concatenate([[0.0], np.cumsum(0.5 * (ampere[1:] + ampere[:-1]) * width)])
    soc, grid = parameters[5] + moved / 3600 / capacity, np.linspace(0, 1, ocv.size)
    above = np.clip(soc - 1, 0, None) * (ocv[-1] - ocv[-2]) / grid[1]
    volt = np.interp(soc, grid, ocv) + above + r0 * ampere
    for r, tau in ((r1, tau1), (r2, tau2)):
        kept = np.exp(-width / tau)
        slope = np.diff(ampere) / np.where(width > 0, width, np.inf)
        end = r * (width > 0) * (ampere[1:] - tau * slope - kept * (ampere[:-1] - tau * slope))
        over, pair = 0.0, [0.0]
        for factor, more in zip(kept.tolist(), end.tolist(), strict=True):
            over = factor * over + more
            pair.append(over)
        volt = volt + np.array(pair)
    return volt


@pytest.mark.parametrize(
    "change",
    [{"hysteresis_instant_volt": 0.004}, {"charge_asymmetry": 0.2}, {"hysteresis_volt": 0.01,
     "hysteresis_per_soc": 20.0}],
    ids=["instant", "asymmetry", "one_state"],
)  # fmt: skip
def test_gap_is_what_a_whole_refit_leaves(plain, change):
    """Nonlinear least squares of another implementation of the circuit, to 3 %."""
    changed, (file,), cell = plain.with_cell(**change), SHORT, plain.cell
    record, sound = noise_free_record(file, changed), noise_free_record(file, plain)
    begins = np.cumsum([0.0, *[times[-1] for times, _ in record.steps]])
    parts = [begin + times for begin, (times, _) in zip(begins, record.steps, strict=False)]
    second, ampere = np.concatenate(parts), np.concatenate([a for _, a in record.steps])
    start = np.log([cell.r0_ohm, cell.pair_r_ohm[0], cell.pair_tau_second[0],
                    cell.pair_r_ohm[1], cell.pair_tau_second[1]])  # fmt: skip

    start = np.append(start, 1.0)

    def left(parameters, record=record):
        model = _two_pairs(second, ampere, parameters, cell.ocv_volt, cell.capacity_ampere_hour)
        return (record.volt - model)[record.sampled]

    assert np.abs(left(start, sound)).max() < 5e-6
    best = least_squares(left, start, x_scale=0.1)
    rms = np.sqrt(np.mean(best.fun**2))
    assert gap(file_gaps(changed, plain, SHORT)).visible_volt == pytest.approx(rms, rel=0.03)


@pytest.mark.parametrize(
    ("effect", "volt"),
    [
        ("resistance_asymmetry", 1e-3),
        ("resistance_asymmetry", 6e-3),
        ("hysteresis_one_state", 2.5e-3),
        ("charge_transfer_nonlinearity", 5e-4),
        ("resistance_temperature", 2.5e-3),
    ],
)
def test_strength_is_what_was_asked(effect, volt):
    files = WARM_AND_COLD if effect == "resistance_temperature" else SHORT
    hidden = _hidden(effect, volt, files)
    assert hidden.gap.visible_volt == pytest.approx(volt, rel=0.02)
    again = gap(file_gaps(hidden.setup, _plain(), files)).visible_volt
    assert again == pytest.approx(hidden.gap.visible_volt, rel=1e-9)


@pytest.mark.parametrize(("seed", "sign"), [(0, 1.0), (1, -1.0)])
def test_skew_has_either_sign_and_its_strength(seed, sign):
    hidden = _hidden("time_skew", 5e-4, SHORT, seed=seed)
    assert np.sign(hidden.parameters["voltage_delay_second"]) == sign
    assert hidden.gap.visible_volt == pytest.approx(5e-4, rel=0.02)


def test_effects_of_temperature_show_only_between_temperatures():
    """At 25 °C alone there is nothing to see (structural ties of the contract)."""
    changed = EFFECTS["entropic_ocv"].act(_plain(), 5e-4, {"shape": "changing_sign"})
    changed = EFFECTS["resistance_temperature"].act(changed, 20e3, {})
    assert gap(file_gaps(changed, _plain(), SHORT)).visible_volt < 1e-6
    assert gap(file_gaps(changed, _plain(), WARM_AND_COLD)).visible_volt > 1e-3


@pytest.mark.parametrize("effect", INVISIBLE)
def test_what_no_instrument_can_tell_leaves_no_gap(effect):
    """A gain is in the counted capacity too: a cell with other parameters is the same."""
    hidden = _hidden(effect, 2.5e-3)
    assert abs(hidden.parameters[EFFECTS[effect].parameter]) == INVISIBLE[effect]
    assert hidden.gap.visible_volt < INVISIBLE_VOLT
    assert not hidden.visible


def test_a_leak_and_an_offset_are_one():
    """The cell gets less than what is shown, whoever is to blame."""
    leak = _hidden("leakage", 1e-3, WITH_REST)
    offset = _hidden("current_offset", 1e-3, WITH_REST)
    found = leak.parameters["leak_ampere"], offset.parameters["offset_ampere"]
    assert found[0] == pytest.approx(found[1], rel=0.05)
    ties = [accepted(hidden, _plain(), 1) for hidden in (leak, offset)]
    assert "current_offset" in ties[0]
    assert "leakage" in ties[1]
    assert not {*ties[0], *ties[1]} & {"hysteresis_instant", "resistance_asymmetry", "time_skew"}


@pytest.mark.parametrize("delay_second", [-0.3, 0.3])
def test_skewed_voltage_is_that_of_another_instant(plain, delay_second):
    (file,) = SHORT
    late = noise_free_record(file, plain.with_chain(voltage_delay_second=delay_second))
    behaviours = fast.run(file.steps, plain.cell, chamber=steady(25.0))
    times, begin = late.steps[1][0], behaviours[0].duration_second
    inside = (times > 1.0) & (times < times[-1] - 1.0)
    true = behaviours[1].voltage(times[inside] - delay_second)
    rows = late.steps[0][0].size + np.flatnonzero(inside)
    np.testing.assert_allclose(late.volt[rows], true, atol=1e-9)
    assert begin == 20.0
    assert np.abs(true - behaviours[1].voltage(times[inside])).max() > 1e-3


def test_two_effects_are_both_there_each_as_strong_as_asked():
    first = _hidden("resistance_asymmetry", 3e-3, SHORT)
    second = _hidden("hysteresis_instant", 3e-3, SHORT, plain=first.setup)
    cell = second.setup.cell
    asymmetry = first.parameters["charge_resistance_excess_relative"]
    assert cell.charge_asymmetry == pytest.approx(asymmetry, rel=1e-5)
    instant = second.parameters["amplitude_volt"]
    assert cell.hysteresis_instant_volt == pytest.approx(instant, rel=1e-5)
    assert second.gap.visible_volt == pytest.approx(3e-3, rel=0.02)
    # Both at once leave more than either, before the plain cell.
    assert gap(file_gaps(second.setup, _plain(), SHORT)).visible_volt > 3.5e-3


@pytest.mark.parametrize("order", [1, -1])
def test_effects_on_the_same_elements_go_together(plain, order):
    """A third pair, and every pair with the activation energy."""
    first, second = ["resistance_temperature", "slow_diffusion"][::order]
    drawn = {"slow_diffusion": {"form": "third_rc", "time_constant_second": 900.0}}
    setup = plain
    for name, size in ((first, EFFECTS[first].first), (second, EFFECTS[second].first)):
        setup = EFFECTS[name].act(setup, size, drawn.get(name, {}))
    assert setup.cell.pair_r_ohm == (*plain.cell.pair_r_ohm, EFFECTS["slow_diffusion"].first)
    assert setup.cell.pair_activation_joule_per_mole == (5e3,) * 3
    fast.run(_load(1, second=20.0), setup.cell, chamber=steady(10.0))


@pytest.mark.parametrize("effect", OUTSIDE)
def test_what_is_in_no_vocabulary_leaves_a_gap(effect):
    hidden = _hidden(effect, 1e-3, SHORT)
    assert hidden.gap.visible_volt == pytest.approx(1e-3, rel=0.02)


def test_parameters_told_make_the_same_contact_again():
    hidden = _hidden("contact", 1e-3, SHORT)
    told = dict(hidden.parameters)
    again = OUTSIDE["contact"].act(_plain(), told.pop("resistance_ohm"), told)
    second, ampere = np.linspace(0, 3000, 500), np.full(500, -2.0)
    np.testing.assert_allclose(again.disturbance(second, ampere),
                               hidden.setup.disturbance(second, ampere), atol=1e-7)  # fmt: skip


# What a cell or an instrument can have at most, whatever the code says.
PLAUSIBLE = {
    "volt": 0.2, "relative": 4.0, "ohm": 0.1, "ampere": 0.1, "kelvin": 1e-2, "second": 2.0,
    "mole": 80e3, "watt": 50.0, "charge": 0.15, "per_ampere": 20.0,
}  # fmt: skip


@pytest.mark.parametrize("effect", EFFECTS)
def test_sizes_have_a_unit_and_an_end(effect):
    made = EFFECTS[effect]
    name = "per_ampere" if made.parameter.endswith("per_ampere") else made.parameter.split("_")[-1]
    assert 0 < made.first < made.most <= PLAUSIBLE[name]


@pytest.mark.parametrize("effect", ["voltage_offset", "voltage_gain", "leakage"])
def test_a_size_ends_where_it_is_no_longer_plausible(effect):
    hidden = _hidden(effect, 1.0, SHORT)
    (size, *_) = hidden.parameters.values()
    assert abs(size) == EFFECTS[effect].most
    assert hidden.gap.visible_volt < 1.0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("effect", EFFECTS)
def test_effects_leave_a_cell_a_cell(plain, effect, seed):
    """With the first size: rising open-circuit voltage, positive resistances and capacity."""
    made = EFFECTS[effect]
    drawn = made.draw(np.random.default_rng(seed))
    sign = (-1) ** seed if made.either_sign else 1
    cell = made.act(plain, sign * made.first, drawn).cell
    assert (np.diff(cell.ocv_volt) > 0).all()
    assert 0.8 * SMALL_AMPERE_HOUR < cell.capacity_ampere_hour < 1.2 * SMALL_AMPERE_HOUR
    assert np.min(cell.r0_factor) > 0
    assert all(np.min(table) > 0 for table in cell.pair_factor)
    for celsius in (10.0, 40.0):
        found = fast.resistances(cell, np.linspace(0.05, 0.95, 7), celsius=celsius)
        assert 0.005 < found["r0"].min() <= found["r_10s"].min() <= found["r_total"].min() < 0.2


def test_healthy_cells_differ_as_stated():
    cells = [healthy(np.random.default_rng(seed)).cell for seed in range(400)]
    spread = np.array([(c.r0_ohm, *c.pair_r_ohm, *c.pair_tau_second) for c in cells])
    # Four standard errors of a standard deviation of 400 draws: 14 %.
    assert np.log(spread).std(axis=0) == pytest.approx([0.18] * 3 + [0.2] * 2, rel=0.14)
    middle = np.exp(np.log(spread).mean(axis=0))
    assert middle == pytest.approx([0.020, 0.010, 0.012, 7.0, 125.0], rel=0.05)
    capacity = np.array([c.capacity_ampere_hour for c in cells])
    assert capacity.std() == pytest.approx(0.05 * 5.0, rel=0.14)
    volt = np.array([c.ocv_volt for c in cells])
    error = volt - volt.mean(axis=0)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(1e-3, rel=0.05)
    assert (np.diff(volt, axis=1) > 0).all()


def test_a_name_and_a_seed_are_one_cell():
    def parameters(name, seed):
        specimens._hidden_in.cache_clear()
        cell = HiddenCell(name, seed, "none", (), 0.0).setup.cell
        return (cell.capacity_ampere_hour, cell.r0_ohm, *cell.pair_tau_second, *cell.ocv_volt)

    assert parameters("n0001", 0) == parameters("n0001", 0)
    assert parameters("n0001", 0) != parameters("n0002", 0)
    assert parameters("n0001", 0) != parameters("n0001", 1)


def test_an_effect_is_drawn_alike_for_a_seed():
    first, again, other = (_hidden("hysteresis_one_state", 2e-3, SHORT, seed=s) for s in (1, 1, 2))
    assert first.parameters == again.parameters
    assert first.parameters != other.parameters


def test_nothing_is_told_about_a_healthy_cell():
    told = HiddenCell("n0001", 0, "none", (), 0.0).facts("n0001")["missing_effect"]
    assert told == [
        {"cell": "n0001", "kind": "none", "visible": False, "none_acceptable": True,
         "floor_volt": round(NOISE_VOLT, 6), "effects": []}
    ]  # fmt: skip


def _stub(monkeypatch, module, plain, setup):
    monkeypatch.setattr(module, "hidden_in", lambda _: SimpleNamespace(plain=plain, setup=setup))


def test_a_disturbance_goes_by_the_clock_of_the_test(monkeypatch, plain):
    ripple = OUTSIDE["ripple"].act(plain, 0.01, {"period_second": 90.0})
    _stub(monkeypatch, specimens, plain, ripple)
    cell = HiddenCell("u", 0, "unknown", ("ripple",), 6e-3)
    with_it = cell.run(_load(1), chamber=steady(25.0))
    without = fast.run(_load(1), plain.cell, chamber=steady(25.0))
    begin = 0.0
    for one, other in zip(with_it, without, strict=True):
        second = np.linspace(0.0, one.duration_second, 50)
        wave = 0.01 * np.sin(2 * np.pi * (begin + second) / 90.0)
        np.testing.assert_allclose(one.voltage(second) - other.voltage(second), wave, atol=1e-12)
        begin += one.duration_second


def test_the_cell_of_the_capacity_test_is_the_one_of_then(plain):
    changed = EFFECTS["capacity_error"].act(plain, -0.1, {})
    assert changed.at_capacity_test.capacity_ampere_hour == SMALL_AMPERE_HOUR
    assert changed.cell.capacity_ampere_hour == pytest.approx(0.9 * SMALL_AMPERE_HOUR)
    full = [Step("current", -0.35, 7200.0, 20.0, until_volt=RATING.lower_cutoff_volt)]
    then, now = (
        noise_free_record(File(full, 25.0, kind), changed) for kind in ("capacity", "drive")
    )
    taken = [record.steps[0][0][-1] for record in (then, now)]
    assert taken[1] / taken[0] == pytest.approx(0.9, rel=0.01)


def test_an_effect_laid_over_a_healthy_cell_is_the_cell_with_the_effect(monkeypatch, plain):
    """Where the cell below is the plain one itself, the sum must be the cell with the effect."""
    changed = plain.with_cell(charge_asymmetry=0.3, hysteresis_instant_volt=0.003)
    for module in (specimens, specimens):  # what it does itself, and what it has from HiddenCell
        _stub(monkeypatch, module, plain, changed)
    below = SimpleNamespace(run=partial(_run_plain, plain.cell))
    monkeypatch.setattr(HiddenPhysics, "_physical", property(lambda _: below))
    laid_over = HiddenPhysics("p", 0, "single", ("resistance_asymmetry",), 6e-3)
    steps = _load(1)
    found = laid_over.run(steps, chamber=steady(25.0))
    wanted = fast.run(steps, changed.cell, chamber=steady(25.0))
    for one, other in zip(found, wanted, strict=True):
        second = np.linspace(0.01, one.duration_second - 0.01, 300)
        np.testing.assert_allclose(one.voltage(second), other.voltage(second), atol=1e-4)


def _run_plain(cell, steps, *, chamber, initial_soc):
    return fast.run(steps, cell, chamber=chamber, initial_soc=initial_soc)


def _small(group):
    cells = [cell._replace(capacity_ampere_hour=SMALL_AMPERE_HOUR) for cell in group.cells]
    return group._replace(cells=tuple(cells))


def _numbers(group):
    """All that a group effect may change."""
    of_cells = [x for c in group.cells for x in (c.capacity_ampere_hour, c.r0_ohm, *c.pair_r_ohm)]
    sensors = [*group.chain.branch_offset_ampere, *group.chain.branch_gain]
    return [*of_cells, *group.wire_ohm, *group.initial_soc, *group.warmer_kelvin, *sensors]


@pytest.mark.parametrize("effect", GROUP_EFFECTS)
def test_effects_in_groups_are_as_strong_as_asked(effect):
    random = np.random.default_rng(4)
    plain = _small(healthy_group(random, 2))
    changed, parameters, strength = with_group_effect(plain, effect, 1e-3, GROUP_FILES, random)
    assert strength == pytest.approx(1e-3, rel=0.02)
    assert deviation(changed, plain, GROUP_FILES) == pytest.approx(strength, rel=1e-9)
    size = parameters[GROUP_EFFECTS[effect].parameter]
    assert 0 < abs(size) < GROUP_EFFECTS[effect].most
    assert parameters["branch"] in (1, 2)
    # What is told, put into the plain group, makes the changed one: by sign, too.
    again = GROUP_EFFECTS[effect].act(plain, parameters["branch"] - 1, size)
    assert _numbers(again) == pytest.approx(_numbers(changed), rel=1e-5)
    other = 2 - parameters["branch"]  # counted from 0: the branch that is as the sheets say
    assert changed.cells[other] is plain.cells[other]
    assert (changed.wire_ohm[other], changed.initial_soc[other]) == (
        plain.wire_ohm[other], plain.initial_soc[other])  # fmt: skip


def test_a_healthy_group_has_no_deviation():
    plain = healthy_group(np.random.default_rng(4), 2)
    assert deviation(plain, plain, GROUP_FILES) == 0.0
