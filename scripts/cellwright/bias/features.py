"""What a cell shows without pulses, and how that differs from the reference cell of its type."""

from statistics import median
from typing import NamedTuple

import numpy as np

from cellwright.bias.courses import full_ohm
from cellwright.health.peaks.alike import matched
from cellwright.records.basis import same_condition
from cellwright.records.conditions import same_rate
from cellwright.refusal import Refusal

FULL_SOC, EMPTY_SOC = 0.95, 0.1  # where a load begins that tells of the ends
SHARES = np.round(np.arange(0.05, 0.951, 0.05), 2)  # of the capacity, where charges are compared


class Shown(NamedTuple):
    """Measurements of a cell that a borrowed model uses, and its own model where it has one.

    marked : whether it is marked as a reference. model : dict or None.
    peaks : list of dict, rows of stage `ica`. onset_ohm : resistance at the onset of its discharges
    from full, delay [s] → [ohm]; begin_ohm : the same of its charges from empty; empty where none
    was measured. capacities : list of dict, rows of stage `capacity` with their temperature.
    charges : list of dict, curves of stage `ica_curve`: c_rate, voltage_volt (n,) [V],
    charge_ampere_hour (n,) [Ah]. capacity_std_ampere_hour : of the capacity, None: not known.
    """

    cell: str
    marked: bool
    capacity_ampere_hour: float
    model: dict | None
    peaks: list
    onset_ohm: dict
    begin_ohm: dict = {}  # noqa: RUF012
    capacities: tuple = ()
    charges: tuple = ()
    capacity_std_ampere_hour: float | None = None


def onset_resistances(rows, direction):
    """Median resistance at the onset of discharges from full, or of charges from empty.

    Parameters
    ----------
    rows : list of dict, of stage `onset`. direction : "discharge" or "charge".

    Returns
    -------
    resistance : dict, delay [s] → [ohm].
    """
    by_delay = {}
    for row in rows:
        begins = row["soc"] > FULL_SOC if direction == "discharge" else row["soc"] < EMPTY_SOC
        if row["direction"] == direction and begins:
            by_delay.setdefault(row["delay_second"], []).append(row["resistance_ohm"])
    return {delay: median(values) for delay, values in by_delay.items()}


def differences(reference, cell):
    """Differences of a cell from the reference of its type, by name; only what both show.

    Capacity; resistance at the onset of discharges from full and of charges from empty; of the
    capacity test the gap between the mean voltages of charge and discharge, the share of the charge
    that is taken at the held voltage, and the warming; place and height of each peak of dQ/dV, the
    same peak in both cells; the course of the charge.

    Parameters
    ----------
    reference, cell : Shown.

    Returns
    -------
    scalars : dict, what tells of resistance and of size, by name: logarithms of ratios [1], shifts
        [V]. course : dict, voltage of its charge minus the reference's at shares of the capacity,
        and of the mean of its discharge, by name [V].
    """
    size = np.log(cell.capacity_ampere_hour / reference.capacity_ampere_hour)
    scalars = {"capacity": float(size)}
    scalars |= _log_ratios(reference.onset_ohm, cell.onset_ohm, "onset of discharge at {:g} s")
    scalars |= _log_ratios(reference.begin_ohm, cell.begin_ohm, "onset of charge at {:g} s")
    of_capacity, of_discharge = _of_capacity_tests(reference, cell)
    scalars |= of_capacity | _of_peaks(reference, cell)
    shares, shift = charge_shift(reference, cell)
    named = zip(shares, shift.tolist(), strict=True)
    of_charge = {f"voltage of the charge at {100 * share:.0f} %": volt for share, volt in named}
    course = of_discharge | of_charge
    return tuple({n: v for n, v in part.items() if np.isfinite(v)} for part in (scalars, course))


def resistance_ratio(reference, cell):
    """Ratio of the onset resistances at the longest common delay [1], 1 without any; its source.

    A reference whose onset was not measured has the response of its model at full.

    Parameters
    ----------
    reference, cell : Shown.

    Returns
    -------
    ratio : [1]. words : sentence for the notes.
    """
    ours, of_model = reference.onset_ohm, ""
    if not set(cell.onset_ohm) & set(ours) and reference.model:
        late = [delay for delay in cell.onset_ohm if delay >= 1.0]
        ours = {delay: full_ohm(reference.model, delay) for delay in late}
        of_model = ", against the response of the reference's model"
    both = set(cell.onset_ohm) & set(ours)
    common = [delay for delay in both if min(cell.onset_ohm[delay], ours[delay]) > 0]
    if not common:
        found = f"; found {min(cell.onset_ohm.values()):.3g} ohm at an onset" if both else ""
        return 1.0, f"its resistance is not known: taken as the reference's{found}"
    delay = max(common)
    words = f"resistance by the onset of its discharges from full ({delay:g} s{of_model})"
    return cell.onset_ohm[delay] / ours[delay], words


