"""Peaks of dQ/dV calibrated over the cells of one type, and the state of health that they tell."""

from typing import NamedTuple

import numpy as np

from cellwright.health.peaks.alike import named_alike
from cellwright.health.peaks.estimate import (
    MOST_TERMS,
    disagreeing,
    errors_of,
    left_out_estimates,
)
from cellwright.health.peaks.features import IdentifiedPeak, PeakCharge
from cellwright.health.table import DISAGREE
from cellwright.records.conditions import same_rate, same_temperature
from cellwright.refusal import Refusal

MOST_COMPARED = 60  # charges that errors with and without a peak are computed from
NEEDED = 1.25  # times the error without a peak, from which on it is said to hold information


class PeakHealth(NamedTuple):
    """What the peaks of one charge tell of its cell's health.

    capacity_ampere_hour, std, lower, upper : estimated without the capacity of this check-up
    [Ah], with the 95 % interval. soh, soh_std : over `fresh_ampere_hour`, which `soh_of` names.
    measured_ampere_hour : of the check-up, NaN where nobody measured it. left_out_error : of the
    estimate, as a share of the fresh capacity; left_out_cell_error : the same without the whole
    cell. peaks_used : identities, joined by ";". charges, cells : calibrated on.
    """

    cell: str
    test: str
    cycle: float
    c_rate: float
    ambient_temperature_celsius: float
    capacity_ampere_hour: float
    capacity_std_ampere_hour: float
    capacity_lower_ampere_hour: float
    capacity_upper_ampere_hour: float
    soh: float
    soh_std: float
    soh_of: str
    fresh_ampere_hour: float
    measured_ampere_hour: float
    left_out_error: float
    left_out_cell_error: float
    peaks_used: str
    charges: int
    cells: int
    reason: str


class PeakInformation(NamedTuple):
    """How much of the capacity one peak tells at one rate and temperature.

    weight : mean share of the models' weight that needs the peak [1]. rms_all, rms_alone,
    rms_without : error of left-out check-ups with all peaks, with this one only, and with all
    others, as shares of the fresh capacity [1]; NaN where too few charges remain.
    charges : of known capacity that have the peak.
    """

    c_rate: float
    ambient_temperature_celsius: float
    identity: str
    weight: float
    rms_all: float
    rms_alone: float
    rms_without: float
    charges: int


class PeakCalibration(NamedTuple):
    """Health of every charge of the type, information of every peak, and notes."""

    rows: list
    information: list
    notes: list


def peak_charges(peak_rows, capacity_rows, curves):
    """Charges with their peaks by identity and the capacity of their check-up.

    The capacity of a charge in an ageing record is that of the discharge of its cycle in the
    record. Else it is that of the complete discharges of its check-up, of the rate at which most
    check-ups of the type have one (the slowest of those), at the temperature of the charge.

    Parameters
    ----------
    peak_rows : dicts with cell, test, cycle, ambient_temperature_celsius, c_rate, voltage_volt,
        height_ampere_hour_per_volt, area_ampere_hour and, where peaks were tracked, identity.
    capacity_rows : dicts with cell, test, cycle, ambient_temperature_celsius, direction, c_rate,
        capacity_ampere_hour; of_a_life, true for discharges of an ageing record.
    curves : dict of (voltage_volt, dq_dv) by (cell, test, cycle).

    Returns
    -------
    list of PeakCharge, by cell and cycle. Without identity the peaks are numbered from low
    voltage, charge by charge.
    """
    discharges = [row for row in capacity_rows if row["direction"] == "discharge"]
    grouped = {}
    for row in peak_rows:
        grouped.setdefault((row["cell"], row["test"], _number(row["cycle"], 0.0)), []).append(row)
    by_cycle = {}
    for row in discharges:
        key = row["cell"], row.get("test", ""), _number(row["cycle"], 0.0)
        by_cycle.setdefault(key, []).append(row["capacity_ampere_hour"])
    usual = _usual_rate([row for row in discharges if not row.get("of_a_life")])
    charges = []
    for key, rows in grouped.items():
        cell, test, cycle = key
        celsius = _number(rows[0]["ambient_temperature_celsius"])
        own = by_cycle.get(key)
        size = np.mean(own) if own else _capacity(discharges, cell, cycle, celsius, usual)
        curve = curves.get(key, (np.empty(0), np.empty(0)))
        rate = _number(rows[0]["c_rate"])
        charges.append(
            PeakCharge(cell, test, cycle, rate, celsius, float(size), _peaks(rows), *curve)
        )
    return sorted(charges, key=lambda charge: (charge.cell, charge.cycle, charge.c_rate))


