"""Figures of laws over temperature: lines through the points, dotted where nothing was tested."""

import numpy as np
from arrhenius import arrhenius_law
from figure_panels import drawn, labels, law, panels

from figures import temperature


def test_temperature_draws_the_laws_over_the_points_and_dots_what_was_not_tested():
    celsius = np.array([0.0, 25.0, 40.0])
    points = {
        "quantity": np.array(["R"] * 3 + ["R far"] * 3 + ["capacity at 1C"] * 3),
        "unit": np.array(["Ohm"] * 6 + ["Ah"] * 3),
        "temperature_celsius": np.tile(celsius, 3),
        "value": np.array([3.0, 2.0, 1.5, 9.0, 9.0, 9.0, 1.0, 1.1, 1.2]),
        "family": np.array(["R"] * 6 + ["capacity"] * 3),
        "soc": np.array([0.5] * 3 + [0.9] * 3 + [np.nan] * 3),
    }
    laws = law("R", "quadratic", 0.0, -0.0375, 3.0) + law("R", "arrhenius", 2.0, 1e4, chosen=True)
    figure = temperature.draw_temperature_laws(points, laws)
    first, second, *empty = panels(figure)
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert named == ["measured", "quadratic", "Arrhenius"]
    assert first.get_title(loc="left").endswith("Arrhenius: chosen")
    np.testing.assert_allclose(drawn(first)[0], np.column_stack([celsius, [3e3, 2e3, 1.5e3]]))
    np.testing.assert_allclose(drawn(first)[2][0], [0.0, 3e3])
    assert [line.get_linestyle() for line in first.get_lines()[1:4]] == [":", "-", ":"]
    assert [line.get_xdata()[-1] for line in first.get_lines()[1:4]] == [0, 40, 45]
    assert (first.get_ylabel(), second.get_ylabel()) == ("[mΩ]", "[Ah]")
    assert [panel.axison for panel in empty] == [False]


def test_a_quadratic_that_turns_says_where_and_is_dotted_from_there():
    points = {
        "quantity": np.array(["R"] * 3),
        "unit": np.array(["Ohm"] * 3),
        "temperature_celsius": np.array([0.0, 25.0, 40.0]),
        "value": np.array([3.0, 2.0, 1.9]),
        "family": np.array(["R"] * 3),
        "soc": np.array([0.5] * 3),
    }
    laws = law("R", "quadratic", 1e-3, -0.06, 3.0, valid=(-np.inf, 30.0))
    figure = temperature.draw_temperature_laws(points, laws)
    panel, *empty = panels(figure)
    # A page shows any figure as wide as itself: one panel alone would be magnified.
    assert panel.get_position().width < 0.4
    assert [one.axison for one in empty] == [False, False]
    assert panel.get_title(loc="left") == "R\nquadratic: turns upward at 30 °C"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["measured", "quadratic"]
    drawn_to = [(x.get_linestyle(), x.get_xdata()[-1]) for x in panel.get_lines()[1:]]
    assert drawn_to == [(":", 0.0), ("-", 30.0), (":", 40.0), (":", 45.0)]


def test_arrhenius_lines_have_their_residuals_beneath():
    name, celsius = "resistance at 50 % SoC, 10 s", np.array([0.0, 25.0, 40.0])
    value = arrhenius_law(celsius, 0.02, 2e4) * np.array([1.0, 1.01, 1.0])
    points = [
        {"quantity": name, "family": "resistance, 10 s", "soc": 0.5, "std": 1e-4}
        | {"temperature_celsius": c, "value": v}
        for c, v in zip(celsius, value, strict=True)
    ]
    capacity_point = {"quantity": "capacity at 1C", "family": "capacity", "soc": np.nan}
    figure = temperature.draw_arrhenius(
        [*points, capacity_point], law(name, "arrhenius", 0.02, 2e4)
    )
    upper, _, _, lower, *_ = panels(figure)
    assert labels(upper) == ["50 % SoC"]
    assert [tick.get_text() for tick in lower.get_xticklabels()] == ["0", "25", "40"]
    residual = next(xy for xy in drawn(lower) if len(xy) == 3)
    np.testing.assert_allclose(residual[:, 1], [0, 1, 0], atol=1e-9)
    assert (
        "No resistance"
        in temperature.draw_arrhenius([capacity_point], []).axes[0].texts[0].get_text()
    )
