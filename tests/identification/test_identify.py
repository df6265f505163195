"""Identification: recovers a known cell within its stated uncertainty, and knows its limits."""

import json

import numpy as np
import pytest
import truth
from synthetic import (
    CAPACITY,
    NOISE_VOLT,
    data,
    diffusion,
    fit,
    harsh,
    hysteresis,
    measured,
    transfer,
)

from cellwright.circuits.circuit import Branch
from cellwright.circuits.model_file import (
    condition_entry,
    ocv_from_slow_branch,
    simulate_model,
    std_of_r0,
)
from cellwright.circuits.temperature import resistance_factor
from cellwright.identification.columns import MOST_KEPT, columns_of, ocv_of, on_table
from cellwright.identification.condition import first_samples
from cellwright.identification.identify import data_of
from cellwright.identification.search import shared_of
from cellwright.records.blocks import fit_mask
from cellwright.records.filled import bridged
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

THERMAL_VOLT = 2 * 8.314462618 * 298.15 / 96485.33212
ENERGY = 30e3
COURSE = 25.0 + 6.0 * np.sin(np.arange(4000.0) / 900.0)
FACTOR = resistance_factor(COURSE, 25.0, ENERGY)


def pulls(condition):
    """(found − true)/stated of every resistance, and of the time constants."""
    named = [(condition.r0_ohm, truth.R0, condition.r0_std_ohm)]
    named += [
        (b.values["r_ohm"], true, b.stds["r_ohm"])
        for b, true in zip(condition.branches, truth.R, strict=True)
    ]
    named += [
        (b.values["tau_second"][:1], true, b.stds["tau_second"][:1])
        for b, true in zip(condition.branches, truth.TAU, strict=True)
    ]
    return [(result - true) / std for result, true, std in named]


@pytest.fixture(scope="module")
def recovered():
    return [fit(data(*measured(seed))).condition for seed in range(8)]


def test_recovers_the_true_cell_within_its_uncertainty(recovered):
    for values in zip(*map(pulls, recovered), strict=True):
        z = np.concatenate(values)
        assert np.abs(z).max() < 4.5
        assert 0.5 < np.sqrt(np.mean(z**2)) < 1.6
    for condition in recovered:
        assert condition.fit_rmse_volt == pytest.approx(NOISE_VOLT, rel=0.03)
        assert condition.at_bound == ()
        assert max(abs(condition.missing), abs(condition.stretch)) < 4e-3


def test_without_noise_the_truth_is_found(recovered):
    time, current, _, soc = measured(0)
    condition = fit(data(time, current, truth.voltage(time, current, soc), soc)).condition
    np.testing.assert_allclose(condition.r0_ohm, truth.R0, rtol=3e-3)
    taus = [branch.values["tau_second"][0] for branch in condition.branches]
    np.testing.assert_allclose(taus, truth.TAU, rtol=5e-3)
    assert condition.fit_rmse_volt < 5e-5


def test_an_error_of_the_ocv_table_does_not_become_resistance():
    condition = fit(data(*measured(6, shift=0.015))).condition
    total = sum(branch.values["r_ohm"] for branch in condition.branches)
    np.testing.assert_allclose(condition.r0_ohm, truth.R0, rtol=0.02)
    np.testing.assert_allclose(total, truth.R.sum(axis=0), rtol=0.05)


def test_the_size_of_a_hysteresis_is_found():
    fitted = fit(data(*measured(1, extra=(hysteresis(),))), "2RC+H")
    branch = fitted.condition.branches[-1]
    assert branch.kind == "hysteresis"
    np.testing.assert_allclose(branch.values["charge_ampere_hour"], 0.06)
    z = (branch.values["m_volt"] - 0.02) / branch.stds["m_volt"]
    assert np.abs(z).max() < 4.5
    np.testing.assert_allclose(branch.values["m_volt"], 0.02, rtol=0.15)


def test_where_there_is_no_hysteresis_little_is_found():
    condition = fit(data(*measured(1)), "2RC+H").condition
    branch = condition.branches[-1]
    free = np.isfinite(branch.stds["m_volt"])
    np.testing.assert_array_equal(branch.values["m_volt"][~free], 0.0)
    assert (branch.values["m_volt"] < 3 * branch.stds["m_volt"])[free].all()
    np.testing.assert_allclose(condition.r0_ohm, truth.R0, rtol=0.03)


