"""The fit: linear problems have an answer on paper, bounds hold, standard deviations are true."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from cellwright.numerics.least_squares import Free, Problem, derivatives, fit, level, stds

RANDOM = np.random.default_rng(7)
MATRIX = RANDOM.normal(size=(200, 3))
TRUE = np.array([1.0, -2.0, 0.5])
ROWS = MATRIX @ TRUE + RANDOM.normal(size=200)
NAMES = ("a", "b", "c")
ZERO = dict.fromkeys(NAMES, 0.0)


def linear(free=None, rows=ROWS, coupling=None):
    free = free or tuple(Free(name, 0.1) for name in NAMES)

    def predict(values):
        return MATRIX @ np.array([values[name] for name in NAMES])

    return Problem(predict, rows, np.array, free, coupling)


def at(solution):
    return np.array([solution.values[name] for name in NAMES])


def test_a_linear_problem_is_solved_in_one_step():
    solution = fit(linear(), ZERO, steps=1)
    least = np.linalg.lstsq(MATRIX, ROWS, rcond=None)[0]
    np.testing.assert_allclose(at(solution), least, atol=1e-4)
    np.testing.assert_allclose(solution.residual, ROWS - MATRIX @ at(solution), atol=1e-12)
    assert solution.chi_square == pytest.approx(solution.residual @ solution.residual)
    assert solution.names == NAMES
    assert solution.at_bound == ()


def test_priors_pull_as_on_paper():
    free = (Free("a", 0.1, 3.0, 0.05), Free("b", 0.1), Free("c", 0.1))
    coupling = np.zeros((3, 3))
    coupling[1:, 1:] = [[50.0, -20.0], [-20.0, 40.0]]
    solution = fit(linear(free, coupling=coupling), ZERO)
    weight = np.diag([400.0, 0.0, 0.0])
    precision = MATRIX.T @ MATRIX + weight + coupling
    exact = np.linalg.solve(precision, MATRIX.T @ ROWS + weight @ [3.0, 0.0, 0.0])
    np.testing.assert_allclose(at(solution), exact, atol=1e-5)
    np.testing.assert_allclose(solution.precision, precision, rtol=1e-6)


def test_a_bound_holds_and_is_told():
    free = (Free("a", 0.1, upper=0.3), Free("b", 0.1), Free("c", 0.1))
    solution = fit(linear(free), ZERO)
    assert solution.values["a"] == 0.3
    assert solution.at_bound == ("a",)
    assert solution.cost < fit(linear(free), ZERO, steps=0).cost


def test_parameters_that_move_rows_of_their_own_are_moved_together():
    owner, asked = np.arange(200) % 3, []

    def predict(values):
        asked.append(values)
        return MATRIX[:, 0] * np.array([values[name] for name in NAMES])[owner] ** 2

    problem = linear()._replace(predict=predict, apart=lambda values: [(NAMES, owner)])
    values = {"a": 1.0, "b": 2.0, "c": 3.0}
    prediction = predict(values)
    together = derivatives(problem, values, prediction)
    assert len(asked) == 2
    np.testing.assert_allclose(
        together, derivatives(problem._replace(apart=None), values, prediction)
    )


def test_what_is_not_on_a_bound_follows_what_is_in_the_same_step():
    mixed = MATRIX @ np.array([[1.0, 0.9, 0.0], [0.0, 0.4, 0.5], [0.0, 0.0, 0.9]])
    free = (Free("a", 0.1, upper=0.3), Free("b", 0.1), Free("c", 0.1, lower=-0.2))
    problem = linear(free, rows=mixed @ TRUE)._replace(
        predict=lambda values: mixed @ np.array([values[name] for name in NAMES])
    )
    solution = fit(problem, ZERO, steps=1)
    exact = lsq_linear(mixed, mixed @ TRUE, ([-np.inf, -np.inf, -0.2], [0.3, np.inf, np.inf]))
    np.testing.assert_allclose(at(solution), exact.x, atol=1e-4)
    assert solution.at_bound == ("a",)


@pytest.mark.parametrize("seed", range(5))
def test_from_any_corner_of_its_bounds_a_fit_ends_at_the_same_minimum(seed):
    """Twelve parameters that follow each other, most of them on a bound in the end."""
    random = np.random.default_rng(seed)
    names = tuple(f"p{k}" for k in range(12))
    matrix = random.normal(size=(80, 12)) @ random.normal(size=(12, 12))
    rows = matrix @ random.normal(size=12)
    lower, upper = np.full(12, -0.4), np.full(12, 0.4)

    def predict(values):
        return matrix @ np.array([values[name] for name in names])

    free = tuple(Free(name, 0.1, lower=-0.4, upper=0.4) for name in names)
    problem = Problem(predict, rows, np.array, free)
    exact = lsq_linear(matrix, rows, (lower, upper), tol=1e-13)
    corners = [dict(zip(names, random.choice([-0.4, 0.4], 12), strict=True)) for _ in range(4)]
    for corner in corners:
        solution = fit(problem, corner)
        assert solution.cost + rows @ rows == pytest.approx(2 * exact.cost + rows @ rows, rel=1e-6)
        assert np.sum(np.abs(exact.x) > 0.4 - 1e-6) == len(solution.at_bound) > 2


def test_derivatives_that_foresaw_a_step_are_not_made_anew():
    asked = []

    def predict(values):
        asked.append(values)
        return MATRIX @ np.array([values[name] for name in NAMES])

    fit(linear()._replace(predict=predict), ZERO)
    # The start, three derivatives and one step; where that would end is foreseen.
    assert len(asked) == 5


def test_a_delay_that_counts_in_whole_rows_is_level_within_one():
    """Beside a gain that makes up for what it does within the row; a straight line is not level."""
    x = np.linspace(1.0, 2.0, 50)

    def predict(values):
        return values["gain"] * (2.0 + values["delay"]) * x + 5.0 * np.ceil(values["delay"])

    free = Free("gain", 0.01, 1.0, 10.0), Free("delay", 0.05, 0.0, np.inf, -3.0, 3.0)
    problem = Problem(predict, predict({"gain": 1.0, "delay": 1.3}), lambda rows: rows / 0.01, free)
    solution = fit(problem, {"gain": 0.9, "delay": 1.6})
    lower, upper = level(problem, solution, "delay")
    assert 1.0 < lower < 1.05
    assert 1.95 < upper <= 2.0
    straight = linear()
    assert level(straight, fit(straight, ZERO), "a") is None


def test_a_derivative_stays_below_the_upper_bound():
    free = (Free("a", 0.1, upper=0.05), *(Free(name, 0.1) for name in NAMES[1:]))
    problem = linear(free)
    solution = derivatives(problem, ZERO, problem.predict(ZERO))
    np.testing.assert_allclose(solution, MATRIX, atol=1e-12)


def test_a_bent_problem_is_solved_and_the_cost_never_rises():
    clock = np.linspace(0, 5, 300)

    def predict(values):
        return values["size"] * np.exp(-clock * np.exp(values["rate"]))

    rows = predict({"size": 2.0, "rate": 0.7}) + 0.01 * np.random.default_rng(1).normal(size=300)
    free = (Free("size", 0.01), Free("rate", 0.01))
    problem = Problem(predict, rows, lambda r: r / 0.01, free)
    start = {"size": 0.3, "rate": -1.0}
    costs = [fit(problem, start, steps=n).cost for n in range(12)]
    assert (np.diff(costs) <= 1e-9).all()
    solution = fit(problem, start)
    assert solution.values["size"] == pytest.approx(2.0, abs=4 * stds(solution)["size"])
    assert solution.values["rate"] == pytest.approx(0.7, abs=4 * stds(solution)["rate"])
    assert solution.chi_square == pytest.approx(300, rel=0.3)


def test_a_chord_reaches_the_same_place():
    whole = fit(linear(), ZERO)
    near = fit(linear(), ZERO, columns=MATRIX * 1.02, renew=("a",))
    np.testing.assert_allclose(at(near), at(whole), atol=1e-2)


def test_a_further_parameter_is_made_anew_beside_derivatives_that_stay():
    two = fit(linear()._replace(free=linear().free[:2]), ZERO)
    kept = {"columns": two.columns, "white": two.white}
    np.testing.assert_allclose(at(fit(linear(), ZERO, **kept)), at(fit(linear(), ZERO)), atol=1e-6)
    by_name = fit(linear(), ZERO, columns=MATRIX * [1.0, 1.0, 0.0], renew=("c",))
    np.testing.assert_allclose(at(fit(linear(), ZERO, **kept)), at(by_name), rtol=1e-12)
    assert two.columns.shape == two.white.shape == (200, 2)


def test_standard_deviations_cover():
    far = []
    for seed in range(300):
        rows = MATRIX @ TRUE + np.random.default_rng(seed).normal(size=200)
        solution = fit(linear(rows=rows), ZERO, steps=1)
        far.append(
            [(solution.values[n] - t) / stds(solution)[n] for n, t in zip(NAMES, TRUE, strict=True)]
        )
    assert np.mean(np.square(far)) == pytest.approx(1.0, abs=0.15)
    assert np.mean(np.abs(far) < 1.96) == pytest.approx(0.95, abs=0.03)


def test_what_a_model_lacks_widens_them():
    solution = fit(linear(), ZERO)
    worse = fit(linear(rows=ROWS * 3), ZERO)
    assert stds(worse)["a"] == pytest.approx(3 * stds(solution)["a"], rel=0.15)


def test_errors_that_last_over_blocks_are_in_the_deviations_of_their_sums():
    """Each block of twenty rows errs as one: deviations by rows cover a third, by blocks most."""
    blocks, matrix = np.repeat(np.arange(20), 10), np.repeat(MATRIX[:20], 10, axis=0)
    far = {"rows": [], "blocks": []}
    for seed in range(200):
        error = np.random.default_rng(seed).normal(size=20)[blocks]
        problem = linear(rows=matrix @ TRUE + error)._replace(
            predict=lambda values: matrix @ np.array([values[name] for name in NAMES])
        )
        solution = fit(problem, ZERO, steps=1)
        off = np.array([solution.values[n] - t for n, t in zip(NAMES, TRUE, strict=True)])
        for by, told in (("rows", stds(solution)), ("blocks", stds(solution, blocks))):
            far[by].append(off / [told[n] for n in NAMES])
    assert np.mean(np.abs(far["rows"]) < 1.96) < 0.6
    assert np.mean(np.abs(far["blocks"]) < 1.96) > 0.85


def test_of_five_blocks_the_intervals_still_hold():
    """As records of a campaign are few; a normal deviation would hold nine in ten."""
    blocks, matrix = np.repeat(np.arange(5), 10), np.ones((50, 1))
    inside = []
    for seed in range(400):
        error = np.random.default_rng(seed).normal(size=5)[blocks]
        free = (Free("a", 0.1),)
        problem = Problem(lambda v: matrix[:, 0] * v["a"], 2.0 + error, np.array, free)
        solution = fit(problem, {"a": 0.0}, steps=1)
        inside.append(abs(solution.values["a"] - 2.0) < 1.96 * stds(solution, blocks)["a"])
    assert 0.92 < np.mean(inside) < 0.98


def test_inside_is_the_solution_without_what_a_bound_holds():
    free = (Free("a", 0.1, upper=0.2), Free("b", 0.1), Free("c", 0.1))
    solution = fit(linear(free), ZERO)
    inside = solution.inside
    assert solution.at_bound == ("a",)
    assert inside.names == ("b", "c")
    np.testing.assert_array_equal(inside.columns, solution.columns[:, 1:])
    np.testing.assert_array_equal(inside.white, solution.white[:, 1:])
    np.testing.assert_array_equal(inside.precision, solution.precision[1:, 1:])
    assert inside.values == solution.values
