"""Peaks followed through a life: known motions, merging, splitting, vanishing, rates, refusals."""

import numpy as np
import pytest

from cellwright.health.peaks.tracking import TrackedCharge, ica_tracks
from cellwright.refusal import Refusal

COLUMNS = (
    "voltage_volt",
    "voltage_std_volt",
    "height_ampere_hour_per_volt",
    "height_std_ampere_hour_per_volt",
    "area_ampere_hour",
    "area_std_ampere_hour",
    "width_volt",
)


def charge(cycle, peaks, *, c_rate=0.05, celsius=25.0, reason=""):
    """A charge with peaks of (voltage, height, area)."""
    volt, height, area = np.array(peaks, float).reshape(-1, 3).T
    values = (volt, 0 * volt + 1e-4, height, 0.01 * height, area, 0.01 * area, 0 * volt + 0.02)
    columns = dict(zip(COLUMNS, values, strict=True)) if len(peaks) else {}
    return TrackedCharge(f"t{cycle}_{c_rate}_{celsius}", cycle, c_rate, celsius, columns, reason)


def tracks(charges):
    """Rows by (cycle, rate): {identity: row}."""
    found = {}
    for row in ica_tracks(charges).rows:
        found.setdefault((row["cycle"], row["c_rate"]), {})[row["identity"]] = row
    return found


FRESH = [(3.50, 30, 5.0), (3.70, 25, 6.0), (3.95, 28, 7.0)]


def moved(peaks, volt=0.0, height=1.0):
    return [(v + volt, height * h, a) for v, h, a in peaks]


def test_names_stay_while_resistance_moves_all_peaks():
    charges = [charge(100 * k, moved(FRESH, 0.03 * k)) for k in range(5)]
    found = tracks(charges)
    for k in range(5):
        rows = found[100 * k, 0.05]
        assert list(rows) == ["P1", "P2", "P3"]
        assert [row["voltage_volt"] for row in rows.values()] == pytest.approx(
            [v + 0.03 * k for v, _, _ in FRESH]
        )
        assert not any(row["event"] for row in rows.values())
    shifts = [found[100 * k, 0.05]["P1"]["common_shift_volt"] for k in range(1, 5)]
    assert shifts == pytest.approx([0.03] * 4, rel=0.35)


@pytest.mark.parametrize("seed", range(10))
def test_identity_holds_where_the_middle_peak_is_missing_for_a_while(seed):
    rng = np.random.default_rng(seed)
    lives = []
    for k in range(8):
        peaks = [
            (
                v + 0.004 * k + 0.004 * rng.standard_normal(),
                h * np.exp(0.1 * rng.standard_normal()),
                a,
            )
            for v, h, a in FRESH
        ]
        lives.append(charge(k, peaks if k not in (3, 4) else [peaks[0], peaks[2]]))
    found = tracks(lives)
    assert all(list(found[k, 0.05]) == ["P1", "P2", "P3"] for k in range(8))
    assert found[3, 0.05]["P2"]["event"] == "vanished"
    assert found[4, 0.05]["P2"]["event"] == "absent"
    assert found[5, 0.05]["P2"]["event"] == "returned"
    assert "no peak near 3.7" in found[3, 0.05]["P2"]["reason"]


def test_a_merging_and_a_splitting_are_said_by_the_areas():
    together = [(3.50, 30, 5.0), (3.92, 30, 13.0)]
    found = tracks([charge(0, FRESH), charge(1, together)])
    assert found[1, 0.05]["P2"]["event"] == "merged with P3"
    apart = tracks([charge(0, together), charge(1, [FRESH[0], (3.80, 25, 6.0), (3.93, 28, 7.0)])])
    assert apart[1, 0.05]["P2"]["event"] == "split from P3"


def test_a_peak_that_goes_without_its_area_going_to_a_neighbour_has_vanished():
    found = tracks([charge(0, FRESH), charge(1, FRESH[1:])])
    assert found[1, 0.05]["P1"]["event"] == "vanished"


