"""Figures along the time of a test: model, filters and parallel cells over measurement."""

import numpy as np
from figure_panels import TIME, drawn, labels, panels, rendered

from figures import validation


def test_validation_shows_the_chosen_member_the_errors_of_all_and_greys_what_is_not_scored():
    series = {"test_time_second": TIME, "current_ampere": TIME * 0, "voltage_volt": 3.7 + TIME * 0}
    series |= {"simulated_1RC_volt": 3.69 + TIME * 0, "simulated_2RC_volt": 3.7 + TIME * 0}
    scores = [
        {"model": "1RC", "rmse_volt": 0.01, "chosen": False},
        {"model": "2RC", "rmse_volt": 0.0, "chosen": True},
    ]
    for scored, patches in ((TIME >= 0, 0), (TIME > 3600, 1), ((TIME // 1800) % 2 == 0, 2)):
        figure = validation.draw_validation(series | {"scored": scored}, scores, "udds")
        voltage, residual, _, members = panels(figure)
        assert len(residual.patches) == patches
    assert labels(voltage) == ["measured", "2RC: RMSE 0.0 mV"]
    np.testing.assert_allclose(drawn(residual)[-1][:, 1], 0.0)
    assert [text.get_text() for text in members.get_yticklabels()] == ["1RC", "2RC (chosen)"]
    np.testing.assert_allclose([bar.get_width() for bar in members.patches], [10.0, 0.0])


def test_pack_draws_branches_measured_and_simulated():
    series = {"test_time_second": TIME, "voltage_volt": 3.7 + 0 * TIME, "scored": TIME > 3600}
    series["simulated_voltage_volt"] = 3.71 + 0 * TIME
    for k in (1, 2):
        series[f"branch_{k}_current_ampere"] = k + 0 * TIME
        series[f"simulated_branch_{k}_current_ampere"] = k - 0.02 + 0 * TIME
    scores = [{"branch": k, "current_rmse_ampere": 0.02, "voltage_rmse_volt": 0.01} for k in (1, 2)]
    current, residual, _ = panels(validation.draw_pack(series, scores, "discharge"))
    assert labels(current) == ["branch 1: RMSE 20 mA", "branch 2: RMSE 20 mA"]
    np.testing.assert_allclose(np.concatenate(drawn(residual)[:2])[:, 1], 20.0)


def test_every_filter_is_drawn_once_with_its_band_where_it_has_one():
    series = {"test_time_second": TIME, "soc": 0.5 + 0 * TIME, "scored": TIME > 600}
    for name, level in (("coulomb", 0.2), ("aekf", 0.51)):
        series[f"estimated_{name}_soc"] = level + 0 * TIME
        series[f"std_{name}_soc"] = 0.01 + 0 * TIME
    row = {"rmse_soc": 0.01, "convergence_second": 120.0}
    rows = [{"filter": "coulomb", "rmse_soc": 0.3, "convergence_second": np.nan}]
    rows += [{"filter": "aekf"} | row, {"filter": "aekf", "rmse_soc": 9.0} | row]
    figure = validation.draw_soc(series, rows, "udds")
    level, error = rendered(figure)
    told = [text.get_text() for text in level.get_legend().get_texts()]
    coulomb, aekf = "coulomb: does not converge RMSE 30.0 %", "aekf: 120 s, then RMSE 1.0 %"
    assert told == ["counted", coulomb, aekf]
    np.testing.assert_allclose(error.get_lines()[0].get_ydata(), 1.0)
    assert len(error.get_lines()) == 1
    assert len(error.collections) == 1
