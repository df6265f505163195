"""A space of models: where all is linear, what it says of a set is what fits of that set say."""

import numpy as np
import pytest
from linear_space import Linear, effect, random_columns
from small_plant import Truth, searched

from cellwright.effects import space
from cellwright.effects.score import densities
from cellwright.effects.search import worth
from cellwright.effects.space import block_products

COLUMNS = random_columns("one", "two", "three")
SIZES = {"one": 0.8, "two": -0.5}


@pytest.mark.parametrize("inside", [(), ("one",), ("one", "three")])
@pytest.mark.parametrize("chosen", [(), ("one",), ("two",), ("one", "two"), ("two", "three")])
def test_a_block_left_out_is_predicted_as_by_a_fit_without_it(inside, chosen):
    """Whatever the model has about which the space was made: taken out, kept or joined."""
    linear = Linear(COLUMNS, SIZES, inside=inside)
    model = linear.terms(*chosen)
    by_hand = linear.squares(chosen)
    np.testing.assert_allclose(linear.space.squares(model), by_hand, rtol=1e-6)
    by_hand = densities(by_hand)
    np.testing.assert_allclose(linear.space.density(model), by_hand, atol=1e-6)


def test_tenths_of_the_blocks_give_the_same_order():
    linear = Linear(COLUMNS, SIZES)
    sets = [(), ("three",), ("two",), ("one",), ("one", "two")]
    sums = [linear.space.roughly(linear.terms(*names)) for names in sets]
    exact = [linear.space.worth(linear.terms(*names)) for names in sets]
    assert np.argsort(sums).tolist() == np.argsort(exact).tolist()
    np.testing.assert_allclose(sums, exact, rtol=0.1)


def test_a_size_ends_on_its_bound_and_is_no_more_fitted():
    effects = {name: effect(name) for name in COLUMNS} | {"two": effect("two", lower=-0.2)}
    linear = Linear(COLUMNS, SIZES, effects=effects)
    at = linear.space.values_of(linear.terms("two"), {})
    assert at["two.size"] == -0.2
    free = Linear(COLUMNS, SIZES)
    inside, bounded = (one.space.density(one.terms("two")).sum() for one in (free, linear))
    assert bounded < inside
    held = linear.y - linear.columns["two"] * -0.2
    fits = ~linear.judges[linear.block] & (linear.block != 0)
    X = linear.plain[fits]
    b = np.linalg.solve(X.T @ X + 0.3 * np.eye(3), X.T @ held[fits])
    mine = linear.block == 0
    square = np.mean((held[mine] - linear.plain[mine] @ b) ** 2)
    assert linear.space.squares(linear.terms("two"))[0] == pytest.approx(square, rel=1e-6)


def test_terms_that_promise_most_come_first_and_each_effect_once():
    linear = Linear(COLUMNS, SIZES)
    order = linear.space.further(frozenset())
    assert [linear.space.terms[k].effect.id for k in order] == ["one", "two", "three"]
    beside = linear.space.further(linear.terms("one"), barred={"three"})
    assert [linear.space.terms[k].effect.id for k in beside] == ["two"]


def test_what_a_plausible_size_would_not_show_takes_no_part():
    effects = {name: effect(name, size=1e-3) for name in COLUMNS}
    linear = Linear(COLUMNS, SIZES, effects=effects)
    assert not any(linear.space.visible)
    assert linear.space.further(frozenset()) == []


def test_gains_are_those_over_the_model_as_it_is():
    linear = Linear(COLUMNS, SIZES, inside=("one",))
    gains = {one.id: (gain, size) for one, gain, size, *_ in linear.space.gains()}
    assert set(gains) == {"two", "three"}
    gain, size = gains["two"]
    own = linear.space.difference(linear.terms("one", "two"), linear.terms("one"))
    assert gain == own
    assert size == pytest.approx(-0.5, abs=0.15)
    changes = linear.space.changes_by_another(("a", "b", "c", "one.size"))
    both = linear.fitted(("one", "two"), ~linear.judges[linear.block])
    alone = linear.fitted(("one",), ~linear.judges[linear.block])
    found = np.array([changes[0][name] for name in ("a", "b", "c", "one.size")])
    np.testing.assert_allclose(found, both[:4] - alone, atol=1e-6)


def test_products_of_rows_by_block_and_of_those_in_none():
    random = np.random.default_rng(1)
    columns, block = random.normal(size=(60, 4)), random.integers(-1, 5, 60)
    products, loose, rows = block_products(columns, block, 6)
    for k in range(6):
        mine = columns[block == k]
        np.testing.assert_allclose(products[k], mine.T @ mine, atol=1e-12)
        assert rows[k] == len(mine)
    np.testing.assert_allclose(loose, columns[block == -1].T @ columns[block == -1])


def test_about_a_fitted_model_the_space_says_what_the_fit_says():
    found = searched(Truth(hysteresis=0.012))[0]
    last = found.spaces[-1]
    assert last.keys(last.inside) == found.model.keys
    exact = found.yardstick.density(found.model.squares)
    np.testing.assert_allclose(last.density(last.inside), exact, atol=0.02)
    assert last.worth(last.inside) == pytest.approx(worth(found.model, found.yardstick), abs=0.5)
    assert len(exact) == len(found.yardstick.blocks.record)


def test_blocks_left_out_in_the_kernel_are_what_its_twin_and_fits_without_them_say(monkeypatch):
    """Three parts of two blocks, and one block that no fit saw; five columns used, three free."""
    random = np.random.default_rng(4)
    columns = random.normal(size=(7, 30, 9))
    products = np.einsum("bri,brj->bij", columns, columns)
    part = np.array([0, 1, 2, 0, 1, 2, -1])
    of_parts = np.array([products[part == k].sum(axis=0) for k in range(3)])
    free, rest = np.array([5, 0, 3]), np.array([8, 2])
    used, whole = np.concatenate([free, rest]), of_parts.sum(axis=0)

    def fitted(grams):
        """Residual: both other columns less what the free ones explain of them."""
        pull = grams[np.ix_(free, rest)].sum(axis=1)
        return np.append(-np.linalg.solve(grams[np.ix_(free, free)], pull), [1.0, 1.0])

    fit = used, 3, fitted(whole), np.ascontiguousarray(whole[np.ix_(free, free)]), of_parts, part
    squares = space.squares_left_out(products, *fit)
    monkeypatch.setattr(space, "function", lambda *types: None)
    np.testing.assert_allclose(squares, space.squares_left_out(products, *fit), rtol=1e-12)
    for block, own in enumerate(part):
        without = fitted(whole - of_parts[own] if own >= 0 else whole)
        error = columns[block][:, used] @ without
        assert squares[block] == pytest.approx(error @ error, rel=1e-10)
