"""Figures of packs at 2 and at 50 cells: what is drawn, and that its texts stay apart."""

import numpy as np
import pytest
from figure_panels import TIME, drawn, labels, panels, sound, title

from figures import packs


def branches(count):
    """A series and scores of a group whose branch k errs by k × 10 mA."""
    series = {"test_time_second": TIME, "voltage_volt": 3.7 + 0 * TIME, "scored": TIME > 3600}
    series["simulated_voltage_volt"] = 3.71 + 0 * TIME
    scores = []
    for k in range(1, count + 1):
        series[f"branch_{k}_current_ampere"] = k + 0 * TIME
        series[f"simulated_branch_{k}_current_ampere"] = k - 0.01 * k + 0 * TIME
        row = {"branch": k, "cell": f"P{k}", "current_rmse_ampere": 0.01 * k}
        scores.append(row | {"voltage_rmse_volt": 0.01})
    return series, scores


def test_few_branches_are_drawn_each_measured_and_simulated():
    figure = packs.draw_pack(*branches(2), "discharge")
    current, residual, _ = panels(figure)
    assert labels(current) == ["P1: RMSE 10 mA", "P2: RMSE 20 mA"]
    levels = sorted(xy[0, 1] for xy in drawn(residual) if len(xy) > 2)
    np.testing.assert_allclose(levels, [10.0, 20.0])
    sound(figure)


def test_of_many_branches_the_worst_are_named_and_all_are_a_band():
    figure = packs.draw_pack(*branches(50), "discharge")
    current, residual, _ = panels(figure)
    worst = [f"P{k}: RMSE {10 * k} mA" for k in (48, 49, 50)]
    assert labels(current) == ["all, measured", "all, simulated", *worst]
    edges = {float(xy[0, 1]) for xy in drawn(current)[:4]}
    assert edges == {1.0, 0.99, 50.0, 49.5}
    assert len([xy for xy in drawn(residual) if len(xy) > 2]) == 3
    sound(figure)


SPREAD = {
    "soc_low": np.arange(0.0, 1.0, 0.05),
    "soc_high": np.arange(0.05, 1.01, 0.05),
    "largest_share": np.full(20, 1.2),
    "simulated_largest_share": np.full(20, 1.21),
    "spread": np.full(20, 0.3),
    "simulated_spread": np.full(20, 0.32),
    "relative_current_rmse": np.full(20, 0.015),
}
FINDINGS = {
    "group_capacity_ampere_hour": 57.0,
    "cells_capacity_ampere_hour": 60.0,
    "simulated_group_capacity_ampere_hour": 56.5,
    "last_15_soc_charge_share": 0.1,
    "current_c_rate": 1.0,
}


def test_spread_over_soc_and_the_capacity_of_the_group():
    figure = packs.draw_pack_spread(SPREAD, FINDINGS, "discharge")
    share, error, capacity = panels(figure)
    np.testing.assert_allclose(drawn(share)[0][:, 1], 120.0)
    np.testing.assert_allclose(drawn(error)[0][:, 1], 1.5)
    assert title(capacity) == "At 1C (◆ simulated: 56.50 Ah)"
    texts = sound(figure)
    assert {"60.00 Ah", "57.00 Ah (-5.0 %)", "51.30 Ah (-14.5 %)"} <= set(texts)


def cells_in_series(count):
    return [
        {"cell": f"P{k:02}", "model": "1RC", "margin_ampere_hour": 0.1 * ((7 * k) % count)}
        for k in range(count)
    ]


WATERFALL = [
    {"stage": stage, "ampere_hour": charge}
    for stage, charge in (("mean capacity of the cells", 26.0), ("as it is balanced", 21.84))
]


@pytest.mark.parametrize("count", [2, 50])
def test_what_a_string_gives_of_its_cells_and_when_each_is_empty(count):
    figure = packs.draw_series_pack(WATERFALL, cells_in_series(count), "fuds")
    _, ends = panels(figure)
    (margins,) = drawn(ends)
    assert len(margins) == count
    assert (np.diff(margins[:, 0]) >= 0).all()
    texts = sound(figure)
    assert "21.84 Ah (-16.0 %)" in texts
    named = [text for text in texts if text.startswith("P")]
    assert named == (["P00", "P01"] if count == 2 else [])
    assert ("first: P00, P43, P36, P29, P22" in texts) == (count == 50)


def weakest(count, *, measured=True):
    rows = np.arange(len(TIME))
    names = np.array([f"P{(row // 10) % count:02}" for row in rows])
    low = 3.6 - TIME / 36000
    series = {"test_time_second": TIME, "lowest_cell": names, "lowest_cell_volt": low}
    series |= {"highest_cell_volt": low + 0.02, "highest_soc": 0.9 + 0 * TIME}
    series |= {"mean_soc": 0.8 + 0 * TIME, "least_soc": 0.7 + 0 * TIME}
    if measured:
        series |= {"measured_lowest_cell": np.roll(names, 3), "measured_lowest_cell_volt": low}
        series |= {"measured_highest_cell_volt": low + 0.02}
    return series


@pytest.mark.parametrize("count", [2, 50])
def test_the_weakest_cell_over_time(count):
    figure = packs.draw_weakest(weakest(count), "fuds")
    volt, which, _ = panels(figure)
    assert labels(volt) == ["measured", "lowest, simulated", "highest, simulated"]
    assert labels(which) == ["measured", "simulated"]
    names = [text.get_text() for text in which.get_yticklabels()]
    assert len(names) == (2 if count == 2 else 12)
    sound(figure)


def ways(count):
    errors = {"reference": 0.04, "scaled": 0.01, "bias": 0.003, "own": 0.002, "bias_of_few": 0.5}
    return [
        {"cell": f"P{k:02}", "way": way, "mean_abs_volt": volt, "max_abs_volt": 5 * volt}
        for k in range(count)
        for way, volt in errors.items()
    ]


@pytest.mark.parametrize("count", [2, 50])
def test_four_ways_by_cell_and_over_all(count):
    cells = [f"P{k:02}" for k in range(count)]
    figure = packs.draw_ways(ways(count), cells)
    single, whole = panels(figure)
    np.testing.assert_allclose(drawn(single)[0][:, 1], 40.0)
    assert len(drawn(single)[0]) == count
    assert [text.get_text() for text in whole.get_xticklabels()] == list(packs.WAYS)
    sound(figure)
