"""Records that judge: where they begin, and what an error of that costs nobody."""

import numpy as np
import pytest
from small_cells import CAPACITY, CELL, PLAIN, drive
from small_plant import HEALTHY, case, case_of

from cellwright.effects import base, beginning
from cellwright.effects.base import Tolerance
from cellwright.effects.judge import (
    FAR_STDS,
    Rests,
    rests_of,
    started,
    unfitted,
    unsure_by_temperature,
    unsure_of,
)
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import parts_of, stacked
from cellwright.effects.state import state_of
from cellwright.effects.stated.nuisances import declared_values_at_limit
from cellwright.numerics.least_squares import Solution, fit
from cellwright.numerics.noise import FIRST, whitening

TRUE = 0.95
TOLERANCE = Tolerance()


def laid(soc=TRUE, volt=0.0, seed=1):
    """A drive by the model itself from a true SoC, and an error of all its voltages [V]."""
    stack = stacked([drive(soc=soc, seed=seed)], capacity_ampere_hour=CAPACITY)
    measured = base.voltage(CELL, stack, PLAIN | {"soc0[0]": TRUE}) + volt
    return stack._replace(voltage_volt=measured)


def residual_of(stack, values):
    return stack.voltage_volt - base.voltage(CELL, stack, values)


def test_a_record_begins_where_its_rest_says():
    result = started(CELL, laid(soc=TRUE - 0.01), PLAIN, (), TOLERANCE)
    assert result["soc0[0]"] == pytest.approx(TRUE, abs=1e-4)


def test_no_record_begins_beyond_full_however_flat_the_ocv_is_there():
    """A rest 30 mV above a plateau that rises by 0.1 V over all of the SoC is no SoC of 1.2."""
    soc = np.linspace(0.0, 1.0, 201)
    plateau = CELL._replace(ocv_volt=3.3 + 0.1 * soc)
    stack = laid(soc=0.9, volt=0.03)._replace(soc_at_start=np.array([0.9]))
    at_rest = np.abs(stack.current_ampere) <= 0.1
    volt = np.where(at_rest, 3.3 + 0.1 * 0.9 + 0.03, stack.voltage_volt)
    tight = TOLERANCE._replace(ocv_volt=1e-4)
    result = started(plateau, stack._replace(voltage_volt=volt), PLAIN, (), tight)
    assert 1.0 < result["soc0[0]"] <= 1.0 + TOLERANCE.soc


@pytest.mark.parametrize("seed", [1, 2])
def test_a_rest_is_read_as_rests_of_fitted_records_were(seed):
    """An OCV that is off where records begin must not shift all that comes after."""
    off = 3e-3
    many = Rests(np.full(9, TRUE), np.full(9, off))
    stack = laid(seed=seed)
    resting = np.arange(len(stack.file)) < np.argmax(np.abs(stack.current_ampere) > 0.1)
    stack = stack._replace(voltage_volt=stack.voltage_volt + off * resting)
    alone = started(CELL, stack, PLAIN, (), TOLERANCE)
    with_rests = started(CELL, stack, PLAIN, (), TOLERANCE, rests=many)
    far = started(CELL, stack, PLAIN, (), TOLERANCE, rests=many._replace(soc=np.full(9, 0.5)))
    assert abs(with_rests["soc0[0]"] - TRUE) < 0.15 * abs(alone["soc0[0]"] - TRUE)
    assert far == alone


def test_starts_hang_on_first_rests_alone_and_a_record_without_one_begins_as_stated():
    """Whatever is measured later, whether the whole record rests or begins under load."""
    records = [drive(seed=3), drive(test="rest", seed=5, seconds=60)]
    stack = stacked(records, capacity_ampere_hour=CAPACITY)
    values = PLAIN | {"soc0[0]": TRUE, "soc0[1]": TRUE + 0.01}
    stack = stack._replace(voltage_volt=base.voltage(CELL, stack, values))
    found = started(CELL, stack, PLAIN, (), TOLERANCE)
    assert found["soc0[1]"] > found["soc0[0]"] + 0.005
    later = (stack.second > 59.0) & (stack.file == 0)
    other = stack._replace(voltage_volt=stack.voltage_volt + 0.5 * later)
    assert started(CELL, other, PLAIN, (), TOLERANCE) == found
    at_once = stack.current_ampere - 1.0
    at_once = stack._replace(current_ampere=at_once, voltage_volt=stack.voltage_volt + 0.02)
    begun = started(CELL, at_once, PLAIN, (), TOLERANCE)
    assert [begun[f"soc0[{k}]"] for k in range(2)] == pytest.approx(stack.soc_at_start.tolist())


