"""Peaks of dQ/dV of one cell over temperature: one scale of smoothing, matched, their shift."""

from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from cellwright.messages import said_of
from cellwright.numerics.statistics import NORMAL_95
from cellwright.records import inputs
from cellwright.records.conditions import REFERENCE_CELSIUS, same_rate
from cellwright.refusal import Refusal
from cellwright.result import Result

SIGMA_VOLT = 0.01  # all curves are smoothed alike, against the ripples of a chamber that swings
SHIFT_TOLERANCE_VOLT = 0.04


# ASSUME: Between temperatures the peaks keep their order, and all move by about the same voltage.
def match_peaks(reference, other, *, end_volt=np.inf):
    """Peaks of one curve matched with those of another, at another temperature.

    Both lists are aligned in order, by dynamic programming: one peak to one, up to three to one
    (merged) or one to three (split), or none. A step costs the squared difference of the areas
    over its variance, and that of the position once a shift common to all peaks is taken out
    (polarisation moves them all); the alignment and shift of least cost win. Groups are called
    merged or split only where the areas' sums agree within the 95 % interval.

    Parameters
    ----------
    reference, other : lists of Peak, from low voltage.
    end_volt : where the other curve ends [V].

    Returns
    -------
    list of dict, in order of voltage. reference_peaks, peaks: numbers from 1, joined by "+"; ""
        where there is none. fate: kept; changed (one peak stays, its area does not); merged;
        split; lost; cut (lost, but it may lie behind the end of the curve); new; unresolved (peaks
        stand where others stood, but their areas do not add up, or not all peaks of the other
        curve stand clear of their valleys, so that ripples may be among them). Voltages are means
        weighted by area [V]; areas are sums [Ah], of the outer valleys only, with the standard
        deviation of their difference.

    Source: thesis 3.3 (figure 3.20: of four peaks at 20 °C the upper two become one at −20 °C).
    """
    # In the cold a charge's polarisation grows: shifts to higher voltage are the usual ones.
    shifts = np.arange(-0.06, 0.261, 0.01)
    alignments = [(*_aligned(reference, other, shift), shift) for shift in shifts]
    _, blocks, shift = min(alignments, key=lambda alignment: alignment[0])
    reach = end_volt - shift - SHIFT_TOLERANCE_VOLT
    matches = [_match(reference, other, reach, *block) for block in blocks]
    if all(peak.clear for peak in other):
        return matches
    return [m if m["fate"] == "kept" else m | {"fate": "unresolved"} for m in matches]


def _aligned(reference, other, shift):
    """Least cost of an alignment at one common shift [V], and its blocks in either list."""
    best = {(0, 0): (0.0, [])}
    places = product(range(len(reference) + 1), range(len(other) + 1))
    for i, j in list(places)[1:]:
        options = [
            (best[i - k, j - m][0] + cost, (i - k, i, j - m, j))
            for k, m, cost in _steps(reference[:i], other[:j], shift)
        ]
        cost, block = min(options)
        best[i, j] = (cost, [*best[block[0], block[2]][1], block])
    return best[len(reference), len(other)]


def _steps(reference, other, shift):
    """Every last step of an alignment: peaks it takes of either list, and its cost."""
    alone = 12.0  # of two peaks together as much as of a match five standard deviations off
    if reference:
        yield 1, 0, alone
    if other:
        yield 0, 1, alone
    for k, m in ((1, 1), (2, 1), (3, 1), (1, 2), (1, 3)):
        if k <= len(reference) and m <= len(other):
            yield k, m, _cost(reference[-k:], other[-m:], shift)


def _cost(reference, other, shift):
    """Cost of matching these peaks at a common shift [squared standard deviations]."""
    difference, std = _difference(reference, other)
    moved = (_centre(other) - _centre(reference) - shift) / SHIFT_TOLERANCE_VOLT
    # An area that disagrees costs no more than four deviations: place and order still count.
    area = min((difference / std) ** 2, 16.0)
    common = (shift / 0.1) ** 2
    further = len(reference) + len(other) - 2
    return area + moved**2 + common + 6.0 * further


def _area(peaks):
    return sum(peak.area_ampere_hour for peak in peaks)


def _centre(peaks):
    """Mean voltage of peaks, weighted by area [V]."""
    return sum(peak.voltage_volt * peak.area_ampere_hour for peak in peaks) / _area(peaks)


def _difference(reference, other):
    """Difference of the summed areas and its standard deviation [Ah]; inner valleys cancel."""
    edges = [
        value
        for peaks in (reference, other)
        for value in (peaks[0].left_std_ampere_hour, peaks[-1].right_std_ampere_hour)
    ]
    return _area(other) - _area(reference), max(float(np.linalg.norm(edges)), 1e-12)


