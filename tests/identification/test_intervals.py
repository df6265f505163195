"""Intervals of a simulated voltage: nine of ten samples of what was not seen lie within them."""

import numpy as np
import pytest
import truth

from cellwright.circuits.model_file import simulate_model
from cellwright.identification.in_use import FittedRecord
from cellwright.identification.intervals import (
    _start_std,
    beyond,
    half_width_volt,
    shares_holding,
    simulated,
    with_intervals,
)
from cellwright.identification.validation import below_in_words, validate
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

BLOCK = 400  # rows
SHARE, READING_VOLT = 0.08, 2e-3  # of the overvoltage that a model misses in a block, and a reading


def record(seed, *, share=SHARE, blocks=40, amplify=1.0, celsius=25.0, start=0.95, **about):
    """A drive whose overvoltage is off by another share in each block, and its blocks."""
    random = np.random.default_rng(seed)
    time, current = truth.drive(random, blocks * BLOCK)
    current = amplify * current
    soc = truth.soc_of(time, current, start)
    model = truth.model()
    run = simulate_model(model, "2RC", time, current, soc, 25.0)
    block = np.arange(len(time)) // BLOCK
    off = random.normal(0.0, share, block[-1] + 1)[block]
    volt = run.voltage_volt + off * run.overpotential_volt.sum(axis=0)
    volt = volt + random.normal(0.0, READING_VOLT, len(time))
    return record_of(time, current, volt, soc, celsius=celsius, **about), block


def fitted(*, seed=1, grown=1.0, blocks=40, **settings):
    """A model of whose overvoltage blocks left out show an error, and its records fitted."""
    one, block = record(seed, blocks=blocks, **settings)
    model = truth.model()
    error = one.voltage_volt - simulated(model, "2RC", one).voltage_volt
    square = np.bincount(block, error**2) / np.bincount(block)
    left_out = {"ambient_temperature_celsius": 25.0, "rows": np.bincount(block).tolist()}
    left_out["square_volt2"] = {"2RC": (grown**2 * square).tolist()}
    return model | {"left_out": [left_out]}, [[FittedRecord(one, block)]]


def shares(model, one):
    run = simulated(model, "2RC", one)
    half = half_width_volt(model, "2RC", one, {"2RC": run})
    return np.mean(np.abs(one.voltage_volt - run.voltage_volt) <= half), half


def test_factors_are_those_under_which_nine_of_ten_errors_are_held():
    random = np.random.default_rng(2)
    size = np.array([np.ones(4000), random.uniform(0.0, 0.3, 4000)])
    std = 2e-3 + 0.05 * size[1]
    factors = shares_holding(np.abs(random.normal(0.0, std)), size, np.ones(4000))
    np.testing.assert_allclose(factors, 1.645 * np.array([2e-3, 0.05]), rtol=0.15)
    held = np.abs(random.normal(0.0, std)) <= factors @ size
    assert held.mean() == pytest.approx(0.9, abs=0.02)
    half = shares_holding(np.abs(random.normal(0.0, std)), size, np.ones(4000), held=0.5)
    np.testing.assert_allclose(half, 0.674 * np.array([2e-3, 0.05]), rtol=0.2)


@pytest.mark.parametrize("seed", range(10, 14))
def test_nine_of_ten_samples_of_unseen_drives_lie_within(seed):
    model = with_intervals(*fitted())
    held, half = shares(model, record(seed)[0])
    assert 0.85 < held < 0.95
    # Under a load twice as heavy the model errs by more, and says so.
    heavy, wider = shares(model, record(seed, amplify=2.0, blocks=15)[0])
    assert 0.85 < heavy < 0.97
    assert wider.mean() > 1.4 * half.mean()


def test_what_a_block_is_missed_by_more_when_it_is_left_out_widens_the_interval():
    names = ("reading_volt", "at_once_share", "lasting_share", "soc_error", "rival_share")
    (narrow,), (wide,) = (with_intervals(*fitted(grown=g))["intervals"] for g in (1.0, 4.0))
    narrow, wide = ([entry[name] for name in names] for entry in (narrow, wide))
    # Left out it was missed by 4 times as much: its leverage is 3/4, and (1 + h)/(1 − h) 7.
    np.testing.assert_allclose(wide, np.sqrt(7.0) * np.array(narrow), rtol=1e-6)
    # Blocks that happen to be met better without their fold narrow nothing.
    (lucky,) = with_intervals(*fitted(grown=0.5))["intervals"]
    np.testing.assert_allclose([lucky[name] for name in names], narrow, rtol=1e-6)


