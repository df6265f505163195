"""Capacity by direction and rate, from complete discharges and charges only."""

import numpy as np

from cellwright.protocols import Found
from cellwright.protocols.half_cycles import (
    NAMES,
    NEAR_VOLT,
    TURN_SHARE,
    Before,
    energy_counted,
    half_cycles,
    unsure_of_edges,
    with_starts,
)
from cellwright.records.anchor import first_rest_second
from cellwright.records.conditions import same_rate
from cellwright.refusal import Refusal
from cellwright.series.doubts import RATING_SHARE, in_words
from cellwright.series.edges import edge_variance
from cellwright.series.steps import assumed_rating, constant_current_end

EFFICIENCY_MAX = 1.05  # above it the two were not one cycle between the same two ends
BALANCE_SHARE = 0.01  # of a cycle's charge that does not come back: side reactions, gain of ranges
BEYOND_VOLT = 0.03  # a tester ends a load within its own sampling and lead drop of the cut-off
DRIFT_SHARE = 0.02  # within which any tester holds a current; its noise is less in the median
LEAST_DRIFT_ROWS = 32
UNFINISHED_C_RATE = 0.1  # a hold that a record ends in above it was not finished
COLD_CELSIUS, FAST_C_RATE = 10.0, 1.2  # colder or faster a good cell may give less than half
THERMOMETER_KELVIN = 10.0  # between a thermometer at the start and the stated temperature
# Every negative electrode lies below 2 V against lithium, and no full cell's window ends there.
ANODE_VOLT = 2.0
GAIN_SHARE = 0.001  # of a capacity: an instrument's gain, which no record tells, is no surer


def capacity(
    test_time_second,
    current_ampere,
    voltage_volt,
    charge_ampere_hour,
    steps,
    *,
    rated_capacity_ampere_hour,
    lower_cutoff_volt,
    upper_cutoff_volt,
    surface_temperature_celsius=None,
    whole_swing=False,
    state_before="",
    soc_at_start=None,
    curve=None,
    doubt=None,
    ambient_temperature_celsius=None,
):
    """Capacity of every complete discharge and charge, averaged over repeats at one rate.

    1. The record is cut where its counted charge turns. 2. A discharge is complete from full (the
    charge before it reached the upper cut-off, or the record begins full) to the lower cut-off, a
    charge from empty to the upper cut-off; what was held there at constant voltage is part of it.
    3. It is counted to where the limit is first reached; with `whole_swing` to the turn itself, so
    that a remainder drawn later, at another temperature, is included (slow OCV tests).
    4. Discharges, or charges, of one rate (`conditions.same_rate`) are repeats: mean and standard
    deviation (thesis, ch. 4.3).

    What an unsure start may lack, the charge of steps of current between two rows, and what both
    halves of a cycle differ by (`imbalance`) are part of the standard deviation. Coulombic
    efficiency is the discharge over the charge before it, or else the one after it; NaN where there
    is none, or where it exceeds 1.05: such a charge did not return the discharge. Of a negative
    electrode against lithium (upper cut-off below 2 V) it is the charge over the discharge before
    it, which inserts.

    test_time_second, current_ampere, voltage_volt, charge_ampere_hour : (n,) [s], [A], [V], [Ah],
        positive on charge.
    steps : Steps of the record.
    rated_capacity_ampere_hour : [Ah] for the C-rate; None: `assumed_rating` of the record.
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None: then no charge is complete.
    surface_temperature_celsius : (n,) [°C] or None.
    whole_swing : count from turn to turn of the charge.
    state_before : "full" or "empty", as the test before this one in time left the cell; "": not
        known.
    soc_at_start : of the first row, as the sheet states it [1], or None.
    curve : open-circuit voltage that this is held against, see `anchor.contradiction`, or None.
    doubt : (n,) flags of `series.doubts.Doubt`, or None. ambient_temperature_celsius : as the sheet
        states it [°C], or None.

    Returns found: Found; rows are columns of stage `capacity`, one entry a direction and rate:
    means over the repeats, and capacity_std_ampere_hour, which is NaN where nothing tells it;
    constant_current_ampere_hour is the part before the voltage was held; doubt says in words what
    speaks against the number, "" where nothing does. A sentence for each half cycle that is
    incomplete or of unsure start. Raises Refusal: nothing in the record is complete; the reasons
    are named.
    """
    columns = tuple(
        np.asarray(column, float) for column in (current_ampere, voltage_volt, charge_ampere_hour)
    )
    rated = rated_capacity_ampere_hour or assumed_rating(columns[0], columns[2])
    limits = (lower_cutoff_volt, upper_cutoff_volt)
    known = Before(state_before, soc_at_start, curve, first_rest_second(steps))
    # A drive has no rate: where it crosses the cut-off no capacity of a rate ends.
    halves = half_cycles(
        columns, steps, limits, least_ampere_hour=TURN_SHARE * rated, dynamic=False
    )
    halves = [_counted(half, columns[0], steps, whole_swing) for half in halves]
    halves = with_starts(halves, columns, limits, known)
    left_out = tuple(
        f"{NAMES[half.sign]} from {test_time_second[half.first_row]:.0f} s: "
        f"{half.fault or half.words}"
        for half in halves
        if half.fault or half.words
    )
    unsure = edge_variance(np.asarray(test_time_second, float), columns[0], columns[2])
    inserts = -1 if upper_cutoff_volt is not None and upper_cutoff_volt < ANODE_VOLT else 1
    complete = []
    for half, partner in zip(halves, _partners(halves, inserts), strict=True):
        if half.fault:
            continue
        row = _measured(half, partner, columns, steps, surface_temperature_celsius, inserts)
        off = 0.0 if partner is None else imbalance(half, partner, columns, steps, limits)
        row["edges"] = unsure_of_edges(half, unsure, columns, limits)
        row["missing"] = float(np.hypot(row["missing"], off))
        row["doubt"] = [
            *_against_record(half, columns, steps, limits, doubt),
            *([] if partner is None else _of_partner(partner, doubt)),
            *[half.words] * _begins_unsure(half),
            *_against_partner(half, partner, off, columns[2]),
            *_against_sheet(half, row, rated_capacity_ampere_hour, ambient_temperature_celsius),
        ]
        complete.append(row)
    if not complete:
        raise Refusal(f"no complete discharge or charge: {'; '.join(left_out) or 'none begins'}")
    return Found(_repeats_joined(complete, rated), left_out)


