"""Figures of the search for a missing effect: every part is drawn, what is empty says so."""

import numpy as np
import pytest
from figure_panels import rendered, title

from cellwright.effects.story.words import name_of_effect
from figures import canvas, effects


def numbers(panel):
    """Texts written into the cells of a map."""
    return [text for a in panel.artists if isinstance(a, canvas.Numbers) for text in a.texts]


def bins(*rows):
    names = ("role", "test", "rate", "soc_low", "soc_high", "rows")
    columns = {
        name: np.array(values) for name, values in zip(names, zip(*rows, strict=True), strict=True)
    }
    size = np.arange(1.0, len(rows) + 1) * 1e-3
    return columns | {"before_rms_volt": size, "after_rms_volt": size / 10}


def test_the_map_has_a_line_for_each_test_and_current_and_one_scale():
    columns = bins(
        ("validation", "udds", "charge_low", 0.1 * 3, 0.4, 10),
        ("fit", "hppc", "rest", 0.2, 0.3, 10),
        ("fit", "hppc", "rest", 0.3, 0.4, 30),
        ("fit", "hppc", "rest", 0.3, 0.4, 10),
    )
    before, after, bar = rendered(effects.draw_residual_map(columns))
    lines = [text.get_text() for text in before.get_yticklabels()]
    assert lines == ["hppc (fitted): rest", "udds (validation): charge, slow"]
    (left,), (right,) = before.collections, after.collections
    pooled = np.sqrt((30 * 3.0**2 + 10 * 4.0**2) / 40)
    np.testing.assert_allclose(left.get_array().ravel(), [2.0, pooled, np.nan, 1.0])
    assert left.get_clim() == right.get_clim()
    assert 2.0 < left.get_clim()[1] <= pooled
    assert "[mV]" in bar.get_ylabel()
    assert sorted(numbers(after)) == ["0.1", "0.2", "0.3"]


def test_a_part_where_the_model_ran_empty_does_not_hide_the_others():
    change = np.append(np.linspace(1e-3, 4e-3, 40), 28.0)
    columns = {"effect": np.full(41, "leakage"), "test": np.full(41, "a"), "rows": np.full(41, 9)}
    columns |= {"sensitivity_volt": change, "residual_volt": 0.5 * change}
    (panel, *_) = rendered(effects.draw_evidence(columns))
    assert panel.get_xlim()[1] < 5.0
    assert title(panel).endswith("; 1 not drawn, at up to 28 V")


def test_evidence_shows_the_parts_that_judged_each_effect_and_says_what_they_say_together():
    change = np.linspace(1e-3, 4e-3, 8)
    one = {"rows": np.full(8, 200), "sensitivity_volt": change, "test": np.repeat(["a", "b"], 4)}
    one |= {"role": np.full(8, "validation")}
    columns = {name: np.tile(values, 3) for name, values in one.items()}
    columns["effect"] = np.repeat(["leakage", "ocv_edge", "time_skew"], 8)
    columns["role"][16:] = "fit"
    columns["residual_volt"] = np.concatenate([change, 0.4 * change, np.where(change < 3e-3, 9, 1)])
    columns["rows"][-1] = 100
    figure = effects.draw_evidence(columns)
    panels = rendered(figure)
    said = "{}: {} % of it was missing\nbetter with it: {} of 8 parts"
    assert [panel.get_legend() for panel in panels] == [None] * 4, "one legend below all"
    assert [text.get_text() for text in figure.legends[0].get_texts()][-2:] == ["a", "b"]
    assert [panel.axison for panel in panels] == [True, True, True, False]
    assert title(panels[0]) == said.format(name_of_effect("leakage"), 100, 8)
    assert title(panels[1]) == said.format(name_of_effect("ocv_edge"), 40, 0)
    np.testing.assert_allclose(panels[0].get_lines()[0].get_xydata(), [[0, 0], [4.2, 4.2]])
    points = panels[1].collections[-1]
    assert points.get_label() == "b"
    wanted = 1e3 * np.column_stack([change, 0.4 * change])[4:]
    np.testing.assert_allclose(points.get_offsets(), wanted)
    areas = panels[2].collections[-1].get_sizes()
    assert areas[-1] < areas[0]


def trial(number, effect, gain, z, **more):
    row = {"round": number, "effect": effect, "gain": gain, "z": z, "rank_z": z + 1.0}
    return row | {"chosen": False, "tied": False, "in_range": True} | more


def test_the_ranking_is_sorted_marks_what_is_needed_and_greys_what_is_out_of_range():
    rows = [
        trial(1, "leakage", 48.0, 4.0, in_range=False),
        trial(1, "slow_diffusion", 59.0, 5.0, chosen=True),
        trial(1, "ocv_edge", 58.9, 4.5, tied=True),
        trial(2, "leakage", -1.5, -2.0),
    ]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    figure = effects.draw_ranking(columns)
    (first,) = rendered(figure)
    names = [text.get_text() for text in first.get_yticklabels()]
    assert names == [*map(name_of_effect, ("slow_diffusion", "ocv_edge", "leakage"))]
    assert [bar.get_width() for bar in first.patches] == [5.0, 4.5, 4.0]
    assert [bar.get_hatch() for bar in first.patches] == [None, None, effects.HATCH]
    assert title(first) == "Each beside the plain model"
    assert first.get_lines()[0].get_xdata()[0] == 1.645
    assert "gain 48.0, by ranks 5.0" in [text.get_text() for text in first.texts]
    assert "1.645 standard errors" in figure.legends[0].get_texts()[-1].get_text()


