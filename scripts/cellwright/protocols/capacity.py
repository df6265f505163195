"""Capacity by direction and rate, from complete discharges and charges only."""

from functools import partial

import numpy as np

from cellwright.messages import doubt_columns
from cellwright.protocols.balance import balance_of, inserting_sign, unsure_of_count
from cellwright.protocols.capacity_doubts import doubts_of, mode_in_words
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
    main_load,
    reading_at_rest,
    unsure_of_edges,
    unsure_of_instrument,
    with_starts,
)
from cellwright.records import inputs
from cellwright.records.anchor import RELAXED_SECOND, first_rest
from cellwright.records.basis import curve_at
from cellwright.records.conditions import SAME_CELSIUS, grouped_alike, same_rate
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.edges import edge_variance
from cellwright.series.steps import assumed_rating, constant_current_end
from cellwright.settings import Instrument

EFFICIENCY_MAX = 1.05  # above it the two were not one cycle between the same two ends
# Temperatures that are chosen to differ stand so far apart: a load warms its cell by less from one
# repeat to the next.
OTHER_CELSIUS = 2 * SAME_CELSIUS


def capacity(
    series,
    steps,
    cell,
    settings=None,
    *,
    whole_swing=False,
    test=None,
    course=None,
    curves=(),
    **changes,
):
    """Capacity of every complete discharge and charge, averaged over repeats at one rate.

    1. The record is cut where its counted charge turns. 2. A discharge is complete from full (the
    charge before it reached the upper cut-off, or the record begins full) to the lower cut-off, a
    charge from empty to the upper cut-off; what was held there at constant voltage is part of it.
    3. It is counted to where the limit is first reached; with `whole_swing` to the turn itself, so
    that a remainder drawn later, at another temperature, is included (slow OCV tests).
    4. Discharges, or charges, of one rate (`conditions.same_rate`) are repeats, unless their cell
    was 5 K apart: mean and standard deviation (thesis, ch. 4.3).

    What an unsure start may lack, the charge of steps of current between two rows, what both halves
    of a cycle differ by beyond what its ends explain (`balance`), what the instrument's stated
    accuracy leaves open (`unsure_of_instrument`) and what its least digit does (`unsure_of_digit`)
    are part of the standard deviation. Coulombic efficiency is the discharge over the charge before
    it, or else the one after it; NaN where there is none, or where it exceeds 1.05: such a charge
    did not return the discharge. Its standard deviation holds what the two ends of the cycle leave
    open. Of a negative electrode against a metal (`is_negative_electrode`) it is the charge over
    the discharge before it, which inserts.

    settings : `settings.Instrument`.
    whole_swing : a half cycle that ends short of the cut-off counts too, as in slow OCV tests: from
        turn to turn of the charge.
    curves : list of dict, open-circuit voltages of the cell that a stated SoC is held against.

    Returns rows: columns (k,) of stage `capacity`, one entry a direction, rate and temperature:
    means over the repeats of charge [Ah], energy [Wh], rate [1/h], efficiency [1], and their
    standard deviations; constant_current_ampere_hour is the part before the voltage was held; doubt
    says in words what speaks against the number, "" where nothing does, doubt_codes in codes. Half
    cycles that are incomplete, of unsure start or at a constant power or resistance are in the
    notes. Raises Refusal: no complete charge or discharge; the reasons are named.
    Source: docs/capacity.md.

    >>> import cellwright as cw, numpy as np
    >>> time = np.arange(0.0, 7300.0, 10.0)  # rest, 2 A for an hour, rest
    >>> current = np.where((time >= 600) & (time < 4200), -2.0, 0.0)
    >>> voltage = np.interp(time, [600, 4200], [4.2, 3.0])
    >>> record = {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    >>> cell = cw.CellFacts("A", 2.0, lower_cutoff_volt=3.0, upper_cutoff_volt=4.2)
    >>> series = cw.clean(record)
    >>> (row,) = cw.capacity(series, cw.segment(series, cell), cell).to_frame().to_dict("records")
    >>> row["direction"], round(row["capacity_ampere_hour"], 2)
    ('discharge', 2.0)
    """
    series, steps = inputs.columns(series, *inputs.COUNTED), inputs.steps(steps)
    columns, time = columns_of(series), np.asarray(series["test_time_second"], float)
    accuracy = inputs.settings_of(Instrument, settings, changes)
    stated, limits = inputs.rating(cell), tuple(inputs.cutoffs(cell).values())
    rated = stated or assumed_rating(columns[0], columns[2])
    celsius = None if test is None else inputs.test_facts(test).ambient_temperature_celsius
    known = Before(
        **known_of_start(course, test),
        # The OCV moves by tenths of a mV/K: the curve of the nearest temperature errs least.
        curve=curve_at(curves, celsius) if curves else None,
        rest=first_rest(steps, time, columns[1]),
    )
    # A drive has no rate: where it crosses the cut-off no capacity of a rate ends.
    halves = half_cycles(
        columns, steps, limits, least_ampere_hour=TURN_SHARE * rated, dynamic=False
    )
    halves = [_counted(half, columns[0], steps, whole_swing) for half in halves]
    halves = with_starts(halves, columns, limits, known)
    named = [(half, f"{NAMES[half.sign]} from {time[half.first_row]:.0f} s") for half in halves]
    said = ((of, half.fault or half.words) for half, of in named)
    left_out = tuple(f"{of}: {words}" for of, words in said if words)
    modes = tuple(
        f"{of}: {words}"
        for half, of in named
        if not half.fault and (words := mode_in_words(half, columns, steps, limits))
    )
    unsure, inserts = edge_variance(time, columns[0], columns[2]), inserting_sign(limits)
    logged = series.get("logged_current_ampere", columns[0])
    at_rest, digit = reading_at_rest(logged, steps), coarsest_digit_ampere(logged, rated)
    balance = partial(balance_of, columns=columns, time=time, steps=steps, limits=limits)
    counted = partial(
        unsure_of_count,
        columns=columns,
        test_time_second=time,
        variance=unsure,
        limits=limits,
        share=accuracy.current_accuracy_share,
        rest_ampere=at_rest,
    )
    sheet, complete = (stated, celsius), []
    unread = np.full(len(time), np.nan)
    temperature = np.asarray(series.get("surface_temperature_celsius", unread), float)
    for half, partner in zip(halves, _partners(halves, inserts), strict=True):
        if half.fault:
            continue
        row = _measured(half, partner, columns, steps, temperature, inserts)
        row |= _of_balance(half, partner, balance, counted, inserts)
        row["edges"] = unsure_of_edges(half, unsure, columns, limits)
        row["instrument"] = unsure_of_instrument(
            *(half, time, columns[0], accuracy.current_accuracy_share, at_rest),
            clock_share=accuracy.clock_error_share,
        )
        both = [one for one in (half, partner) if one is not None]
        stds = [unsure_of_digit(one, time, columns[0], digit) for one in both]
        row |= {"digit": stds[0], "digit_of_cycle": max(stds)}
        doubt = series.get("doubt")
        row["doubt"] = doubts_of(half, partner, row, columns, steps, limits, doubt, sheet)
        row["missing"] = float(np.hypot(row["missing"], row["off"]))
        complete.append(row)
    if not complete:
        why = _of_all(named) or _none_begins(columns[0], columns[2], rated)
        raise Refusal(f"no complete discharge or charge: {why}")
    # One row for the repeats of a direction, rate and temperature.
    ordered = sorted(complete, key=lambda half: (-half["sign"], half["rate"]))
    rows = [_row(repeats, rated) for repeats in grouped_alike(ordered, _repeated)]
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Result({"rows": table}, notes=(*left_out, *modes))


