"""Figures of models: parameters, validation, filters."""

import numpy as np
import pytest
from figure_panels import SOC, TIME, drawn, labels, panels, rendered

from figures import models


def pair(r, tau, std, kind="RC"):
    branch = {"kind": kind, "r_ohm": [r] * 11, "r_std_ohm": std}
    return branch | {"tau_second": [tau] * 11, "tau_std_second": std}


def one_member(name, branches, std=(None,) * 11):
    entry = {"soc": SOC.tolist(), "r0_ohm": [0.05] * 11, "r0_std_ohm": list(std)}
    entry |= {"branches": branches, "ocv_shift_volt": [0.002] * 11}
    conditions = [entry | {"ambient_temperature_celsius": celsius} for celsius in (0.0, None)]
    return {"chosen": name, "members": [{"model": name, "conditions": conditions}]}


@pytest.mark.parametrize("std", [[0.001] * 11, [None] * 11])
def test_parameters_with_and_without_uncertainty(std):
    model = one_member("1RC", [pair(0.02, 30.0, std)], std)
    r0, ten, hundred, settled, spread, shift = panels(models.draw_parameters(model))
    assert all(np.allclose(xy[:, 1], 50.0) for xy in drawn(r0) if len(xy) == 11 and not std[0])
    assert labels(r0) == ["0 °C", "temperature not stated"]
    expected = [50 + 20 * (1 - np.exp(-10 / 30)), 50 + 20 * (1 - np.exp(-100 / 30)), 70.0]
    for panel, value in zip((ten, hundred, settled), expected, strict=True):
        np.testing.assert_allclose(drawn(panel)[0][:, 1], value)
    assert any(np.allclose(xy, [[30.0, 20.0]]) for xy in drawn(spread))
    np.testing.assert_allclose(drawn(shift)[0][:, 1], 2.0)


def test_parameters_of_a_distribution_with_kinetics_hysteresis_and_diffusion():
    """Charge transfer that is not resolved has a panel of its own, not a place among the pairs."""
    none, taus = [None] * 11, np.geomspace(10, 2000, 10)
    hysteresis = {"kind": "hysteresis", "m_volt": [0.012] * 11, "m_std_volt": none}
    others = [{"kind": "diffusion", "soc_per_ampere": none, "tau_second": none}, hysteresis]
    transfer = pair(0.15, 1e-3, none, "kinetic"), pair(0.02, 1.0, none, "kinetic")
    branches = [*transfer, *(pair(0.001 * k, tau, none) for k, tau in enumerate(taus)), *others]
    found = panels(models.draw_parameters(one_member("DRT+H+K+D", branches)))
    assert [panel.get_title(loc="left") for panel in found] == [
        *("R0", "Charge transfer", "Resistance after 10 s", "Resistance after 100 s"),
        *("Resistance settled", "RC pairs at 50 % SoC", "Correction of the OCV"),
        "Hysteresis, either way",
    ]
    for place, value in ((1, 170.0), (4, 50 + 170 + 45), (7, 12.0)):
        np.testing.assert_allclose(drawn(found[place])[0][:, 1], value)
    line = next(xy for xy in drawn(found[5]) if len(xy) == 10)
    np.testing.assert_allclose(line, np.column_stack([taus, np.arange(10.0)]))
    kinetic = panels(models.draw_parameters(one_member("1RC+K", [transfer[0], branches[2]])))
    assert [panel.axison for panel in kinetic] == [True] * 7 + [False]