@pytest.mark.parametrize("electrodes", [1, 2])
def test_the_scale_of_the_kinetics_is_found(electrodes):
    scale = electrodes * THERMAL_VOLT
    fitted = fit(data(*harsh(1, extra=(transfer(scale),))), "2RC+K")
    (kinetic,) = [b for b in fitted.condition.branches if b.kind == "kinetic"]
    assert fitted.held.scale_volt == pytest.approx(scale)
    np.testing.assert_allclose(kinetic.values["scale_volt"], scale)
    np.testing.assert_allclose(kinetic.values["r_ohm"], 0.04, rtol=0.05)
    linear = fit(data(*harsh(1, extra=(transfer(scale),)))).condition
    assert fitted.condition.fit_rmse_volt < 0.5 * linear.fit_rmse_volt


def test_a_linear_cell_stays_linear():
    """A scale may be tried, but next to nothing of the resistance follows it."""
    condition = fit(data(*harsh(2)), "2RC+K").condition
    (kinetic,) = [b for b in condition.branches if b.kind == "kinetic"]
    assert (kinetic.values["r_ohm"] < 0.05 * truth.R0).all()
    np.testing.assert_allclose(condition.r0_ohm + kinetic.values["r_ohm"], truth.R0, rtol=0.01)


@pytest.mark.parametrize("second", [1000.0, 4000.0])
def test_the_diffusion_time_is_found_within_a_step_of_its_grid(second):
    fitted = fit(data(*measured(2, extra=(diffusion(second),))), "2RC+D")
    assert 0.5 <= fitted.held.diffusion_second / second <= 2.0
    assert fitted.condition.fit_rmse_volt < 1.1 * NOISE_VOLT


def test_where_nothing_diffuses_no_diffusion_is_found():
    fitted = fit(data(*measured(2)), "2RC+D")
    assert fitted.held.diffusion_second is None
    assert fit(data(*measured(2)), "2RC+D", diffusion_second=2000.0).held.diffusion_second == 2000


@pytest.mark.parametrize(("missing", "stretch"), [(0.03, 0.0), (0.0, 0.02), (0.03, -0.02)])
def test_the_scale_of_the_soc_is_found(missing, stretch):
    """The capacity is 2 % off, or full was 3 % short: tens of millivolts of OCV."""
    time, current, volt, soc = measured(3)
    counted = 1.0 - (1.0 - soc - missing) / (1.0 + stretch)
    ready = data(time, current, volt, counted)
    fitted = fit(ready)
    assert fitted.condition.missing == pytest.approx(missing, abs=0.01)
    assert fitted.condition.stretch == pytest.approx(stretch, abs=0.012)
    shift = np.interp(counted, fitted.condition.soc, fitted.condition.ocv_shift_volt)
    error = ocv_of(ready, on_table(counted, fitted.held)) + shift - truth.ocv_at(soc)
    inner = (soc > 0.15) & (soc < 0.9)
    assert np.abs(error[inner]).max() < 4e-3
    np.testing.assert_allclose(fitted.condition.r0_ohm, truth.R0, rtol=0.03)


def test_a_distribution_predicts_a_drive_of_a_cell_of_two_pairs():
    condition = fit(data(*measured(4)), "DRT").condition
    assert condition.fit_rmse_volt < 1.5 * NOISE_VOLT
    time, current, volt, soc = measured(14)
    run = simulate_model(model_file("DRT", condition), None, time, current, soc, 25.0)
    inner = (soc > 0.1) & (soc < 0.9)
    assert np.sqrt(np.mean((run.voltage_volt - volt)[inner] ** 2)) < 1.5 * NOISE_VOLT


def model_file(name, condition):
    """One condition as it comes back from a file."""
    about = {"ambient_temperature_celsius": 25.0, "tests": ["a"]}
    entry = condition_entry(condition, **about) | {"activation_energy_joule_per_mole": ENERGY}
    table = {"soc": truth.OCV_SOC.tolist(), "ocv_volt": truth.OCV_VOLT.tolist()}
    model = {
        "cell": "A",
        "capacity_ampere_hour": 2.0,
        "ocv": [table | {"ambient_temperature_celsius": 25.0}],
        "members": [{"model": name, "conditions": [entry]}],
        "chosen": name,
    }
    return json.loads(json.dumps(model))


