"""Identification: recovers a known cell within its stated uncertainty, and knows its limits."""

import numpy as np
import pytest
import truth

from cellwright.models.conditions import condition_entry, ocv_from_slow_branch, select
from cellwright.models.identify import identify
from cellwright.models.linear import correlation_factor
from cellwright.models.records import Record, knots_of, records_of, thin
from cellwright.models.split import fit_mask
from cellwright.refusal import Refusal

NOISE_VOLT = 1e-3
BOUNDS = ((0.5, 60.0), (40.0, 1000.0))


def measured(seed, shift=0.0):
    rng = np.random.default_rng(seed)
    time, current = truth.drive(rng)
    soc = truth.soc_of(time, current, 0.95)
    volt = truth.voltage(time, current, soc, shift) + rng.normal(0, NOISE_VOLT, len(time))
    return time, current, volt, soc


def fit(records, **change):
    settings = {"knots": truth.KNOTS, "tau_bounds_second": BOUNDS, "relative": 0.0} | change
    return identify(records, truth.OCV_SOC, truth.OCV_VOLT, **settings)


def scores_of(found):
    errors = [found.r0_ohm - truth.R0, *(found.r_ohm - truth.R), found.tau_second - truth.TAU]
    stds = [found.r0_std_ohm, *found.r_std_ohm, found.tau_std_second]
    return np.concatenate(errors) / np.concatenate(stds)


def test_recovers_the_true_cell_within_its_uncertainty():
    z = np.concatenate([scores_of(fit(records_of(*measured(seed)))) for seed in range(3)])
    assert np.abs(z).max() < 5
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.5


def test_weights_leave_the_truth_where_it_is():
    found = fit(records_of(*measured(5)), relative=0.2)
    np.testing.assert_allclose(found.r0_ohm, truth.R0, rtol=0.05)
    np.testing.assert_allclose(found.tau_second, truth.TAU, rtol=0.1)
    assert found.fit_rmse_volt == pytest.approx(NOISE_VOLT, rel=0.05)


def test_an_error_of_the_ocv_table_does_not_become_resistance():
    found = fit(records_of(*measured(6, shift=0.02)))
    np.testing.assert_allclose(found.ocv_shift_volt, 0.02, atol=2e-3)
    np.testing.assert_allclose(found.r_ohm.sum(axis=0), truth.R.sum(axis=0), rtol=0.15)


def test_bic_chooses_the_true_number_of_branches():
    records = records_of(*measured(7))
    members = [
        {
            "model": f"{n}RC",
            "conditions": [
                condition_entry(
                    fit(records, n_rc=n, tau_bounds_second=bounds),
                    ambient_temperature_celsius=25,
                    tests=["a"],
                )
            ],
        }
        for n, bounds in ((1, ((0.5, 1000.0),)), (2, BOUNDS))
    ]
    assert select(members) == "2RC"
    members[0]["conditions"][0]["samples"] += 1
    with pytest.raises(Refusal, match="not fitted to the same samples"):
        select(members)


def test_rows_that_are_not_used_do_not_move_the_fit():
    time, current, volt, soc = measured(8)
    mask = fit_mask(time, current, rest_ampere=0.01)
    spoiled = np.where(mask, volt, volt + 0.3)
    first = fit(records_of(time, current, volt, soc, used=mask))
    second = fit(records_of(time, current, spoiled, soc, used=mask))
    np.testing.assert_array_equal(first.r0_ohm, second.r0_ohm)
    np.testing.assert_array_equal(first.tau_second, second.tau_second)


def test_a_time_constant_at_its_bound_is_named():
    found = fit(records_of(*measured(9)), tau_bounds_second=((0.5, 4.0), (40.0, 1000.0)))
    assert "tau1" in found.at_bound


def test_entry_is_plain_and_complete():
    entry = condition_entry(
        fit(records_of(*measured(10))), ambient_temperature_celsius=np.nan, tests=("a",)
    )
    assert entry["ambient_temperature_celsius"] is None
    assert [len(entry[k]) for k in ("soc", "r0_ohm", "r0_std_ohm", "ocv_shift_volt")] == [5] * 4
    assert {len(b["tau_second"]) for b in entry["branches"]} == {5}
    assert isinstance(entry["r0_ohm"][0], float)


def test_one_slow_branch_gives_the_true_ocv_back():
    """Where resistance does not change with SoC the correction is exact."""
    found = fit(records_of(*measured(11)))._replace(r0_ohm=truth.R0, r_ohm=truth.R)
    total = np.interp(truth.OCV_SOC, truth.KNOTS, truth.R0 + truth.R.sum(axis=0))
    slow = truth.OCV_VOLT - 0.1 * total
    corrected = ocv_from_slow_branch(truth.OCV_SOC, slow, -0.1, found)
    np.testing.assert_allclose(corrected, truth.OCV_VOLT, atol=1e-12)


