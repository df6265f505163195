"""Figures of incremental capacity: peaks are marked, and joined over temperature."""

import numpy as np
from figure_panels import SOC, about, columns, labels, panels

from figures import incremental_capacity


def test_ica_marks_the_peaks_and_needs_none():
    curve = {"voltage_volt": 3 + SOC, "dq_dv_ampere_hour_per_volt": SOC}
    peaks = {"voltage_volt": [3.5], "height_ampere_hour_per_volt": [0.5]}
    (panel,) = panels(
        incremental_capacity.draw_ica([(curve, peaks, about("a")), (curve, {}, about("b"))])
    )
    assert [text.get_text() for text in panel.texts] == ["3.500 V"]
    assert labels(panel) == ["a", "b"]


def test_matched_peaks_are_joined_and_unclear_ones_open():
    volt = np.tile(np.linspace(3.5, 4.2, 50), 2)
    curves = {
        "temperature_celsius": np.repeat([20.0, -20.0], 50),
        "voltage_volt": volt,
        "dq_dv_ampere_hour_per_volt": np.ones(100),
    }
    peaks = columns(
        [
            {
                "temperature_celsius": c,
                "voltage_volt": v,
                "height_ampere_hour_per_volt": 2.0,
                "clear": ok,
            }
            for c, v, ok in ((20.0, 4.02, True), (20.0, 4.07, True), (-20.0, 4.05, False))
        ]
    )
    match = {
        "reference_celsius": 20.0,
        "temperature_celsius": -20.0,
        "reference_peaks": "1+2",
        "peaks": "1",
        "fate": "merged",
    }
    lost = match | {"reference_peaks": "2", "peaks": "", "fate": "lost"}
    axes = incremental_capacity.draw_ica_temperature(curves, peaks, [match, lost]).axes[0]
    joined = [line.get_xdata().tolist() for line in axes.lines if len(line.get_xdata()) == 2]
    assert joined == [[4.02, 4.05], [4.07, 4.05]]
    assert [line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"][
        -1
    ] == "white"
    assert "merged" in [text.get_text() for text in axes.texts]
