"""Peaks of dQ/dV calibrated over the cells of one type, and the state of health that they tell."""

import numpy as np

from cellwright.health.peaks.alike import named_alike
from cellwright.health.peaks.estimate import MOST_TERMS, disagreeing, left_out_estimates
from cellwright.health.peaks.features import IdentifiedPeak, PeakCharge, made_alike
from cellwright.health.table import DISAGREE
from cellwright.laws.points import grouped
from cellwright.messages import said_of
from cellwright.numerics.statistics import rms
from cellwright.records import inputs
from cellwright.records.conditions import grouped_alike, same_rate, same_temperature
from cellwright.refusal import Refusal
from cellwright.result import Result


def health_from_peaks(peaks, capacities, curves=None, *, rated_ampere_hour=None, tracked=()):
    """State of health of cells of one type from peaks of dQ/dV, calibrated on known capacities.

    peaks : rows of `ica_peaks` with cell, test, cycle and ambient_temperature_celsius, or of
        `ica_tracks` with cell.
    capacities : rows of `capacity` with cell, cycle and ambient_temperature_celsius; of
        `ageing_cycles` also test, and of_a_life, true.
    curves : mapping of the curve of `ica` (or its columns) by (cell, test, cycle); None: the
        charge between two peaks is not used.
    rated_ampere_hour : rating of the type [Ah], None: not known.
    tracked : cells in which an identity is one peak through the life.

    Returns one row a charge. Raises Refusal: fewer than four charges of known capacity at any rate
    and temperature. Source: docs/health.md.
    """
    names = ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    pairs = {key: inputs.quantities(curve, names) for key, curve in (curves or {}).items()}
    charges = peak_charges(inputs.rows(peaks), inputs.rows(capacities), pairs)
    rows, information, notes = peak_calibration(
        charges, rated_ampere_hour=rated_ampere_hour, tracked=tracked
    )
    return Result({"rows": rows, "information": information}, notes=tuple(notes))


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
    by_cycle = grouped(discharges, _key)
    at_check_ups = [row for row in discharges if not row.get("of_a_life")]
    usual = _usual_rate(at_check_ups)
    charges = []
    for key, rows in grouped(peak_rows, _key).items():
        cell, _, cycle = key
        celsius = _number(rows[0]["ambient_temperature_celsius"])
        sizes = by_cycle.get(key) or [
            row
            for row in at_check_ups
            if row["cell"] == cell
            and _number(row["cycle"], 0.0) == cycle
            and same_rate(row["c_rate"], usual)
            and same_temperature(row["ambient_temperature_celsius"], celsius)
        ]
        size = np.mean([row["capacity_ampere_hour"] for row in sizes]) if sizes else np.nan
        curve = curves.get(key, (np.empty(0), np.empty(0)))
        rate = _number(rows[0]["c_rate"])
        charges.append(PeakCharge(*key, rate, celsius, float(size), _peaks(rows), *curve))
    return sorted(charges, key=lambda charge: (charge.cell, charge.cycle, charge.c_rate))


def _number(value, otherwise=np.nan):
    return otherwise if value is None or np.isnan(value) else float(value)