def _match(reference, other, reach, first, stop, low, high):
    """One block of the alignment as a row."""
    reference_peaks, other_peaks = reference[first:stop], other[low:high]
    names = ["+".join(str(k + 1) for k in range(*span)) for span in ((first, stop), (low, high))]
    place = [_centre(peaks) if peaks else np.nan for peaks in (reference_peaks, other_peaks)]
    area = [_area(peaks) if peaks else np.nan for peaks in (reference_peaks, other_peaks)]
    difference, std = (
        _difference(reference_peaks, other_peaks)
        if reference_peaks and other_peaks
        else (np.nan, np.nan)
    )
    fate = _fate(len(reference_peaks), len(other_peaks), abs(difference) <= NORMAL_95 * std)
    return {
        "reference_peaks": names[0],
        "peaks": names[1],
        "fate": "cut" if fate == "lost" and place[0] > reach else fate,
        "reference_voltage_volt": place[0],
        "voltage_volt": place[1],
        "shift_volt": place[1] - place[0],
        "reference_area_ampere_hour": area[0],
        "area_ampere_hour": area[1],
        "area_difference_ampere_hour": difference,
        "area_difference_std_ampere_hour": std,
    }


def _fate(reference_count, other_count, agree):
    """Fate of the reference's peaks in a block, from how many there are and whether areas agree."""
    if not reference_count or not other_count:
        return "lost" if reference_count else "new"
    if reference_count == other_count:
        return "kept" if agree else "changed"
    if not agree:
        return "unresolved"
    return "merged" if reference_count > other_count else "split"


class Peak(NamedTuple):
    """A peak of dQ/dV at the smoothing common to all temperatures.

    voltage_volt, height_ampere_hour_per_volt, area_ampere_hour from valley to valley;
    voltage_std_volt : what smoothing leaves open. left_std_ampere_hour, right_std_ampere_hour :
    of the area, by the place of either valley.
    clear : whether both valleys lie below 0.8 of its height.
    """

    voltage_volt: float
    voltage_std_volt: float
    height_ampere_hour_per_volt: float
    area_ampere_hour: float
    left_std_ampere_hour: float
    right_std_ampere_hour: float
    clear: bool


def smoothed(voltage_volt, dq_dv, *, sigma_volt):
    """dQ/dV (n,) on its uniform grid (n,) [V], smoothed by a Gaussian of width sigma_volt [V].

    At the ends the Gaussian is cut and scaled up, so that a constant stays itself.
    """
    step = (voltage_volt[-1] - voltage_volt[0]) / (len(voltage_volt) - 1)
    reach = max(int(np.ceil(4 * sigma_volt / step)), 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / sigma_volt) ** 2)
    inside = np.convolve(np.ones(len(dq_dv)), kernel)[reach:-reach]
    return np.convolve(dq_dv, kernel)[reach:-reach] / inside


# ASSUME: The edge of a peak's area is uncertain by the smoothing width (five of them at the ends
# of the curve), its place by how far it moves when smoothed twice as wide.
def scaled_peaks(
    voltage_volt,
    dq_dv,
    *,
    sigma_volt=SIGMA_VOLT,
    prominence=0.05,
):
    """Peaks of one curve at the smoothing common to all temperatures.

    A chamber that swings prints ripples into dQ/dV that noise of the channel does not explain;
    curves are smoothed alike before their peaks are held against each other.

    Parameters
    ----------
    voltage_volt, dq_dv : (n,) curve of stage `ica_curve` [V], [A h/V].
    sigma_volt : width of the Gaussian [V]. prominence : least rise of a peak above the higher of
        its two valleys, as a share of the curve's highest value [1].

    Returns
    -------
    list of Peak, from low voltage.

    Raises
    ------
    Refusal : a curve shorter than eight widths, or without a peak.
    """
    from scipy.signal import find_peaks

    if voltage_volt[-1] - voltage_volt[0] < 8 * sigma_volt:
        raise Refusal(f"dQ/dV spans less than {8 * sigma_volt:g} V")
    height = smoothed(voltage_volt, dq_dv, sigma_volt=sigma_volt)
    wide = smoothed(voltage_volt, dq_dv, sigma_volt=2 * sigma_volt)
    tops, _ = find_peaks(height, prominence=prominence * height.max())
    if not len(tops):
        raise Refusal(f"no peak of dQ/dV stands out at a smoothing of {1e3 * sigma_volt:g} mV")
    # Each peak reaches from valley to valley, and the outer ones to the ends of the curve.
    valleys = [a + int(height[a:b].argmin()) for a, b in pairwise(tops)]
    edges = [0, *valleys, len(height) - 1]
    return [
        _peak(voltage_volt, height, wide, top, lower, upper, sigma_volt)
        for top, (lower, upper) in zip(tops, pairwise(edges), strict=True)
    ]


