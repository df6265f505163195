"""Peaks of dQ/dV of one cell at several temperatures against those at the reference temperature."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.peak_matching import match_peaks
from cellwright.laws.peak_scale import scaled_peaks, smoothed
from cellwright.refusal import Refusal

SAME_RATE = 1.12


class Charge(NamedTuple):
    """One slow charge: its test, temperature [°C], rate [1/h] and curve, (n,) [V], [A h/V]."""

    test: str
    temperature_celsius: float
    c_rate: float
    voltage_volt: np.ndarray
    dq_dv_ampere_hour_per_volt: np.ndarray


class OverTemperature(NamedTuple):
    """Rows for three tables: matches, peaks at the common smoothing, curves on it; and notes."""

    matches: list
    peaks: list
    curves: dict
    notes: list


def peaks_over_temperature(charges, *, reference_celsius=25.0, sigma_volt=0.01, prominence=0.05):
    """Match the peaks of slow charges at several temperatures with those at the reference.

    Parameters
    ----------
    charges : list of Charge, all of one age. reference_celsius : wanted; the nearest is taken.
    sigma_volt, prominence : as for `scaled_peaks`.

    Returns
    -------
    OverTemperature. Charges at another rate than the reference's (by more than 12 %) are left
    out: peaks move with the rate as well.

    Raises
    ------
    Refusal : fewer than two temperatures with charges of one rate.
    """
    notes, mine = [], []
    first = min(charges, key=lambda one: abs(one.temperature_celsius - reference_celsius))
    for charge in sorted(charges, key=lambda one: -one.temperature_celsius):
        ratio = max(charge.c_rate / first.c_rate, first.c_rate / charge.c_rate)
        if ratio > SAME_RATE:
            rates = f"{charge.c_rate:.3g}C, the reference {first.test} at {first.c_rate:.3g}C"
            notes.append(f"{charge.test} was left out: it is at {rates}")
        else:
            mine.append(charge)
    if len({charge.temperature_celsius for charge in mine}) < 2:
        raise Refusal("charges of one rate are known at one temperature only")
    peaks = {
        one.test: scaled_peaks(
            one.voltage_volt,
            one.dq_dv_ampere_hour_per_volt,
            sigma_volt=sigma_volt,
            prominence=prominence,
        )
        for one in mine
    }
    unclear = [one.test for one in mine if not all(peak.clear for peak in peaks[one.test])]
    notes += [f"{test}: not all peaks stand clear of their valleys" for test in unclear]
    matches = [
        row
        for charge in mine
        if charge.test != first.test
        for row in _matched(first, charge, peaks, sigma_volt)
    ]
    return OverTemperature(matches, _peak_rows(mine, peaks), _curves(mine, sigma_volt), notes)


def _matched(first, charge, peaks, sigma):
    found = match_peaks(
        peaks[first.test], peaks[charge.test], end_volt=charge.voltage_volt[-1] - sigma
    )
    return [
        {
            "test": charge.test,
            "temperature_celsius": charge.temperature_celsius,
            "reference_celsius": first.temperature_celsius,
            **match._asdict(),
        }
        for match in found
    ]


def _peak_rows(charges, peaks):
    return [
        {
            "test": charge.test,
            "temperature_celsius": charge.temperature_celsius,
            "peak": number,
            **peak._asdict(),
        }
        for charge in charges
        for number, peak in enumerate(peaks[charge.test], 1)
    ]


def _curves(charges, sigma):
    """Columns of all smoothed curves, one below the other."""
    parts = [
        (
            np.full(len(one.voltage_volt), one.temperature_celsius),
            one.voltage_volt,
            smoothed(one.voltage_volt, one.dq_dv_ampere_hour_per_volt, sigma_volt=sigma),
        )
        for one in charges
    ]
    names = ("temperature_celsius", "voltage_volt", "dq_dv_ampere_hour_per_volt")
    return dict(zip(names, (np.concatenate(p) for p in zip(*parts, strict=True)), strict=True))
