"""Real lives: NASA's B0047, whose capacity recovers after each pause of some days."""

import numpy as np
import pytest

import cellwright as cw

FACTS = {"cell": "B0047", "rated_capacity_ampere_hour": 2.0}
LIMITS = {"lower_cutoff_volt": 2.5, "upper_cutoff_volt": 4.2}


@pytest.fixture(scope="module")
def fade(shared):
    cell = FACTS | LIMITS
    test = {"test": "ageing", "kind": "ageing"}
    series = cw.clean(cw.read(shared / "campaigns/nasa/raw/B0047_ageing.parquet"))
    cycles = cw.ageing_cycles(series, cw.segment(series, cell), test, cell)
    return cw.fade([(test, cycles, None)], cell)


@pytest.mark.slow
def test_what_rests_bring_back_is_told_and_is_no_fade(fade):
    assert fade.summary["recovery_log_evidence"] > 20
    assert 5 < fade.summary["recovery_percent"] < 15
    used = fade.columns["used"]
    whole = fade.columns["law_ampere_hour"] + fade.columns["recovered_ampere_hour"]
    off = (whole - fade.columns["at_reference_ampere_hour"])[used]
    assert np.sqrt(np.mean(off**2)) < 0.015


def test_no_knee_is_told_of_a_life_that_slows_down(fade):
    assert np.isnan(fade.summary["knee_cycle"])
    assert fade.summary["end_of_life_reached"]
    assert 20 < fade.summary["end_of_life_cycle"] < 40
    assert 0.70 < fade.summary["soh"] < 0.80
