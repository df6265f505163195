"""The verdict file: every key of the contract, its formulas, and where the remainder sits."""

import json

import numpy as np
import pytest
from small_plant import HEALTHY, Truth, searched

from cellwright.effects.judge import rate_of, worst
from cellwright.effects.library import LIBRARY
from cellwright.effects.verdict import gap_closed, verdict_of

CONTRACT = {"cell", "verdict", "effects", "located_at", "floor_volt", "next_test", "not_testable"}
OF_AN_EFFECT = {
    *("effect", "alternatives", "parameters", "rmse_volt"),
    *("validation_rmse_volt", "gap_closed"),
}
LEFT = {
    "role": ["fit", "validation"],
    "test": ["a", "b"],
    "soc_low": [0.1, 0.5],
    "soc_high": [0.2, 0.6],
    "rate": ["rest", "discharge_high"],
    "temperature_celsius": [25.0, 8.0],
    "rows": [100, 50],
    "before_rms_volt": [0.01, 0.01],
    "after_rms_volt": [0.002, 0.005],
}


def verdict(truth, **options):
    found, result, fitted = searched(truth, every=2.0)
    place = worst(LEFT, result.floor.validation_volt)
    return verdict_of("h1", found, result, place, fitted.stds, **options)


@pytest.fixture(scope="module")
def named():
    return verdict(Truth(hysteresis=0.012), next_test="a test", not_testable=("entropic_ocv",))


def test_it_has_all_keys_of_the_contract_and_is_plain_json(named):
    assert set(named) >= CONTRACT
    assert json.loads(json.dumps(named)) == named
    assert named["cell"] == "h1"
    assert named["next_test"] == "a test"
    assert named["not_testable"] == ["entropic_ocv"]


def test_an_effect_has_its_numbers_with_units(named):
    entry = named["effects"][0]
    assert named["verdict"] == "named"
    assert set(entry) >= OF_AN_EFFECT
    assert entry["effect"] == "hysteresis_instant"
    assert entry["alternatives"] == []
    size = entry["parameters"]["amplitude_volt"]
    assert size["unit"] == LIBRARY["hysteresis_instant"].parameters[0].unit
    assert size["value"] == pytest.approx(0.012, rel=0.05)
    assert 0 < size["std"] < 1e-3
    assert size["at_bound"] is False


def test_before_and_after_fall_and_close_the_gap(named):
    entry, floor = named["effects"][0], named["floor_volt"]
    for name in ("rmse_volt", "validation_rmse_volt"):
        assert entry[name]["before"] > 3 * entry[name]["after"]
    both = entry["validation_rmse_volt"]
    remaining, whole = (both[k] ** 2 - floor**2 for k in ("after", "before"))
    assert entry["gap_closed"] == pytest.approx(1 - remaining / whole)


def test_an_effect_says_how_it_was_proven(named):
    entry = named["effects"][0]
    assert entry["proof"] == "proven"
    assert entry["gain"]["total"] > 10
    assert entry["gain"]["z"] > 2
    assert entry["gain"]["rank_z"] > 3


def test_a_name_beside_another_is_less_likely_than_one_alone(named):
    (alone,) = named["effects"]
    both = verdict(Truth(hysteresis=0.012, activation=2.5e4))["effects"]
    assert len(both) == 2
    assert max(one["probability"] for one in both) < alone["probability"] < 1.0


def test_each_record_that_judges_has_its_floor_and_the_remainder_is_told(named):
    floors = {row["test"]: row["volt"] for row in named["floors"]}
    assert set(floors) == {"wild", "mild"}
    assert min(floors.values()) < named["floor_volt"] < max(floors.values())
    assert named["remainder"]["adequate"] is True
    assert named["remainder"]["excess_volt"] < 3e-3
    assert named["located_at"] is None


def test_a_healthy_cell_has_an_empty_verdict():
    result = verdict(HEALTHY)
    assert result["verdict"] == "none"
    assert result["effects"] == result["partial"] == []
    assert result["located_at"] is None
    assert result["next_test"] is None


def test_what_is_unknown_is_located_and_not_named():
    result = verdict(Truth(ripple=0.008))
    assert result["verdict"] == "unknown"
    assert result["effects"] == []
    assert result["located_at"]["file"] == "b"
    assert result["remainder"]["adequate"] is False
    assert result["remainder"]["excess_volt"] > 3e-3


def test_the_share_of_the_gap():
    assert gap_closed(5e-3, 3e-3, 0.0) == pytest.approx(1 - 9 / 25)
    assert gap_closed(5e-3, 1e-3, 1e-3) == 1.0
    assert gap_closed(5e-3, 6e-3, 1e-3) < 0
    assert gap_closed(5e-3, 0.5e-3, 1e-3) > 1
    assert gap_closed(1e-3, 1e-3, 1e-3) is None


def test_the_remainder_sits_where_most_of_it_is():
    excess = np.array([100 * (4e-6 - 1e-6), 50 * (25e-6 - 1e-6)])
    assert worst(LEFT, 1e-3) == {
        "file": "b",
        "soc": [0.5, 0.6],
        "current": "discharge_high",
        "temperature_celsius": [8.0],
        "share": pytest.approx(excess[1] / excess.sum()),
    }
    assert worst(LEFT, 0.01) is None
    assert worst({}, 1e-3) is None


def test_rates_have_a_class_each():
    current = [0.0, -0.05, -0.5, -2.0, 0.5, 2.0]
    assert rate_of(current, 1.0).tolist() == [0, 0, 1, 2, 3, 4]