def _of_all(named):
    """Why none of the named half cycles counts: what is so of several, once."""
    alike = {}
    for half, of in named:
        alike.setdefault((half.sign, half.fault or half.words), []).append(of)
    more = {key: f" and {len(of) - 1} more" if len(of) > 1 else "" for key, of in alike.items()}
    return "; ".join(f"{of[0]}{more[key]}: {key[1]}" for key, of in alike.items() if key[1])


def _none_begins(current, charge, rated):
    """Why a record of current (n,) [A] and charge (n,) [Ah] holds no half cycle, in words."""
    if not np.any(current):
        return "the current reads 0 A in all rows"
    moved = float(np.ptp(charge))
    return (
        f"none begins: time × current moves {moved:.2g} Ah in all, {moved / rated:.2g} of the "
        f"rating of {rated:g} Ah. If it is no rest, its time or current is of another unit than "
        "read"
    )


def _counted(half, current, steps, whole):
    """Half cycle to where its cut-off is first reached, or its turn, with a fault of its rate."""
    loads = half.loads if whole else half.to_cutoff
    if not loads:
        return half
    half = half._replace(loads=loads, last_row=int(steps.last_row[loads[-1]]))
    if half.fault:
        return half
    main, moved = main_load(half, steps)
    if steps.kind[main] == "dynamic":
        return half._replace(fault="the load is dynamic, not a constant current")
    rates = np.array([_rate(current, steps, step)[0] for step in loads])
    # Portions of one discharge at a constant current may differ by 5 %: range and noise.
    same = np.abs(rates / _rate(current, steps, main)[0] - 1.0) <= 0.05
    if not whole and moved[same].sum() < 0.9 * moved.sum():
        fault = "its current changes: less than 90 % of the charge moved at one rate"
        return half._replace(fault=fault)
    return half


