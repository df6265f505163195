"""Which effects records cannot tell apart, and which they cannot show, from sensitivities alone."""

import numpy as np
import pytest
import small_cells as small

from cellwright.effects.library import LIBRARY
from cellwright.effects.records import stacked
from cellwright.effects.sensitivity import at_starts_of, information, projected
from cellwright.effects.ties import (
    STRUCTURAL,
    RestCurrent,
    classes_of,
    confounding,
    offset_or_leak,
    rest_current,
    shown,
    tie_of,
    visibility,
    with_partners,
)


@pytest.fixture(scope="module")
def usual():
    case, model = small.usual()
    return case, model, shown(case, LIBRARY, model)


def seen(case, found):
    return visibility(found, case.gates, rows=len(case.fit.file))


def correlation(columns, *pair):
    pairs = zip(columns["effect_a"], columns["effect_b"], columns["correlation"], strict=True)
    return next(c for a, b, c in pairs if {a, b} == set(pair))


def test_leak_and_offset_are_one_class(usual):
    columns = confounding(usual[2])
    assert correlation(columns, "leakage", "current_offset") > 0.99
    own = next(one for one in classes_of(columns) if "leakage" in one)
    assert "current_offset" in own
    assert set(own) <= {"leakage", "current_offset", "coulombic_inefficiency"}


def test_what_a_drive_tells_apart_is_no_class(usual):
    columns = confounding(usual[2])
    alone = [one[0] for one in classes_of(columns) if len(one) == 1]
    dynamic = {"resistance_asymmetry", "hysteresis_instant", "slow_diffusion", "time_skew"}
    assert dynamic <= set(alone)
    assert all(0.0 <= c <= 1.0 for c in columns["correlation"])


def test_classes_are_connected_components():
    pairs = {"effect_a": list("aab"), "effect_b": list("bcc"), "same_class": [True, False, True]}
    assert classes_of(pairs) == [("a", "b", "c")]
    pairs["same_class"] = [False, False, True]
    assert classes_of(pairs) == [("a",), ("b", "c")]


@pytest.mark.parametrize("effect", ["lead_resistance", "current_gain"])
def test_a_gain_and_a_lead_leave_nothing(usual, effect):
    found = seen(usual[0], usual[2])
    assert found.fit[effect] < 1.0
    assert effect in found.unseen


@pytest.mark.parametrize("celsius", [5.0, 25.0])
@pytest.mark.parametrize(
    "effect", ["resistance_temperature", "entropic_ocv", "capacity_temperature"]
)
def test_what_depends_on_temperature_is_not_testable_at_one(celsius, effect):
    case, model = small.usual(celsius)
    assert effect in seen(case, shown(case, LIBRARY, model)).unseen


def test_resistance_over_temperature_is_testable_at_two_on_both_sides():
    fit = [small.capacity_test(), small.drive(), small.drive("cold", celsius=10.0)]
    case, model = small.case(fit, [small.drive("validation", seed=2, celsius=15.0)])
    found = seen(case, shown(case, LIBRARY, model))
    assert "resistance_temperature" not in found.unseen
    assert found.fit["resistance_temperature"] > 1000.0


def test_projection_is_what_a_refit_leaves(usual):
    """The chi-square left equals that of a least-squares fit of all nuisances, priors as rows."""
    case, model, _ = usual
    effect = LIBRARY["hysteresis_instant"]
    found = information(case.cell, case.fit, model, [effect], tolerance=case.tolerance)
    left = projected(found, case.tolerance).left[0, 0]
    whole = found.matrix[-1, -1]
    assert 0.0 < left < whole
    tight = case.tolerance._replace(ocv_volt=1e-6, soc=1e-6, capacity=1e-6)
    facts = {"tolerance": tight}
    more = projected(information(case.cell, case.fit, model, [effect], **facts), tight)
    assert left <= more.left[0, 0]


def test_information_of_records_adds_up(usual):
    """Two stacks apart tell what they tell together: their starts are their own."""
    case, model, _ = usual
    effects = [LIBRARY["slow_diffusion"], LIBRARY["leakage"]]
    records = [small.drive("a", seed=3), small.drive("b", seed=4, soc=0.8)]

    def told(chosen):
        stack = stacked(chosen, capacity_ampere_hour=small.CAPACITY)
        here = at_starts_of(model, stack)
        return information(case.cell, stack, here, effects, tolerance=case.tolerance)

    together, apart = told(records), told(records[:1]).with_more(told(records[1:]))
    scale = np.sqrt(np.outer(*[np.diag(together.matrix) + 1e-9] * 2))
    assert np.abs((together.matrix - apart.matrix) / scale).max() < 1e-6


