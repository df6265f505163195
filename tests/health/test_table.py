"""The table of health: rows of each method, with knee and remaining cycles of the life."""

import numpy as np
import pytest
from lives_made import life, noise, smooth

import cellwright as cw
from cellwright.health.of_life import analysed
from cellwright.refusal import Refusal


def test_methods_stand_side_by_side():
    share = smooth("straight", 300, 0.3) + noise(np.random.default_rng(0), 300)
    columns, _, summary = analysed(life(share))
    check_ups = [
        {"cycle": c, "capacity_ampere_hour": 3 * s, "soh": s, "soh_std": 0.002}
        for c, s in ((0.0, 1.0), (150.0, 0.85))
    ]
    mode = {"lli": 0.1, "lam_negative": 0.02, "lam_positive": np.nan}
    mode |= {"lli_std": 0.025, "lam_negative_std": 0.01, "lam_positive_std": np.nan}
    against = {"doubt": "hangs on the window", "fresh_ampere_hour": 3.1}
    modes = [
        mode | against | {"cycle": 0.0, "capacity_ampere_hour": 3.1},
        mode | against | {"cycle": 150.0, "capacity_ampere_hour": 2.635},
        dict.fromkeys(mode, np.nan) | {"cycle": 300.0, "capacity_ampere_hour": 2.2},
    ]
    rows = cw.state_of_health(check_ups, (summary, columns), modes).rows
    by_method = {}
    for row in rows:
        by_method.setdefault(row["method"], {})[row["cycle"]] = row
    assert set(by_method) == {"check-up", "ageing cycles", "degradation modes"}
    assert by_method["ageing cycles"][150.0]["soh"] == pytest.approx(0.85, abs=0.003)
    assert by_method["degradation modes"][150.0]["soh"] == pytest.approx(0.85)
    found = by_method["degradation modes"][150.0]
    assert (found["lli"], found["lli_std"]) == (0.1, 0.025)
    assert 300.0 not in by_method["degradation modes"]
    doubts = {method: {row["doubt"] for row in of.values()} for method, of in by_method.items()}
    assert doubts["degradation modes"] == {"hangs on the window"}
    assert doubts["check-up"] == doubts["ageing cycles"] == {""}
    assert by_method["check-up"][150.0]["remaining_cycles"] == pytest.approx(50, abs=3)
    assert by_method["ageing cycles"][300.0]["remaining_cycles"] == 0


def test_an_estimate_that_the_capacity_contradicts_is_no_state_of_health():
    of_peaks = {"capacity_ampere_hour": 3.0, "soh": 1.0, "soh_std": 0.01}
    wrong = "capacity and peaks of this check-up disagree by 11 %: one of them is wrong"
    peaks = [of_peaks | {"cycle": 0.0, "reason": ""}, of_peaks | {"cycle": 9.0, "reason": wrong}]
    rows = cw.state_of_health((), None, (), peaks).rows
    assert [row["cycle"] for row in rows] == [0.0]


def test_no_method_at_all_is_refused():
    with pytest.raises(Refusal, match="no state of health"):
        cw.state_of_health()


def test_a_cell_of_one_check_up_is_as_worn_as_its_lost_lithium_says():
    """Its losses refer to a fresh cell of the type: so does its state of health."""
    lost = {"lli": 0.12, "lam_negative": 0.02, "lam_positive": 0.01}
    row = lost | {f"{name}_std": 0.01 for name in lost}
    row |= {"cycle": 0.0, "capacity_ampere_hour": 2.64, "fresh_ampere_hour": 3.0}
    (found,) = cw.state_of_health(modes=[row]).rows
    assert found["soh"] == pytest.approx(0.88)