def test_thinning_keeps_edges_and_leaves_the_fit():
    time = np.arange(0.0, 3000.0)
    current = np.where((time % 1000 >= 100) & (time % 1000 < 130), -2.0, 0.0)
    soc = truth.soc_of(time, current, 0.5)
    volt = truth.voltage(time, current, soc)
    record = Record(time, current, volt, soc, np.ones(3000, bool))
    small = thin(record, step_ampere=0.1)
    assert len(small.soc) < 800
    for edge in (100.0, 99.0, 130.0, 129.0, 2130.0):
        assert edge in small.test_time_second
    whole, part = (
        identify([r], truth.OCV_SOC, truth.OCV_VOLT, knots=[0.49], n_rc=2) for r in (record, small)
    )
    np.testing.assert_allclose(part.r0_ohm, whole.r0_ohm, rtol=1e-3)


def test_knots_lie_at_set_points_and_on_a_grid_for_drives():
    points = np.repeat([0.2, 0.5, 0.8], 6) + np.tile([0, 0, 0.002, 0.002, 0.004, 0.004], 3)
    record = Record(np.arange(18.0), np.tile([0.0, -1.0], 9), points, points, np.ones(18, bool))
    np.testing.assert_allclose(
        knots_of([record], step_ampere=0.5), [0.202, 0.502, 0.802], atol=1e-3
    )
    soc = np.linspace(0.2, 0.8, 601)
    record = Record(np.arange(601.0), np.tile([0, 1.0], 301)[:601], soc, soc, np.ones(601, bool))
    np.testing.assert_allclose(
        knots_of([record], step_ampere=0.5), np.linspace(0.2, 0.8, 13), atol=2e-3
    )


def test_records_are_cut_at_gaps():
    time = np.array([0.0, 1.0, 2.0, 5000.0, 5001.0])
    first, second = records_of(time, time * 0, time * 0 + 3.5, time * 0 + 0.5)
    assert len(first.soc) == 3
    assert second.test_time_second[0] == 5000.0


def test_correlation_factor_of_known_noise():
    rng = np.random.default_rng(12)
    white = rng.normal(size=20000)
    assert correlation_factor(white) < 1.1
    red = np.zeros(20000)
    for k in range(1, 20000):
        red[k] = 0.9 * red[k - 1] + white[k]
    assert correlation_factor(red) == pytest.approx(19.0, rel=0.3)
    assert correlation_factor(np.zeros(5)) == 1.0


def test_odd_blocks_fit():
    time = np.arange(0.0, 2000.0)
    current = np.where(time % 500 < 300, -1.0, 0.0)
    mask = fit_mask(time, current, rest_ampere=0.01)
    np.testing.assert_array_equal(mask, (time // 500) % 2 == 0)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"test_time_second": np.arange(100.0)[::-1]}, "time runs back"),
        ({"voltage_volt": np.full(100, np.nan)}, "not finite"),
        ({"soc": np.linspace(1.3, 0.9, 100)}, "outside −0.05 to 1.05"),
        (
            {k: np.zeros(1) for k in ("test_time_second", "current_ampere", "voltage_volt", "soc")},
            "has 1 sample",
        ),
    ],
)
def test_records_refuse(change, reason):
    given = {
        "test_time_second": np.arange(100.0),
        "current_ampere": np.zeros(100),
        "voltage_volt": np.full(100, 3.7),
        "soc": np.full(100, 0.5),
    } | change
    with pytest.raises(Refusal, match=reason):
        records_of(**given)


def test_identify_refuses_what_excites_nothing():
    time = np.arange(100.0)
    flat = records_of(time, time * 0 - 1.0, time * 0 + 3.7, time * 0 + 0.5)
    with pytest.raises(Refusal, match="current never changes"):
        identify(flat, truth.OCV_SOC, truth.OCV_VOLT)
    once = records_of(time, np.where(time < 50, 0.0, -1.0), time * 0 + 3.7, time * 0 + 0.5)
    with pytest.raises(Refusal, match="fewer than 2 steps"):
        identify(once, truth.OCV_SOC, truth.OCV_VOLT)
    records = records_of(*measured(13))
    with pytest.raises(Refusal, match="no default bounds"):
        identify(records, truth.OCV_SOC, truth.OCV_VOLT, n_rc=5)
    with pytest.raises(Refusal, match="cannot show"):
        fit(records, tau_bounds_second=((1.0, 50.0), (5000.0, 9000.0)))
    with pytest.raises(Refusal, match="not excited"):
        fit(records, knots=np.linspace(-3, 0.9, 40))
    with pytest.raises(Refusal, match="no rest"):
        fit_mask(time, time * 0 - 1.0, rest_ampere=0.01)
