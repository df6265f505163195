"""The reference's model with other resistances, OCV and capacity; everything else stays."""

import numpy as np
import pytest
import truth

from cellwright.bias import scaled
from cellwright.bias.courses import KNOTS, courses_of
from cellwright.circuits.model_file import simulate_model
from cellwright.refusal import Refusal


def test_scaled_reference():
    model = scaled.scaled_reference(truth.model(), cell="B", capacity=1.5, resistance_ratio=1.3)
    entry = model["members"][0]["conditions"][0]
    np.testing.assert_allclose(entry["r0_ohm"], 1.3 * truth.R0)
    np.testing.assert_allclose(entry["branches"][1]["r_ohm"], 1.3 * truth.R[1])
    assert model["kind"] == "scaled"
    with pytest.raises(Refusal, match="not positive"):
        scaled.scaled_reference(truth.model(), cell="B", capacity=1.5, resistance_ratio=0.0)


EVERYTHING = [
    {"kind": "kinetic", "r_ohm": [0.03] * 5, "tau_second": [1e-3] * 5, "scale_volt": [0.05] * 5},
    {"kind": "RC", "r_ohm": [0.0, 0.01, 0.0, 0.01, 0.02], "tau_second": [60.0] * 5},
    {"kind": "hysteresis", "m_volt": [0.01] * 5, "charge_ampere_hour": [0.06] * 5},
    {"kind": "diffusion", "soc_per_ampere": [0.01] * 5, "tau_second": [900.0] * 5},
]


def whole():
    """A reference whose chosen member has every kind that is identified, and a scaled OCV."""
    model = truth.model()
    entry = model["members"][0]["conditions"][0] | {"ocv_scale": {"missing": 0.01, "stretch": 0.02}}
    entry |= {"r0_std_ohm": [1e-3, None, 1e-3, 1e-3, 1e-3]}
    more = {"model": "all", "conditions": [entry | {"branches": EVERYTHING}]}
    return model | {"members": [*model["members"], more], "chosen": "all"}


def run(model, member, current_factor=1.0):
    time, current = truth.drive(np.random.default_rng(1), 4000)
    soc = truth.soc_of(time, current)
    return simulate_model(model, member, time, current_factor * current, soc, 25.0).voltage_volt


@pytest.mark.parametrize("member", ["2RC", "all"])
def test_a_cell_of_another_size_runs_the_same_at_the_same_rate(member):
    """k times the capacity, a k-th of the resistance, k times the current: the same voltage."""
    larger = scaled.scaled_reference(
        whole(), cell="B", capacity=3 * truth.CAPACITY_AMPERE_HOUR, resistance_ratio=1 / 3
    )
    one, other = run(whole(), member), run(larger, member, 3.0)
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-12)


def corrected(fast, slow, ocv=0.0, knots=KNOTS):
    model = whole()
    return scaled.changed(
        model,
        lambda soc: (fast, slow, ocv * np.ones(len(soc))),
        cell="B",
        capacity=model["capacity_ampere_hour"],
        kind="bias",
        notes=[],
        knots=knots,
    )


@pytest.mark.parametrize("member", ["2RC", "all"])
def test_further_knots_alone_change_nothing(member):
    finer = corrected(1.0, 1.0)
    assert len(finer["members"][0]["conditions"][0]["soc"]) > 10
    np.testing.assert_allclose(run(finer, member), run(whole(), member), rtol=0, atol=1e-12)


def test_fast_and_slow_responses_change_by_what_was_asked():
    found, before = (courses_of(one, "2RC") for one in (corrected(1.2, 1.5), whole()))
    at = np.isin(KNOTS, truth.KNOTS.round(2))  # between the knots ohms are linear, not ratios
    np.testing.assert_allclose((found.fast_ohm / before.fast_ohm)[at], 1.2, rtol=1e-9)
    np.testing.assert_allclose((found.slow_ohm / before.slow_ohm)[at], 1.5, rtol=1e-9)


def test_the_correction_moves_resistances_and_ocv_and_nothing_else():
    entry = corrected(1.2, 1.5, 0.01, knots=())["members"][1]["conditions"][0]
    kinetic, slow, hysteresis, diffusion = entry["branches"]
    np.testing.assert_allclose(np.array(entry["r0_ohm"])[[0, 2]], 1.2 * truth.R0[[0, 2]])
    np.testing.assert_allclose(entry["ocv_shift_volt"], 0.01)
    np.testing.assert_array_equal(np.array(slow["r_ohm"]) > 0, np.array([0, 1, 0, 1, 1]) > 0)
    assert kinetic["scale_volt"] == EVERYTHING[0]["scale_volt"]
    assert (hysteresis, diffusion) == (EVERYTHING[2], EVERYTHING[3])
    assert entry["ocv_scale"] == {"missing": 0.01, "stretch": 0.02}


def test_no_resistance_falls_below_a_tenth():
    entry = corrected(1e-4, 1e-4, knots=())["members"][0]["conditions"][0]
    np.testing.assert_allclose(entry["r0_ohm"], 0.1 * truth.R0)
    np.testing.assert_allclose(entry["branches"][1]["r_ohm"], 0.1 * truth.R[1])


def test_a_deviation_that_is_not_known_stays_so():
    entry = corrected(1.0, 1.0)["members"][1]["conditions"][0]
    assert entry["r0_std_ohm"][-1] == 1e-3
    assert None in entry["r0_std_ohm"]
