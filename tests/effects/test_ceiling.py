"""What a function without physics could still explain, and names that fall short of it."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_plant import HEALTHY, Truth, case, rounds

from cellwright.effects.ceiling import ceiling, reached
from cellwright.effects.proof import excess_volt

SHAPED = Truth(falling=0.8)
OPENING = Truth(contact=0.012)


def of_plain(truth, **changes):
    """Ceiling of the plain model, and its State."""
    step = rounds(truth, **changes)[0]
    return ceiling(case(truth), step.before, step.filters, step.floor), step.before


def test_a_resistance_over_soc_can_be_learned():
    best, before = of_plain(SHAPED)
    assert best.learnable is True
    assert best.validation_volt < 0.6 * before.validation_rmse_volt


def test_a_contact_that_opens_under_load_can_be_learned_and_has_no_name():
    """A step over the current, of which a resistance that differs by its sign takes a part."""
    best, before = of_plain(OPENING)
    assert best.learnable is True
    assert best.validation_volt < 0.7 * before.validation_rmse_volt
    steps = rounds(OPENING)
    kept, _ = reached(case(OPENING), steps, steps[0].floor)
    assert [step.chosen for step in kept] == [None]


def test_a_healthy_cell_leaves_nothing_to_be_learned():
    best, before = of_plain(HEALTHY)
    assert best.learnable is None
    assert best.validation_volt == pytest.approx(before.validation_rmse_volt, rel=0.05)


def test_what_only_the_records_that_judge_show_cannot_be_learned():
    step, own = rounds(HEALTHY)[0], case(HEALTHY)
    wave = 0.02 * np.sin(np.arange(len(step.before.validation)) / 37.0)
    error = step.before.validation + wave
    size = float(np.sqrt(np.mean(error[step.filters.validation_rows] ** 2)))
    state = step.before._replace(validation=error, validation_rmse_volt=size)
    best = ceiling(own, state, step.filters, step.floor)
    assert best.learnable is False
    assert excess_volt(size, best.validation_volt) < 0.3 * size


def test_the_records_that_judge_do_not_move_what_is_left_of_those_fitted():
    step = rounds(SHAPED)[0]
    turned = step.before._replace(validation=-step.before.validation)
    args = case(SHAPED), step.filters, step.floor
    both = [ceiling(args[0], state, *args[1:]) for state in (step.before, turned)]
    assert both[0].fit_volt == both[1].fit_volt


@pytest.mark.parametrize(
    "truth",
    [
        *(SHAPED, Truth(hysteresis=0.012), Truth(activation=2.5e4), Truth(slow_ohm=0.04)),
        *(Truth(asymmetry=0.6), Truth(exchange=3.0, charge=0.4)),
    ],
)
def test_a_right_name_is_never_refused(truth):
    steps = rounds(truth)
    kept, refused = reached(case(truth), steps, steps[0].floor)
    assert refused is None
    assert kept is steps


def test_a_name_that_explains_a_quarter_of_what_can_be_learned_is_refused():
    steps = rounds(SHAPED)
    first = steps[0]
    plain, named = first.before, steps[-1].before

    def part_of(name):
        before, after = getattr(plain, name), getattr(named, name)
        return float(np.sqrt(before**2 - 0.25 * (before**2 - after**2)))

    sides = {name: part_of(name) for name in ("rmse_volt", "validation_rmse_volt")}
    weak = [*steps[:-1], steps[-1]._replace(before=named._replace(**sides))]
    kept, refused = reached(case(SHAPED), weak, first.floor)
    assert refused is first
    assert kept[-1].chosen is None
    assert "resistance_soc" in kept[-1].dropped


def test_nothing_is_refused_where_nothing_was_named():
    steps = rounds(HEALTHY)
    assert reached(SimpleNamespace(), steps, steps[0].floor) == (steps, None)