def _counted(half, current, steps, whole):
    """Half cycle to where its cut-off is first reached, or its turn, with a fault of its rate."""
    loads = half.loads if whole else half.to_cutoff
    if not loads:
        return half
    half = half._replace(loads=loads, last_row=int(steps.last_row[loads[-1]]))
    if half.fault:
        return half
    main, moved = _main_load(half, steps)
    if steps.kind[main] == "dynamic":
        return half._replace(fault="the load is dynamic, not a constant current")
    rates = np.array([_rate(current, steps, step)[0] for step in loads])
    # Portions of one discharge at a constant current may differ by 5 %: range and noise.
    same = np.abs(rates / _rate(current, steps, main)[0] - 1.0) <= 0.05
    if not whole and moved[same].sum() < 0.9 * moved.sum():
        fault = "its current changes: less than 90 % of the charge moved at one rate"
        return half._replace(fault=fault)
    return half


def _main_load(half, steps):
    """The load of a half cycle that moves the most, and what each of them moves [Ah]."""
    moved = np.abs(steps.charge_ampere_hour[list(half.loads)])
    return half.loads[int(np.argmax(moved))], moved


def _rate(current, steps, step):
    """Size of the current of a step before its voltage is held [A], and the row that ends it."""
    first, last = int(steps.first_row[step]), int(steps.last_row[step])
    end = constant_current_end(first, last, steps.cv_first_row[step])
    # Never zero: rates are compared by their ratio.
    return max(float(np.median(np.abs(current[first:end]))), 1e-12), min(end, last)


def _partners(halves, inserts):
    """Complete other half of the cycle of each half cycle, or None.

    A cycle is a charge and the discharge after it, or else a discharge and the charge after it;
    with `inserts` −1 the other way round.
    """
    padded = [None, *halves, None]
    sides = [
        side if half.sign == -inserts else side[::-1]
        for half, *side in zip(halves, padded[:-2], padded[2:], strict=True)
    ]
    return [next((half for half in side if half and not half.fault), None) for side in sides]