@pytest.fixture(scope="module")
def warmed():
    """All effects at once, the cell's temperature moving; ready for either hold."""
    extra = (hysteresis(), diffusion(2000.0, FACTOR), transfer(THERMAL_VOLT, 0.04 * FACTOR))
    columns = {}
    for hold in ("first_order", "zero_order"):
        run = harsh(5, extra=extra, resistance_factor=FACTOR, hold=hold)
        columns[hold] = data(*run, resistance_factor=FACTOR, hold=hold, knots=None)
    return columns


MEMBERS = ("0RC", "1RC", "2RC", "2RC+H", "DRT", "DRT+K", "DRT+D", "DRT+H+K+D")


@pytest.mark.parametrize("hold", ["first_order", "zero_order"])
@pytest.mark.parametrize("name", MEMBERS)
def test_the_file_simulates_what_was_fitted(warmed, name, hold):
    """Entry → JSON → look-up → simulation gives the voltage of the columns it was solved with."""
    ready = warmed[hold]
    fitted = fit(ready, name)
    (record,) = ready.records
    celsius = np.interp(record.test_time_second, np.arange(4000.0), COURSE)
    args = (record.test_time_second, record.current_ampere, record.soc, celsius)
    run = simulate_model(model_file(name, fitted.condition), None, *args, hold=hold)
    simulated = run.voltage_volt[record.used]
    np.testing.assert_allclose(simulated, predicted(ready, fitted), rtol=0, atol=absent(fitted))
    rmse = np.sqrt(np.mean((simulated - record.voltage_volt[record.used]) ** 2))
    assert rmse == pytest.approx(fitted.condition.fit_rmse_volt, rel=0.005)


def absent(result):
    """A diffusion that was not found is written as one of next to nothing."""
    written = any(branch.kind == "diffusion" for branch in result.condition.branches)
    return 1e-7 if written and result.held.diffusion_second is None else 1e-9


def predicted(ready, result):
    """Voltage of the used rows by the columns of the design."""
    columns, values = columns_of(ready, result.held), result.solution.values
    measured_volt = np.concatenate([r.voltage_volt[r.used] for r in ready.records])
    over = sum(column @ values[name] for name, column in columns.resistances)
    return measured_volt - columns.target_volt + columns.shift @ values["shift"] + over


def test_a_linear_fit_is_simulated_to_its_own_residual(warmed):
    """The SoC's scale that is written is the one that the values belong to, also where it ran."""
    for name in ("0RC", "2RC+H", "DRT"):
        fitted, ready = fit(warmed["first_order"], name), warmed["first_order"]
        residual = ready.records[0].voltage_volt[ready.records[0].used] - predicted(ready, fitted)
        np.testing.assert_allclose(residual, fitted.solution.residual_volt, rtol=0, atol=1e-9)


def test_a_gap_that_is_bridged_costs_nothing():
    """Set points without the discharges between them: the same cell as from the whole record."""
    cycle = np.zeros(1800)
    cycle[:540], cycle[900:930], cycle[1200:1230] = -2.0, -3.0, 2.0
    current = np.concatenate([np.zeros(60), np.tile(cycle, 5)])
    time = np.arange(float(len(current)))
    soc = truth.soc_of(time, current, 0.95)
    volt = truth.voltage(time, current, soc) + np.random.default_rng(1).normal(0, 2e-4, len(time))
    kept = (time < 60) | ((time - 60) % 1800 >= 780)
    whole = record_of(time, current, volt, soc)
    cut = record_of(time[kept], current[kept], volt[kept], soc[kept])
    full, mended, torn = (
        fit(data_of([record], truth.OCV_VOLT, capacity_ampere_hour=CAPACITY))
        for record in (whole, bridged(cut, capacity_ampere_hour=CAPACITY), cut)
    )
    at = np.linspace(0.3, 0.7, 9)
    course = [np.interp(at, f.condition.soc, f.condition.r0_ohm) for f in (full, mended)]
    np.testing.assert_allclose(course[1], course[0], rtol=0.02)
    assert mended.condition.fit_rmse_volt < 1.5 * full.condition.fit_rmse_volt
    assert torn.condition.fit_rmse_volt > 2.0 * mended.condition.fit_rmse_volt


