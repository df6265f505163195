"""Ageing records: the complete discharges and charges of many cycles in one test."""

from collections import Counter

import numpy as np

from cellwright.protocols.balance import FORMATION_SHARE, inserting_sign
from cellwright.protocols.capacity import EFFICIENCY_MAX
from cellwright.protocols.coarse import coarsest_digit_ampere, unsure_of_digit
from cellwright.protocols.half_cycles import (
    NAMES,
    TURN_SHARE,
    Before,
    charge_moved,
    columns_of,
    energy_counted,
    half_cycles,
    known_of_start,
    reading_at_rest,
    unsure_of_edges,
    unsure_of_instrument,
    weighted_median,
    with_starts,
)
from cellwright.protocols.messages import say
from cellwright.records import inputs
from cellwright.records.anchor import first_rest
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.edges import edge_variance
from cellwright.series.rest_current import as_logged
from cellwright.series.steps import assumed_rating
from cellwright.settings import Instrument

EFFICIENCY_LEAST = 0.8
FORMATION_LEAST = 1.0 - FORMATION_SHARE
EXAMPLES = 5  # cycles named in a sentence


# ASSUME: A half cycle that reaches its cut-off under load is complete, whatever its load's shape;
# so cycles of pulsed discharges count too.
def ageing_cycles(series, steps, test, cell, course=None, instrument=None):
    """Capacity, energy and temperature of every complete half cycle of an ageing record.

    1. The record is cut where its counted charge turns (a return of less than 2 % of the rating
    is no turn), and where a charge between two discharges was not logged. 2. A half cycle is
    complete where it reaches its cut-off within 10 mV (what is held there afterwards is part of it)
    and begins at the other (`half_cycles.starts_of`); what it may lack at its start is its standard
    deviation. What was cut short is left out, and so is what follows it. 3. Coulombic efficiency is
    a discharge over the charge before it, of a negative electrode against lithium a charge over the
    discharge before it; NaN outside 0.8 … 1.05, where the record lacks what happened between, in
    the first cycle of a new cell outside 0.5 … 1.05.

    test : its `cycle` is that of the first. instrument : `settings.Instrument`.

    Returns rows, columns (k,) [Ah], [Wh], [1], [°C], one entry a complete discharge or charge, in
    time order. cycle counts discharges: that of the sheet plus 1 for the first one in the record; a
    charge has the number of the discharge that it prepares. room_temperature_celsius is the
    recorded temperature of the surroundings over the half cycle, temperature_start_celsius the
    cell's as it begins, temperature_mean_celsius the cell's over it; NaN where not recorded.
    left_out: for each reason how many half cycles were left out, and which. Raises Refusal: a
    cut-off is not stated, or no complete cycle; the reasons are named. Source: docs/health.md.
    """
    limits = tuple(inputs.cutoffs(cell).values())
    if None in limits:
        raise Refusal("a cut-off is not stated, so which cycles are complete cannot be told")
    series, steps = inputs.columns(series, *inputs.COUNTED), inputs.steps(steps)
    columns, time = columns_of(series), np.asarray(series["test_time_second"], float)
    accuracy = inputs.settings_of(Instrument, instrument, {})
    rated = inputs.rating(cell) or assumed_rating(columns[0], columns[2])
    # A record counts its own cycles; the sheet says how many came before it.
    first_cycle = inputs.test_facts(test).cycle or 0.0
    known = Before(**known_of_start(course, test), rest=first_rest(steps, time, columns[1]))
    halves = half_cycles(columns, steps, limits, least_ampere_hour=TURN_SHARE * rated)
    halves = [half._replace(last_row=_last_row(half, steps)) for half in halves]
    halves = with_starts(halves, columns, limits, known)
    discharges = np.cumsum([half.sign < 0 and bool(half.loads) for half in halves])
    cycles = [first_cycle + n + (h.sign > 0) for n, h in zip(discharges, halves, strict=True)]
    left_out, by_rest = (_by_reason(halves, cycles, faulty=faulty) for faulty in (True, False))
    inserts = inserting_sign(limits)
    efficiencies = _efficiencies(halves, columns[2], inserts, new=first_cycle == 0)
    unsure = edge_variance(time, columns[0], columns[2])
    logged = as_logged(series)["current_ampere"]
    at_rest, digit = reading_at_rest(logged, steps), coarsest_digit_ampere(logged, rated)
    rows, shares = [], (accuracy.current_accuracy_share, at_rest)
    for cycle, efficiency, half in zip(cycles, efficiencies, halves, strict=True):
        if half.fault:
            continue
        parts = (
            half.missing_ampere_hour,
            unsure_of_edges(half, unsure, columns, limits),
            unsure_of_instrument(
                *(half, time, columns[0], *shares), clock_share=accuracy.clock_error_share
            ),
            unsure_of_digit(half, time, columns[0], digit),
        )
        row = {"cycle": cycle} | _numbers(half, efficiency, series, rated)
        rows.append(row | {"capacity_std_ampere_hour": np.linalg.norm(parts)})
    if not rows:
        raise Refusal(say("ageing.none", why="; ".join(left_out) or say("ageing.no_half")))
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Result({"rows": table}, {"left_out": left_out}, (*left_out, *by_rest))