def _measured(half, partner, columns, steps, temperature, inserts):
    """Columns of stage `capacity` for one complete half cycle, and what it may lack [Ah].

    Its partner gives the efficiency: NaN where the charge was cut short. inserts : sign of what a
    cycle begins with.
    """
    current, voltage, charge = columns
    rate, held_row = _rate(current, steps, _main_load(half, steps)[0])
    rows = slice(half.first_row, half.last_row + 1)
    efficiency = np.nan
    if partner is not None:
        out, put_in = (half, partner) if half.sign == -inserts else (partner, half)
        efficiency = _moved(out, charge) / _moved(put_in, charge)
    return {
        "sign": half.sign,
        "first_row": half.first_row,
        "rate": rate,
        "capacity_ampere_hour": _moved(half, charge),
        "energy_watt_hour": abs(energy_counted(voltage[rows], charge[rows])[-1]),
        "coulombic_efficiency": efficiency if efficiency <= EFFICIENCY_MAX else np.nan,
        "mean_current_ampere": half.sign * rate,
        "temperature_mean_celsius": np.nan
        if temperature is None
        else _mean(np.asarray(temperature, float)[rows]),
        "temperature_start_celsius": np.nan
        if temperature is None
        else float(np.asarray(temperature, float)[half.first_row]),
        "constant_current_ampere_hour": abs(charge[held_row] - charge[half.first_row]),
        "missing": half.missing_ampere_hour,
    }


def imbalance(half, partner, columns, steps, limits):
    """Charge [Ah] by which the two halves of a cycle differ beyond what their ends explain.

    The first begins and the second ends at a rest. Where these rest at the same voltage both move
    the same charge; voltage between them explains charge at twice the cell's mean slope, which no
    common open-circuit curve exceeds near full or empty. A rest that still moves moves as far
    again. 0 where another half lies between them, or a cut-off is not stated.
    """
    first, second = sorted((half, partner), key=lambda one: one.first_row)
    between = second.first_row > first.turn_row + _rows_of_rest(first, steps)
    if between or None in limits:
        return 0.0
    _, voltage, charge = columns
    after = [k for k in (second.loads[-1] + 1,) if k < len(steps.kind) and steps.kind[k] == "rest"]
    last = int(steps.last_row[after[0]]) if after else second.last_row
    middle = (last + int(steps.first_row[after[0]])) // 2 if after else last
    moves = abs(float(voltage[last] - voltage[middle]))
    apart = abs(float(voltage[first.first_row] - voltage[last])) + moves + NEAR_VOLT
    larger = max(_moved(first, charge), _moved(second, charge))
    explained = larger * (BALANCE_SHARE + 2 * apart / (limits[1] - limits[0]))
    return max(abs(_moved(first, charge) - _moved(second, charge)) - explained, 0.0)


def _begins_unsure(half):
    """Whether what a start may lack is more than a cycle's charge differs by anyway."""
    unsure = half.missing_ampere_hour > BALANCE_SHARE * half.moved_ampere_hour
    return bool(half.words and (half.under_load or unsure))


def _rows_of_rest(half, steps):
    """Rows of the rest after a half cycle, 0 where none follows."""
    after = half.loads[-1] + 1
    rests = after < len(steps.kind) and steps.kind[after] == "rest"
    return int(steps.last_row[after] - steps.first_row[after] + 1) if rests else 0


def _against_record(half, columns, steps, limits, doubt):
    """What the rows of a half cycle themselves say against it, in words."""
    current, voltage, _ = columns
    said = [in_words(doubt, _own_rows(half))]
    # The last row itself may lie anywhere beyond: a steep end between two rows.
    limit, end = limits[half.sign > 0], float(voltage[half.last_row - 1])
    if half.sign * (end - limit) > BEYOND_VOLT:
        said.append(f"its load goes on to {end:.3f} V, beyond the stated cut-off of {limit:g} V")
    if drift := _drift(current, steps, _main_load(half, steps)[0]):
        said.append(
            f"its current drifts from {drift[0]:.4g} to {drift[1]:.4g} A: a tester holds it"
        )
    left = abs(float(current[-1]))
    if half.last_row == len(current) - 1 and steps.cv_first_row[half.loads[-1]] >= 0:
        said += [f"the record ends inside the hold, at {left:.3g} A"] * _unfinished(
            left, half, steps
        )
    return [words for words in said if words]