def test_the_rests_of_fitted_records_are_those_before_their_first_load():
    stack = laid(volt=2e-3)
    values = PLAIN | {"soc0[0]": TRUE}
    blank = (None,) * len(Solution._fields)
    solution = Solution(*blank)._replace(values=values, residual=residual_of(stack, values))
    result = rests_of(CELL, stack, solution)
    assert result.soc == pytest.approx([TRUE])
    assert result.error_volt == pytest.approx([2e-3])


def explained_by(stack, values, effects, volt, white, shared=()):
    """Change of the voltage by what is unsure of the records, and its errors."""
    unsure = unsure_of(CELL, stack, values, effects, TOLERANCE, volt, shared)
    errors = unsure.errors_in(stack.voltage_volt - volt, white)
    return unsure.change_by(errors), errors


def explained(stack, values):
    """(chi-square, that of it which the start explains)."""
    white = whitening(FIRST, stack)
    volt = base.voltage(CELL, stack, values)
    error = stack.voltage_volt - volt
    moved, _ = explained_by(stack, values, (), volt, white)
    square, left = (float(np.sum(white.apply(one) ** 2)) for one in (error, error - moved))
    return square, square - left


def test_a_start_that_is_a_little_off_is_no_proof_of_anything():
    square, start = explained(laid(), PLAIN | {"soc0[0]": TRUE + 5e-4})
    assert start > 0.8 * square


def test_what_a_start_moves_is_taken_out_of_the_error():
    stack, values = laid(), PLAIN | {"soc0[0]": TRUE + 5e-4}
    volt, white = base.voltage(CELL, stack, values), whitening(FIRST, stack)
    moved, _ = explained_by(stack, values, (), volt, white)
    error = stack.voltage_volt - volt
    assert np.sqrt(np.mean((error - moved) ** 2)) < 0.5 * np.sqrt(np.mean(error**2))


@pytest.mark.parametrize("source", ["the chamber's", "the surface's measured"])
def test_a_sheet_that_states_a_temperature_wrongly_makes_no_error_of_the_model(source):
    """20 °C stated, 15 true: of a model that knows how its resistance follows temperature."""
    effect = LIBRARY["resistance_temperature"]
    sizes = {name: p.neutral for name, p in zip(effect.names, effect.parameters, strict=True)}
    values = PLAIN | {"soc0[0]": TRUE} | sizes | {effect.names[0]: 3e4}
    stated = drive(celsius=20.0)._replace(temperature_source=source)
    stack = stacked([stated], capacity_ampere_hour=CAPACITY)
    true = stacked([drive(celsius=15.0)], capacity_ampere_hour=CAPACITY)
    stack = stack._replace(voltage_volt=base.voltage(CELL, true, values, [effect]))
    volt, white = base.voltage(CELL, stack, values, [effect]), whitening(FIRST, stack)
    moved, errors = explained_by(stack, values, [effect], volt, white)
    error = stack.voltage_volt - volt
    left = np.sqrt(np.mean((error - moved) ** 2) / np.mean(error**2))
    if source == "the chamber's":
        assert left < 0.2
        assert errors[0, -1] == pytest.approx(-5.0, abs=1.0)
    else:
        assert left > 0.8
        assert errors.shape == (1, 1)  # of the start alone


def test_an_error_of_another_shape_stays():
    other = PLAIN | {"soc0[0]": TRUE, "log_r0": PLAIN["log_r0"] + 0.1}
    square, start = explained(laid(), other)
    assert start < 0.2 * square


