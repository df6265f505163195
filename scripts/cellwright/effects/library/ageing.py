"""Effect of the age of the cell, which grows from test to test."""

from cellwright.effects.base import kept_response, slowed
from cellwright.effects.library.vocabulary import Effect, Parameter, Tie, worded

LOSS, GROWTH = "capacity_loss_relative", "resistance_growth_relative"
SAME_TEST_AGAIN = "one of the first tests once more, at its temperature, after the last one"


def _ageing(fields, stack, p):
    """Capacity falls and resistances grow by the same share in each day between the tests.

    The model is that of the test that its OCV and capacity are from; earlier records have more
    capacity. ASSUME: over the weeks of one check-up neither speeds up nor slows down, and time
    constants stay as they are.
    """
    if stack.age is None:
        return fields
    left, grown = kept_response(
        stack, (stack.file,), (_ageing, *p.values()), lambda: _factors(stack, p)
    )
    fields = fields._replace(capacity=fields.capacity * left, r0=fields.r0 * grown)
    return slowed(stack, fields, (grown, grown))


def _factors(stack, p):
    """Factors of the capacity and of the resistances at each row (n,) [1]."""
    age = stack.age[stack.file]
    return (1.0 - p[LOSS]) ** age, (1.0 + p[GROWTH]) ** age


def _as_it_is(p, blocks):
    """The member is the cell at the date of the test that its OCV and capacity are from."""
    return blocks


def _loss_and_growth(effect, p, values):
    between = "between the first and the last test"
    if "aged_day" in values:
        between = f"in the {values['aged_day']:.0f} days {between}"
    return [
        (f"capacity lost {between}", 100 * p[LOSS], "%"),
        ("growth of the resistances", 100 * p[GROWTH], "%"),
    ]


EFFECTS = worded(
    Effect(
        id="ageing_between_tests",
        parameters=(
            Parameter(*(LOSS, "1", 0.0, -0.1, 0.5), step=2e-3, plausible=0.03),
            # A cell whose resistances doubled between tests of one check-up was misused, not aged.
            Parameter(*(GROWTH, "1", 0.0, -0.3, 1.0), step=0.02, plausible=0.1),
        ),
        stage="counting",
        act=_ageing,
        blocks=_as_it_is,
        needs=("age",),
        shows=SAME_TEST_AGAIN,
        ties=(Tie("capacity_temperature", SAME_TEST_AGAIN, one_order=True),),
        quantity="capacity_over_days",
        sizes_in_words=_loss_and_growth,
    ),
)
