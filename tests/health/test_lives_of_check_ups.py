"""A cell of which only check-ups are known: law, knee and remaining cycles of these."""

import numpy as np
import pytest

import cellwright as cw

CELL = {"cell": "A", "rated_capacity_ampere_hour": 5.0}


def check_ups(cycles, capacities):
    """Rows of check-ups with nothing but a capacity each."""
    return [
        {"cycle": float(n), "capacity_ampere_hour": q, "energy_watt_hour": np.nan}
        for n, q in zip(cycles, capacities, strict=True)
    ]


def test_nine_check_ups_of_a_straight_fade_tell_when_the_end_of_life_comes():
    cycles = np.arange(0, 900, 100)
    noise = 0.002 * np.random.default_rng(3).standard_normal(9)
    found = cw.fade((), CELL, check_ups=check_ups(cycles, 5.0 * (1 - 2e-4 * cycles) + noise))
    summary = found.summary
    assert summary["source"] == "check-up"
    assert summary["cycles"] == 9
    assert summary["soh"] == pytest.approx(0.84, abs=0.003)
    assert summary["remaining_lower_cycles"] < 200 < summary["remaining_upper_cycles"]
    assert np.isnan(summary["knee_cycle"])
    assert np.isnan(summary["throughput_ampere_hour"])


def test_a_check_up_without_a_capacity_is_none_of_the_life():
    rows = check_ups([*range(0, 900, 100), 950], [*np.linspace(5, 4.2, 9), np.nan])
    assert cw.fade((), CELL, check_ups=rows).summary["last_cycle"] == 800


def test_too_few_check_ups_are_refused_with_how_many_a_law_needs():
    with pytest.raises(cw.Refusal, match="5 comparable discharges; a law of the fade needs 8"):
        cw.fade((), CELL, check_ups=check_ups(range(5), np.linspace(5, 4, 5)))


def test_a_life_of_check_ups_adds_no_rows_of_cycles_but_knee_and_what_remains():
    cycles = np.arange(0, 900, 100)
    rows = check_ups(cycles, 5.0 * (1 - 2e-4 * cycles))
    rows = [row | {"soh": row["capacity_ampere_hour"] / 5, "soh_std": 0.002} for row in rows]
    found = cw.state_of_health(rows, cw.fade((), CELL, check_ups=rows)).rows
    assert [row["method"] for row in found] == ["check-up"] * 9
    assert np.all(np.diff([row["remaining_cycles"] for row in found]) < 0)
