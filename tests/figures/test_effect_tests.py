"""Figures of tests for proof: models before and after the search, of cells and of groups."""

import numpy as np
import pytest
from figure_panels import rendered, title

from figures import effect_tests

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
    voltage, worst, residual, _ = rendered(effect_tests.draw_effect_validation(verdict, found))
    assert title(voltage).startswith("udds: ")
    rms = 1e3 * np.sqrt(np.mean((found["voltage_volt"] - found["before_volt"])[: len(SECOND)] ** 2))
    assert f"plain model {rms:.2f} mV, with what was missing 1.00 mV" in title(residual)
    assert "noise floor 0.80 mV" in title(residual)
    before, after = [line.get_ydata() for line in residual.get_lines()]
    assert (before.min(), before.max()) == pytest.approx((4.0, 6.0))
    np.testing.assert_allclose(after, 1.0)
    hours = worst.get_lines()[0].get_xdata()
    assert hours.min() >= 1.0
    assert hours.max() - hours.min() == pytest.approx(0.1)


def test_a_cell_that_lacks_nothing_has_one_model_and_many_tests_are_counted():
    verdict = {"effects": [], "partial": [], "floor_volt": 1e-3}
    figure = effect_tests.draw_effect_validation(
        verdict, series(*((f"t{k}", "validation") for k in range(5)))
    )
    panels = rendered(figure)
    assert len(panels) == 12
    assert figure.get_suptitle() == "3 of 5 tests"
    assert len(panels[0].get_lines()) == 2
    assert "with what was missing" not in title(panels[2])


def test_a_group_is_drawn_branch_by_branch():
    one = series(("drive", "validation"), ("soft", "fit"))
    for k in (1, 2):
        one |= {f"soc_branch_{k}": one["voltage_volt"]}
        one |= {f"branch_{k}_current_ampere": one["voltage_volt"]}
        one |= {f"{end}_branch_{k}_current_ampere": one[f"{end}_volt"] for end in BOTH}
    found = {"effects": [{"effect": "branch_capacity"}], "partial": []}
    panels = rendered(effect_tests.draw_effect_branches(found, one))
    assert [title(panel) for panel in panels][::2] == ["drive: branch 1", "branch 2"]
    assert "1 mA" in title(panels[1])
    blind = {name: x for name, x in one.items() if not name.startswith("branch_")}
    assert len(rendered(effect_tests.draw_effect_branches(found, blind))) == 2