def _number(value, otherwise=np.nan):
    return otherwise if value is None or np.isnan(value) else float(value)


def _peaks(rows):
    """Peaks of one charge by identity, in order of voltage; none of rows without a voltage."""
    found = [row for row in rows if row["voltage_volt"] is not None]
    found = sorted(
        (row for row in found if np.isfinite(row["voltage_volt"])),
        key=lambda row: row["voltage_volt"],
    )
    return {
        str(row.get("identity") or place): IdentifiedPeak(
            *(float(row[name]) for name in IdentifiedPeak._fields[:3]),
            *(_number(row.get(name), 0.0) for name in IdentifiedPeak._fields[3:]),
        )
        for place, row in enumerate(found, 1)
    }


def _usual_rate(discharges):
    """Rate at which most check-ups have a discharge, the slowest of those [1/h]; NaN: none."""
    best = (0, np.nan)
    for rate in sorted({row["c_rate"] for row in discharges}, reverse=True):
        near = [row for row in discharges if same_rate(row["c_rate"], rate)]
        check_ups = len({(row["cell"], _number(row["cycle"], 0.0)) for row in near})
        best = max(best, (check_ups, rate), key=lambda one: (one[0], -one[1]))
    return best[1]


def _capacity(discharges, cell, cycle, celsius, usual):
    """Mean capacity of the discharges of a check-up at the usual rate [Ah]; NaN where none is."""
    sizes = [
        row["capacity_ampere_hour"]
        for row in discharges
        if row["cell"] == cell
        and not row.get("of_a_life")
        and _number(row["cycle"], 0.0) == cycle
        and same_rate(row["c_rate"], usual)
        and same_temperature(row["ambient_temperature_celsius"], celsius)
    ]
    return float(np.mean(sizes)) if sizes else np.nan


def peak_calibration(charges, *, rated_ampere_hour=None, tracked=(), most_terms=MOST_TERMS):
    """State of health of every charge of one type from its peaks, and which peaks tell it.

    Charges are told apart by rate and temperature. Capacities are estimated without
    the check-up's own capacity (`left_out_estimates`), so that the errors are those at a check-up,
    and at a cell, that the calibration has not seen.

    Parameters
    ----------
    charges : list of PeakCharge of cells of one type.
    rated_ampere_hour : rating of the type [Ah], None: not known.
    tracked : cells in which an identity is one peak through the life (`named_alike`).
    most_terms : as for `capacity_from_peaks`.

    Returns
    -------
    calibration : PeakCalibration.

    Raises
    ------
    Refusal : at no rate and temperature are there four charges of known capacity.
    """
    rows, information, notes, refused = [], [], [], []
    for alike in _conditions(charges):
        named = named_alike(alike, tracked)
        try:
            found, wrong = _estimated(named, most_terms)
        except Refusal as error:
            refused.append(f"{_where(alike)}: {error}")
            continue
        fresh = {cell: _fresh(cell, named, rated_ampere_hour) for cell in {c.cell for c in named}}
        rows += [_health(one, *fresh[one.charge.cell], wrong) for one in found]
        told = _information(named, found, fresh, most_terms, wrong)
        information += told
        notes.append(_sentence(_where(alike), told, found, fresh, wrong))
    if not rows:
        raise Refusal("; ".join(refused) or "no charge has a peak of dQ/dV")
    return PeakCalibration(rows, information, [*notes, *refused])


def _estimated(charges, most_terms):
    """Estimates of charges, and check-ups that were not calibrated on: see `disagreeing`."""
    found = left_out_estimates(charges, most_terms=most_terms)
    wrong = disagreeing(found)
    if wrong:
        found = left_out_estimates(charges, most_terms=most_terms, distrusted=wrong)
    return found, wrong


def _conditions(charges):
    """Charges in lists of one rate and temperature each."""
    lists = []
    for charge in charges:
        alike = next((one for one in lists if _alike(one[0], charge)), None)
        if alike is None:
            lists.append([charge])
        else:
            alike.append(charge)
    return lists


def _alike(first, second):
    as_warm = same_temperature(first.temperature_celsius, second.temperature_celsius)
    return same_rate(first.c_rate, second.c_rate) and as_warm


def _where(charges):
    celsius = charges[0].temperature_celsius
    at = f" and {celsius:g} °C" if np.isfinite(celsius) else ""
    return f"charges at {charges[0].c_rate:.2g}C{at}"