def _rate(current, steps, step):
    """Size of the current of a step before its voltage is held [A], and the row that ends it."""
    first, last = int(steps.first_row[step]), int(steps.last_row[step])
    end = constant_current_end(first, last, steps.cv_first_row[step])
    # Never zero: rates are compared by their ratio.
    return max(float(np.median(np.abs(current[first:end]))), 1e-12), min(end, last)


def _partners(halves, inserts):
    """Complete other half of the cycle of each half cycle, or None.

    A cycle is a charge and the discharge after it, or else a discharge and the charge after it;
    with `inserts` −1 the other way round. Where the half cycle between two of one direction was not
    logged there is none.
    """
    padded = [None, *halves, None]
    sides = [
        side if half.sign == -inserts else side[::-1]
        for half, *side in zip(halves, padded[:-2], padded[2:], strict=True)
    ]
    return [
        next((one for one in side if one and not one.fault and one.sign != half.sign), None)
        for half, side in zip(halves, sides, strict=True)
    ]


def _measured(half, partner, columns, steps, temperature, inserts):
    """Columns of stage `capacity` for one complete half cycle, and what it may lack [Ah].

    Its partner gives the efficiency: NaN where the charge was cut short. inserts : sign of what a
    cycle begins with.
    """
    current, voltage, charge = columns
    rate, held_row = _rate(current, steps, main_load(half, steps)[0])
    rows = slice(half.first_row, half.last_row + 1)
    rests = _rests_beside(half, voltage, steps)
    efficiency = np.nan
    if partner is not None:
        out, put_in = (half, partner) if half.sign == -inserts else (partner, half)
        efficiency = out.moved_ampere_hour / put_in.moved_ampere_hour
    return {
        "sign": half.sign,
        "first_row": half.first_row,
        "rate": rate,
        "capacity_ampere_hour": charge_moved(half, charge),
        "rested_ampere_hour": charge_moved(half, charge) if rests else np.nan,
        "rest_before_volt": rests[0] if rests else np.nan,
        "rest_after_volt": rests[1] if rests else np.nan,
        "energy_watt_hour": abs(energy_counted(voltage[rows], charge[rows])[-1]),
        "coulombic_efficiency": efficiency if efficiency <= EFFICIENCY_MAX else np.nan,
        "mean_current_ampere": half.sign * rate,
        "temperature_mean_celsius": _mean(temperature[rows]),
        "temperature_start_celsius": float(temperature[half.first_row]),
        "constant_current_ampere_hour": abs(charge[held_row] - charge[half.first_row]),
        "missing": half.missing_ampere_hour,
    }