def test_a_peak_that_loses_height_is_said_to_have_shrunk_once():
    charges = [charge(k, [*FRESH[:2], (3.95, 28 * 0.7**k, 7.0 * 0.7**k)]) for k in range(5)]
    events = [tracks(charges)[k, 0.05]["P3"]["event"] for k in range(5)]
    assert events == ["", "", "shrunk to 49%", "", ""]


def test_another_rate_and_another_temperature_keep_the_names():
    charges = [charge(0, FRESH), charge(100, moved(FRESH, 0.004))]
    charges += [charge(c, moved(FRESH, 0.06, 0.8), c_rate=0.5) for c in (0, 100)]
    charges += [charge(0, moved(FRESH, 0.09, 0.7), celsius=0.0)]
    rows = ica_tracks(charges).rows
    for row in rows:
        nearest = min(
            FRESH, key=lambda p, r=row: abs(p[0] + r["common_shift_volt"] - r["voltage_volt"])
        )
        assert row["identity"] == f"P{FRESH.index(nearest) + 1}"
    assert len(rows) == 15


def test_what_appears_later_at_two_rates_is_one_peak():
    late = [*FRESH[:2], (3.85, 26, 3.0), (3.95, 28, 4.0)]
    charges = [charge(0, FRESH), charge(100, late)]
    charges += [charge(c, moved(p, 0.04), c_rate=0.5) for c, p in ((0, FRESH), (100, late))]
    found = tracks(charges)
    assert list(found[100, 0.05]) == list(found[100, 0.5]) == ["P1", "P2", "P3", "P4"]


def test_a_charge_without_peaks_is_an_answer():
    found = tracks([charge(0, FRESH), charge(900, [], reason="no peaks: flat")])
    assert {row["reason"] for row in found[900, 0.05].values()} == {"no peaks: flat"}
    assert {row["event"] for row in found[900, 0.05].values()} == {"vanished"}


def test_a_jump_beyond_all_tolerances_is_another_peak():
    found = tracks([charge(0, FRESH[:1]), charge(1, [(3.75, 30, 5.0)])])
    assert found[1, 0.05]["P1"]["event"] == "vanished"
    assert found[1, 0.05]["P2"]["event"] == "appeared"


def test_the_only_peak_left_of_three_keeps_its_name_in_doubt():
    found = tracks([charge(0, FRESH), charge(1, FRESH[2:])])
    assert "the only one left of 3" in found[1, 0.05]["P3"]["reason"]


def test_the_chemistry_only_names():
    plain = ica_tracks([charge(0, FRESH), charge(1, FRESH)]).rows
    named = ica_tracks([charge(0, FRESH), charge(1, FRESH)], chemistry="NMC").rows
    assert [row["identity"] for row in named[:3]] == [
        "graphite 4-3 / P1",
        "graphite 2-1 / P2",
        "NMC / P3",
    ]
    assert [r | {"identity": ""} for r in plain] == [r | {"identity": ""} for r in named]


@pytest.mark.parametrize(
    ("charges", "reason"),
    [
        ([charge(0, FRESH)], "1 charge for dQ/dV; two are needed"),
        ([charge(k, [], reason="no peaks: flat") for k in (0, 1)], "no peaks in any of 2 charges"),
    ],
)
def test_refusals(charges, reason):
    with pytest.raises(Refusal, match=reason):
        ica_tracks(charges)


def test_names_are_in_doubt_after_a_collapse_but_not_in_a_partial_charge():
    whole = [(3.50, 30, 5.0), (3.70, 25, 6.0), (3.95, 28, 7.0)]
    collapsed = [(3.52, 8, 2.0), (3.72, 14, 3.0), (3.97, 15, 3.5)]
    partial = [(3.70, 25, 2.5), (3.95, 28, 7.0)]
    fell = tracks([charge(0, whole), charge(400, collapsed)])[400, 0.05]
    assert all("changed by a factor of 2.1" in row["reason"] for row in fell.values())
    cut = tracks([charge(0, whole), charge(400, partial)])[400, 0.05]
    assert [row["reason"] for row in cut.values() if np.isfinite(row["voltage_volt"])] == ["", ""]
