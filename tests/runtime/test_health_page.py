"""Health in the overview: the latest state by each method, and nothing that nobody told."""

import numpy as np
import pandas as pd
import pytest
from contract_rows import row_of

from runtime import health_page

NAMES = ["cell", "cycle", "soh", "soh_std", "method", "lli", "lam_negative", "lam_positive"]


def row(cell, cycle, soh, method, *modes, std=0.004):
    stds = {"lli_std": 0.025 if modes else np.nan}
    values = [cell, cycle, soh, std, method, *(modes or [np.nan] * 3)]
    return dict(zip(NAMES, values, strict=True)) | stds


HEALTH = pd.DataFrame(
    [
        row("A", 0.0, 1.0, "check-up"),
        row("A", 900.0, 0.8765, "check-up"),
        row("A", 500.0, 0.95, "check-up"),
        row("A", 900.0, 0.881, "dQ/dV peaks", std=np.nan),
        row("A", 900.0, np.nan, "degradation modes", 0.08, 0.02, 0.031),
        row("B", 0.0, 0.98, "check-up"),
    ]
)
FADE = pd.DataFrame(
    [
        {
            "cell": "A",
            "start_ampere_hour": 20.0,
            "knee_cycle": 843.2,
            "knee_lower_cycle": 800.0,
            "knee_upper_cycle": np.nan,
            "remaining_cycles": np.nan,
        }
    ]
)


def as_text(frame):
    """A table as the report reads it: text, an empty cell for what is not known."""
    return frame.astype(object).where(frame.notna(), "").astype(str)


def test_the_overview_has_the_latest_state_by_each_method():
    tables = {"health": as_text(HEALTH), "fade": as_text(FADE)}
    (found,) = health_page.section(tables)["rows"]
    assert found["check_up"] == {"soh": "87.6 ± 0.4 %", "cycle": "900.0"}
    assert found["peaks"]["soh"] == "88.1 %"
    assert found["cycles"] == {}
    assert [found[name] for name in health_page.SHARES] == ["8.0 ± 2.5 %", "2.0 %", "3.1 %"]
    assert found["knee"] == "843 (800 to ?)"
    assert found["remaining"] == ""


def test_a_life_without_check_ups_is_in_the_overview():
    lone = pd.DataFrame([row("C", 28.0, 0.955, "ageing cycles")])
    life = FADE.assign(cell="C", knee_cycle=np.nan, knee_lower_cycle=np.nan)
    (found,) = health_page.section({"health": as_text(lone), "fade": as_text(life)})["rows"]
    assert (found["cell"], found["cycles"]) == ("C", {"soh": "95.5 ± 0.4 %", "cycle": "28.0"})


def test_lives_are_drawn_from_every_discharge_else_from_check_ups(saved):
    """Of the three discharges the second was left out."""
    course = row_of("fade_course", test="life")
    rows = [
        course | {"cycle": cycle, "capacity_ampere_hour": size, "used": why == "", "reason": why}
        for cycle, size, why in ((1.0, 20.0, ""), (2.0, 5.0, "cut short"), (3.0, 18.0, ""))
    ]
    path = saved("results/stages/fade_course/A.parquet", rows)
    aged = pd.concat([HEALTH, pd.DataFrame([row("B", 100.0, 0.9, "check-up")])])
    lives = health_page.lives(aged, FADE, [path], {"A": "fast_charge", "B": None})
    cycled, checked = lives
    assert cycled["protocol"] == "fast_charge"
    assert cycled["soh"].tolist() == pytest.approx([1.0, 0.9])
    assert cycled["knee_cycle"] == 843.2
    assert cycled["peaks"].tolist() == [[900.0, 0.881]]
    assert checked["cycle"].tolist() == [0.0, 100.0]
    assert checked["protocol"] == ""