def _of_balance(half, partner, balance_with, unsure_of, inserts):
    """What the balance of its cycle leaves unexplained [Ah], and the deviation of its efficiency.

    balance_with, unsure_of : `balance_of` and `unsure_of_count` of the record's half cycles.
    """
    if partner is None:
        return {"off": 0.0, "efficiency_std": np.nan}
    unsure = unsure_of([half, partner])
    balance = balance_with(half, partner, unsure_ampere_hour=unsure, inserts=inserts)
    off = balance.off_ampere_hour
    put_in = half if half.sign == inserts else partner
    std = np.linalg.norm([balance.ends_ampere_hour, off, unsure]) / put_in.moved_ampere_hour
    return {"off": off, "efficiency_std": float(std)}


def _rests_beside(half, voltage, steps):
    """Voltages [V] at the end of the rests beside a half cycle; () without ten minutes each."""
    before, after = half.loads[0] - 1, half.loads[-1] + 1
    if before < 0 or after >= len(steps.kind):
        return ()
    rested = [
        steps.kind[k] == "rest" and steps.duration_second[k] >= RELAXED_SECOND
        for k in (before, after)
    ]
    return [float(voltage[steps.last_row[k]]) for k in (before, after)] if all(rested) else ()


def _scatter(values):
    """Standard deviation of the finite values, 0 of fewer than two."""
    known = values[np.isfinite(values)]
    return known.std(ddof=1) if len(known) > 1 else 0.0


def _efficiency_std(columns):
    """Standard deviation of the mean efficiency: of its repeats, and of what no repeat tells."""
    known = np.isfinite(columns["coulombic_efficiency"])
    if not known.any():
        return np.nan
    return float(
        np.hypot(_scatter(columns["coulombic_efficiency"]), columns["efficiency_std"][known].mean())
    )


def _repeated(first, half):
    """Whether a half cycle repeats another: direction, rate, and no other temperature chosen."""
    apart = abs(half["temperature_mean_celsius"] - first["temperature_mean_celsius"])
    alike = first["sign"] == half["sign"] and same_rate(half["rate"], first["rate"])
    # Where nothing was measured nothing is apart.
    return alike and not apart > OTHER_CELSIUS


def _mean(values):
    """Mean of the finite values; NaN where there are none."""
    measured = values[np.isfinite(values)]
    return float(measured.mean()) if len(measured) else np.nan


def _row(halves, rated):
    """One row of stage `capacity`: means over the repeats, standard deviation of the capacity.

    It is that of the repeats, of what their starts may lack, of steps of current between two rows,
    of the instrument and of its digit.
    """
    names = [name for name in halves[0] if name != "doubt"]
    columns = {name: np.array([half[name] for half in halves]) for name in names}
    sizes = columns["capacity_ampere_hour"]
    edges = np.sqrt(np.mean(columns["edges"] ** 2))
    parts = [edges, *(columns[name].mean() for name in ("missing", "instrument", "digit"))]
    std, rested_std = (
        float(np.linalg.norm([_scatter(columns[f"{name}_ampere_hour"]), *parts]))
        for name in ("capacity", "rested")
    )
    means = {name: _mean(values) for name, values in columns.items()}
    return {
        "direction": NAMES[halves[0]["sign"]],
        "c_rate": means["rate"] / rated,
        "capacity_ampere_hour": sizes.mean(),
        "capacity_std_ampere_hour": std,
        "energy_watt_hour": means["energy_watt_hour"],
        "energy_std_watt_hour": std / sizes.mean() * means["energy_watt_hour"],
        "coulombic_efficiency": means["coulombic_efficiency"],
        "coulombic_efficiency_std": _efficiency_std(columns),
        # Of a new cell that of formation, which no mean may hide.
        "first_coulombic_efficiency": min(halves, key=lambda half: half["first_row"])[
            "coulombic_efficiency"
        ],
        "repeats": len(sizes),
        "mean_current_ampere": means["mean_current_ampere"],
        "temperature_mean_celsius": means["temperature_mean_celsius"],
        "constant_current_ampere_hour": means["constant_current_ampere_hour"],
        "rested_ampere_hour": means["rested_ampere_hour"],
        "rested_std_ampere_hour": rested_std,
        "rest_before_volt": means["rest_before_volt"],
        "rest_after_volt": means["rest_after_volt"],
        **doubt_columns(words for half in halves for words in half["doubt"]),
    }
