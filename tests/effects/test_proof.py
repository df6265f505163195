"""What proves an effect: even help over blocks; a chi-square corrected for misfit; the floor."""

import numpy as np
import pytest
from small_plant import CELL, HEALTHY, NOISE_VOLT, case

from cellwright.effects import base
from cellwright.effects.candidates import State
from cellwright.effects.judge import BANDS
from cellwright.effects.proof import (
    blocks_of,
    can_judge,
    consistency,
    excess_volt,
    floor_of,
    inflation,
    misfit_of,
    promised_of,
)
from cellwright.numerics.least_squares import fit

MATERIAL_VOLT = 1e-3
BLOCKS, ROWS = 8, 200
BLOCK = np.repeat(np.arange(BLOCKS), ROWS)
RECORD = BLOCK // 4
RANDOM = np.random.default_rng(5)
CHANGE = 4e-3 * RANDOM.normal(size=BLOCKS * ROWS)
NOISE = 1e-3 * RANDOM.normal(size=BLOCKS * ROWS)


def judged(lacking, change=CHANGE, noise=NOISE):
    """Consistency of a change of the residual, where the model lacks another [V]."""
    before = noise + lacking
    limit = {"material_volt": MATERIAL_VOLT}
    return consistency(before, before - change, BLOCK, RECORD, **limit)


def test_an_effect_that_helps_every_block_evenly_holds():
    proof = judged(CHANGE)
    assert proof.gain == pytest.approx(1.0, abs=0.02)
    assert proof.std < 0.02
    assert (proof.excited, proof.helped, proof.hurt) == (BLOCKS, BLOCKS, 0)
    assert proof.changed_volt == pytest.approx(4e-3, rel=0.05)
    assert proof.harm == 0.0
    assert proof.worse_volt == pytest.approx(-3.1e-3, rel=0.05)
    assert proof.holds


def test_one_that_lives_from_one_block_does_not_hold_however_much_it_takes_off_there():
    """Ten times as much in one block: the pooled error falls to less than half of it."""
    size = np.where(BLOCK == 3, 10.0, 1.0)
    lacking, change = np.where(BLOCK == 3, 10.0, 0.0) * CHANGE, size * CHANGE
    proof = judged(lacking, change)
    before, after = NOISE + lacking, NOISE + lacking - change
    assert np.sqrt(np.mean(after**2)) < 0.5 * np.sqrt(np.mean(before**2))
    assert proof.std > 0.2
    assert (proof.excited, proof.helped, proof.hurt) == (BLOCKS, 1, BLOCKS - 1)
    assert not proof.holds