def _peak(voltage, height, wide, top, lower, upper, sigma):
    """Peak at a row, its place by a parabola, its area between its valleys."""
    step = voltage[1] - voltage[0]
    bend = height[top - 1] - 2 * height[top] + height[top + 1]
    shift = 0.5 * (height[top - 1] - height[top + 1]) / bend if bend else 0.0
    reach = max(int(2 * sigma / step), 1)
    near = slice(max(top - reach, 0), top + reach + 1)
    # A place that moves when smoothed more hangs on the smoothing.
    moved = voltage[near][int(np.argmax(wide[near]))] - voltage[top]
    inside = height[lower : upper + 1]
    # Where a curve begins and ends polarisation sets, not the cell: five widths open at either end.
    left, right = 5 if lower == 0 else 1, 5 if upper == len(height) - 1 else 1
    return Peak(
        float(voltage[top] + shift * step),
        float(np.hypot(0.5 * moved, step / np.sqrt(12))),
        float(height[top]),
        float(np.sum((inside[1:] + inside[:-1]) / 2) * step),
        float(height[lower] * sigma * left),
        float(height[upper] * sigma * right),
        bool(max(height[lower], height[upper]) < 0.8 * height[top]),
    )


class Charge(NamedTuple):
    """One slow charge: its test, temperature [°C], rate [1/h] and curve, (n,) [V], [A h/V]."""

    test: str
    temperature_celsius: float
    c_rate: float
    voltage_volt: np.ndarray
    dq_dv_ampere_hour_per_volt: np.ndarray


def ica_over_temperature(charges):
    """Peaks of incremental capacity of one cell, matched across temperatures.

    charges : `health.peaks.over_temperature.Charge` each, or (test, result of `ica`).

    Returns rows: the matches; peaks, curves. Raises Refusal: fewer than two temperatures.
    Source: docs/charge-temperature.md.
    """

    def charge_of(charge):
        if isinstance(charge, Charge):
            return charge
        test, ica = inputs.test_facts(charge[0]), charge[1]
        curve = ica.curve.voltage_volt, ica.curve.dq_dv_ampere_hour_per_volt
        return Charge(test.test, test.ambient_temperature_celsius, ica.c_rate, *curve)

    rows, peaks, curves, notes = peaks_over_temperature(list(map(charge_of, charges)))
    tables = {"rows": rows, "peaks": peaks, "curves": curves}
    return Result(tables, notes=tuple(notes))


def peaks_over_temperature(
    charges,
    *,
    reference_celsius=REFERENCE_CELSIUS,
    sigma_volt=SIGMA_VOLT,
):
    """Peaks of slow charges at several temperatures, matched with those at the reference.

    Parameters
    ----------
    charges : list of Charge, all of one age. reference_celsius : wanted; the nearest is taken.
    sigma_volt : as for `scaled_peaks`.

    Returns
    -------
    matches, peaks : lists of dict. curves : dict of columns, at the common smoothing.
    notes : list of sentences. Charges at another rate than the reference's (by more than 11.8 %)
        are left out: peaks move with the rate as well.

    Raises
    ------
    Refusal : fewer than two temperatures with charges of one rate.
    """
    reference = min(charges, key=lambda charge: abs(charge.temperature_celsius - reference_celsius))
    by_warmth = sorted(charges, key=lambda charge: -charge.temperature_celsius)
    comparable = [charge for charge in by_warmth if same_rate(charge.c_rate, reference.c_rate)]
    notes = [
        f"{charge.test} was left out: it is at {charge.c_rate:.3g}C, the reference "
        f"{reference.test} at {reference.c_rate:.3g}C"
        for charge in by_warmth
        if not same_rate(charge.c_rate, reference.c_rate)
    ]
    if len({charge.temperature_celsius for charge in comparable}) < 2:
        raise Refusal("charges of one rate are known at one temperature only")
    found = {
        charge.test: scaled_peaks(
            charge.voltage_volt, charge.dq_dv_ampere_hour_per_volt, sigma_volt=sigma_volt
        )
        for charge in comparable
    }
    matches, peaks = [], []
    for charge in comparable:
        own = found[charge.test]
        about = {"test": charge.test, "temperature_celsius": charge.temperature_celsius}
        peaks += [about | {"peak": k} | peak._asdict() for k, peak in enumerate(own, 1)]
        if not all(peak.clear for peak in own):
            notes.append(said_of(charge.test, "not all peaks stand clear of their valleys"))
        if charge.test != reference.test:
            end_volt = charge.voltage_volt[-1] - sigma_volt
            about["reference_celsius"] = reference.temperature_celsius
            rows = match_peaks(found[reference.test], own, end_volt=end_volt)
            matches += [about | row for row in rows]
    return matches, peaks, _curves(comparable, sigma_volt), notes


def _curves(charges, sigma):
    """Columns of all smoothed curves, one below the other."""
    parts = [
        (
            np.full(len(charge.voltage_volt), charge.temperature_celsius),
            charge.voltage_volt,
            smoothed(charge.voltage_volt, charge.dq_dv_ampere_hour_per_volt, sigma_volt=sigma),
        )
        for charge in charges
    ]
    names = ("temperature_celsius", "voltage_volt", "dq_dv_ampere_hour_per_volt")
    return dict(zip(names, (np.concatenate(p) for p in zip(*parts, strict=True)), strict=True))