def _drift(current, steps, step):
    """First and last level of a constant current [A] that moves by more than 2 %; else None."""
    first, last = int(steps.first_row[step]), int(steps.last_row[step])
    end = constant_current_end(first, last, steps.cv_first_row[step])
    size = np.abs(current[first + 1 : end - 1])  # first and last row may hold the edges
    if len(size) < LEAST_DRIFT_ROWS:
        return None
    begun, ended = (
        float(np.median(part)) for part in (size[: len(size) // 8], size[-len(size) // 8 :])
    )
    return (begun, ended) if abs(ended - begun) > DRIFT_SHARE * max(begun, ended) else None


def _own_rows(half):
    """Rows whose flags speak of a half cycle: to the first one after it, where its load ends."""
    return slice(half.first_row, half.last_row + 2)


def _of_partner(partner, doubt):
    """What speaks against the other half of the cycle, and so against the efficiency."""
    said = in_words(doubt, _own_rows(partner))
    return [f"in the {NAMES[partner.sign]} of its cycle {said}"] * bool(said)


def _unfinished(left, half, steps):
    rates = np.abs(steps.c_rate[half.loads[-1]] / (steps.current_mean_ampere[half.loads[-1]] or 1))
    return bool(left * rates > UNFINISHED_C_RATE)


def _against_partner(half, partner, off, charge):
    """That the other half of a cycle moves another charge, in words."""
    if not off > 0:
        return []
    other = f"the {NAMES[-half.sign]} of its cycle moves {_moved(partner, charge):.4g} Ah"
    return [f"{other}: {off:.2g} Ah further from it than their ends explain"]


def _against_sheet(half, row, rated, celsius):
    """What the sheet says against a capacity, in words."""
    said = []
    if rated:
        share = row["capacity_ampere_hour"] / rated
        warm = not row["temperature_mean_celsius"] < COLD_CELSIUS
        warm &= celsius is None or celsius >= COLD_CELSIUS
        little = share < RATING_SHARE[0] and warm and row["rate"] / rated <= FAST_C_RATE
        if little or share > RATING_SHARE[1]:
            alike = abs(row["capacity_ampere_hour"] - 1) < 0.1
            c_rate = ": does the file hold C-rates under ampere?" if alike else ""
            said.append(f"it is {share:.3g} times the rating of {rated:g} Ah{c_rate}")
    started = row["temperature_start_celsius"]
    if celsius is not None and abs(started - celsius) > THERMOMETER_KELVIN:
        said.append(f"the cell begins at {started:.3g} °C, the sheet says {celsius:g} °C")
    return said


def _begin(measured):
    return measured["first_row"]


def _moved(half, charge):
    return abs(float(charge[half.last_row] - charge[half.first_row]))


def _mean(values):
    """Mean of the finite values; NaN where there are none."""
    measured = values[np.isfinite(values)]
    return float(measured.mean()) if len(measured) else np.nan


def _repeats_joined(complete, rated):
    """Columns of stage `capacity` with the repeats of each direction and rate as one row."""
    repeats = []
    for half in sorted(complete, key=lambda half: (-half["sign"], half["rate"])):
        first = repeats[-1][0] if repeats else {"sign": 0}
        if first["sign"] == half["sign"] and same_rate(half["rate"], first["rate"]):
            repeats[-1].append(half)
        else:
            repeats.append([half])
    rows = [_row(halves, rated) for halves in repeats]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _row(halves, rated):
    """One row of stage `capacity`: means over the repeats, standard deviation of the capacity.

    It is that of the repeats, of what their starts may lack and of steps of current between two
    rows; NaN where none is known, or only what is less than an instrument's gain.
    """
    names = [name for name in halves[0] if name != "doubt"]
    columns = {name: np.array([half[name] for half in halves]) for name in names}
    sizes, missing = columns["capacity_ampere_hour"], columns["missing"].mean()
    several, edges = len(sizes) > 1, float(np.sqrt(np.mean(columns["edges"] ** 2)))
    scatter = sizes.std(ddof=1) if several else 0.0
    told = several or missing or edges > GAIN_SHARE * sizes.mean()
    std = float(np.linalg.norm([scatter, missing, edges])) if told else np.nan
    means = {name: _mean(values) for name, values in columns.items()}
    return {
        "direction": NAMES[halves[0]["sign"]],
        "c_rate": means["rate"] / rated,
        "capacity_ampere_hour": sizes.mean(),
        "capacity_std_ampere_hour": std,
        "energy_watt_hour": means["energy_watt_hour"],
        "coulombic_efficiency": means["coulombic_efficiency"],
        # Of a new cell that of formation, which no mean may hide.
        "first_coulombic_efficiency": min(halves, key=_begin)["coulombic_efficiency"],
        "repeats": len(sizes),
        "mean_current_ampere": means["mean_current_ampere"],
        "temperature_mean_celsius": means["temperature_mean_celsius"],
        "constant_current_ampere_hour": means["constant_current_ampere_hour"],
        "doubt": "; ".join(dict.fromkeys(words for half in halves for words in half["doubt"])),
    }
