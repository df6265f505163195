"""True and false capacity loss: told where a slow test tells, bounded where none does."""

import numpy as np
import pytest

from cellwright.health.capacity_loss import capacity_losses, law_rows
from cellwright.refusal import Refusal


def row(size, celsius, rate=1 / 30, direction="charge", **more):
    return {
        "test": f"{direction}_{rate:.3g}_{celsius}_{more.get('number', 0)}",
        "direction": direction,
        "c_rate": rate,
        "capacity_ampere_hour": size + more.get("held", 0.0),
        "constant_current_ampere_hour": size,
        "capacity_std_ampere_hour": more.get("std", np.nan),
        "repeats": more.get("repeats", 1),
        "temperature_mean_celsius": more.get("measured", np.nan),
        "ambient_temperature_celsius": celsius,
        "cycle": more.get("cycle"),
    }


THESIS = [row(31.001, 20.0), row(30.975, 0.0), row(28.820, -20.0)]


def by_place(losses):
    return {
        (loss["direction"], loss["temperature_celsius"], round(loss["c_rate"], 2)): loss
        for loss in losses
    }


def test_the_thesis_example():
    """Golden, thesis 3.3: 99.91 % and 92.96 % of 31.001 Ah are left at 0 and −20 °C."""
    losses, notes = capacity_losses(THESIS)
    remaining = [100 - loss["true_percent"] for loss in losses]
    assert remaining == pytest.approx([100, 99.916, 92.965], abs=1e-3)
    assert [loss["verdict"] for loss in losses] == ["none", "none", "true"]
    assert not notes


def test_a_faster_test_adds_false_loss_to_the_true_one():
    losses, _ = capacity_losses([*THESIS, row(30.0, 20.0, 0.5), row(20.0, -20.0, 0.5)])
    cold = by_place(losses)["charge", -20.0, 0.5]
    assert cold["true_percent"] == pytest.approx(100 * (1 - 28.82 / 31.001))
    assert cold["true_percent"] + cold["false_percent"] == pytest.approx(cold["total_percent"])
    assert cold["verdict"] == "both"
    assert by_place(losses)["charge", 20.0, 0.5]["verdict"] == "false"


def test_intervals_cover_the_truth_as_often_as_they_say():
    random, truth, hits = np.random.default_rng(3), (10.0, 9.9, 9.2, 7.0), []
    for _ in range(300):
        seen = [size + 0.04 * random.standard_normal() for size in truth]
        rows = [row(seen[0], 25), row(seen[1], 0), row(seen[2], -20), row(seen[3], -20, 1.0)]
        loss = by_place(capacity_losses(rows, assumed_share=0.004)[0])["charge", -20, 1.0]
        hits.append(
            int(loss["true_lower_percent"] <= 8.0 <= loss["true_upper_percent"])
            + int(loss["false_lower_percent"] <= 22.0 <= loss["false_upper_percent"])
        )
    assert 0.92 < np.mean(hits) / 2 < 0.98


def test_without_a_slow_test_the_split_is_bounded_by_the_neighbours():
    rows = [row(10.0, 25), row(9.5, 0), row(8.8, -20), row(5.0, -10.0, 0.5), row(9.3, -10, 0.2)]
    losses, notes = capacity_losses(rows)
    losses_at = by_place(losses)
    loss = losses_at["charge", -10.0, 0.5]
    assert (loss["known"], loss["verdict"]) == (False, "both")
    assert np.isnan(loss["true_percent"])
    assert loss["true_lower_percent"] == pytest.approx(5 - 1.96 * 0.42, abs=0.1)
    assert loss["true_upper_percent"] == pytest.approx(12 + 1.96 * 0.42, abs=0.1)
    assert losses_at["charge", -10.0, 0.2]["verdict"] == "true or both"
    assert any("at -10 °C: loss to rate and to temperature not separable" in note for note in notes)
    alone = capacity_losses([row(10.0, 25), row(9.0, -20, 0.5)])[0][-1]
    assert alone["verdict"] == "true or false"


def test_what_a_held_voltage_brings_back_was_not_lost():
    loss = capacity_losses([row(30.0, 25), row(1.0, -20, 0.5, held=27.0)])[0][-1]
    assert loss["false_lower_percent"] == pytest.approx(90, abs=1.5)
    assert loss["true_upper_percent"] < 8.0
    assert loss["verdict"] == "false or both"


