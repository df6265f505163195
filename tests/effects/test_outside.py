"""What the vocabulary has no name for: told as such where it explains more than a name."""

import numpy as np
import pytest
from small_plant import HEALTHY, Truth, case, searched

from cellwright.effects.finding import of_case
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.outside import OUTSIDE
from cellwright.effects.verdict import shown_outside

DRIFTING = Truth(drift=0.25)  # [1/h]


def test_a_resistance_that_drifts_is_unknown_and_told_with_its_size():
    verdict = of_case("cell", case(DRIFTING), LIBRARY).verdict
    assert (verdict["verdict"], verdict["effects"]) == ("unknown", [])
    (told,) = verdict["outside"]
    assert (told["effect"], told["unit"]) == ("resistance_drift", "1/h")
    assert told["value"] == pytest.approx(DRIFTING.drift, abs=3 * told["std"] + 0.02)
    for side in ("rmse_volt", "validation_rmse_volt"):
        assert told[side]["after"] < 2.2e-3 < told[side]["before"]
    looks = "What is left looks like a resistance that drifts while a test runs (24.9"
    assert looks in verdict["paragraph"]
    assert "no name in the vocabulary and is not in the model: with it" in verdict["paragraph"]
    assert verdict["next_test"].startswith("To see whether the ohmic resistance drifts")
    assert verdict["against"]["resistance_drift"] == "no_name"


@pytest.mark.slow
@pytest.mark.parametrize("drift", [0.4, -0.3])
def test_so_is_a_larger_one_and_one_that_falls(drift):
    (told,) = of_case("cell", case(Truth(drift=drift)), LIBRARY).verdict["outside"]
    assert told["value"] == pytest.approx(drift, abs=3 * told["std"] + 0.02)


@pytest.mark.slow
@pytest.mark.parametrize("drift", [0.4, -0.25])
def test_a_drift_that_ends_is_no_name_either(drift):
    """The rival's law is linear; a contact that warms has another."""
    verdict = of_case("cell", case(Truth(drift=drift, settling=1200.0)), LIBRARY).verdict
    assert verdict["verdict"] == "unknown"
    (told,) = verdict["outside"]
    assert np.sign(told["value"]) == np.sign(drift)
    after = told["validation_rmse_volt"]["after"]
    assert after < 0.7 * told["validation_rmse_volt"]["before"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "truth",
    [
        HEALTHY,
        Truth(falling=0.8),
        Truth(activation=25e3),
        Truth(thermal=25.0),
        Truth(slow_ohm=0.03),
        Truth(hysteresis=0.012),
        Truth(drift=0.02),
    ],
    ids=["healthy", "over SoC", "cold", "heat", "slow", "hysteresis", "drift of 2 % an hour"],
)
def test_what_has_a_name_or_is_too_small_to_act_on_is_told_no_drift(truth):
    found, result, _ = searched(truth)
    assert shown_outside(found, result) == ()
    assert result.names or truth in (HEALTHY, Truth(drift=0.02))


def test_rivals_are_in_no_library_and_need_no_place_in_a_model():
    assert not set(OUTSIDE) & set(LIBRARY)
    for effect in OUTSIDE.values():
        assert effect.shows
        assert (effect.circuit, effect.blocks) == (None, None)
