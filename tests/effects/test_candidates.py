"""The score test: what it promises is what a refit gives, where all is linear."""

import numpy as np
import pytest

from cellwright.effects.candidates import Candidate, candidates, neutral, scored
from cellwright.effects.library.vocabulary import Effect, Parameter

RANDOM = np.random.default_rng(11)
NUISANCES = RANDOM.normal(size=(400, 4))
PRIOR = np.diag([0.0, 3.0, 0.0, 10.0])
OWN = RANDOM.normal(size=(400, 2)) + 0.8 * NUISANCES[:, :2]
ROWS = RANDOM.normal(size=400) + OWN @ [0.3, -0.2]


def effect(lower=-10.0, **changes):
    sizes = [Parameter(n, "V", 0.0, lower, 10.0, step=0.1, plausible=0.5) for n in ("one", "two")]
    shape = Parameter("width", "s", 5.0, 1.0, 9.0, step=1.0, shape=True)
    made = Effect("made_up", "", (*sizes, shape), "reading", _act)
    return made._replace(**changes)


def _act(fields, stack, p):
    return fields


def least(columns, prior):
    """Smallest cost of a linear model, and where."""
    precision = columns.T @ columns + prior
    x = np.linalg.solve(precision, columns.T @ ROWS)
    residual = ROWS - columns @ x
    return residual @ residual + x @ prior @ x, x


def score(made_up):
    cost, x = least(NUISANCES, PRIOR)
    precision = NUISANCES.T @ NUISANCES + PRIOR
    candidate = Candidate(made_up, ("made_up.one", "made_up.two"), neutral(made_up), OWN)
    residual = ROWS - NUISANCES @ x
    return cost, scored([candidate], OWN, residual, NUISANCES, precision, {})[0]


def test_the_score_is_the_gain_of_a_linear_refit():
    cost, result = score(effect())
    prior = np.zeros((6, 6))
    prior[:4, :4] = PRIOR
    after, x = least(np.concatenate([NUISANCES, OWN], axis=1), prior)
    assert result.chi_square == pytest.approx(cost - after, rel=1e-4)
    np.testing.assert_allclose(result.estimate, x[4:], rtol=1e-3)


def test_a_plausible_size_tells_what_could_be_seen():
    result = score(effect())[1]
    assert result.visible == pytest.approx(0.25 * np.diag(result.information).max())


def test_an_effect_that_the_nuisances_mimic_is_not_visible():
    made_up = effect()
    columns = NUISANCES[:, [0, 2]]
    candidate = Candidate(made_up, ("made_up.one", "made_up.two"), neutral(made_up), columns)
    precision = NUISANCES.T @ NUISANCES
    result = scored([candidate], columns, ROWS, NUISANCES, precision, {})[0]
    assert result.visible < 1e-6


def test_a_one_sided_effect_takes_no_wrong_sign():
    assert score(effect())[1].estimate[1] < 0
    assert score(effect(lower=0.0))[1].estimate[1] == 0.0


def test_two_candidates_are_scored_as_each_alone():
    made_up, (_, alone) = effect(), score(effect())
    names = ("made_up.one", "made_up.two")
    x = least(NUISANCES, PRIOR)[1]
    both = [Candidate(made_up, names, {}, OWN[:, ::-1]), Candidate(made_up, names, {}, OWN)]
    columns = np.concatenate([c.columns for c in both], axis=1)
    precision = NUISANCES.T @ NUISANCES + PRIOR
    result = scored(both, columns, ROWS - NUISANCES @ x, NUISANCES, precision, {})
    assert result[1].chi_square == pytest.approx(alone.chi_square)
    np.testing.assert_allclose(result[0].estimate, alone.estimate[::-1])


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