def peak_pairs(reference, cell):
    """Rows of the same peak of dQ/dV in two cells, of charges at one rate.

    Parameters
    ----------
    reference, cell : Shown.

    Returns
    -------
    pairs : list of (number of the reference's peak from low voltage, its row, the cell's row).

    Raises
    ------
    Refusal : no charges at one rate, or no peak is the same.
    """
    ours, theirs = _at_one_rate(reference.peaks, cell.peaks)
    if not theirs:
        raise Refusal(f"{cell.cell} and {reference.cell} have no IC peaks at the same rate")
    rows = [sorted(part, key=lambda row: row["voltage_volt"]) for part in (ours, theirs)]
    places = [
        [(row["voltage_volt"], np.log(row["height_ampere_hour_per_volt"])) for row in part]
        for part in rows
    ]
    pairs = matched(*places)[0]
    if not pairs:
        raise Refusal(f"no IC peak of {cell.cell} is one of {reference.cell}")
    return [(i + 1, rows[0][i], rows[1][j]) for i, j in pairs]


def charge_pair(reference, cell):
    """The charges of two cells at one rate, or None; dicts as in `Shown`.

    Parameters
    ----------
    reference, cell : Shown.
    """
    ours, theirs = _at_one_rate(reference.charges, cell.charges)
    return (ours[0], theirs[0]) if theirs else None


def charge_shift(reference, cell):
    """Voltage of a charge minus the reference's at the same share of the capacity of each [V].

    Parameters
    ----------
    reference, cell : Shown.

    Returns
    -------
    shares : (m,) of `SHARES`, which both charges reach. shift_volt : (m,) [V]; both empty without
        charges at one rate.
    """
    pair = charge_pair(reference, cell)
    if pair is None:
        return np.empty(0), np.empty(0)
    volts = []
    for charge, owner in zip(pair, (reference, cell), strict=True):
        share = np.asarray(charge["charge_ampere_hour"]) / owner.capacity_ampere_hour
        volts.append(np.interp(SHARES, share, charge["voltage_volt"], left=np.nan, right=np.nan))
    reached = np.isfinite(volts[0]) & np.isfinite(volts[1])
    return SHARES[reached], (volts[1] - volts[0])[reached]


def _at_one_rate(ours, theirs):
    """Rows of both at the slowest rate of the first that the second has too."""
    for rate in sorted({row["c_rate"] for row in ours}):
        alike = [row for row in theirs if same_rate(row["c_rate"], rate)]
        if alike:
            return [row for row in ours if row["c_rate"] == rate], alike
    return [], []


def _log_ratios(reference, cell, name):
    common = sorted(set(reference) & set(cell))
    return {
        name.format(delay): float(np.log(cell[delay] / reference[delay]))
        for delay in common
        if cell[delay] > 0 and reference[delay] > 0
    }


def _of_peaks(reference, cell):
    try:
        pairs = peak_pairs(reference, cell)
    except Refusal:
        return {}
    found = {}
    for number, ours, theirs in pairs:
        found[f"place of peak {number}"] = theirs["voltage_volt"] - ours["voltage_volt"]
        heights = [row["height_ampere_hour_per_volt"] for row in (theirs, ours)]
        found[f"height of peak {number}"] = float(np.log(heights[0] / heights[1]))
    return found


def same_cycles(reference, cell):
    """Rows of charge and of discharge of two cells under one condition, youngest and slowest first.

    Parameters
    ----------
    reference, cell : Shown.

    Returns
    -------
    pairs : dict, direction → (the reference's row, the cell's); without those none share.
    """
    found = {}
    for ours in sorted(reference.capacities, key=_young_and_slow):
        alike = [row for row in cell.capacities if same_condition(ours, row)]
        if alike and ours["direction"] not in found:
            found[ours["direction"]] = (ours, min(alike, key=_young_and_slow))
    return found


def _young_and_slow(row):
    return row["cycle"] or 0, row["c_rate"]


def _of_capacity_tests(reference, cell):
    """Differences in capacity tests of one condition: scalars, and the mean discharge voltage."""
    pairs = same_cycles(reference, cell)
    if "discharge" not in pairs:
        return {}, {}
    ours, theirs = pairs["discharge"]
    course = {"mean voltage of the discharge": _mean_volt(theirs) - _mean_volt(ours)}
    warming = [
        _number(row["temperature_mean_celsius"]) - _number(row["ambient_temperature_celsius"])
        for row in (theirs, ours)
    ]
    scalars = {"warming in the discharge": warming[0] - warming[1]}
    if "charge" not in pairs:
        return scalars, course
    ours_charged, theirs_charged = pairs["charge"]
    gaps = [
        _mean_volt(charged) - _mean_volt(discharged)
        for charged, discharged in ((theirs_charged, theirs), (ours_charged, ours))
    ]
    if min(gaps) > 0:
        scalars["gap of charge and discharge"] = float(np.log(gaps[0] / gaps[1]))
    held = [
        1 - _number(row["constant_current_ampere_hour"]) / row["capacity_ampere_hour"]
        for row in (theirs_charged, ours_charged)
    ]
    return scalars | {"share charged at the held voltage": held[0] - held[1]}, course


def _mean_volt(row):
    return _number(row["energy_watt_hour"]) / row["capacity_ampere_hour"]


def _number(value):
    return np.nan if value is None else float(value)
