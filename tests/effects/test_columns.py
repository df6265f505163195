"""What an effect would change: secants by each of its sizes, at each of its starts."""

import numpy as np

from cellwright.effects.columns import candidates, frees_of
from cellwright.effects.library.vocabulary import Effect, Parameter

RANDOM = np.random.default_rng(11)


def effect(**changes):
    sizes = [Parameter(n, "V", 0.0, -10.0, 10.0, step=0.1, plausible=0.5) for n in ("one", "two")]
    shape = Parameter("width", "s", 5.0, 1.0, 9.0, step=1.0, shape=True)
    form = Parameter("form", "1", 0.0, 0.0, 1.0, step=0.0, shape=True)
    made = Effect("made_up", (*sizes, shape, form), "reading", lambda fields, stack, p: fields)
    return made._replace(**changes)


def test_columns_are_the_change_by_each_size_at_each_start():
    made_up = effect(starts=({"width": 2.0}, {"width": 4.0, "one": 0.5}))
    base = RANDOM.normal(size=50)

    def predict(values, _):
        width = values["made_up.width"]
        return base + width * values["made_up.one"] * np.arange(50) - values["made_up.two"]

    result = candidates(predict, base, {}, [made_up])
    assert [c.start["made_up.width"] for c in result] == [2.0, 4.0]
    assert result[1].start["made_up.one"] == 0.5
    for candidate, width in zip(result, (2.0, 4.0), strict=True):
        assert candidate.sizes == ("made_up.one", "made_up.two")
        np.testing.assert_allclose(candidate.columns[:, 0], width * np.arange(50), atol=1e-9)
        np.testing.assert_allclose(candidate.columns[:, 1], -1.0, atol=1e-9)


def test_what_a_start_sets_alone_is_not_fitted():
    names = [free.name for free in frees_of(effect())]
    assert names == ["made_up.one", "made_up.two", "made_up.width"]
