"""Figures of capacity and of incremental capacity."""

import numpy as np
from figure_panels import SOC, about, columns, drawn, labels, panels

from figures import capacity


def capacities(size):
    return {
        "direction": np.array(["discharge", "charge"]),
        "c_rate": np.array([1.0, 0.5]),
        "capacity_ampere_hour": np.array([size, size + 0.1]),
        "capacity_std_ampere_hour": np.array([0.01, np.nan]),
    }


def test_capacity_over_rate_and_over_ageing_only_where_there_is_any():
    (fresh,) = panels(capacity.draw_capacity([(capacities(2.0), about())]))
    marks = {tuple(data[0]) for data in drawn(fresh)}
    assert {(1.0, 2.0), (1.0, 1.99), (1.0, 2.01), (0.5, 2.1)} == marks  # with caps of the error bar
    assert labels(fresh) == ["25 °C"]
    tests = [(capacities(2.0), about(cycle=0)), (capacities(1.6), about(cycle=500, celsius=None))]
    rate, age = panels(capacity.draw_capacity(tests))
    assert {xy[0, 0] for xy in drawn(age) if len(xy) == 1} == {0, 500}
    assert "temperature not stated" in labels(rate)


def loss(celsius, rate, total, true, *, known=True, direction="discharge"):
    part = true if known else np.nan
    return {
        "direction": direction,
        "temperature_celsius": celsius,
        "c_rate": rate,
        "total_percent": total,
        "true_percent": part,
        "true_std_percent": 1.0 if known else np.nan,
        "true_lower_percent": true,
        "false_percent": total - part,
        "false_lower_percent": 0.0,
        "known": known,
    }


def test_bars_of_capacity_loss_add_up_to_the_reference():
    rows = [loss(25.0, 0.05, 0, 0), loss(-20.0, 1.0, 40, 10), loss(-10.0, 1.0, 20, 2, known=False)]
    figure = capacity.draw_capacity_loss(
        columns([*rows, loss(25.0, 0.05, 0, 0, direction="charge")])
    )
    first, second = figure.axes
    tops = {}
    for bar in first.patches:
        tops[round(bar.get_x(), 3)] = max(
            tops.get(round(bar.get_x(), 3), 0), bar.get_y() + bar.get_height()
        )
    assert np.allclose(list(tops.values()), 100)
    assert [bar.get_height() for bar in first.patches if bar.get_hatch()] == [0, 0, 18]
    assert (first.get_title(loc="left"), second.get_title(loc="left")) == ("Discharge", "Charge")


def test_ica_marks_the_peaks_and_needs_none():
    curve = {"voltage_volt": 3 + SOC, "dq_dv_ampere_hour_per_volt": SOC}
    peaks = {"voltage_volt": [3.5], "height_ampere_hour_per_volt": [0.5]}
    (panel,) = panels(capacity.draw_ica([(curve, peaks, about("a")), (curve, {}, about("b"))]))
    assert [text.get_text() for text in panel.texts] == ["3.500 V"]
    assert labels(panel) == ["a", "b"]
    (panel,) = panels(capacity.draw_ica([(curve, peaks, about(test)) for test in "abc"]))
    assert list(panel.texts) == []


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
    axes = capacity.draw_ica_temperature(curves, peaks, [match, lost]).axes[0]
    joined = [line.get_xdata().tolist() for line in axes.lines if len(line.get_xdata()) == 2]
    assert joined == [[4.02, 4.05], [4.07, 4.05]]
    assert [line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"][
        -1
    ] == "white"
    assert "merged" in [text.get_text() for text in axes.texts]
