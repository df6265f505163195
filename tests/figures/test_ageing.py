"""Figures of cycles and fast charges: shares add up, and what is not known is said."""

import numpy as np

from figures import ageing


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


def test_ageing_tells_slope_and_period():
    found = {"period_hour": np.array([30.0, 24.0, 8.0]), "power": np.array([1.0, 50.0, 1.0])}
    axes = ageing.draw_ageing(cycles(np.arange(6.0)), found, summary()).axes
    assert "0.25 %/K" in axes[1].get_legend().get_texts()[0].get_text()
    assert "24 h: ±0.5 %" in axes[2].texts[0].get_text()


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
    left, right = ageing.draw_fast_charge([(series, steps, numbers, about)]).axes
    assert [bar.get_height() for bar in right.patches] == [20.0, 30.0]
    assert "50 %" in [text.get_text() for text in right.texts]
    assert "[min]" in left.get_xlabel()
