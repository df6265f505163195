"""Noise: whitening makes rows independent, and no slow effect is taken for noise."""

import numpy as np
import pytest

from cellwright.effects.records import stacked
from cellwright.numerics import noise
from cellwright.numerics.noise import Noise, estimate_noise, read_volt, whitening, with_misfit
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


PER_RECORD = (MIXED, Noise(1.5e-3, 9e-3, 1000.0), Noise(0.4e-3, 0.0, 30.0))


def test_kernel_and_twin_agree_where_each_record_has_its_own_noise(monkeypatch):
    stack = stack_of(900, records=3)
    rows = np.random.default_rng(4).normal(size=(900, 3))
    kernel = whitening(PER_RECORD, stack, extra_volt=1e-3)
    kernel_rows = kernel.apply(rows)
    monkeypatch.setattr(noise, "function", lambda *_, **__: None)
    twin = whitening(PER_RECORD, stack, extra_volt=1e-3)
    for row, other in zip(kernel, twin, strict=True):
        np.testing.assert_allclose(row, other, rtol=1e-12)
    np.testing.assert_allclose(kernel_rows, twin.apply(rows), rtol=1e-10, atol=1e-10)


def test_a_record_with_its_own_noise_is_whitened_as_if_it_were_alone():
    stack = stack_of(900, records=3)
    rows = np.random.default_rng(4).normal(size=900)
    together = whitening(PER_RECORD, stack).apply(rows)
    for number, own in enumerate(PER_RECORD):
        alone = whitening(own, stack).apply(rows)
        part = stack.file == number
        np.testing.assert_allclose(together[part], alone[part], rtol=1e-12)


def test_a_slow_misfit_is_found_in_the_record_that_has_it_and_nowhere_else():
    stack, misfit = stack_of(9000, records=3), Noise(1.5e-3, 8e-3, 1000.0)
    own = drawn(misfit, stack, seed=5)
    rows = np.where(stack.file == 1, own, drawn(MIXED, stack))
    first, second, third = with_misfit(MIXED, rows, stack)
    assert first == third == MIXED
    assert second.volt == pytest.approx(misfit.volt, rel=0.35)
    assert second.slow_second >= 300.0
    white = whitening((first, second, third), stack).apply(rows)
    for number in range(3):
        assert np.mean(white[stack.file == number] ** 2) == pytest.approx(1.0, abs=0.1)
    as_all = whitening(MIXED, stack).apply(rows)[stack.file == 1]
    assert np.mean(as_all**2) > 1.5, "taken for the noise of all it would be significant"


@pytest.mark.parametrize("seed", range(5))
def test_healthy_records_keep_the_noise_of_all(seed):
    stack = stack_of(4000, seed=seed)
    assert with_misfit(MIXED, drawn(MIXED, stack, seed + 50), stack) == (MIXED, MIXED)


def test_rows_that_are_not_compared_are_no_misfit():
    stack = stack_of(4000)
    rows = drawn(MIXED, stack)
    unused = np.where((stack.file == 0) & (np.arange(4000) % 40 < 20), 1e4, 0.0)
    spoilt = np.where(unused > 0, 0.5, rows)
    assert with_misfit(MIXED, spoilt, stack, extra_volt=unused)[1] == MIXED
    assert with_misfit(MIXED, spoilt, stack, extra_volt=unused)[0] == MIXED


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
