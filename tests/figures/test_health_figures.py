"""Figures of health: what is known is drawn with its limits, what is not is said."""

import numpy as np
from figure_panels import labels

from figures import health

CYCLE = np.arange(1.0, 101.0)
LAW = 3 - 0.004 * CYCLE
COURSE = {
    "cycle": CYCLE,
    "capacity_ampere_hour": LAW + 0.01,
    "at_reference_ampere_hour": LAW,
    "used": np.append(False, np.ones(99, bool)),
    "law_ampere_hour": LAW,
    "law_lower_ampere_hour": LAW - 0.01,
    "law_upper_ampere_hour": LAW + 0.01,
    "recovered_ampere_hour": np.zeros(100),
    "energy_efficiency": np.full(100, np.nan),
    "coulombic_efficiency": np.full(100, np.nan),
}
LIFE = {
    "law": "linear",
    "soh": 0.87,
    "last_cycle": 100.0,
    "knee_cycle": np.nan,
    "knee_lower_cycle": np.nan,
    "knee_upper_cycle": np.nan,
    "end_of_life_cycle": 150.0,
    "end_of_life_reached": False,
    "remaining_lower_cycles": 20.0,
    "remaining_upper_cycles": np.nan,
}


def test_the_end_of_life_is_drawn_as_far_as_it_is_known():
    first, second = health.draw_fade(COURSE, LIFE).axes
    assert first.get_title(loc="left") == "Fade: linear, SoH 87.0 %"
    assert labels(first)[-1] == "end of life 150 (120 or later)"
    assert not [text for text in labels(first) if "knee" in text]
    assert second.get_title(loc="left") == "Efficiency: charges not recorded"


def test_a_knee_has_its_interval():
    life = LIFE | {"knee_cycle": 80.0, "knee_lower_cycle": 70.0, "knee_upper_cycle": 85.0}
    course = COURSE | {"energy_efficiency": np.full(100, 0.95)}
    first, second = health.draw_fade(course, life | {"end_of_life_cycle": np.nan}).axes
    assert labels(first)[-1] == "knee 80 (70 to 85)"
    assert labels(second) == ["energy"]


def test_growth_of_resistance_has_a_line_for_each_check_up():
    growth = {
        "cycle": np.repeat([0.0, 900.0], 3),
        "direction": np.full(6, "discharge"),
        "delay_second": np.zeros(6),
        "soc": np.tile([0.2, 0.5, 0.8], 2),
        "resistance_ohm": np.repeat([0.002, 0.008], 3),
        "factor": np.repeat([1.0, 4.0], 3),
    }
    first, second = health.draw_resistance_growth(growth).axes
    assert labels(first) == ["cycle 0", "cycle 900"]
    assert second.lines[1].get_ydata().tolist() == [4.0, 4.0, 4.0]
    fresh = {name: values[growth["cycle"] == 0] for name, values in growth.items()}
    for few in (fresh, {}):  # {}: pulses of which none has a resistance
        assert "needs pulse tests at two check-ups" in health.draw_resistance_growth(few).not_drawn


def test_a_fleet_names_its_outlier_or_says_why_there_is_no_line():
    cells = [
        {
            "type": "NMC",
            "cell": name,
            "capacity_ampere_hour": size,
            "resistance_ohm": 0.002,
            "predicted_ampere_hour": 25.0,
            "predicted_std_ampere_hour": 1.0,
            "error_ampere_hour": 25.0 - size,
            "outlier": out,
        }
        for name, size, out in (("P1", 20.0, False), ("P2", 30.0, True))
    ]
    line = {
        "type": "NMC",
        "slope_ohm_per_ampere_hour": -1e-4,
        "intercept_ohm": 5e-3,
        "held_out_share": 0.034,
        "line_held_out_rms_ampere_hour": 1.5,
        "socs": 10,
        "delay": "1 s",
        "verdict": "",
    }
    by_line, by_course = health.draw_fleet(cells, [line]).axes
    assert [text.get_text() for text in by_line.texts] == ["P2"]
    assert "left out to 6.0 %" in by_line.get_title(loc="left")
    assert by_course.get_title(loc="left") == "from 10 resistances over SoC: to 3.4 %"
    none = line | {"slope_ohm_per_ampere_hour": np.nan, "verdict": "2 cells; a fleet needs 6"}
    shown = health.draw_fleet([], [none])
    texts = [*shown.texts, *[text for axes in shown.axes for text in axes.texts]]
    assert any("a fleet needs 6" in text.get_text() for text in texts)