def test_trials_below_what_is_needed_are_counted_and_not_drawn():
    weak = [trial(2, name, 0.1, 1.0) for name in ("leakage", "ocv_edge", "time_skew")]
    rows = [*weak, trial(2, "slow_diffusion", 59.0, 5.0, chosen=True)]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    (panel,) = rendered(effects.draw_ranking(columns))
    assert [text.get_text() for text in panel.get_yticklabels()] == ["slow diffusion"]
    said = "Each beside the other effects of the last model (1 in it); 3 below what is needed"
    assert title(panel).replace("\n", " ").startswith(said)
    nothing = {name: [row[name] for row in weak] for name in rows[0]}
    (panel,) = rendered(effects.draw_ranking(nothing))
    assert len(panel.get_yticklabels()) == 3, "where none reaches it, all are drawn"


BOTH = ("before", "after")
SECOND = np.arange(0.0, 7200.0, 10.0)


def series(*tests):
    """One record a test; the plain model is 4 mV too low, in the second hour of the last 6 mV."""
    late = np.where(SECOND >= 3600, 6e-3, 4e-3)
    one = {"test_time_second": SECOND, "voltage_volt": 3.7 + 0 * SECOND}
    one |= {"before_volt": 3.7 - late, "after_volt": 3.699 + 0 * SECOND}
    many = {name: np.tile(values, len(tests)) for name, values in one.items()}
    many["test"] = np.repeat([name for name, _ in tests], len(SECOND))
    many["used"] = np.ones(len(many["test"]), bool)
    return many | {"role": np.repeat([role for _, role in tests], len(SECOND))}


def test_only_tests_for_proof_are_drawn_whole_and_where_the_plain_model_is_worst():
    verdict = {"effects": [{"effect": "leakage"}], "floor_volt": 0.8e-3}
    found = series(("hppc", "fit"), ("udds", "validation"))
    voltage, worst, residual, _ = rendered(effects.draw_effect_validation(verdict, found))
    assert title(voltage).startswith("udds: ")
    rms = 1e3 * np.sqrt(np.mean((found["voltage_volt"] - found["before_volt"])[: len(SECOND)] ** 2))
    assert f"plain model {rms:.3g} mV, with what was missing 1 mV" in title(residual)
    assert "grey: floor 0.8 mV" in title(residual)
    before, after = [line.get_ydata() for line in residual.get_lines()]
    assert (before.min(), before.max()) == pytest.approx((4.0, 6.0))
    np.testing.assert_allclose(after, 1.0)
    hours = worst.get_lines()[0].get_xdata()
    assert hours.min() >= 1.0
    assert hours.max() - hours.min() == pytest.approx(0.1)


def test_errors_are_those_of_the_verdict_and_leave_out_what_it_leaves_out():
    """Rows on a steep end of the OCV are drawn, not counted; the error of all stands on top."""
    found = series(("udds", "validation"), ("us06", "validation"))
    steep = found["test_time_second"] >= 7000.0
    found["before_volt"] = found["before_volt"] - 0.1 * steep
    found["counted"] = found["used"] & ~steep
    error = (found["voltage_volt"] - found["before_volt"])[found["counted"]]
    together = {"before": float(np.sqrt(np.mean(error**2))), "after": 1e-3}
    verdict = {"effects": [{"effect": "leakage"}], "floor_volt": 0.8e-3}
    figure = effects.draw_effect_validation(verdict | {"validation_rmse_volt": together}, found)
    panels = rendered(figure)
    plain = f"plain model {1e3 * together['before']:.3g} mV"
    assert f"over all 2 tests together, as in the text: {plain}" in figure.get_suptitle()
    for residual in (panels[2], panels[6]):
        assert f"of this test: {plain}, with what was missing 1 mV" in title(residual)
        assert residual.get_lines()[0].get_ydata().max() > 100.0


def test_the_floor_of_a_test_is_its_own_where_the_verdict_has_it():
    verdict = {"effects": [], "partial": [], "floor_volt": 1e-3}
    verdict["floors"] = [{"test": "udds", "volt": 2.5e-3}]
    found = series(("udds", "validation"), ("us06", "validation"))
    panels = rendered(effects.draw_effect_validation(verdict, found))
    assert [f"floor {size} mV" in title(panels[k]) for k, size in ((2, "2.5"), (6, "1"))] == [
        True,
        True,
    ]


def test_a_cell_that_lacks_nothing_has_one_model_and_of_many_tests_the_worst_are_drawn():
    verdict = {"effects": [], "partial": [], "floor_volt": 1e-3}
    found = series(*((f"t{k}", "validation") for k in range(5)))
    for test in ("t0", "t3", "t4"):
        found["before_volt"] = found["before_volt"] - 0.01 * (found["test"] == test)
    figure = effects.draw_effect_validation(verdict, found)
    panels = rendered(figure)
    assert len(panels) == 12
    assert [title(panels[k])[:3] for k in (0, 4, 8)] == ["t0:", "t3:", "t4:"]
    assert figure.get_suptitle() == "3 of 5 tests, with the largest error"
    assert len(panels[0].get_lines()) == 2
    assert "with what was missing" not in title(panels[2])


def test_a_group_is_drawn_branch_by_branch():
    one = series(("drive", "validation"), ("soft", "fit"))
    for k in (1, 2):
        one |= {f"soc_branch_{k}": one["voltage_volt"]}
        one |= {f"branch_{k}_current_ampere": one["voltage_volt"]}
        one |= {f"{end}_branch_{k}_current_ampere": one[f"{end}_volt"] for end in BOTH}
    found = {"effects": [{"effect": "branch_capacity"}], "partial": []}
    panels = rendered(effects.draw_effect_branches(found, one))
    assert [title(panel) for panel in panels][::2] == ["drive: branch 1", "branch 2"]
    assert "1 mA" in title(panels[1])
    blind = {name: x for name, x in one.items() if not name.startswith("branch_")}
    assert len(rendered(effects.draw_effect_branches(found, blind))) == 2
