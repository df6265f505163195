"""The figure of the SoC filters: what was estimated is what is drawn."""

import io

import numpy as np

from drawing import soc

TIME = np.arange(0.0, 7200.0, 60.0)


def test_every_filter_is_drawn_once_with_its_band_where_it_has_one():
    series = {"test_time_second": TIME, "soc": 0.5 + 0 * TIME, "scored": TIME > 600}
    for name, level in (("coulomb", 0.2), ("aekf", 0.51)):
        series[f"estimated_{name}_soc"] = level + 0 * TIME
        series[f"std_{name}_soc"] = 0.01 + 0 * TIME
    row = {"rmse_soc": 0.01, "convergence_second": 120.0}
    rows = [{"filter": "coulomb", "rmse_soc": 0.3, "convergence_second": np.nan}]
    rows += [{"filter": "aekf"} | row, {"filter": "aekf", "rmse_soc": 9.0} | row]
    canvas = soc.draw(series, rows, "udds")
    canvas.savefig(io.BytesIO(), format="svg")
    level, error = canvas.get_axes()
    told = [text.get_text() for text in level.get_legend().get_texts()]
    coulomb, aekf = "coulomb: does not converge RMSE 30.0 %", "aekf: 120 s, then RMSE 1.0 %"
    assert told == ["counted", coulomb, aekf]
    np.testing.assert_allclose(error.get_lines()[0].get_ydata(), 1.0)
    assert len(error.get_lines()) == 1
    assert len(error.collections) == 1