def _last_row(half, steps):
    """Last row of the load that reaches the cut-off, or of the holds there that follow at once.

    A rest between them or not: schedules pause for some minutes before they hold.
    """
    counted = len(half.to_cutoff)
    if not half.reached:
        return half.turn_row
    while counted < len(half.loads) and steps.kind[half.loads[counted]] in ("CV", "CCCV"):
        counted += 1
    return int(steps.last_row[half.loads[counted - 1]])


def _by_reason(halves, cycles, *, faulty):
    """A sentence for each reason and direction: how many half cycles, of how many, and which."""
    reasons, numbered = {}, Counter(half.sign for half in halves)
    for half, cycle in zip(halves, cycles, strict=True):
        if bool(half.fault) == faulty and (half.fault or half.words):
            reasons.setdefault((half.sign, half.code), []).append((cycle, half.fault or half.words))
    code = "ageing.left_out" if faulty else "ageing.by_rest"
    return tuple(
        _sentence(code, NAMES[sign], numbered[sign], members)
        for (sign, _), members in reasons.items()
    )


def _sentence(code, direction, among, members):
    """One reason in words, from the (cycle, words) of its half cycles."""
    cycles = list(dict.fromkeys(f"{cycle:g}" for cycle, _ in members))
    named = ", ".join(cycles[:EXAMPLES]) + (" …" if len(cycles) > EXAMPLES else "")
    cycle, why = members[0]
    about = {"count": len(members), "all": among, "direction": direction, "cycles": named}
    return say(code, cycle=cycle, why=why, **about)


def _numbers(half, efficiency, series, rated):
    """Columns of `ageing_cycles` after `cycle` for one complete half cycle."""
    rows = slice(half.first_row, half.last_row + 1)
    time, charge = series["test_time_second"][rows], series["charge_ampere_hour"][rows]
    surface = series.get("surface_temperature_celsius")
    ambient = series.get("ambient_temperature_celsius")
    # The cell's temperature before the load warms it, over the last rows of the rest.
    before_load = slice(max(half.first_row - 5, 0), half.first_row + 1)
    current = _middle_current(series["current_ampere"][rows], np.diff(charge))
    return {
        "direction": NAMES[half.sign],
        "start_time_second": float(time[0]),
        "duration_second": float(time[-1] - time[0]),
        "c_rate": current / rated,
        "capacity_ampere_hour": abs(float(charge[-1] - charge[0])),
        "energy_watt_hour": abs(float(energy_counted(series["voltage_volt"][rows], charge)[-1])),
        "coulombic_efficiency": efficiency,
        "room_temperature_celsius": _time_mean(ambient, rows, time),
        "temperature_start_celsius": _median(surface, before_load),
        "temperature_mean_celsius": _time_mean(surface, rows, time),
    }


def _middle_current(current, moved):
    """Median size of the current [A], weighted by the charge that it moves."""
    # Where a pulse ends between two samples the charge belongs to the larger of both.
    size = np.maximum(np.abs(current[1:]), np.abs(current[:-1]))
    return float(weighted_median(size, np.abs(moved)))


def _efficiencies(halves, charge, inserts, new):
    """Charge taken out over that put in before it [1] of each half cycle, NaN where none is told.

    inserts : sign of what a cycle begins with, −1 of a negative electrode against lithium. Outside
    0.8 to 1.05 the record lacks a half cycle between the two; the first cycle of a `new` cell, its
    formation, may keep half.
    """
    found, least = [], FORMATION_LEAST if new else EFFICIENCY_LEAST
    for before, half in zip([None, *halves], halves, strict=False):
        paired = half.sign == -inserts and before is not None and not (before.fault or half.fault)
        share = charge_moved(half, charge) / charge_moved(before, charge) if paired else np.nan
        found.append(share if least <= share <= EFFICIENCY_MAX else np.nan)
        least = EFFICIENCY_LEAST if half.loads and half.sign == -inserts else least
    return found


def _time_mean(values, rows, time):
    """Mean over time of the finite values of some rows; NaN where fewer than two are."""
    if values is None:
        return np.nan
    measured = np.isfinite(values[rows])
    values, time = values[rows][measured], time[measured]
    if len(time) < 2 or time[-1] <= time[0]:
        return np.nan
    return float(np.trapezoid(values, time) / (time[-1] - time[0]))


def _median(values, rows):
    """Median of the finite values of some rows; NaN where there are none."""
    measured = np.empty(0) if values is None else values[rows][np.isfinite(values[rows])]
    return float(np.median(measured)) if len(measured) else np.nan
