"""The campaign at a glance and thumbnails of records: what was recorded is what is drawn."""

import numpy as np
from figure_panels import TIME, about, drawn, labels, panels

from figures import campaign


def test_records_colour_each_step_and_say_how_many_are_not_shown():
    series = {"test_time_second": TIME, "voltage_volt": 3 + TIME / 7200}
    steps = {"kind": np.array(["rest", "CC"]), "first_row": np.array([0, 60])}
    steps["last_row"] = np.array([59, 119])
    tests = [(series, steps, about(f"t{k}")) for k in range(5)]
    figure = campaign.draw_records(tests, 7)
    found = panels(figure)
    assert "(5 of 7 records)" in figure.get_suptitle()
    assert [panel.get_title(loc="left") for panel in found[:5]] == ["t0", "t1", "t2", "t3", "t4"]
    assert [panel.axison for panel in found] == [True] * 5 + [False] * 3
    rest, constant = (np.isfinite(xy[:, 1]).sum() for xy in drawn(found[1])[:2])
    assert (rest, constant) == (60, 61)
    assert "records)" not in campaign.draw_records(tests, 5).get_suptitle()


def test_overview_has_a_line_for_every_cell():
    facts = {"cell": "A", "ambient_temperature_celsius": "25"}
    sizes = [facts | {"capacity_ampere_hour": "2.0", "direction": "discharge"}]
    late = facts | {"resistance_ohm": "0.03", "direction": "charge"}
    ohms = [
        late | {"soc": soc, "delay_second": s}
        for soc, s in (("0.5", "10"), ("0.9", "10"), ("0.5", "0"))
    ]
    errors = [facts | {"rmse_volt": "0.004", "ambient_temperature_celsius": "", "chosen": "True"}]
    errors.append(facts | {"rmse_volt": "0.009", "chosen": "False"})
    kind = dict.fromkeys("AB", "NMC, 2 Ah")
    size, ohm, error = panels(campaign.draw_overview(kind, sizes, ohms, errors))
    assert [text.get_text() for text in size.get_yticklabels()] == ["A", "B"]
    np.testing.assert_allclose(np.concatenate(drawn(size)), [[2.0, 2]])
    np.testing.assert_allclose(np.concatenate(drawn(ohm)), [[30.0, 2]])
    np.testing.assert_allclose(np.concatenate(drawn(error)), [[4.0, 2]])
    assert labels(error) == ["25 °C", "temperature not stated"]
    assert size.get_xlim()[1] > 2.0, "no dot lies on the frame"
    near = [sizes[0] | {"ambient_temperature_celsius": f"{at}"} for at in (20.0, 20.4, 22.0, 30)]
    (size,) = panels(campaign.draw_overview(kind, near, [], []))
    assert labels(size) == ["20 °C", "30 °C"], "a chamber's wobble is no other temperature"
    room = [sizes[0] | {"ambient_temperature_celsius": at} for at in ("25", "24", "25")]
    (size,) = panels(campaign.draw_overview(kind, room, [], []))
    assert labels(size) == ["25 °C"], "as most sheets state it, and no mean of them"
    assert campaign.draw_overview({}, [], [], []).not_drawn


def test_cells_that_differ_little_lie_apart_and_what_is_not_known_has_no_panel():
    rows = [
        {"cell": name, "ambient_temperature_celsius": "25", "direction": "discharge"}
        | {"capacity_ampere_hour": f"{size}"}
        for name, size in zip("ABC", (4.9, 5.0, 5.1), strict=True)
    ]
    kinds = dict.fromkeys("ABC", "NMC, 5 Ah") | {"T2": "LMO, 32 Ah"}
    (size,) = panels(campaign.draw_overview(kinds, rows, [], []))
    low, high = size.get_xlim()
    assert (low, high) == (4.9 - 0.012, 5.1 + 0.012), "the differences, not the way from 0"
    assert size.get_title(loc="left") == "NMC, 5 Ah: Capacity [Ah]"
