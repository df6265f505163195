"""Figures of rests and of the polarisation that they tell."""

import numpy as np
import pytest
from figure_panels import about, drawn, panels

from figures import relaxation


def test_relaxation_shows_one_rest_of_each_temperature():
    time = np.arange(0.0, 100.0, 5.0)
    columns = {"time_second": time, "voltage_volt": 3.7 - 0.01 * np.exp(-time / 20)}
    columns |= {"fitted_volt": columns["voltage_volt"] - 1e-3, "soc": np.full(20, 0.5)}
    empty = {name: np.zeros(0) for name in columns}
    tests = [(columns, about("warm", 25.0)), (columns, about("again", 25.0))]
    tests += [(columns, about("cold", -10.0)), (empty, about("none", 0.0))]
    found = panels(relaxation.draw_relaxation(tests))
    assert len(found) == 4
    assert found[0].get_title(loc="left") == "-10 °C, SoC 50 %"
    assert drawn(found[2])[0][:, 1] == pytest.approx(np.ones(20))
    assert len(panels(relaxation.draw_relaxation([(empty, about("none", 0.0))]))) == 1


def test_polarisation_over_soc_and_temperature():
    """Medians in the lower row are those of the points, and both laws run through them."""
    points = [
        {"quantity": name, "unit": unit, "temperature_celsius": t, "soc": z, "value": size - t / 10}
        | {"std": 0.1}
        for name, unit, size in (("a", "V", 9.0), ("tau1", "s", 60.0))
        for t in (0.0, 10.0, 20.0)
        for z in (0.2, 0.5, 0.8)
    ]
    law = {"quantity": "polarisation tau1, median over SoC", "law": "linear", "chosen": True}
    laws = [law | {"value": -0.1}, law | {"value": 57.5}]
    found = panels(relaxation.draw_polarisation(points, laws))
    assert [panel.get_title(loc="left") for panel in found][:2] == ["a over SoC", "tau1 over SoC"]
    median, line = drawn(found[3])
    assert median[:, 1].tolist() == [60, 59, 58]
    assert np.interp(10, line[:, 0], line[:, 1]) == pytest.approx(59)
    assert found[1].get_ylabel() == "tau1 [s]"
    assert len(panels(relaxation.draw_polarisation([], []))) == 1