def test_an_error_that_is_not_there_is_not_stated():
    model = with_intervals(*fitted(share=0.0))
    (entry,) = model["intervals"]
    assert (entry["model"], entry["rival"], entry["blocks"]) == ("2RC", None, 40)
    assert entry["reading_volt"] == pytest.approx(1.645 * READING_VOLT, rel=0.1)
    # Beside it what the instrument may count wrong is stated, and nothing else.
    held, half = shares(model, record(11, share=0.0)[0])
    assert 0.88 < held < 0.97
    assert half.mean() < 1.5 * entry["reading_volt"]


def test_a_load_alone_tells_nothing_of_the_full_charges_before_tests():
    tables = [{"ambient_temperature_celsius": celsius} for celsius in (0.0, 10.0, 25.0)]
    particle = {"celsius": [-20.0, 0.0, 10.0, 25.0], "missing": [-0.05, 0.01, 0.012, 0.008]}
    expected = np.std(particle["missing"][1:], ddof=1)
    assert _start_std({"ocv": tables, "particle": particle}) == pytest.approx(expected)
    assert _start_std({"ocv": tables[:2], "particle": particle}) == 0.0
    assert _start_std({"ocv": tables, "particle": None}) == 0.0


def test_a_core_warmer_than_the_surface_is_doubted_only_where_the_surface_was_measured():
    model = with_intervals(*fitted())
    entry = model["members"][0]["conditions"][0]
    entry["activation_energy_joule_per_mole"] = 40e3
    stated = record(12, amplify=2.0, blocks=15, temperature_source="the chamber's")[0]
    measured = stated._replace(temperature_source="the surface's measured")
    assert np.all(shares(model, measured)[1] >= shares(model, stated)[1])
    assert shares(model, measured)[1].mean() > 1.02 * shares(model, stated)[1].mean()


def test_too_few_blocks_state_no_interval():
    model = with_intervals(*fitted(blocks=3))
    assert model["intervals"] == []
    (note,) = model["notes"]
    assert note.startswith("2RC states no interval of its voltage: 3 blocks were left out")
    assert note.endswith("wanted 9 or more")
    (row,) = validate(model, record(10)[0]).rows
    names = ("voltage_std_volt", "share_within_90", "share_within_90_fitted")
    assert np.isnan([row[name] for name in names]).all()


def test_errors_that_are_no_numbers_are_refused():
    with pytest.raises(Refusal, match="not finite; wanted numbers"):
        shares_holding(np.array([0.1, np.nan]), np.ones((1, 2)), np.ones(2))


def test_scores_state_deviation_and_how_many_samples_lie_within():
    model, one = with_intervals(*fitted()), record(13)[0]
    found = validate(model, one)
    (row,) = found.rows
    held, half = shares(model, one)
    assert row["share_within_90"] == held
    assert row["voltage_std_volt"] == pytest.approx(np.sqrt(np.mean(half**2)) / 1.644854)
    np.testing.assert_array_equal(found.series["half_width_90_volt"], half)
    assert "half_width_90_volt" not in validate(truth.model(), one).series


def test_samples_are_told_by_what_they_lie_beyond():
    model = with_intervals(*fitted(blocks=20))
    (limits,) = model["fitted_to"]
    one = record(13, start=0.7, blocks=30)[0]
    masks = beyond(model, one, simulated(model, "2RC", one))
    low = max(limits["soc"][0], truth.KNOTS[0])
    np.testing.assert_array_equal(masks["below"], one.soc < low)
    assert 0 < masks["below"].mean() < 1
    over = np.abs(one.current_ampere) > 1.25**0.5 * limits["most_ampere"]
    np.testing.assert_array_equal(masks["rate"], over)
    heavy = record(13, amplify=2.0, blocks=10)[0]
    (row,) = validate(model, heavy).rows
    assert row["beyond_rate"] == np.mean(
        np.abs(heavy.current_ampere) > 1.25**0.5 * limits["most_ampere"]
    )
    assert 0 < row["beyond_rate"] <= row["extrapolated"]


def test_what_lies_below_the_lowest_fitted_soc_is_said_where_it_moves_the_error():
    model = with_intervals(*fitted(blocks=20))
    one = record(13, start=0.7, blocks=30)[0]
    (row,) = validate(model, one).rows
    assert below_in_words(row) == ""  # it errs there as anywhere
    low = max(model["fitted_to"][0]["soc"][0], truth.KNOTS[0])
    bad = one._replace(voltage_volt=one.voltage_volt - np.where(one.soc < low, 0.2, 0.0))
    found = validate(model, bad)
    (row,) = found.rows
    assert row["rmse_below_fitted_volt"] == pytest.approx(0.2, rel=0.05)
    assert row["rmse_above_lowest_fitted_volt"] < 0.02
    assert found.notes[-1].endswith(
        f"2RC errs by {1e3 * row['rmse_below_fitted_volt']:.3g} mV RMS there, "
        f"by {1e3 * row['rmse_above_lowest_fitted_volt']:.3g} mV above"
    )
    assert f"{row['below_fitted']:.0%} of the samples lie below" in found.notes[-1]