def test_a_start_that_was_fitted_explains_nothing_more():
    stack, values = laid(), PLAIN | {"soc0[0]": TRUE + 5e-4}
    volt = base.voltage(CELL, stack, values)
    white = whitening(FIRST, stack)
    moved, _ = explained_by(stack, values, (), volt, white, [(0, 0)])
    assert not moved.any()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_asks_for_more_than_a_start_leaves_unsure_stays_an_error(sign):
    """60 mV under load, which a start 4 % off would follow, are not taken out of the error."""
    values, error = PLAIN | {"soc0[0]": TRUE}, sign * 0.06
    stack = laid()
    loaded = np.abs(stack.current_ampere) > 0.1
    stack = stack._replace(voltage_volt=stack.voltage_volt + error * loaded)
    volt, white = base.voltage(CELL, stack, values), whitening(FIRST, stack)
    moved, _ = explained_by(stack, values, (), volt, white)
    left = stack.voltage_volt - volt - moved
    assert np.abs(moved).max() < 0.2 * abs(error)
    assert np.sum(white.apply(left) ** 2) < np.sum(white.apply(stack.voltage_volt - volt) ** 2)


def test_records_fitted_begin_where_their_rest_says_whatever_follows():
    made = case(HEALTHY)
    values, free = unfitted(made)
    by_rest = started(made.cell, made.fit, values, (), made.tolerance)
    starts = [one for one in free if one.name.startswith("soc0[")]
    assert [one.prior for one in starts] == pytest.approx(made.fit.soc_at_start.tolist())
    for one in starts:
        ends = sorted((one.prior, by_rest[one.name]))
        assert one.std == made.tolerance.soc
        assert ends[0] - one.lower == pytest.approx(one.upper - ends[1], abs=1e-4)
        assert 0 < one.upper - ends[1] <= FAR_STDS * made.tolerance.soc
    assert any(one.upper - one.lower < 0.4 * FAR_STDS * made.tolerance.soc for one in starts)


def fitted(made):
    free, values, filters = made.begun()
    return state_of(made, (), fit(made.problem((), free, filters), values), filters)


def test_what_a_model_takes_beyond_its_tolerance_is_told_and_of_a_healthy_cell_there_is_none():
    made = case(HEALTHY)._replace(holds_declared=True)
    state, parts = fitted(made), parts_of(made.fit)
    assert declared_values_at_limit(made, state, parts) == []
    start = next(one for one in unfitted(made)[1] if one.name == "soc0[0]")
    farthest = FAR_STDS * base.ocv_stds(made.cell, made.tolerance)[7]
    moved = {
        "capacity": -0.12,
        "ocv[7]": -farthest,
        "ocv[8]": 0.5 * farthest,
        "soc0[0]": start.upper,
    }
    held = ("ocv[7]", "soc0[0]", "log_tau1")
    solution = state.solution._replace(values=state.solution.values | moved, at_bound=held)
    found = declared_values_at_limit(made, state._replace(solution=solution), parts)
    capacity, ocv, soc = found
    assert [one["name"] for one in found] == ["capacity", "open_circuit_voltage", "soc_at_start"]
    assert (capacity["value"], capacity["prior_std"]) == (-0.12, made.tolerance.capacity)
    assert (ocv["value"], ocv["soc"], ocv["unit"]) == (-farthest, pytest.approx(7 / 15), "V")
    assert ocv["prior_std"] == pytest.approx(farthest / FAR_STDS)
    assert ocv["std"] is None
    assert soc["test"] == made.fit.tests[0]
    assert soc["value"] == pytest.approx(start.upper - start.prior)


def test_an_ocv_that_nothing_holds_is_told_where_it_ends_far_off():
    made = case(HEALTHY)
    state, parts = fitted(made), parts_of(made.fit)
    values = state.solution.values | {"ocv[12]": 0.04}
    found = declared_values_at_limit(
        made, state._replace(solution=state.solution._replace(values=values)), parts
    )
    (ocv,) = found
    assert (ocv["name"], ocv["value"]) == ("open_circuit_voltage", 0.04)
    assert 0 < ocv["std"] < 0.01


def test_a_capacity_at_its_limit_is_told_without_a_deviation():
    made = case(HEALTHY)._replace(holds_declared=True)
    state, limit = fitted(made), FAR_STDS * made.tolerance.capacity
    values = state.solution.values | {"capacity": limit}
    solution = state.solution._replace(values=values, at_bound=("capacity",))
    (capacity,) = declared_values_at_limit(
        made, state._replace(solution=solution), parts_of(made.fit)
    )
    assert (capacity["value"], capacity["std"]) == (limit, None)


