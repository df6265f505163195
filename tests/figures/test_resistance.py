"""Figures of pulse resistance: delays, and the surface over SoC and temperature."""

import numpy as np
from figure_panels import about, drawn, labels, law, panels

from cellwright.laws.surface import FORMS
from figures import resistance


def test_resistance_at_the_first_sample_and_near_ten_seconds():
    delays = np.array([0.0, 1.0, 9.0, 60.0])
    columns = {
        "delay_second": delays,
        "actual_delay_second": delays,
        "direction": np.array(["discharge"] * 4),
        "c_rate": np.ones(4),
        "soc": np.full(4, 0.5),
        "resistance_ohm": np.array([0.01, 0.02, 0.03, 0.04]),
        "resistance_std_ohm": np.array([1e-4, 1e-4, 1e-4, np.nan]),
    }
    first, later = panels(resistance.draw_resistance([(columns, about())]))
    assert first.get_title(loc="left") == "Resistance, first sample"
    assert later.get_title(loc="left") == "Resistance, 9 s into the pulse"
    assert any(np.allclose(xy, [[50, 30]]) for xy in drawn(later))
    assert (
        len(panels(resistance.draw_resistance([({k: v[:1] for k, v in columns.items()}, about())])))
        == 1
    )


def test_a_first_sample_after_seconds_does_not_stand_beside_one_that_is_prompt():
    columns = {
        "delay_second": np.zeros(2),
        "actual_delay_second": np.array([0.1, 5.8]),
        "direction": np.array(["discharge"] * 2),
        "c_rate": np.ones(2),
        "soc": np.full(2, 0.5),
        "resistance_ohm": np.array([0.007, 0.018]),
        "resistance_std_ohm": np.full(2, 1e-4),
    }
    (first,) = panels(resistance.draw_resistance([(columns, about())]))
    np.testing.assert_allclose(np.concatenate(drawn(first)), [[50, 7]])
    late = {name: values[1:] for name, values in columns.items()}
    (first,) = panels(resistance.draw_resistance([(late, about())]))
    np.testing.assert_allclose(np.concatenate(drawn(first)), [[50, 18]])


def test_a_surface_shows_the_chosen_form_and_every_forms_error_left_out():
    celsius, soc = np.repeat([0.0, 25.0], 3), np.tile([0.2, 0.5, 0.8], 2)
    ohm = np.repeat([0.04, 0.02], 3)
    points = {
        "quantity": np.array(["resistance, 10 s"] * 6),
        "soc": soc,
        "temperature_celsius": celsius,
        "resistance_ohm": ohm,
        **{f"{form}_ohm": ohm for form in FORMS},
        **{f"{form}_left_out_ohm": 1.1 * ohm for form in FORMS},
    }
    points["additive_left_out_ohm"] = np.full(6, np.nan)
    laws = law("resistance over SoC and temperature, 10 s", "table", 6.0, chosen=True)
    fitted, shape, additive, _, table = panels(resistance.draw_resistance_surface(points, laws))[:5]
    assert shape.get_title(loc="left") == "surface: table"
    assert labels(fitted) == ["0 °C", "25 °C"]
    assert "too few temperatures" in additive.texts[0].get_text()
    np.testing.assert_allclose([xy[:, 1] for xy in drawn(table) if len(xy) == 3], 10.0)
    assert table.get_title(loc="left") == "left out: table ★"
