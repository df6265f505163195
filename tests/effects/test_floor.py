"""Error that no missing effect has made: noise and tolerances."""

import numpy as np
import pytest
from small_plant import CELL, HEALTHY, NOISE_VOLT, case

from cellwright.effects import base
from cellwright.effects.floor import excess_volt, floor_of
from cellwright.effects.state import State, state_of
from cellwright.numerics.least_squares import fit


def test_what_is_left_beyond_a_floor():
    assert excess_volt(5e-3, 4e-3) == pytest.approx(3e-3)
    assert excess_volt(4e-3, 5e-3) == 0.0


DRAWS = 40


def fitted(made):
    """(free parameters, State) of the plain model of a case."""
    free, values, filters = made.begun()
    return free, state_of(made, (), fit(made.problem((), free, filters), values), filters), filters


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
