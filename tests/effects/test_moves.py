"""Moves in a space: what joins, goes, changes places, and what helps only together."""

import numpy as np
from linear_space import BLOCKS, ROWS, Linear, effect, random_columns

from cellwright.effects.case import Gates
from cellwright.effects.library.vocabulary import Tie
from cellwright.effects.moves import best_model, rivals

GATES = Gates()
COLUMNS = random_columns("one", "two", "three", "four")


def reached(linear, *begun, **options):
    models = [linear.terms(*names) for names in begun or ((),)]
    return linear.names(best_model(linear.space, models, GATES, **options))


def test_nothing_joins_a_model_that_lacks_nothing():
    assert reached(Linear(COLUMNS, {})) == set()


def test_what_is_there_joins_and_what_is_not_goes():
    linear = Linear(COLUMNS, {"one": 0.8, "two": 0.6}, inside=("three",))
    assert reached(linear, ("three",)) == {"one", "two"}


def test_the_best_of_two_alike_takes_the_place_of_the_other():
    """Begun with an imitation, a search that only adds would keep it."""
    columns = random_columns("one", "three")
    columns["like_one"] = columns["one"] + 1.5 * random_columns("own", seed=9)["own"]
    linear = Linear(columns, {"one": 0.8}, inside=("like_one",))
    assert reached(linear, ("like_one",)) == {"one"}


def test_two_that_help_only_together_join_as_a_pair():
    """Each alone adds as much as it takes: what they share is large, and cancels."""
    random = np.random.default_rng(5)
    shared = 30.0 * random.normal(size=BLOCKS * ROWS)
    own = random.normal(size=BLOCKS * ROWS)
    columns = {"up": shared + own, "down": -shared + own}
    linear = Linear(columns, {"up": 0.5, "down": 0.5})
    alone = [linear.space.worth(linear.terms(name)) for name in columns]
    assert max(alone) < linear.space.worth(frozenset())
    assert reached(linear) == {"up", "down"}


def test_effects_that_no_test_tells_apart_are_never_both_in_a_model():
    effects = {name: effect(name) for name in COLUMNS}
    effects["one"] = effect("one", ties=(Tie("two", "nothing", exact=True),))
    linear = Linear(COLUMNS, {"one": 0.8, "two": 0.6}, effects=effects)
    assert len(reached(linear) & {"one", "two"}) == 1


def test_what_is_barred_or_was_fitted_is_not_reached_again():
    linear = Linear(COLUMNS, {"one": 0.8})
    assert reached(linear, barred={"one"}) == set()
    assert reached(linear, fitted={(("one", ()),)}) != {"one"}


def test_an_imitation_is_a_rival_and_noise_is_none():
    columns = random_columns("one", "three")
    columns["like_one"] = columns["one"] + 0.05 * random_columns("own", seed=9)["own"]
    linear = Linear(columns, {"one": 0.8}, inside=("one",))
    found = rivals(linear.space, linear.terms("one"), GATES)
    assert [linear.names(model) for model in found] == [{"like_one"}]


def test_about_the_plain_model_single_effects_are_fitted_too():
    """What is no line in its sizes is worth more than its columns promise."""
    linear = Linear(COLUMNS, {"one": 0.8})
    found = rivals(linear.space, linear.terms("one"), GATES)
    assert {name for model in found for name in linear.names(model)} == {"two", "three", "four"}