def test_rows_that_are_not_used_do_not_move_the_fit():
    time, current, volt, soc = measured(8)
    mask = fit_mask(time, current, rest_ampere=0.01)
    spoiled = np.where(mask, volt, volt + 0.3)
    for name in ("2RC+H", "DRT+K"):
        first, second = (
            fit(data(time, current, v, soc, used=mask), name).condition for v in (volt, spoiled)
        )
        entries = [
            json.dumps(condition_entry(c, ambient_temperature_celsius=25.0, tests=[]))
            for c in (first, second)
        ]
        assert entries[0] == entries[1]


def test_a_time_constant_at_its_bound_is_named_and_has_no_deviation():
    condition = fit(data(*measured(9)), limits_second=(0.5, 60.0)).condition
    assert "tau2" in [one["parameter"] for one in condition.at_bound]
    assert np.isnan(condition.branches[1].stds["tau_second"]).all()


def test_more_pairs_than_the_cell_has_are_still_fitted():
    """Pairs that hold nothing have no deviation, and no number that is not finite is written."""
    time, current, _, soc = measured(9)
    noise = np.random.default_rng(9).normal(0, NOISE_VOLT, len(time))
    ohmic = truth.ocv_at(soc) + 0.03 * current + noise
    condition = fit(data(time, current, ohmic, soc), "3RC").condition
    np.testing.assert_allclose(condition.r0_ohm, 0.03, rtol=5e-3)
    assert np.isfinite([branch.values["r_ohm"] for branch in condition.branches]).all()


def test_entry_is_plain_and_complete():
    condition = fit(data(*measured(10)), "2RC+H").condition
    entry = condition_entry(condition, ambient_temperature_celsius=np.nan, tests=("a",))
    assert entry["ambient_temperature_celsius"] is None
    assert [len(entry[k]) for k in ("soc", "r0_ohm", "r0_std_ohm", "ocv_shift_volt")] == [5] * 4
    assert [branch["kind"] for branch in entry["branches"]] == ["RC", "RC", "hysteresis"]
    assert entry["branches"][2]["charge_std_ampere_hour"] == [None] * 5
    assert isinstance(entry["r0_ohm"][0], float)
    assert json.loads(json.dumps(entry, allow_nan=False)) == entry


def test_what_a_fit_misses_at_the_first_samples_is_part_of_r0():
    """A third pair, of 1 s, which a circuit of two cannot hold."""
    fast = Branch("RC", {"r_ohm": 0.01, "tau_second": 1.0})
    time, current = [0.0], [0.0]
    legs = [(-2.0, 10.0, 0.2), (0.0, 40.0, 0.2), (-1.0, 550.0, 5.0), (0.0, 900.0, 5.0)]
    for ampere, seconds, period in 9 * legs:
        after = np.append(1e-3, np.arange(1, round(seconds / period) + 1) * period)
        time, current = np.append(time, time[-1] + after), np.append(current, 0 * after + ampere)
    soc = truth.soc_of(time, current, 0.95)
    volt = truth.voltage(time, current, soc, extra=[fast])
    noise = np.random.default_rng(1).normal(0, 1e-4, len(time))
    condition = fit(data(time, current, volt + noise, soc)).condition
    second = condition.first_sample_second
    assert second == pytest.approx(0.2, abs=0.01)

    def then(r0, pairs):
        return r0 + sum(ohm * -np.expm1(-second / tau) for ohm, tau in pairs)

    true = then(truth.R0, [*zip(truth.R, truth.TAU, strict=True), (0.01, 1.0)])
    names = ("r_ohm", "tau_second")
    found = then(condition.r0_ohm, [[b.values[n] for n in names] for b in condition.branches])
    entry = condition_entry(condition, ambient_temperature_celsius=25.0, tests=[])
    wrong = np.abs(found - true)
    assert np.all(wrong < 1.96 * np.array(std_of_r0(entry)))
    assert np.all(wrong[2:] > 1.96 * condition.r0_std_ohm[2:])  # were the circuit right