def test_repeats_set_the_scatter():
    rows = [row(10.0, 25), *[row(s, 0, number=k) for k, s in enumerate((9.0, 9.4, 9.8))]]
    cold = by_place(capacity_losses(rows)[0])["charge", 0.0, 0.03]
    assert cold["capacity_ampere_hour"] == pytest.approx(9.4)
    assert cold["std_ampere_hour"] == pytest.approx(0.4 / np.sqrt(3), rel=0.1)


def test_a_deficit_above_the_reference_counts_as_scatter_not_as_temperature():
    """As LG HG2's: at 40 °C 3.3 % less than at 25 °C, so that −20 °C cannot be told to 1 %."""
    warm = [row(2.7788, 25), row(2.6868, 40), row(2.4919, -20)]
    losses, notes = capacity_losses(warm)
    assert losses[-1]["true_std_percent"] > 2.5
    assert any("temperature cannot do" in note for note in notes)


def test_a_test_at_another_temperature_than_stated_is_left_out():
    rows = [*THESIS, row(25.0, 40.0, 1.0, measured=5.4), row(29.0, 25.0, 2.0, measured=45.0)]
    losses, notes = capacity_losses(rows)
    assert any("stated 40 °C, the cell was at 5.4 °C" in note for note in notes)
    # A fast test that warmed itself gives more than a slow one of a cold cell.
    assert any("stated 25 °C, the cell was at 45.0 °C" in note for note in notes)
    assert {loss["temperature_celsius"] for loss in losses} == {20.0, 0.0, -20.0}


def test_a_test_slower_than_the_reference_is_no_gain():
    """LG M50's C/10 charge at 45 °C "lost" −15 % of one at C/3 at 25 °C."""
    charges = [
        row(size, celsius, rate) | {"direction": "charge"}
        for size, celsius, rate in ((4.28, 25, 1 / 3), (4.92, 45, 0.1), (4.59, 45, 1 / 3))
    ]
    losses, notes = capacity_losses(charges)
    assert {round(loss["c_rate"], 3) for loss in losses} == {0.333}
    assert any("charge at 45 °C and 0.1C is left out" in note for note in notes)


def test_the_same_record_under_two_kinds_counts_once():
    losses, _ = capacity_losses([*THESIS, THESIS[1] | {"test": "again"}])
    assert [loss["tests"].count(";") for loss in losses] == [0, 0, 0]


def test_charge_left_in_by_a_cold_discharge_is_told():
    rows = [row(10.0, 25, direction="discharge"), row(10.0, 25)]
    rows += [row(9.0, -20, direction="discharge"), row(8.5, -20)]
    rows = [loss | {"test": str(loss["ambient_temperature_celsius"])} for loss in rows]
    cold = by_place(capacity_losses(rows)[0])["charge", -20, 0.03]
    assert (cold["total_percent"], cold["left_in_percent"]) == pytest.approx((15, 10))


def test_age_does_not_pass_for_temperature():
    losses, _ = capacity_losses([*THESIS, row(20.0, -10, cycle=500)])
    assert all(loss["temperature_celsius"] != -10 for loss in losses)


def test_a_fast_reference_says_so():
    losses, notes = capacity_losses([row(30.0, 25, 0.5), row(25.0, -20, 0.5)])
    assert any("the reference is the one at 0.5C" in note for note in notes)
    with pytest.raises(Refusal, match="no slow test"):
        law_rows([loss for loss in losses if not loss["known"]])


def test_rows_of_the_table_hold_the_true_losses():
    rows = law_rows(capacity_losses(THESIS)[0])
    assert [r["parameter"] for r in rows] == ["at 20 degC", "at 0 degC", "at -20 degC"]
    assert {r["quantity"] for r in rows} == {"true capacity loss, charge at up to 0.033C"}
    assert rows[2]["value"] == pytest.approx(7.035, abs=1e-3)


def test_one_capacity_is_refused():
    with pytest.raises(Refusal, match="fewer than two comparable capacities"):
        capacity_losses(THESIS[:1])