@pytest.mark.parametrize(("blocks", "holds"), [(40, True), (8, False)])
def test_many_blocks_that_agree_outweigh_one_with_a_large_error_of_another_kind(blocks, holds):
    """The scatter is of one that errs by far more; of eight the others are too few to tell."""
    random = np.random.default_rng(6)
    block = np.repeat(np.arange(blocks), ROWS)
    change, noise = 4e-3 * random.normal(size=(2, len(block)))
    other = np.where(block == 5, -0.45 * blocks * change, 0.0)
    before = 0.2 * noise + change + other
    proof = consistency(before, before - change, block, block // 8, material_volt=MATERIAL_VOLT)
    assert proof.gain < 2 * proof.std
    assert proof.helped == blocks - 1
    assert proof.beyond_chance is holds


def test_one_that_harms_a_fifth_of_what_it_helps_does_not_hold():
    mild = judged(np.where(BLOCK == 0, 0.4, 1.0) * CHANGE)
    grave = judged(np.where(BLOCK < 2, -0.2, 1.0) * CHANGE)
    assert mild.harm < 0.05
    assert mild.holds
    assert grave.harm > 0.2
    assert grave.helped == BLOCKS - 2
    assert not grave.holds


@pytest.mark.parametrize(("size", "holds"), [(0.4, False), (0.7, True), (1.9, True), (2.3, False)])
def test_records_that_ask_for_twice_the_size_or_less_than_half_lack_something_else(size, holds):
    proof = judged(size * CHANGE)
    assert proof.gain == pytest.approx(size, abs=0.02)
    assert proof.holds is holds


def test_one_that_changes_less_than_is_material_excites_no_block_and_is_not_proven():
    proof = judged(0.02 * CHANGE, 0.02 * CHANGE, 0.0 * NOISE)
    assert proof.gain == pytest.approx(1.0)
    assert (proof.excited, proof.helped) == (0, 0)
    assert not proof.holds


def test_one_that_follows_chance_alone_does_not_hold():
    other = 4e-3 * np.random.default_rng(6).normal(size=len(BLOCK))
    proof = judged(other)
    assert abs(proof.gain) < 3 * proof.std
    assert not proof.holds


def test_rows_that_do_not_count_and_blocks_of_few_rows_change_nothing():
    off = BLOCK == 7
    block = np.where(off, -1, BLOCK)
    limit = {"material_volt": MATERIAL_VOLT}
    spoilt = np.where(off, 1.0, NOISE + CHANGE)
    proof = consistency(spoilt, spoilt - CHANGE, block, RECORD, **limit)
    assert proof.excited == BLOCKS - 1
    assert proof.gain == pytest.approx(1.0, abs=0.02)
    none = consistency(spoilt, spoilt - CHANGE, np.full(len(block), -1), RECORD, **limit)
    assert not none.holds
    few = np.where(np.arange(len(block)) < 4, BLOCKS, BLOCK)
    spoilt = np.where(few == BLOCKS, 1.0, NOISE + CHANGE)
    assert consistency(spoilt, spoilt - CHANGE, few, RECORD, **limit).excited == BLOCKS


@pytest.mark.parametrize(
    ("share", "inflation", "excited", "gain", "judges"),
    [
        (0.3, 1.0, 3, 0.9, True),  # 1600 rows of 0.3 deviations: chi-square may fall by 144
        (0.1, 1.0, 3, 0.9, False),  # by 16, where 25 are asked
        (0.3, 6.0, 3, 0.9, False),  # as the first, with six times fewer rows that tell anything
        (0.1, 1.0, 3, 0.3, True),  # it makes the error larger: that can always be told
        (0.3, 1.0, 0, 0.9, False),  # no block changes by what matters
    ],
)
def test_records_judge_what_could_pass_there(share, inflation, excited, gain, judges):
    none = State((), None, {}, None, np.zeros(len(BLOCK)), None, 0.0, 0.0)
    changed = none._replace(validation_white=np.full(len(BLOCK), share))
    promised = promised_of(none, changed, RECORD, np.full(2, inflation)).sum()
    assert promised == pytest.approx(len(BLOCK) * share**2 / inflation)
    fitted, gates = judged(CHANGE), case(HEALTHY).gates
    shown = fitted._replace(excited=excited, gain=gain, changed_volt=0.2 * fitted.changed_volt)
    assert can_judge(gates, shown, fitted, promised) is judges
    as_much = shown._replace(changed_volt=fitted.changed_volt)
    assert can_judge(gates, as_much, fitted, promised) is (excited > 0)


def test_a_block_is_a_band_of_the_soc_in_one_record():
    stack = case(HEALTHY).validation
    soc = np.linspace(-0.1, 1.1, len(stack.file))
    rows = np.arange(len(soc)) % 7 > 0
    block = blocks_of(stack, soc, rows)
    assert (block[~rows] == -1).all()
    assert (block[rows] // BANDS == stack.file[rows]).all()
    inside = rows & (soc > 0) & (soc < 1)
    assert (block[inside] % BANDS == np.floor(10 * soc[inside])).all()


def lagged(kept, rows, seed):
    """Rows of unit variance whose neighbours correlate by `kept`."""
    random, state, made = np.random.default_rng(seed), 0.0, np.empty(rows)
    for k in range(rows):
        state = kept * state + np.sqrt(1 - kept**2) * random.normal()
        made[k] = state
    return made


def test_independent_rows_are_counted_as_they_are():
    white = np.random.default_rng(7).normal(size=60000)
    factors = inflation(white, np.zeros(60000, int), 1)
    assert 1.0 <= factors[0] < 1.3


def test_correlated_rows_count_less_each_record_by_itself():
    """Of batches far longer than the correlation: (1 + r)/(1 − r)."""
    white = np.r_[np.random.default_rng(8).normal(size=30000), lagged(0.8, 60000, 9)]
    file = np.repeat([0, 1], [30000, 60000])
    factors = inflation(white, file, 2)
    assert factors[0] < 1.3
    assert factors[1] == pytest.approx(1.8 / 0.2, rel=0.2)


def test_a_chi_square_is_never_made_larger():
    """A record of few rows, and one whose neighbours alternate."""
    alternating = np.tile([1.0, -1.0], 3000)
    factors = inflation(np.r_[alternating, [2.0] * 20], np.repeat([0, 1], [6000, 20]), 2)
    assert factors.tolist() == [1.0, 1.0]


def test_what_is_left_beyond_a_floor():
    assert excess_volt(5e-3, 4e-3) == pytest.approx(3e-3)
    assert excess_volt(4e-3, 5e-3) == 0.0


DRAWS = 40


def fitted(made):
    """(free parameters, State) of the plain model of a case."""
    free, values, filters = made.begun()
    return free, made.state((), fit(made.problem((), free, filters), values), filters), filters


def drawn(made, values, free, random):
    """Values with the OCV's error and the capacity drawn from what is known before the fit."""
    knots = [k for k, one in enumerate(free) if one.name.startswith("ocv[")]
    covariance = np.linalg.inv(base.coupling(free, made.tolerance)[np.ix_(knots, knots)])
    errors = random.multivariate_normal(np.zeros(len(knots)), covariance)
    capacity = made.tolerance.capacity * random.normal()
    names = [free[k].name for k in knots]
    return values | dict(zip(names, errors.tolist(), strict=True)) | {"capacity": float(capacity)}


def error_of_a_draw(made, values, free, filters, random):
    """Error on the records that judge of a model fitted to a cell drawn from the priors (m,) [V].

    Both sides start where they are stated: what an error of the start does is taken out elsewhere.
    """
    truth = drawn(made, values, free, random)
    volt = base.voltage(CELL, made.fit, truth)
    read = volt + NOISE_VOLT * random.normal(size=len(volt))
    one = made._replace(fit=made.fit._replace(voltage_volt=read))
    solution = fit(one.problem((), free, filters), values)
    starts = {name: value for name, value in values.items() if name.startswith("soc0[")}
    judge = made.validation
    left = base.voltage(CELL, judge, truth) - base.voltage(CELL, judge, solution.values | starts)
    return left + NOISE_VOLT * random.normal(size=len(left))


def test_the_floor_is_what_draws_from_the_priors_leave_on_records_that_judge():
    made = case(HEALTHY)
    free, state, filters = fitted(made)
    stated = {f"soc0[{k}]": float(soc) for k, soc in enumerate(made.fit.soc_at_start)}
    values = state.solution.values | {f"ocv[{k}]": 0.0 for k in range(base.OCV_KNOTS)}
    values |= stated | {"capacity": 0.0}
    here = {f"soc0[{k}]": float(soc) for k, soc in enumerate(made.validation.soc_at_start)}
    same = State((), state.solution, values | here, *state[3:])
    rows = filters.validation_rows
    floor = floor_of(made, same, free, rows, NOISE_VOLT)
    random = np.random.default_rng(12)
    errors = [error_of_a_draw(made, values, free, filters, random) for _ in range(DRAWS)]
    size = np.sqrt(np.mean(np.square(errors)[:, rows]))
    assert floor.fit_volt == NOISE_VOLT
    assert floor.validation_volt == pytest.approx(size, rel=0.1)
    beyond = [excess_volt(volt, NOISE_VOLT) for volt in (floor.validation_volt, size)]
    assert beyond[1] > 0.2e-3
    assert beyond[0] == pytest.approx(beyond[1], rel=0.35)
    for k, test in enumerate(made.validation.tests):
        part = rows & (made.validation.file == k)
        size = np.sqrt(np.mean(np.square(errors)[:, part]))
        assert floor.by_test[test] == pytest.approx(size, rel=0.15)


def test_a_wider_tolerance_raises_the_floor_and_the_noise_is_its_least():
    made = case(HEALTHY)
    free, state, filters = fitted(made)
    tight = floor_of(made, state, free, filters.validation_rows, NOISE_VOLT)
    wide = made._replace(tolerance=made.tolerance._replace(ocv_volt=0.01, capacity=0.03))
    free, state, filters = fitted(wide)
    loose = floor_of(wide, state, free, filters.validation_rows, NOISE_VOLT)
    assert NOISE_VOLT < tight.validation_volt < loose.validation_volt


def test_misfit_is_what_the_best_model_leaves_of_a_block_beyond_the_noise():
    stack = case(HEALTHY).fit
    count = len(stack.file)
    soc = np.where(stack.file == 0, 0.05, 0.95)
    near, far = np.full(count, 3e-3), np.full(count, 5e-3)
    far[stack.file == 0] = 1e-3
    misfit = misfit_of(stack, soc, [near, far], noise_volt=1e-3)
    assert np.allclose(misfit[stack.file == 0], 0.0)
    assert np.allclose(misfit[stack.file > 0], np.sqrt(8) * 1e-3)
