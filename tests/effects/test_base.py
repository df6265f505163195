"""The searched model: analytic answers, the kernel beside its twin, effects that are absent."""

import numpy as np
import pytest
import small_cells as small

from cellwright.effects import base
from cellwright.effects.columns import neutral
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import DAY_SECOND as DAY
from cellwright.effects.records import ages_of, stacked
from cellwright.numerics import lags


def values_for(stack, **changes):
    starts = {f"soc0[{k}]": float(s) for k, s in enumerate(stack.soc_at_start)}
    return small.PLAIN | starts | changes


@pytest.fixture(scope="module")
def stack():
    """Two records with loads, charges and rests, at two temperatures, a month apart."""
    both = [small.drive(seconds=2400, celsius=12.0), small.capacity_test(31.0)]
    both = [one._replace(started_second=30 * DAY * k) for k, one in enumerate(both)]
    return stacked(both, capacity_ampere_hour=small.CAPACITY, ages=ages_of(both))


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0], ids=["held", "mixed", "linear"])
def test_kernel_and_twin_agree(monkeypatch, share):
    random = np.random.default_rng(5)
    step, drive = random.exponential(3.0, 500), random.normal(size=500)
    fresh = (np.arange(500) % 200 == 0).astype(float)
    linear = (random.uniform(size=500) < share) * (1 - fresh)
    step[[7, 8]] = 0.0
    given = (step * (1 - fresh), fresh, linear, drive, 9.0, random.normal(size=500))
    kernel = lags.lag_fresh(*given)
    monkeypatch.setattr(lags, "function", lambda *_, **__: None)
    np.testing.assert_allclose(kernel, lags.lag_fresh(*given), rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", [None, *sorted(LIBRARY)])
def test_the_voltage_is_that_of_the_twins(monkeypatch, stack, name):
    effects = [] if name is None else [LIBRARY[name]]
    values = values_for(stack) | {f"ocv[{k}]": 1e-3 * (-1) ** k for k in range(base.OCV_KNOTS)}
    values |= {n: x for e in effects for n, x in _plausible(e).items()}
    compiled = base.fields_of(small.CELL, stack, values, effects)
    stack = stack._replace(responses={}, courses={})
    monkeypatch.setattr(lags, "function", lambda *_, **__: None)
    twin = base.fields_of(small.CELL, stack, values, effects)
    np.testing.assert_allclose(compiled.soc, twin.soc, rtol=0, atol=1e-14)
    np.testing.assert_allclose(compiled.ocv, twin.ocv, rtol=0, atol=1e-14)
    np.testing.assert_allclose(compiled.volt, twin.volt, rtol=0, atol=1e-12)


def _plausible(effect):
    return neutral(effect) | {
        name: p.neutral + (p.plausible or p.step)
        for p, name in zip(effect.parameters, effect.names, strict=True)
        if not p.shape
    }


@pytest.mark.parametrize("name", [None, *sorted(LIBRARY)])
def test_what_is_kept_of_other_values_changes_nothing(stack, name):
    """Any parameter moved and moved back, on records that keep courses, as on ones that do not."""
    effects = () if name is None else (LIBRARY[name],)
    values = values_for(stack) | {n: x for e in effects for n, x in _plausible(e).items()}
    for moved in values:
        for changed in (values | {moved: 1.001 * values[moved] + 1e-4}, values):
            kept = base.fields_of(small.CELL, stack, changed, effects)
            anew = stack._replace(responses={}, courses={})
            fields = base.fields_of(small.CELL, anew, changed, effects)
            for one, other in zip(kept, fields, strict=True):
                np.testing.assert_equal(one, other)


@pytest.mark.parametrize("every", [1.0, 7.0])
def test_a_pulse_is_the_analytic_one_whatever_the_sampling(every):
    pulse = np.r_[0.0, np.full(40, -2.0)]
    stack = stacked([small.record("p", pulse, every=every, soc=0.6)], capacity_ampere_hour=2.5)
    fields = base.fields_of(small.CELL, stack, values_for(stack))
    t = np.maximum(stack.second - every, 0.0)
    slow = 0.010 * -np.expm1(-t / 8.0) + 0.012 * -np.expm1(-t / 130.0)
    soc = 0.6 - 2.0 * t / 3600.0 / 2.5
    np.testing.assert_allclose(fields.soc, soc, atol=1e-12)
    volt = small.CELL.ocv_at(soc) + pulse * (0.025 + slow)
    np.testing.assert_allclose(fields.volt, volt, atol=1e-12)


def test_a_ramp_is_the_analytic_one_on_linear_intervals():
    ramp = 0.1 * np.arange(60.0)
    stack = small.record("ramp", ramp, every=4.0)
    stack = stacked([stack], capacity_ampere_hour=2.5, hold="first_order")
    t = stack.second
    exact = 0.025 * (t - 9.0 * -np.expm1(-t / 9.0))
    np.testing.assert_allclose(base.relaxed(stack, ramp, 9.0), exact, atol=1e-12)


def test_a_resistance_over_soc_is_a_factor_of_both_or_of_each(stack):
    """What an effect makes of one pair's resistance, row by row, is lagged as the factor is."""

    def each(fields, stack, p):
        factor = np.exp(p["size"] * fields.soc)
        return fields._replace(r1=fields.r1 * factor, r2=fields.r2 * factor)

    def both(fields, stack, p):
        return base.slowed(stack, fields, 2 * (np.exp(p["size"] * fields.soc),))

    effect = LIBRARY["lead_resistance"]
    effects = [
        effect._replace(act=lambda *a, act=act: act(*a[:2], {"size": 2.0})) for act in (each, both)
    ]
    values = values_for(stack) | neutral(effect)
    volts = [base.voltage(small.CELL, stack, values, (one,)) for one in effects]
    np.testing.assert_allclose(*volts, rtol=0, atol=1e-12)
    assert np.abs(volts[0] - base.voltage(small.CELL, stack, values)).max() > 1e-3


def test_a_lag_that_has_decayed_to_nothing_is_zero_and_not_the_smallest_number():
    """A state whose decay rounds to itself would stay there, ten times slower to compute with."""
    drive = np.r_[np.ones(10), np.zeros(400_000)]
    none = np.zeros(len(drive))
    state = lags.lag_fresh(np.full(len(drive), 1.0), none, none, drive, 50.0, none)
    sizes = np.abs(state[state != 0])
    assert state[5] > 0
    assert state[-1] == 0
    assert sizes.min() > 1e-300


@pytest.mark.parametrize("name", sorted(LIBRARY))
def test_an_effect_at_its_neutral_values_changes_nothing(stack, name):
    effect = LIBRARY[name]
    sizes = {f"{name}.{p.name}": p.neutral for p in effect.parameters if not p.shape}
    plain = base.voltage(small.CELL, stack, values_for(stack))
    for start in effect.starts:
        given = neutral(effect) | {f"{name}.{k}": v for k, v in start.items()} | sizes
        volt = base.voltage(small.CELL, stack, values_for(stack) | given, (effect,))
        np.testing.assert_allclose(volt, plain, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", sorted(LIBRARY))
def test_an_effect_of_plausible_size_changes_something(stack, name):
    effect = LIBRARY[name]
    given = {f"{name}.{p.name}": p.neutral if p.shape else p.plausible for p in effect.parameters}
    plain = base.voltage(small.CELL, stack, values_for(stack))
    volt = base.voltage(small.CELL, stack, values_for(stack) | given, (effect,))
    assert np.isfinite(volt).all()
    assert np.abs(volt - plain).max() > 5e-4


@pytest.mark.parametrize("name", sorted(LIBRARY))
def test_an_effect_is_within_its_own_bounds(name):
    for p in LIBRARY[name].parameters:
        assert p.lower <= p.neutral <= p.upper
        assert p.shape or p.material <= p.plausible <= p.upper


def test_the_error_of_the_ocv_is_straight_between_knots():
    soc = np.linspace(0, 1, 301)
    knots = np.random.default_rng(1).normal(size=base.OCV_KNOTS)
    straight = np.interp(soc, np.linspace(0, 1, base.OCV_KNOTS), knots)
    flat = base.Cell(1.0, np.zeros(11))
    np.testing.assert_allclose(base.looked_up(flat, tuple(knots), soc), straight, atol=1e-12)


def test_in_the_cold_resistances_and_time_constants_of_the_pairs_grow_alike():
    """A capacitance that does not change, at one temperature: a plain circuit of other values."""
    stack = stacked([small.drive(seconds=2400, celsius=5.0)], capacity_ampere_hour=small.CAPACITY)
    effect = LIBRARY["resistance_temperature"]
    sizes = neutral(effect) | {f"{effect.id}.activation_energy_joule_per_mole": 25e3}
    grown = 25e3 / 8.314462618 * (1 / 278.15 - 1 / 298.15)
    warm = values_for(stack)
    cold = warm | {name: warm[name] + grown for name in base.LOGARITHMS}
    plain = base.voltage(small.CELL, stack, cold)
    np.testing.assert_allclose(
        base.voltage(small.CELL, stack, warm | sizes, (effect,)), plain, rtol=0, atol=1e-9
    )
    kept = sizes | {f"{effect.id}.time_constant_exponent": 0.0}
    cold |= {name: warm[name] for name in ("log_tau1", "log_tau2")}
    plain = base.voltage(small.CELL, stack, cold)
    np.testing.assert_allclose(
        base.voltage(small.CELL, stack, warm | kept, (effect,)), plain, rtol=0, atol=1e-9
    )


def test_a_polarisation_over_soc_may_be_the_quicker_pairs_alone(stack):
    effect = LIBRARY["polarisation_soc"]
    steps = {f"{effect.id}.step_to_35_percent": 0.2, f"{effect.id}.step_to_20_percent": 0.3}
    quicker = {f"{effect.id}.excess_of_quicker_pair": 1.0}

    def alone(fields, stack, p):
        knots = [0.2, 0.35, 0.5]
        course = np.exp(2 * np.interp(fields.soc, knots, [0.5, 0.2, 0.0]))
        return fields._replace(r1=fields.r1 * course)

    values = values_for(stack) | neutral(effect) | steps | quicker
    volts = [
        base.voltage(small.CELL, stack, values, (one,))
        for one in (effect, effect._replace(act=alone))
    ]
    np.testing.assert_allclose(*volts, rtol=0, atol=1e-12)
    both = base.voltage(small.CELL, stack, values | dict.fromkeys(quicker, 0.0), (effect,))
    assert np.abs(both - volts[0]).max() > 1e-3


def starts_of(effect):
    """Values of an effect, all of them present, at each of its starts; shapes once beside."""
    shapes = {p.name: p.plausible or p.step or p.neutral for p in effect.parameters}
    for start in effect.starts or ({},):
        sizes = {p.name: p.neutral + shapes[p.name] for p in effect.parameters} | dict(start)
        yield {f"{effect.id}.{name}": size for name, size in sizes.items()}


@pytest.mark.parametrize("name", [None, *sorted(LIBRARY)])
def test_the_first_rows_of_records_have_the_voltage_of_the_whole(stack, name):
    """Of any effect, also of one that reads the voltage up to three seconds early.

    Read late, the first row of a record leans by millionths on the last one of the record before.
    """
    least = 1e-6 if name == "time_skew" else 0.0
    effects = [] if name is None else [LIBRARY[name]]
    ends = [70, stack.first[1] + 9]
    for sizes in starts_of(effects[0]) if effects else ({},):
        values = values_for(stack) | sizes
        short, moved_up = stack.first_rows(ends)
        whole, part = (base.voltage(small.CELL, one, values, effects) for one in (stack, short))
        assert len(part) < 100
        for first, end, up in zip(stack.first, ends, moved_up, strict=True):
            rows = part[first - up : end - up], whole[first:end]
            np.testing.assert_allclose(*rows, rtol=1e-13, atol=least)


def test_first_rows_reach_to_the_row_that_the_charge_is_counted_from(stack):
    anchored = stack._replace(anchor_row=stack.first + [200, 30], anchor_rise=np.array([-0.1, 0.0]))
    anchored = anchored.with_courses(1.0 + 0.1 * anchored.celsius, 1.0 + 0.2 * anchored.celsius)
    values = values_for(stack, capacity=0.02)
    short, moved_up = anchored.first_rows([0, len(stack.file)])
    whole, part = (base.voltage(small.CELL, one, values) for one in (anchored, short))
    assert short.first.tolist() == (stack.first - moved_up).tolist()
    assert short.tests == stack.tests
    np.testing.assert_allclose(part[:200], whole[:200], rtol=1e-13)
    np.testing.assert_allclose(part[short.first[1] :], whole[stack.first[1] :], rtol=1e-13)