def _key(row):
    return row["cell"], row.get("test", ""), _number(row["cycle"], 0.0)


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
    # Slowest wins: its capacity polarises least as the cell ages.
    best = (0, np.nan)
    for rate in sorted({row["c_rate"] for row in discharges}, reverse=True):
        near = [row for row in discharges if same_rate(row["c_rate"], rate)]
        check_ups = len({(row["cell"], _number(row["cycle"], 0.0)) for row in near})
        best = max(best, (check_ups, rate), key=lambda one: (one[0], -one[1]))
    return best[1]


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
    rows : list of dict, one a charge, as of stage `peak_calibration`.
    information : list of dict, what each peak tells at each rate and temperature.
    notes : list of sentences.

    Raises
    ------
    Refusal : at no rate and temperature are there four charges of known capacity.
    """
    rows, information, notes, refused = [], [], [], []
    for alike in grouped_alike(charges, made_alike):
        named = named_alike(alike, tracked)
        try:
            found, wrong = _estimated(named, most_terms)
        except Refusal as error:
            refused.append(said_of(_where(alike), error))
            continue
        fresh = {cell: _fresh(cell, named, rated_ampere_hour) for cell in {c.cell for c in named}}
        rows += [_health(one, *fresh[one.charge.cell], wrong) for one in found]
        trusted = [one for one in found if (one.charge.cell, one.charge.cycle) not in wrong]
        sizes = {cell: size for cell, (size, _) in fresh.items()}
        of_peaks = _information(named, trusted, sizes, most_terms, wrong)
        information += of_peaks
        notes.append(_sentence(_where(alike), of_peaks, trusted, sizes, wrong))
    if not rows:
        raise Refusal("; ".join(refused) or "no charge has a peak of dQ/dV")
    return rows, information, [*notes, *refused]


def _estimated(charges, most_terms):
    """Estimates of charges, and check-ups that were not calibrated on: see `disagreeing`."""
    found = left_out_estimates(charges, most_terms=most_terms)
    # Found once with all, then without what would bend its neighbours.
    wrong = disagreeing(found)
    if wrong:
        found = left_out_estimates(charges, most_terms=most_terms, distrusted=wrong)
    return found, wrong


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
    return {
        "cell": charge.cell,
        "test": charge.test,
        "cycle": charge.cycle,
        "c_rate": charge.c_rate,
        "ambient_temperature_celsius": charge.temperature_celsius,
        "capacity_ampere_hour": found.capacity_ampere_hour,
        "capacity_std_ampere_hour": found.std_ampere_hour,
        "capacity_lower_ampere_hour": found.lower_ampere_hour,
        "capacity_upper_ampere_hour": found.upper_ampere_hour,
        "soh": found.capacity_ampere_hour / fresh,
        "soh_std": found.std_ampere_hour / fresh,
        "soh_of": soh_of,
        "fresh_ampere_hour": fresh,
        "measured_ampere_hour": measured,
        "left_out_error": (found.capacity_ampere_hour - measured) / fresh,
        "left_out_cell_error": (other.capacity_ampere_hour - measured) / fresh,
        "peaks_used": ";".join(found.peaks_used),
        "charges": found.charges,
        "cells": found.cells,
        "reason": "; ".join(filter(None, reasons)),
    }


def _errors(found, sizes, without="without_check_up"):
    """Errors of left-out estimates (n,) [1] over the capacities of fresh cells, where known."""
    pairs = [(getattr(one, without), one.charge) for one in found]
    return [
        (estimate.capacity_ampere_hour - charge.capacity_ampere_hour) / sizes[charge.cell]
        for estimate, charge in pairs
        if charge.capacity_ampere_hour > 0 and np.isfinite(estimate.capacity_ampere_hour)
    ]


def _information(charges, found, sizes, most_terms, wrong):
    """What each peak tells, from the models' weights, and from errors with and without it."""
    known = [one for one in found if one.charge.capacity_ampere_hour > 0]
    weights = [one.without_check_up.peaks for one in known if one.without_check_up.peaks]
    names = dict.fromkeys(name for charge in charges for name in charge.peaks)
    return [
        {
            "c_rate": charges[0].c_rate,
            "ambient_temperature_celsius": charges[0].temperature_celsius,
            "identity": name,
            "weight": float(np.mean([one.get(name, 0.0) for one in weights]))
            if weights
            else np.nan,
            "rms_all": rms(_errors(known, sizes)),
            "rms_alone": _error_with(charges, {name}, sizes, most_terms, wrong),
            "rms_without": _error_with(charges, {*names} - {name}, sizes, most_terms, wrong),
            "charges": sum(name in one.charge.peaks for one in known),
        }
        for name in sorted(names)
    ]


def _error_with(charges, kept, sizes, most_terms, wrong):
    """RMS error of left-out check-ups where only some peaks are looked at [1]."""
    # Sixty charges over the life tell an error to a tenth, in a fraction of the time of all.
    places = np.unique(np.linspace(0, len(charges) - 1, 60).round().astype(int))
    fewer = [
        charge._replace(peaks={name: p for name, p in charge.peaks.items() if name in kept})
        for charge in [charges[place] for place in places]
    ]
    fewer = [one for one in fewer if one.peaks and (one.cell, one.cycle) not in wrong]
    try:
        found = left_out_estimates(fewer, most_terms=most_terms, cells=False, distrusted=wrong)
    except Refusal:
        return np.nan
    return rms(_errors(found, sizes))


def _sentence(where, information, found, sizes, wrong):
    """What the calibration reached, and which peaks tell it, for the report."""
    by_test = _errors(found, sizes)
    by_cell = _errors(found, sizes, without="without_cell")
    # Without a peak that holds information of its own the error grows by a quarter or more.
    needed = [one for one in information if one["rms_without"] > 1.25 * one["rms_all"]]
    words = [
        f"{one['identity']} ({100 * one['rms_without']:.2g} % without it)"
        for one in sorted(needed, key=lambda one: -one["rms_without"])
    ]
    peaks = ", ".join(words) or "no single one"
    cells = f"{100 * rms(by_cell):.2g} % at a cell never seen" if by_cell else "one cell only"
    apart = [
        f"{cell} at cycle {cycle:g} ({100 * error:.2g} %)" for (cell, cycle), error in wrong.items()
    ]
    left = f"; not calibrated on, since capacity and peaks disagree: {', '.join(apart)}"
    left = left if apart else ""
    if not by_test:
        return f"Capacity from peaks, {where}: no check-up was left out, its error is unknown{left}"
    return (
        f"Capacity from peaks, {where}: {100 * rms(by_test):.2g} % RMS at {len(by_test)} left-out "
        f"check-ups, {cells}; the information is in peak {peaks}{left}"
    )
