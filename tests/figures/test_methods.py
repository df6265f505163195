"""Figure of identification methods compared on the same pulses."""

import numpy as np

from figures import methods
from pulse_methods.comparison import METHODS, MethodRows


def rows(**changes):
    base = dict.fromkeys(MethodRows._fields, 0.01)
    base |= {"tau1_second": 2.0, "tau2_second": 30.0, "rmse_volt": 1e-3, "evaluations": 5}
    return [
        base | {"soc": soc, "ambient_temperature_celsius": celsius, "method": method} | changes
        for method in METHODS
        for celsius in (0.0, 25.0)
        for soc in (0.2, 0.5, 0.8)
    ]


def test_every_method_is_in_every_panel_at_the_temperature_nearest_25():
    canvas = methods.draw_identification_methods(rows())
    assert canvas.axes[0].get_title(loc="left") == "R0 at 25 °C"
    for axes in canvas.axes[:6]:
        assert len(axes.containers) == len(METHODS)
        assert all(len(one.lines[0].get_xdata()) == 3 for one in axes.containers)
    assert len(canvas.axes[7].patches) == len(METHODS)


def test_a_method_without_values_leaves_its_place_open():
    lost = [row | {"r0_ohm": np.nan} if row["method"] == "genetic" else row for row in rows()]
    canvas = methods.draw_identification_methods(lost)
    assert len(canvas.axes[7].patches) == len(METHODS) - 1
    nothing = methods.draw_identification_methods(rows(r0_ohm=np.nan))
    assert "No pulse was identified" in nothing.axes[0].texts[0].get_text()
