"""What peaks of dQ/dV say about a capacity: numbers that can be compared from charge to charge."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

# ASSUME: A window that begins or ends this much inside that of the calibration cuts the area of the
# peak next to it.
PARTIAL_VOLT = 0.02


class IdentifiedPeak(NamedTuple):
    """A peak of known identity in one charge [V], [A h/V], [A h]; area NaN where it is cut."""

    voltage_volt: float
    height_ampere_hour_per_volt: float
    area_ampere_hour: float


class PeakCharge(NamedTuple):
    """One constant-current charge: its peaks by identity, and its capacity where that is known.

    cycle : of the check-up. c_rate [1/h], temperature_celsius (NaN where not stated).
    capacity_ampere_hour : of the same check-up, measured; NaN where nobody measured it.
    peaks : dict of IdentifiedPeak by identity, in order of voltage.
    voltage_volt, dq_dv_ampere_hour_per_volt : (n,) the curve, for the charge between two peaks;
    empty where there is none.
    """

    cell: str
    test: str
    cycle: float
    c_rate: float
    temperature_celsius: float
    capacity_ampere_hour: float
    peaks: dict
    voltage_volt: np.ndarray = np.empty(0)
    dq_dv_ampere_hour_per_volt: np.ndarray = np.empty(0)


class Features(NamedTuple):
    """Features of several charges: names as (kind, identity, …), and values (n, k), NaN: none."""

    names: list
    values: np.ndarray

    def of_peaks(self, wanted):
        """The features that need no other peaks than these."""
        inside = [set(name[1:]) <= set(wanted) for name in self.names]
        names = [name for name, keep in zip(self.names, inside, strict=True) if keep]
        return Features(names, self.values[:, inside])


def features_of(charges):
    """Positions, heights, areas of peaks, distances and charge between two of them.

    Heights, areas and charges are taken as logarithms, as is the capacity that they shall tell:
    a cell of the type that is larger by one per cent has all of them larger by one per cent. An
    area reaches from valley to valley, so that it is compared only where the neighbours of its
    peak are the same ones: their identities are in its name too. Of each height the squared
    distance from the middle of all is a feature as well, since a life bends.

    Parameters
    ----------
    charges : list of PeakCharge.

    Returns
    -------
    features : Features; NaN where a charge lacks a peak, or its window cuts an area.

    Raises
    ------
    Refusal : no charge has a peak.
    """
    low, high = _usual_window(charges)
    rows = [_of_charge(charge, low, high) for charge in charges]
    names = list(dict.fromkeys(name for row in rows for name in row))
    if not names:
        raise Refusal(f"none of {len(charges)} charge(s) has a peak")
    values = np.array([[row.get(name, np.nan) for name in names] for row in rows], float)
    return _with_bends(Features(names, values))


def _with_bends(features):
    """Features and, of each height, the squared distance from its middle: a curved relation."""
    bent = [k for k, name in enumerate(features.names) if name[0] == "height"]
    around = features.values[:, bent] - np.nanmedian(features.values[:, bent], axis=0)
    names = [("bend", features.names[k][1]) for k in bent]
    return Features([*features.names, *names], np.hstack([features.values, around**2]))


def _usual_window(charges):
    """Voltages between which the charges usually have dQ/dV [V]; infinite where no curve is."""
    ends = [(c.voltage_volt[0], c.voltage_volt[-1]) for c in charges if len(c.voltage_volt)]
    return np.median(ends, axis=0) if ends else (np.inf, -np.inf)


def _of_charge(charge, low, high):
    """Features of one charge by name."""
    found, names = {}, list(charge.peaks)
    for place, (identity, peak) in enumerate(charge.peaks.items()):
        found["position", identity] = peak.voltage_volt
        found["height", identity] = _log(peak.height_ampere_hour_per_volt)
        if not _is_cut(charge, identity, low, high):
            beside = [*names[max(place - 1, 0) : place], *names[place + 1 : place + 2]]
            found["area", identity, *beside] = _log(peak.area_ampere_hour)
    charge_at = _counted(charge)
    for first, second in combinations(charge.peaks, 2):
        ends = [charge.peaks[name].voltage_volt for name in (first, second)]
        found["distance", first, second] = ends[1] - ends[0]
        if charge_at is not None:
            found["charge", first, second] = _log(charge_at(ends[1]) - charge_at(ends[0]))
    return found


def _log(value):
    return np.log(value) if value > 0 else np.nan


def _is_cut(charge, identity, low, high):
    """Whether the window of a partial charge cuts the area of its outermost peak."""
    if not len(charge.voltage_volt):
        return False
    names = list(charge.peaks)
    begins_late = charge.voltage_volt[0] > low + PARTIAL_VOLT and identity == names[0]
    ends_early = charge.voltage_volt[-1] < high - PARTIAL_VOLT and identity == names[-1]
    return begins_late or ends_early


def _counted(charge):
    """Charge up to a voltage [A h], as a function, from the integral of dQ/dV."""
    volt, slope = charge.voltage_volt, charge.dq_dv_ampere_hour_per_volt
    if len(volt) < 2:
        return None
    counted = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(volt))])
    return lambda at: np.interp(at, volt, counted)