def test_what_was_declared_is_held_within_three_deviations():
    made = case(HEALTHY)._replace(holds_declared=True)
    free = {one.name: one for one in unfitted(made)[1]}
    limit = FAR_STDS * made.tolerance.capacity
    assert (free["capacity"].lower, free["capacity"].upper) == (-limit, limit)
    for name, std in zip(base.OCV_NAMES, base.ocv_stds(made.cell, made.tolerance), strict=True):
        assert (free[name].lower, free[name].upper) == (-FAR_STDS * std, FAR_STDS * std)
    gross = unfitted(made._replace(first_capacity=-0.1))[1]
    capacity = next(one for one in gross if one.name == "capacity")
    assert (capacity.prior, capacity.std) == (-0.1, beginning.FINER_CAPACITY)
    wide = FAR_STDS * beginning.FINER_CAPACITY
    assert (capacity.lower, capacity.upper) == pytest.approx((-0.1 - wide, wide))


def test_what_a_slow_test_told_that_is_not_fitted_is_not_held():
    """Its OCV may hold half a hysteresis."""
    declared = {"capacity", *base.OCV_NAMES}
    free = [one for one in unfitted(case(HEALTHY))[1] if one.name in declared]
    assert len(free) == len(declared)
    assert all((one.lower, one.upper) == (-np.inf, np.inf) for one in free)


def test_a_steep_ocv_may_err_by_more():
    soc = np.linspace(0, 1, 1001)
    flat, knee = 3.3 + 1e-3 * soc, 3.3 + 1e-3 * soc - 0.5 * np.exp(-soc / 0.01)
    for volt, ends in ((flat, 1.0), (knee, 20.0)):
        stds = base.ocv_stds(base.Cell(CAPACITY, volt), TOLERANCE)
        assert stds[0] >= ends * TOLERANCE.ocv_volt
        assert stds[8] == pytest.approx(TOLERANCE.ocv_volt, rel=0.01)


def test_a_capacity_that_the_records_hardly_tell_is_not_beyond_its_tolerance():
    made = case(HEALTHY)
    state = fitted(made)
    values = state.solution.values | {"capacity": 4 * made.tolerance.capacity}
    flat = state.solution._replace(values=values, precision=1e-9 * state.solution.precision)
    assert declared_values_at_limit(made, state._replace(solution=flat), parts_of(made.fit)) == []


ENERGY = "resistance_temperature.activation_energy_joule_per_mole"


def warmed(made, kelvin=0.0, record=1):
    """A fit of resistance over temperature with one record warmer: its case, state, filters."""
    effect = LIBRARY["resistance_temperature"]
    stack = made.fit._replace(stated=np.array([False, True, True]))
    celsius = stack.celsius + kelvin * (stack.file == record)
    warm = made._replace(fit=stack._replace(celsius=celsius, responses={}, courses={}))
    free, values, filters = warm.begun()
    free = warm.with_effect(free, effect)
    neutral = dict(zip(effect.names, (p.neutral for p in effect.parameters), strict=True))
    problem = warm.problem((effect,), free, filters)
    solution = fit(problem, values | neutral, steps=60, settled=1e-6)
    return warm, state_of(warm, (effect,), solution, filters), filters


def test_a_temperature_that_was_only_stated_leaves_an_energy_as_unsure_as_a_refit_shows():
    made = case_of(HEALTHY._replace(activation=25e3))
    warm, state, filters = warmed(made)
    covariance = unsure_by_temperature(warm, state, filters.fit)
    energy = state.solution.names.index(ENERGY)
    told = np.sqrt(covariance[energy, energy])
    half = 0.5  # K
    refits = [warmed(made, half, record)[1].solution.values[ENERGY] for record in (1, 2)]
    moved = (np.array(refits) - state.solution.values[ENERGY]) / half
    assert told == pytest.approx(made.tolerance.kelvin * np.hypot(*moved), rel=0.25)
    assert told > 0.05 * state.solution.values[ENERGY]
    sensed = warm._replace(fit=warm.fit._replace(stated=np.zeros(3, bool)))
    of_core = unsure_by_temperature(sensed, state, filters.fit)
    assert 0 < of_core[energy, energy] < 0.5 * covariance[energy, energy]
    known = state._replace(effects=(*state.effects, LIBRARY["self_heating"]))
    assert not unsure_by_temperature(sensed, known, filters.fit).any()