def test_compensation_draws_the_error_at_each_temperature_and_a_pair_of_bars_for_each_test():
    fitted = [
        {"left_out_celsius": celsius, "rmse_volt_soc_5_95": volt, "own_rmse_volt_soc_5_95": 0.002}
        for celsius in (25.0, 0.0)
        for volt in (0.003, 0.004)
    ]
    proof = [
        {
            "predicted_test": test,
            "left_out_celsius": celsius,
            "ratio": 2.0,
            "beyond": celsius == 0.0,
        }
        | {"own_rmse_volt_soc_5_95": 0.002, "rmse_volt_soc_5_95": 0.004}
        for test, celsius in (("udds", 25.0), ("us06", 0.0))
    ]
    by_celsius, by_test = panels(models.draw_compensation(fitted, proof))
    assert labels(by_celsius) == ["left out", "fitted with it"]
    rms = 1e3 * np.sqrt((0.003**2 + 0.004**2) / 2)
    np.testing.assert_allclose(drawn(by_celsius)[0], [[0.0, rms], [25.0, rms]])
    np.testing.assert_allclose(drawn(by_celsius)[1][:, 1], 2.0)
    assert [text.get_text() for text in by_test.get_yticklabels()] == ["us06, 0 °C", "udds, 25 °C"]
    np.testing.assert_allclose([bar.get_width() for bar in by_test.patches], [2.0, 4.0] * 2)
    assert [bar.get_hatch() for bar in by_test.patches] == [None, "////", None, None]
    without_validation = models.draw_compensation(fitted, [])
    assert [panel.axison for panel in panels(without_validation)] == [True, False]


def test_validation_shows_the_chosen_member_the_errors_of_all_and_greys_what_is_not_scored():
    series = {"test_time_second": TIME, "current_ampere": TIME * 0, "voltage_volt": 3.7 + TIME * 0}
    series |= {"simulated_1RC_volt": 3.69 + TIME * 0, "simulated_2RC_volt": 3.7 + TIME * 0}
    scores = [
        {"model": "1RC", "rmse_volt": 0.01, "chosen": False},
        {"model": "2RC", "rmse_volt": 0.0, "chosen": True},
    ]
    for scored, patches in ((TIME >= 0, 0), (TIME > 3600, 1), ((TIME // 1800) % 2 == 0, 2)):
        figure = models.draw_validation(series | {"scored": scored}, scores, "udds")
        voltage, residual, _, members = panels(figure)
        assert len(residual.patches) == patches
    assert labels(voltage) == ["measured", "2RC: RMSE 0.0 mV"]
    np.testing.assert_allclose(drawn(residual)[-1][:, 1], 0.0)
    assert [text.get_text() for text in members.get_yticklabels()] == ["1RC", "2RC (chosen)"]
    np.testing.assert_allclose([bar.get_width() for bar in members.patches], [10.0, 0.0])


def test_the_stated_interval_is_shaded_about_no_error():
    series = {"test_time_second": TIME, "current_ampere": TIME * 0, "voltage_volt": 3.7 + TIME * 0}
    series |= {"simulated_2RC_volt": 3.7 + TIME * 0, "scored": TIME >= 0}
    scores = [{"model": "2RC", "rmse_volt": 0.0, "chosen": True}]
    without = panels(models.draw_validation(series, scores, "udds"))[1]
    assert not without.collections
    assert "interval" not in without.get_title(loc="left") + without.get_title()
    wide = series | {"half_width_90_volt": 0.02 + TIME * 0}
    residual = panels(models.draw_validation(wide, scores, "udds"))[1]
    (band,) = residual.collections
    edges = band.get_paths()[0].vertices[:, 1]
    np.testing.assert_allclose([edges.min(), edges.max()], [-20.0, 20.0])
    assert "interval" in residual.get_title(loc="left") + residual.get_title()


def test_every_filter_is_drawn_once_with_its_band_where_it_has_one():
    series = {"test_time_second": TIME, "soc": 0.5 + 0 * TIME, "scored": TIME > 600}
    for name, level in (("coulomb", 0.2), ("aekf", 0.51)):
        series[f"estimated_{name}_soc"] = level + 0 * TIME
        series[f"std_{name}_soc"] = 0.01 + 0 * TIME
    row = {"rmse_soc": 0.01, "convergence_second": 120.0}
    rows = [{"filter": "coulomb", "rmse_soc": 0.3, "convergence_second": np.nan}]
    rows += [{"filter": "aekf"} | row, {"filter": "aekf", "rmse_soc": 9.0} | row]
    figure = models.draw_soc(series, rows, "udds")
    level, error = rendered(figure)
    told = [text.get_text() for text in level.get_legend().get_texts()]
    coulomb, aekf = "coulomb: does not converge RMSE 30.0 %", "aekf: 120 s, then RMSE 1.0 %"
    assert told == ["counted", coulomb, aekf]
    np.testing.assert_allclose(error.get_lines()[0].get_ydata(), 1.0)
    assert len(error.get_lines()) == 1
    assert len(error.collections) == 1
