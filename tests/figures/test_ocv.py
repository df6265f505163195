"""Figures of the open-circuit voltage, at one temperature and over temperature."""

import numpy as np
import pytest
from figure_panels import SOC, about, drawn, labels, panels

from figures import ocv


def test_ocv_with_one_branch_has_no_gap():
    nothing = np.full(11, np.nan)
    columns = {"soc": SOC, "ocv_volt": 3 + SOC, "discharge_volt": 3 + SOC, "charge_volt": nothing}
    single = columns | {"half_gap_volt": nothing}
    both = columns | {"half_gap_volt": np.full(11, 0.004), "charge_volt": 3.1 + SOC}
    curve, gap = panels(ocv.draw_ocv([(single, about("slow"))]))
    assert (drawn(gap), gap.axison) == ([], False)
    np.testing.assert_allclose(drawn(curve)[-1], np.column_stack([100 * SOC, 3 + SOC]))
    assert labels(curve) == ["slow (25 °C)"]
    _, gap = panels(ocv.draw_ocv([(both, about())]))
    np.testing.assert_allclose(drawn(gap)[0][:, 1], 4.0)


def test_ocv_over_temperature_shows_bias_coefficient_and_functions():
    levels = np.repeat([-10.0, 25.0, 40.0], len(SOC))
    bias = {
        "temperature_celsius": levels,
        "soc": np.tile(SOC, 3),
        "bias_volt": 1e-4 * (np.tile(SOC, 3) - 0.5) * (levels - 25),
        "measured_bias_volt": 1e-4 * (np.tile(SOC, 3) - 0.5) * (levels - 25),
        "tested": np.abs(np.tile(SOC, 3) - 0.5) < 0.45,
    }
    value = np.linspace(-0.05, 0.05, len(SOC))
    entropic = {
        "source": np.array(["steps"] * len(SOC)),
        "used": np.ones(len(SOC), bool),
        "soc": SOC,
        "entropic_millivolt_per_kelvin": value,
        "lower_millivolt_per_kelvin": value - 0.01,
        "upper_millivolt_per_kelvin": value + 0.01,
    }
    errors = {"rmse_volt": 1e-3, "cross_validation_rmse_volt": 2e-3}
    functions = [
        {"function": f"{name}(T)", "chosen": name == "surface", **errors}
        for name in ("log", "surface")
    ]
    figure = ocv.draw_ocv_temperature(
        bias, entropic, {"reference_celsius": np.full(3, 25.0)}, functions
    )
    first, _, third, fourth = panels(figure)[:4]
    assert labels(first) == ["-10 °C", "25 °C", "40 °C"]
    assert labels(third) == ["steps (used)"]
    assert drawn(third)[0][:, 1] == pytest.approx(value)
    assert [text.get_text() for text in fourth.get_yticklabels()] == ["log", "surface ★"]
    ocv.draw_ocv_temperature(bias, entropic, {"reference_celsius": np.full(3, 25.0)}, [])
