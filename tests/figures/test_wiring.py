"""Wirings as they are drawn: every cell once, in its wires, legible at 2 and at 50 cells."""

import pytest
from figure_panels import outside, rendered, text_boxes
from matplotlib.patches import Rectangle
from quick import slow_but

from figures import wiring


def rows(group, cells, connection="parallel", **more):
    return [
        {"group": group, "position": k + 1, "cell": cell, "connection": connection}
        | {name: values[k] for name, values in more.items()}
        for k, cell in enumerate(cells)
    ]


def model(cell, capacity, ohm):
    pairs = [{"kind": "RC", "r_ohm": [0.5 * ohm] * 2, "tau_second": [1e-3] * 2}]
    entry = {"ambient_temperature_celsius": 25.0, "soc": [0.0, 1.0], "r0_ohm": [0.5 * ohm] * 2}
    member = {"model": "1RC", "conditions": [entry | {"branches": pairs}]}
    return {"cell": cell, "capacity_ampere_hour": capacity, "chosen": "1RC", "members": [member]}


MANY = [f"P{k:02}" for k in range(50)]
LADDER = {"link_resistance_ohm": [0.0] + [1e-4] * 15, "wire_resistance_ohm": [1e-3] * 16}
SHEETS = {
    "2 in parallel": rows("g", "AB", wire_resistance_ohm=[1e-3, 0.0]),
    "50 in series": rows("g", MANY, "series", wire_resistance_ohm=[1e-3] * 50),
    "50 in parallel": rows("g", MANY),
    "ladder": rows("g", MANY[:16], **LADDER),
    "ladder, opposite ends": rows("g", MANY[:16], terminals=["opposite_ends"] * 16, **LADDER),
    "modules": [
        *rows("g", ["l", "r"], "series"),
        *rows("l", "AB", sense=["yes", None], terminals=["opposite_ends"] * 2),
        *rows("r", "CD", link_resistance_ohm=[0.0, 1e-3]),
    ],
    "strings": [*rows("g", ["l", "C"]), *rows("l", "AB", "series")],
}


def cells_of(sheet):
    groups = {row["group"] for row in sheet}
    return [row["cell"] for row in sheet if row["cell"] not in groups]


@pytest.mark.parametrize("name", slow_but(["modules", "strings", "2 in parallel"], SHEETS))
def test_every_cell_is_drawn_once_a_panel_apart_from_the_others(name):
    sheet = SHEETS[name]
    cells = cells_of(sheet)
    models = [model(cell, 3.0 + 0.01 * k, 0.02) for k, cell in enumerate(cells)]
    figure = wiring.draw_wiring("g", sheet, models)
    for axes in rendered(figure):
        texts = [text.get_text() for text in axes.texts]
        assert sorted(text for text in texts if text in cells) == sorted(cells)
        assert texts.count("−") == texts.count("+") == 1
        corners = [patch.get_xy() for patch in axes.patches if isinstance(patch, Rectangle)]
        assert len(set(corners)) == len(corners)
    boxes = text_boxes(figure)
    assert outside(figure, boxes) == []


def test_bias_is_written_in_percent_of_the_mean_and_a_cell_without_a_model_says_so():
    models = [model("A", 3.3, 0.018), model("B", 2.7, 0.022)]
    capacity, resistance = rendered(wiring.draw_wiring("g", rows("g", "ABC"), models))
    assert capacity.get_title(loc="left") == "Bias of capacity (mean 3 Ah)"
    assert resistance.get_title(loc="left").endswith("(mean 20 mΩ)")
    for axes, said in ((capacity, ("+10.0 %", "-10.0 %")), (resistance, ("-10.0 %", "+10.0 %"))):
        texts = [text.get_text() for text in axes.texts]
        assert [text for text in texts if "%" in text] == list(said)
        assert texts.count("no model") == 1


def at_temperatures(ohms):
    """A model of one resistance [Ω] at each temperature [°C]."""
    models = {celsius: model("A", 3.0, ohm) for celsius, ohm in ohms.items()}
    conditions = [
        one["members"][0]["conditions"][0] | {"ambient_temperature_celsius": celsius}
        for celsius, one in models.items()
    ]
    return {**models[max(ohms, key=str)], "members": [{"model": "1RC", "conditions": conditions}]}


def test_resistance_is_that_nearest_25_degrees_and_the_title_says_at_which():
    """0 °C is a temperature, not a blank: a blank alone stands for 25 °C."""
    for ohms, said in (
        ({0.0: 0.05, 25.0: 0.02}, ", 25 °C (mean 20 mΩ)"),
        ({0.0: 0.05, 10.0: 0.03}, ", 10 °C (mean 30 mΩ)"),
        ({None: 0.02}, ", 25 °C (mean 20 mΩ)"),
    ):
        figure = wiring.draw_wiring("g", rows("g", "AB"), [at_temperatures(ohms)])
        title = rendered(figure)[1].get_title(loc="left")
        assert title.endswith(said), title
    cold = at_temperatures({0.0: 0.05}) | {"cell": "B"}
    models = [at_temperatures({25.0: 0.02}), cold]
    title = rendered(wiring.draw_wiring("g", rows("g", "AB"), models))[1].get_title(loc="left")
    assert ", 0 to 25 °C (mean" in title
