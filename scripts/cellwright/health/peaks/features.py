"""What peaks of dQ/dV say about a capacity: numbers that can be compared from charge to charge."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from cellwright.records.conditions import same_rate, same_temperature
from cellwright.refusal import Refusal

# ASSUME: A window that begins or ends this much inside that of the calibration cuts the area of the
# peak next to it.
PARTIAL_VOLT = 0.02


def made_alike(first, second):
    """Whether two charges were made at one rate and temperature: others move the peaks."""
    as_warm = same_temperature(first.temperature_celsius, second.temperature_celsius)
    return same_rate(first.c_rate, second.c_rate) and as_warm


class IdentifiedPeak(NamedTuple):
    """A peak of known identity in one charge [V], [A h/V], [A h], each with its standard deviation.

    Area NaN where it is cut; a standard deviation 0 where the method of dQ/dV tells none.
    """

    voltage_volt: float
    height_ampere_hour_per_volt: float
    area_ampere_hour: float
    voltage_std_volt: float = 0.0
    height_std_ampere_hour_per_volt: float = 0.0
    area_std_ampere_hour: float = 0.0


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
    """Features of several charges: names as (kind, identity, …), and values (n, k), NaN: none.

    std : (n, k) of the values, from those of the peaks.
    """

    names: list
    values: np.ndarray
    std: np.ndarray


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
    unknown = np.nan, np.nan
    found = np.array([[row.get(name, unknown) for name in names] for row in rows], float)
    values, std = found[..., 0], found[..., 1]
    bent = [k for k, name in enumerate(names) if name[0] == "height"]
    around = values[:, bent] - np.nanmedian(values[:, bent], axis=0)
    return Features(
        [*names, *(("bend", names[k][1]) for k in bent)],
        np.hstack([values, around**2]),
        np.hstack([std, 2 * np.abs(around) * std[:, bent]]),
    )


def _usual_window(charges):
    """Voltages between which the charges usually have dQ/dV [V]; infinite where no curve is."""
    ends = [(c.voltage_volt[0], c.voltage_volt[-1]) for c in charges if len(c.voltage_volt)]
    return np.median(ends, axis=0) if ends else (np.inf, -np.inf)


def is_partial(charge, others):
    """Whether the window of a PeakCharge begins or ends 20 mV inside the usual one of others."""
    low, high = _usual_window([charge, *others])
    volt = charge.voltage_volt
    return len(volt) > 0 and (volt[0] > low + PARTIAL_VOLT or volt[-1] < high - PARTIAL_VOLT)


def _of_charge(charge, low, high):
    """Features of one charge by name, each with its standard deviation."""
    found, names = {}, list(charge.peaks)
    for place, (identity, peak) in enumerate(charge.peaks.items()):
        found["position", identity] = peak.voltage_volt, peak.voltage_std_volt
        height = peak.height_ampere_hour_per_volt, peak.height_std_ampere_hour_per_volt
        found["height", identity] = _log(*height)
        if not _is_cut(charge, identity, low, high):
            beside = [*names[max(place - 1, 0) : place], *names[place + 1 : place + 2]]
            area = _log(peak.area_ampere_hour, peak.area_std_ampere_hour)
            found["area", identity, *beside] = area
    # What lies between two peaks does not hang on where valleys are drawn.
    charge_at = _counted(charge)
    for first, second in combinations(charge.peaks, 2):
        pair = charge.peaks[first], charge.peaks[second]
        ends, spread = (np.array([one[k] for one in pair]) for k in (0, 3))
        found["distance", first, second] = ends[1] - ends[0], np.hypot(*spread)
        if charge_at is not None:
            moved = np.hypot(*(spread * [one.height_ampere_hour_per_volt for one in pair]))
            found["charge", first, second] = _log(charge_at(ends[1]) - charge_at(ends[0]), moved)
    return found


def _log(value, std):
    """Logarithm of a value, and its standard deviation."""
    return (np.log(value), std / value) if value > 0 else (np.nan, np.nan)


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