def test_a_step_whose_rows_do_not_count_says_nothing_of_the_first_samples():
    """A single row of a wrong current, left out of the fit, as a mark of −9999 A is."""
    time, current = np.arange(40.0), np.zeros(40)
    current[20] = -9999.0
    record = record_of(time, current, np.full(40, 3.7), np.full(40, 0.5), used=current == 0)
    one = data_of([record], np.linspace(3.0, 4.2, 100), capacity_ampere_hour=3.0)
    second, missed = first_samples(one, 1e-3 * np.arange(39.0))
    assert second > 0
    assert np.isnan(missed).all()


def test_one_slow_branch_gives_the_true_ocv_back():
    """Where resistance does not change with SoC the correction is exact."""
    condition = fit(data(*measured(11))).condition
    true = [
        b._replace(values={"r_ohm": r}) for b, r in zip(condition.branches, truth.R, strict=True)
    ]
    total = np.interp(truth.OCV_SOC, truth.KNOTS, truth.R0 + truth.R.sum(axis=0))
    slow = truth.OCV_VOLT - 0.1 * total
    corrected = ocv_from_slow_branch(
        truth.OCV_SOC, slow, -0.1, condition._replace(r0_ohm=truth.R0, branches=tuple(true))
    )
    np.testing.assert_allclose(corrected, truth.OCV_VOLT, atol=1e-12)


def test_knots_are_dense_near_empty_and_end_with_the_data():
    time, current, volt, soc = measured(12)
    knots = data(time, current, volt, soc, knots=None, spacing=0.1).knots
    assert knots[0] == soc.min()
    assert knots[-1] == soc.max()
    inner = knots[(knots > 0.2) & (knots < soc.max())]
    np.testing.assert_allclose(np.diff(inner), 0.1)
    empty = (soc - soc.min()) / np.ptp(soc)
    assert {0.02, 0.04, 0.1, 0.15} <= set(data(time, current, volt, empty, knots=None).knots)


def test_refusals():
    time = np.arange(100.0)
    with pytest.raises(Refusal, match="current never changes"):
        data(time, time * 0 - 1.0, time * 0 + 3.7, time * 0 + 0.5)
    time, current, volt, soc = measured(13)
    with pytest.raises(Refusal, match="no row of the records is left"):
        data(time, current, volt, soc, used=np.zeros(len(time), bool))
    with pytest.raises(Refusal, match="5 rows cannot carry"):
        fit(data(time, current, volt, soc, used=time < 5))
    with pytest.raises(Refusal, match="nothing in the data excites r0"):
        fit(data(time, current, volt, soc, used=(current == 0) & (time > 1250)))


@pytest.mark.parametrize("r_ohm", [0.02, 0.2])
def test_kinetics_settle_to_the_true_resistance(r_ohm):
    """Resistance damps itself: what is written is what it was solved with."""
    ready = data(*harsh(6, extra=(transfer(THERMAL_VOLT, r_ohm),)))
    fitted = fit(ready, "DRT+K")
    np.testing.assert_allclose(fitted.held.transfer_ohm, r_ohm, rtol=0.08)
    (record,) = ready.records
    gap = record.voltage_volt[record.used] - predicted(ready, fitted)
    np.testing.assert_allclose(gap, fitted.solution.residual_volt, atol=3e-4)


def test_members_that_share_columns_and_searches_are_those_fitted_alone():
    ready = data(*harsh(11, extra=(transfer(0.05), hysteresis())))
    shared = shared_of(ready)
    for member in ("1RC", "2RC", "2RC+H", "DRT+K", "DRT+H+K+D"):
        alone, together = (fit(ready, member, shared=one) for one in (None, shared))
        assert together.held.tau_second == alone.held.tau_second
        residual_volt = together.solution.residual_volt
        np.testing.assert_allclose(residual_volt, alone.solution.residual_volt, atol=1e-9)
        for one, other in zip(together.condition.branches, alone.condition.branches, strict=True):
            for name, values in one.values.items():
                np.testing.assert_allclose(values, other.values[name], rtol=1e-6, atol=1e-9)
    assert len(shared.data.kept) <= MOST_KEPT
