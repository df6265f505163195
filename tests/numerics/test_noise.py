"""Noise: whitening makes rows independent, and no slow effect is taken for noise."""

import numpy as np
import pytest

from cellwright.effects.records import stacked
from cellwright.numerics import noise
from cellwright.numerics.noise import (
    Noise,
    estimate_noise,
    least_digit,
    least_digit_ampere,
    read_volt,
    whitening,
)
from cellwright.records.record import record_of

LIMITS = {"most_slow_volt": 5e-3, "most_slow_second": 300.0}


def stack_of(rows=6000, seed=1, records=2):
    """Records on a jittered clock, at rest."""
    random = np.random.default_rng(seed)
    made = []
    for k in range(records):
        clock = np.cumsum(random.uniform(0.5, 2.0, rows // records))
        blank = np.zeros(len(clock))
        made.append(record_of(clock, blank, blank, 0.5, test=f"r{k}"))
    return stacked(made, capacity_ampere_hour=2.0)


def drawn(truth, stack, seed=2):
    """White noise and an Ornstein–Uhlenbeck process that begins anew in each record."""
    random = np.random.default_rng(seed)
    slow, state = np.empty(len(stack.file)), 0.0
    for k, step in enumerate(stack.step_second):
        kept = 0.0 if stack.fresh[k] else np.exp(-step / truth.slow_second)
        state = kept * state + truth.slow_volt * np.sqrt(1 - kept**2) * random.normal()
        slow[k] = state
    return slow + truth.white_volt * random.normal(size=len(slow))


MIXED = Noise(1.5e-3, 0.82e-3, 100.0)


def test_whitened_rows_are_independent_and_of_unit_size():
    stack = stack_of()
    rows = drawn(MIXED, stack)
    white = whitening(MIXED, stack).apply(rows)
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.06)
    for lag in (1, 2, 5, 20):
        assert abs(np.mean(white[lag:] * white[:-lag])) < 0.05
        assert np.mean(rows[lag:] * rows[:-lag]) / np.mean(rows**2) > 0.1


def test_an_extra_error_counts_where_it_is():
    stack = stack_of(2000)
    extra = np.where(np.arange(2000) < 500, 0.01, 0.0)
    white = whitening(Noise(1e-3, 0.0, 30.0), stack, extra_volt=extra).apply(np.full(2000, 1e-3))
    assert white[0] == pytest.approx(1 / np.sqrt(101))
    assert white[-1] == pytest.approx(1.0)


def test_whitening_is_the_cholesky_factor_of_the_covariance():
    stack = stack_of(60)
    clock, file = stack.second, stack.file
    apart = np.abs(np.subtract.outer(clock, clock)) / MIXED.slow_second
    together = np.equal.outer(file, file) * np.exp(-apart) * MIXED.slow_volt**2
    root = np.linalg.cholesky(together + MIXED.white_volt**2 * np.eye(60))
    filters = whitening(MIXED, stack)
    np.testing.assert_allclose(filters.apply(np.eye(60)), np.linalg.inv(root), atol=1e-6)
    assert filters.log_variance == pytest.approx(2 * np.log(np.diag(root)).sum())


def test_kernel_and_twin_agree(monkeypatch):
    stack = stack_of(800)
    rows = np.random.default_rng(3).normal(size=(800, 4))
    kernel = whitening(MIXED, stack, extra_volt=1e-3)
    kernel_rows = kernel.apply(rows)
    monkeypatch.setattr(noise, "function", lambda *_, **__: None)
    twin = whitening(MIXED, stack, extra_volt=1e-3)
    for row, other in zip(kernel, twin, strict=True):
        np.testing.assert_allclose(row, other, rtol=1e-12)
    np.testing.assert_allclose(kernel_rows, twin.apply(rows), rtol=1e-10, atol=1e-10)


def test_rows_that_came_in_stay_as_they_were():
    stack, rows = stack_of(100), np.ones(100)
    whitening(MIXED, stack).apply(rows)
    assert (rows == 1).all()


def test_white_and_slow_noise_are_found():
    stack = stack_of()
    estimate = estimate_noise(drawn(MIXED, stack), stack, **LIMITS)
    assert estimate.white_volt == pytest.approx(1.5e-3, rel=0.1)
    assert estimate.slow_volt == pytest.approx(0.82e-3, rel=0.2)
    assert estimate.slow_second == 100.0
    assert estimate.volt == pytest.approx(MIXED.volt, rel=0.1)


def test_noise_beside_the_grid_is_whitened_all_the_same():
    stack = stack_of()
    rows = drawn(Noise(1.5e-3, 1e-3, 60.0), stack)
    white = whitening(estimate_noise(rows, stack, **LIMITS), stack).apply(rows)
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.05


def test_white_noise_has_no_slow_part():
    stack = stack_of()
    estimate = estimate_noise(drawn(Noise(2e-3, 0.0, 30.0), stack), stack, **LIMITS)
    assert estimate.white_volt == pytest.approx(2e-3, rel=0.05)
    assert estimate.slow_volt < 3e-4


def test_the_slow_part_stays_within_its_limits():
    stack = stack_of()
    rows = drawn(Noise(1e-3, 10e-3, 300.0), stack)
    assert estimate_noise(rows, stack, **LIMITS | {"most_slow_volt": 1.0}).slow_volt > 2e-3
    estimate = estimate_noise(rows, stack, most_slow_volt=1.2e-3, most_slow_second=100.0)
    assert estimate.slow_volt <= 1.2e-3
    assert estimate.slow_second <= 100.0


def test_the_white_part_is_read_beside_a_slow_gap():
    stack = stack_of()
    rows = drawn(Noise(1.5e-3, 0.0, 30.0), stack)
    gap = 0.03 * np.sin(stack.second / 400.0)
    quiet, loud = (read_volt(r, stack, steady_ampere=0.05) for r in (rows, rows + gap))
    assert quiet == pytest.approx(1.5e-3, rel=0.05)
    assert loud == pytest.approx(quiet, rel=0.05)


def test_without_neighbours_the_whole_residual_is_read():
    stack = stack_of(200)
    stack = stack._replace(current_ampere=np.tile([1.0, -1.0], 100))
    rows = drawn(Noise(1.5e-3, 0.0, 30.0), stack)
    assert read_volt(rows, stack, steady_ampere=0.05) == pytest.approx(1.5e-3, rel=0.25)


def random_walk(size=5000, step=1e-3):
    return 3.7 + np.cumsum(np.random.default_rng(11).normal(0, step, size))


DIGITS = {
    "four decimals": (np.round(random_walk(), 4), 1e-4),
    "a converter's step": (np.round(random_walk() / 1.526e-4) * 1.526e-4, 1.526e-4),
    "the same in float32": ((np.round(random_walk() / 1.526e-4) * 1.526e-4).astype("f4"), 1.526e-4),
    "the same with few digits": (np.round(np.round(random_walk() / 2.55e-3) * 2.55e-3, 3), 2.55e-3),
    "repaired rows": (np.append(np.round(random_walk(), 3), [3.70123, 3.71219]), 1e-3),
    "no digit": (random_walk(), 0.0),
    "logged every 5 mV": (4.2 - 5e-3 * np.arange(50) + 5e-5 * np.sin(np.arange(50.0)), 0.0),
    "one level": (np.full(50, 3.7), 0.0),
    "nothing": (np.array([]), 0.0),
    "not finite": (np.append(np.round(random_walk(), 3), np.nan), 1e-3),
}


@pytest.mark.parametrize("what", DIGITS)
def test_the_least_digit_is_the_step_of_the_levels(what):
    values, digit = DIGITS[what]
    assert least_digit(values) == pytest.approx(digit, rel=0.02)


def test_a_reading_that_stands_still_is_no_surer_than_its_digit():
    """Nine of ten neighbours read alike: their scatter alone says that there is no noise."""
    digit, random = 1e-3, np.random.default_rng(5)
    clock = np.arange(4000.0)
    true = 3.7 + 0.02 * np.exp(-clock / 2000) + 0.02e-3 * random.normal(size=clock.size)
    record = record_of(clock, np.zeros(4000), np.round(true / digit) * digit, 0.5)
    stack = stacked([record], capacity_ampere_hour=2.0)
    residual = stack.voltage_volt - true
    hidden = digit / np.sqrt(12)
    assert read_volt(residual, stack, steady_ampere=0.01) >= hidden * 0.99
    assert estimate_noise(residual, stack, **LIMITS).white_volt >= hidden * 0.99
    assert residual.std() == pytest.approx(hidden, rel=0.1)


def test_the_loads_of_a_protocol_are_no_digit_of_its_current():
    loads = np.repeat([0.0, -3.0, 2.25, -1.0], 50)
    assert least_digit_ampere(loads) == 0.0
    steady = np.round(0.15 + 0.01 * np.sin(np.arange(300.0)), 3)
    assert least_digit_ampere(steady) == pytest.approx(0.001)
    record = record_of(np.arange(200.0), loads, np.full(200, 3.7), 0.5)
    assert record.least_digit_ampere == 0.0


@pytest.mark.parametrize("columns", [1, 7, 8, 11, 12, 13, 33])
def test_columns_abreast_are_whitened_as_each_alone(monkeypatch, columns):
    random = np.random.default_rng(8)
    rows, gains = random.normal(size=(700, columns)), random.uniform(0.05, 0.95, (2, 700))
    gains[0, ::150] = 0.0  # where a record begins
    white = noise.Whitening(*gains, np.full(700, 0.7))
    together = white.apply(rows)
    np.testing.assert_array_equal(together, np.column_stack([white.apply(x) for x in rows.T]))
    monkeypatch.setattr(noise, "function", lambda *_, **__: None)
    np.testing.assert_allclose(together, white.apply(rows), rtol=0, atol=1e-12)