def _fresh(cell, charges, rated):
    """Capacity that SoH refers to [Ah], and its name: the first check-up's, else the rating."""
    known = sorted(
        (charge.cycle, charge.capacity_ampere_hour)
        for charge in charges
        if charge.cell == cell and charge.capacity_ampere_hour > 0
    )
    if len({cycle for cycle, _ in known}) > 1:
        return known[0][1], f"first check-up, cycle {known[0][0]:g}"
    return (rated, "rating") if rated else (np.nan, "not known: one check-up and no rating")


def _health(left_out, fresh, soh_of, wrong):
    """Row of one charge."""
    charge, found, other = left_out
    error, reasons = wrong.get((charge.cell, charge.cycle)), [found.reason]
    if error is not None:
        reasons.append(
            f"{DISAGREE} by {100 * error:.2g} %: one of them is wrong, it was not calibrated on"
        )
    measured = charge.capacity_ampere_hour
    return PeakHealth(
        charge.cell,
        charge.test,
        charge.cycle,
        charge.c_rate,
        charge.temperature_celsius,
        found.capacity_ampere_hour,
        found.std_ampere_hour,
        found.lower_ampere_hour,
        found.upper_ampere_hour,
        found.capacity_ampere_hour / fresh,
        found.std_ampere_hour / fresh,
        soh_of,
        fresh,
        measured,
        (found.capacity_ampere_hour - measured) / fresh,
        (other.capacity_ampere_hour - measured) / fresh,
        ";".join(found.peaks_used),
        found.charges,
        found.cells,
        "; ".join(filter(None, reasons)),
    )


def _information(charges, found, fresh, most_terms, wrong):
    """What each peak tells, from the models' weights, and from errors with and without it."""
    known = [one for one in _trusted(found, wrong) if one.charge.capacity_ampere_hour > 0]
    told = [one.without_check_up for one in known if one.without_check_up.peaks]
    names = dict.fromkeys(name for charge in charges for name in charge.peaks)
    sizes = {cell: size for cell, (size, _) in fresh.items()}
    estimates = [one.without_check_up for one in known]
    whole = errors_of(estimates, [o.charge for o in known], fresh_ampere_hour=sizes)
    return [
        PeakInformation(
            charges[0].c_rate,
            charges[0].temperature_celsius,
            name,
            float(np.mean([one.peaks.get(name, 0.0) for one in told])) if told else np.nan,
            whole.rms,
            _error_with(charges, {name}, sizes, most_terms, wrong),
            _error_with(charges, {*names} - {name}, sizes, most_terms, wrong),
            sum(name in one.charge.peaks for one in known),
        )
        for name in sorted(names)
    ]


def _trusted(found, wrong):
    return [one for one in found if (one.charge.cell, one.charge.cycle) not in wrong]


def _error_with(charges, kept, sizes, most_terms, wrong):
    """RMS error of left-out check-ups where only some peaks are looked at [1]."""
    places = np.unique(np.linspace(0, len(charges) - 1, MOST_COMPARED).round().astype(int))
    fewer = [
        charge._replace(peaks={name: p for name, p in charge.peaks.items() if name in kept})
        for charge in [charges[place] for place in places]
    ]
    fewer = [one for one in fewer if one.peaks and (one.cell, one.cycle) not in wrong]
    try:
        found = left_out_estimates(fewer, most_terms=most_terms, cells=False, distrusted=wrong)
    except Refusal:
        return np.nan
    estimates = [one.without_check_up for one in found]
    return errors_of(estimates, fewer, fresh_ampere_hour=sizes).rms


def _sentence(where, information, found, fresh, wrong):
    """What the calibration reached, and which peaks tell it, for the report."""
    found = _trusted(found, wrong)
    sizes = {cell: size for cell, (size, _) in fresh.items()}
    charges = [one.charge for one in found]
    by_test, by_cell = (
        errors_of([getattr(one, name) for one in found], charges, fresh_ampere_hour=sizes)
        for name in ("without_check_up", "without_cell")
    )
    needed = [one for one in information if one.rms_without > NEEDED * one.rms_all]
    words = [
        f"{one.identity} ({100 * one.rms_without:.2g} % without it)"
        for one in sorted(needed, key=lambda one: -one.rms_without)
    ]
    peaks = ", ".join(words) or "no single one"
    cells = f"{100 * by_cell.rms:.2g} % at a cell never seen" if by_cell.count else "one cell only"
    apart = [
        f"{cell} at cycle {cycle:g} ({100 * error:.2g} %)" for (cell, cycle), error in wrong.items()
    ]
    left = f"; not calibrated on, since capacity and peaks disagree: {', '.join(apart)}"
    return (
        f"Capacity from peaks, {where}: {100 * by_test.rms:.2g} % RMS at {by_test.count} left-out "
        f"check-ups, {cells}; the information is in peak {peaks}{left if apart else ''}"
    )