def test_partners_are_added_where_their_bounds_allow_them():
    offset = {"current_offset.offset_ampere": 0.01}
    assert with_partners("current_offset", (), LIBRARY, offset) == ("leakage",)
    charging = {"current_offset.offset_ampere": -0.01}
    assert with_partners("current_offset", (), LIBRARY, charging) == ()
    assert with_partners("leakage", ("slow_diffusion",), LIBRARY, {}) == (
        "slow_diffusion",
        "current_offset",
    )
    assert with_partners("capacity_error", (), LIBRARY, {}) == ("current_gain",)
    assert with_partners("self_heating", (), LIBRARY, {}) == ()
    rest = {one: LIBRARY[one] for one in LIBRARY if one != "leakage"}
    assert with_partners("current_offset", (), rest, offset) == ()


def test_every_tie_is_of_known_effects_and_says_what_separates():
    for tie in STRUCTURAL:
        assert tie.effect in LIBRARY
        assert tie.check
        assert tie_of(tie.partner, tie.effect) is tie
    assert tie_of("lead_resistance").exact
    assert tie_of("self_heating") is None


def logged(offset, *, noise=0.002, step=0.001, seed=5):
    """A drive as its ammeter logs it."""
    one = small.drive()
    reading = one.current_ampere + offset
    reading = reading + noise * np.random.default_rng(seed).standard_normal(len(reading))
    reading = np.round(reading / step) * step
    stack = stacked([one._replace(current_ampere=reading)], capacity_ampere_hour=small.CAPACITY)
    return rest_current(stack, capacity_ampere_hour=small.CAPACITY)


@pytest.mark.parametrize("offset", [0.02, -0.02, 0.004])
def test_an_offset_stands_in_the_log_of_a_rest(offset):
    found = logged(offset)
    assert found.told
    assert abs(found.mean_ampere - offset) < 3 * found.std_ampere
    word, why = offset_or_leak(found, size_ampere=offset, std_ampere=0.1 * abs(offset))
    assert word == "current_offset"
    assert "mA at rest" in why


def test_a_leak_does_not():
    assert offset_or_leak(logged(0.0), size_ampere=0.01, std_ampere=0.001)[0] == "leakage"


def test_half_an_offset_settles_nothing():
    assert offset_or_leak(logged(0.01), size_ampere=0.02, std_ampere=0.001)[0] is None


def test_an_offset_below_the_uncertainty_of_the_log_settles_nothing():
    rest = RestCurrent(1e-4, 4e-4, 10, True, "")
    assert offset_or_leak(rest, size_ampere=5e-4, std_ampere=5e-5)[0] is None


def test_a_reading_forced_to_zero_cannot_tell():
    found = logged(0.0, noise=0.0)
    assert not found.told
    word, why = offset_or_leak(found, size_ampere=0.01, std_ampere=0.001)
    assert word is None
    assert "exactly zero" in why


def test_a_coarse_log_is_as_uncertain_as_its_steps():
    found = logged(0.004, noise=0.0, step=0.01)
    assert not found.told
    found = logged(0.02, noise=0.0, step=0.01)
    assert found.std_ampere >= 0.01 / np.sqrt(12) * 0.99


def test_records_without_a_rest_cannot_tell():
    one = small.record("load", np.full(600, -1.0))
    stack = stacked([one], capacity_ampere_hour=small.CAPACITY)
    found = rest_current(stack, capacity_ampere_hour=small.CAPACITY)
    assert not found.told
    assert "no rest" in found.reason


def test_an_effect_in_the_model_is_no_candidate(usual):
    case, model, _ = usual
    own = LIBRARY["hysteresis_instant"]
    values = model.values | {own.names[0]: 0.01}
    found = shown(case, LIBRARY, model._replace(values=values, effects=(own,)))
    assert own.id not in {label.effect for label in found.fit.labels}
    assert own.names[0] in {free.name for free in found.fit.nuisances}
