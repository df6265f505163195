"""Peaks over temperature: merging is reported where areas say so, never forced."""

import numpy as np
import pytest

from cellwright.health.peaks.over_temperature import (
    Charge,
    match_peaks,
    peaks_over_temperature,
    scaled_peaks,
    smoothed,
)
from cellwright.refusal import Refusal

VOLT = np.arange(3.3, 4.2, 0.003)


def curve(*bells, floor=1.0):
    """dQ/dV of bells (volt, area, sigma) on a floor."""
    height = np.full(len(VOLT), floor)
    for volt, area, sigma in bells:
        height += area / (sigma * np.sqrt(2 * np.pi)) * np.exp(-0.5 * ((VOLT - volt) / sigma) ** 2)
    return height


# Thesis 3.3: peaks at 3.75, 3.90, 4.02 and 4.07 V; at −20 °C the upper two are one at 4.05 V.
WARM = curve((3.75, 5, 0.02), (3.90, 8, 0.02), (4.02, 6, 0.014), (4.07, 7, 0.012))
MERGED = curve((3.77, 5, 0.022), (3.91, 8, 0.022), (4.05, 13, 0.026))


def fates(other, reference=WARM, **settings):
    peaks = [scaled_peaks(VOLT, heights, **settings) for heights in (reference, other)]
    return [
        (m["reference_peaks"], m["peaks"], m["fate"])
        for m in match_peaks(*peaks, end_volt=VOLT[-1])
    ]


def test_the_thesis_example_upper_two_merge():
    assert fates(MERGED) == [("1", "1", "kept"), ("2", "2", "kept"), ("3+4", "3", "merged")]


def test_a_common_shift_is_no_change():
    shifted = curve((3.82, 5, 0.02), (3.97, 8, 0.02), (4.09, 6, 0.014), (4.14, 7, 0.012))
    assert [fate for *_, fate in fates(shifted)] == ["kept"] * 4


def test_areas_that_do_not_add_up_are_not_called_merged():
    too_small = curve((3.77, 5, 0.022), (3.91, 8, 0.022), (4.05, 5, 0.026))
    assert "merged" not in [fate for *_, fate in fates(too_small)]


def test_one_peak_that_becomes_two_is_split():
    matches = fates(WARM, reference=MERGED)
    assert matches[-1] == ("3", "3+4", "split")


def test_a_peak_that_is_gone_is_lost_and_one_behind_the_end_is_cut():
    gone = curve((3.75, 5, 0.02), (4.02, 6, 0.014), (4.07, 7, 0.012))
    assert ("2", "", "lost") in fates(gone)
    warm = scaled_peaks(VOLT, WARM)
    short = VOLT < 4.0
    cold = scaled_peaks(VOLT[short], curve((3.80, 5, 0.02), (3.95, 8, 0.02))[short])
    assert [m["fate"] for m in match_peaks(warm, cold, end_volt=4.0)][-2:] == ["cut", "cut"]


def test_ripples_leave_nothing_but_unresolved_and_are_said():
    """A chamber that swings: ripples that do not stand clear, as in a real charge at −20 °C."""
    ripples = curve(floor=8.0) + 0.8 * np.sin(2 * np.pi * VOLT / 0.09)
    warm, cold = (20.0, 0.033, VOLT, WARM), (-20.0, 0.033, VOLT, ripples)
    matches, _, _, notes = peaks_over_temperature([Charge("warm", *warm), Charge("cold", *cold)])
    assert {match["fate"] for match in matches} == {"unresolved"}
    assert notes == ["cold: not all peaks stand clear of their valleys"]


def test_smoothing_keeps_a_constant_and_the_charge_within():
    assert smoothed(VOLT, np.ones(len(VOLT)), sigma_volt=0.01) == pytest.approx(1)
    inner = curve((3.75, 5, 0.02), floor=0.0)
    assert smoothed(VOLT, inner, sigma_volt=0.01).sum() * 0.003 == pytest.approx(5, rel=1e-3)


def test_position_and_area_of_a_lone_peak():
    (peak,) = scaled_peaks(VOLT, curve((3.75, 5, 0.02), floor=0.0))
    assert peak.voltage_volt == pytest.approx(3.75, abs=1e-3)
    assert peak.area_ampere_hour == pytest.approx(5, rel=1e-3)


def test_small_rises_are_no_peaks_and_a_flat_curve_is_refused():
    small = curve((3.75, 5, 0.02), (3.95, 0.05, 0.02))
    assert len(scaled_peaks(VOLT, small, prominence=0.05)) == 1
    with pytest.raises(Refusal, match="no peak of dQ/dV stands out"):
        scaled_peaks(VOLT, np.linspace(1, 2, len(VOLT)))
    with pytest.raises(Refusal, match="spans less than"):
        scaled_peaks(VOLT[:20], WARM[:20])


def test_several_temperatures_of_one_rate():
    charges = [
        Charge("cold", -20.0, 0.034, VOLT, MERGED),
        Charge("warm", 20.0, 0.033, VOLT, WARM),
        Charge("quick", 0.0, 0.5, VOLT, WARM),
    ]
    matches, peaks, curves, notes = peaks_over_temperature(charges)
    assert {(row["test"], row["reference_celsius"]) for row in matches} == {("cold", 20.0)}
    assert [row["fate"] for row in matches] == ["kept", "kept", "merged"]
    assert any("quick was left out" in note for note in notes)
    assert len(peaks) == 7
    assert len(curves["voltage_volt"]) == 2 * len(VOLT)
    with pytest.raises(Refusal, match="at one temperature only"):
        peaks_over_temperature(charges[1:])
