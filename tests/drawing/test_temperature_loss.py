"""Figures of what temperature takes: bars add up, fates are joined, what is unknown says so."""

import numpy as np

from drawing import ageing, capacity_loss, fast_charge, ica_temperature


def columns(rows):
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


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
    canvas = capacity_loss.draw(columns([*rows, loss(25.0, 0.05, 0, 0, direction="charge")]))
    first, second = canvas.axes
    tops = {}
    for bar in first.patches:
        tops[round(bar.get_x(), 3)] = max(
            tops.get(round(bar.get_x(), 3), 0), bar.get_y() + bar.get_height()
        )
    assert np.allclose(list(tops.values()), 100)
    assert [bar.get_height() for bar in first.patches if bar.get_hatch()] == [0, 0, 18]
    assert (first.get_title(loc="left"), second.get_title(loc="left")) == ("Discharge", "Charge")


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
    axes = ica_temperature.draw(curves, peaks, [match, lost]).axes[0]
    joined = [line.get_xdata().tolist() for line in axes.lines if len(line.get_xdata()) == 2]
    assert joined == [[4.02, 4.05], [4.07, 4.05]]
    assert [line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"][
        -1
    ] == "white"
    assert "merged" in [text.get_text() for text in axes.texts]


def test_a_fast_charge_shows_its_share():
    time = np.arange(0.0, 3600.0, 10.0)
    series = {"test_time_second": time, "charge_ampere_hour": time / 1800}
    steps = {"charge_ampere_hour": np.array([2.0]), "first_row": np.array([0])}
    numbers = {
        "duration_minutes": [60.0],
        "capacity_ampere_hour": [2.0],
        "share": [0.5],
        "constant_current_share": [0.4],
        "minutes_constant_current": [12.0],
        "minutes": [30.0],
        "c_rate": [2.0],
    }
    about = {"params": {"test": {"ambient_temperature_celsius": -20.0}}}
    left, right = fast_charge.draw([(series, steps, numbers, about)]).axes
    assert [bar.get_height() for bar in right.patches] == [20.0, 30.0]
    assert "50 %" in [text.get_text() for text in right.texts]
    assert "[min]" in left.get_xlabel()


def summary(**more):
    names = ("slope", "slope_lower", "slope_upper")
    return {
        "temperature_source": "room",
        "capacity_start_ampere_hour": 20.0,
        "reference_celsius": 24.0,
        "daily_percent": 0.5,
        "daily_false_alarm": 0.0025,
        **{f"{name}_percent_per_kelvin": 0.25 for name in names},
    } | more


def cycles(celsius):
    capacity = np.linspace(20, 19, 6)
    return {
        "cycle": np.arange(6.0),
        "capacity_ampere_hour": capacity,
        "temperature_celsius": np.full(6, 1.0) * celsius,
        "used": np.array([False, *[True] * 5]),
        "fade_ampere_hour": capacity,
        "capacity_at_reference_ampere_hour": capacity,
    }


def test_ageing_says_what_is_not_known():
    none = {"period_hour": np.zeros(0), "power": np.zeros(0)}
    still = summary(slope_percent_per_kelvin=np.nan)
    titles = [axes.get_title(loc="left") for axes in ageing.draw(cycles(24.0), none, still).axes]
    assert titles == ["Over cycles", "Temperature not excited", "Periods: not knowable"]
    bare = ageing.draw(cycles(np.nan), none, summary()).axes[1]
    assert bare.get_xlabel() == "temperature not recorded"


def test_ageing_tells_slope_and_period():
    found = {"period_hour": np.array([30.0, 24.0, 8.0]), "power": np.array([1.0, 50.0, 1.0])}
    axes = ageing.draw(cycles(np.arange(6.0)), found, summary()).axes
    assert "0.25 %/K" in axes[1].get_legend().get_texts()[0].get_text()
    assert "24 h: ±0.5 %" in axes[2].texts[0].get_text()
