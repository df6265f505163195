"""Basis of a cell's SoC: the capacity and the open-circuit voltage curves that it refers to."""

from typing import NamedTuple

import numpy as np

from cellwright.records import inputs
from cellwright.records.anchor import (
    Anchored,
    capacity_in_words,
    is_unsure,
    refuse_impossible_soc,
    soc_series,
    telling_capacity,
)
from cellwright.records.conditions import (
    REFERENCE_CELSIUS,
    SAME_CELSIUS,
    SAME_CHECKUP_CYCLES,
    same_rate,
    same_temperature,
    stated_or_reference,
)
from cellwright.records.facts import stated_capacity
from cellwright.refusal import Refusal
from cellwright.series.doubts import RATING_SHARE


class Lender(NamedTuple):
    """A cell of the same type: its name, whether it is marked as reference, curves, capacities."""

    cell: str
    marked: bool
    curves: list
    capacities: list


def lender(cell, curves, capacities, *, marked=False):
    """OCV curves and capacities of a cell, for other cells of its type to borrow.

    curves : as of `basis`. marked : whether it is a reference of its type.

    Returns `records.basis.Lender`.
    """
    shown = (inputs.entries(curves, inputs.curves_of), inputs.entries(capacities))
    return Lender(inputs.cell_facts(cell).cell, marked, *shown)


def basis_of_one_age(
    cell,
    curves,
    capacities,
    lenders,
    *,
    rests=(),
    rated_capacity_ampere_hour=None,
    state_of_health=None,
    lower_cutoff_volt=-np.inf,
):
    """Capacity and OCV curves that a cell's SoC, 0 to 1, refers to.

    1. With slow tests of its own, the cell's SoC refers to the capacity of the one nearest 25 °C,
    the earliest of them. 2. Without, the curves of the reference cell of its type are borrowed (the
    first marked one, else the largest); the capacity is the cell's own, carried from the rate of
    its test to the slow rate (`carried`) where the reference cell has a test at both rates.
    3. Without a lender, the curves are those from the rests of its own pulse tests, one for each
    temperature, the slowest; the capacity is that of the one nearest 25 °C, and all of them are put
    on its scale, full at 1; without pulse tests, those of its long loads in the same way.
    4. Without any curve the capacity is the cell's own, without a capacity test the rating, times
    the state of health that the sheet states. What was taken is said in `capacity_source`.

    Parameters
    ----------
    cell : name of the cell.
    curves : list of dict, one a slow test: ambient_temperature_celsius, capacity_ampere_hour,
        soc, ocv_volt and what else the OCV stage gives.
    capacities : list of dict, rows of the capacity stage with ambient_temperature_celsius.
    lenders : list of Lender.
    rests : list of dict, as `curves`, one a pulse test or long load, with capacity_source besides.
    rated_capacity_ampere_hour, state_of_health : of the sheet [Ah], [1], or None.
    lower_cutoff_volt : a curve from rests is not continued below it [V].

    Returns
    -------
    basis : dict with cell, capacity_ampere_hour, capacity_std_ampere_hour (None: nothing tells it),
        capacity_source, capacity_doubt, borrowed_from, ocv.

    Raises
    ------
    Refusal
        No capacity test, no slow test and no rating.
    """
    # ASSUME: A cell without a slow test has the open-circuit voltage curve of its reference cell.
    content = {"cell": cell, "borrowed_from": None, "ocv": curves, DOUBT: ""}
    if curves:
        return content | slow_capacity(min(curves, key=first_choice), capacities)
    lender = reference_of(
        [lender for lender in lenders if lender.curves],
        capacity=lambda lender: max(curve["capacity_ampere_hour"] for curve in lender.curves),
    )
    if not lender and rests:
        return content | _from_rests(rests, lower_cutoff_volt, state_of_health)
    if lender:
        content |= {"borrowed_from": lender.cell, "ocv": lender.curves}
    stated = stated_capacity(rated_capacity_ampere_hour, state_of_health)
    return content | _own_capacity(capacities, lender, stated, state_of_health)


def curve_at(curves, celsius):
    """The curve whose temperature is nearest, None where there is none.

    Parameters
    ----------
    curves : list of dict with ambient_temperature_celsius [°C]. celsius : of a test [°C] or None.
    """
    wanted = stated_or_reference(celsius)
    return min(curves, key=lambda curve: abs(_celsius(curve) - wanted), default=None)


def _celsius(row):
    return stated_or_reference(row["ambient_temperature_celsius"])


def first_choice(row):
    """Sort key of tests: distance from 25 °C beyond 2.5 K first, then age in cycles.

    Parameters
    ----------
    row : dict with ambient_temperature_celsius [°C] and cycle, each a number or None.
    """
    celsius = row["ambient_temperature_celsius"]
    distance = abs(REFERENCE_CELSIUS - celsius) if celsius is not None else float("inf")
    return max(distance, SAME_CELSIUS), row["cycle"] or 0


def reference_of(cells, *, capacity):
    """Reference among cells of one type: the first marked one, else the largest, else None.

    Parameters
    ----------
    cells : list of cells with `marked`, in the order of the sheet.
    capacity : function, cell → its capacity [Ah].
    """
    marked = [cell for cell in cells if cell.marked]
    return marked[0] if marked else max(cells, key=capacity, default=None)


def _from_rests(curves, lower_cutoff_volt, state_of_health):
    """Basis from rests, or from long loads: one OCV curve per temperature, the slowest.

    All are on the SoC scale of the one nearest 25 °C.
    """
    ordered = sorted(curves, key=lambda c: (*first_choice(c), -_celsius(c), _load(c)))
    chosen = []
    for curve in ordered:
        as_warm = [c for c in ordered if same_temperature(_celsius(c), _celsius(curve))]
        slowest = min(as_warm, key=lambda c: (c["cycle"] or 0, _load(c)))
        chosen += [slowest] if slowest not in chosen else []
    capacity, source = (chosen[0][name] for name in ("capacity_ampere_hour", "capacity_source"))
    stated = source.startswith("rating")
    if not stated and chosen[0]["branches"] == "rests":
        source += f" (rests of {chosen[0]['test']})"
    scaled = [_on_scale(curve, capacity, lower_cutoff_volt) for curve in chosen]
    std = stated_std_ampere_hour(capacity, state_of_health) if stated else None
    return {"ocv": scaled} | sized(capacity, std, source)


def _load(curve):
    """Current of the loads between the rests [A], rounded so that equal loads compare."""
    sides = (curve["discharge_current_ampere"], curve["charge_current_ampere"])
    known = [abs(side) for side in sides if side is not None and np.isfinite(side)]
    largest = max(known, default=0.0)
    return float(f"{largest:.2g}")


# ASSUME: Tests whose rests make an OCV curve all begin at one SoC; the charge counted from there
# gives the SoC of each rest.
def _on_scale(curve, capacity, lower_cutoff_volt):
    """An OCV curve over the SoC of another capacity; below its lowest SoC on its end slope."""
    soc, volt = (np.asarray(curve[name], float) for name in ("soc", "ocv_volt"))
    if curve["capacity_ampere_hour"] == capacity:
        return curve
    ratio = capacity / curve["capacity_ampere_hour"]
    rescaled = 1 - (1 - soc) * ratio
    slope = (np.interp(0.05, soc, volt) - volt[0]) / 0.05
    floor = min(lower_cutoff_volt, volt[0])
    below = np.maximum(volt[0] + slope * rescaled, floor) + 1e-6 * soc
    low, high = curve["measured_soc"]
    return curve | {
        "ocv_volt": np.where(rescaled < 0, below, np.interp(rescaled, soc, volt)).tolist(),
        "measured_soc": [max(1 - (1 - low) / ratio, 0.0), 1 - (1 - high) / ratio],
    }


# ASSUME: A cell whose capacity was never measured holds what cells of its rating do, half to 1.15
# times the rating; a state of health in its sheet is right within 0.05.
def stated_std_ampere_hour(capacity_ampere_hour, state_of_health=None):
    """Standard deviation of a `stated_capacity` [Ah].

    Parameters
    ----------
    capacity_ampere_hour : as stated [Ah]. state_of_health : of the sheet [1], None where blank.
    """
    low, high = (-0.05, 0.05) if state_of_health else RATING_SHARE
    return capacity_ampere_hour * (high - low) / 12**0.5


def sized(capacity_ampere_hour, std_ampere_hour, source):
    """Capacity [Ah], its standard deviation [Ah] (None or NaN: not known) and its source."""
    std = None if std_ampere_hour is None or np.isnan(std_ampere_hour) else float(std_ampere_hour)
    return dict(zip(CAPACITY, (capacity_ampere_hour, std, source), strict=True))


def scale_in_words(basis):
    """By how much the SoC scale is in doubt where its record is, a sentence; "" where it is not.

    What the capacity is off, the SoC is off by the charge counted since the cell was full: half of
    it at half charge, which the OCV curve nearest 25 °C turns into a voltage.

    Parameters
    ----------
    basis : dict, from `checkups.basis`.
    """
    if not basis.get(DOUBT):
        return ""
    size, std, source = (basis.get(name) for name in CAPACITY)
    said = f"its SoC scale stands on a record in doubt ({source}: {basis[DOUBT]})"
    if not std:
        return f"{said}; by how much is not known"
    share, curve = std / size, curve_at(basis["ocv"], REFERENCE_CELSIUS)
    said += f", by {std:.2g} Ah ({share:.1%}): at half charge {share / 2:.1%} of SoC"
    if curve:
        ends = np.interp([0.5 - share / 2, 0.5 + share / 2], curve["soc"], curve["ocv_volt"])
        said += f" and {1e3 * (ends[1] - ends[0]) / 2:.2g} mV of open-circuit voltage"
    return said


RESTED = "rested_ampere_hour"
CAPACITY = ("capacity_ampere_hour", "capacity_std_ampere_hour", "capacity_source")
DOUBT = "capacity_doubt"  # what speaks against the record that the capacity is of, in words


def slow_capacity(curve, capacities):
    """Capacity of a slow test [Ah], without the drift where its directions differ: as `sized`, with
    its doubt.

    When empty it rests between the discharge's last voltage and the charge's first: what that gap
    moves along the discharge, the discharge may lack. The charge lacks what its rest is below full;
    what else it returns less than was taken, no end explains. Each is, as of even odds between none
    of it and all, part of the standard deviation.

    Parameters
    ----------
    curve : dict as of `OcvCurve`, and test. capacities : rows of the capacity stage, of which that
        of the test's discharge tells the standard deviation, that of its charge the rest after it.
    """
    out, back, closed = (
        curve[f"{name}_ampere_hour"] for name in ("capacity", "charge_capacity", "closed_capacity")
    )
    source = f"slow test {curve['test']}"
    if closed != out:
        source += f", between {out:.4g} Ah discharged and {back:.4g} Ah charged"
    own = {row["direction"]: row for row in capacities if row["test"] == curve["test"]}
    std = own.get("discharge", {}).get(CAPACITY[1], np.nan)
    rest_volt = own.get("charge", {}).get("rest_after_volt", np.nan)
    lost = 0.0 if back is None or np.isnan(back) else closed - back
    if closed == out and lost:
        below_full, beyond_empty = _soc_lacking(curve, rest_volt)
        lost -= min(max(lost, 0.0), below_full * out)
        lost = np.hypot(lost, beyond_empty * out)
    doubts = dict.fromkeys(filter(None, (row.get("doubt") for row in own.values())))
    return sized(closed, np.hypot(std, lost / np.sqrt(3)), source) | {DOUBT: "; ".join(doubts)}


def _soc_lacking(curve, rest_volt):
    """SoC [1] by which a slow test's charge ends below full, and its discharge may above empty.

    rest_volt : at which the cell rests after the charge [V], NaN where not known: none is told.
    """
    soc, discharge_volt = (np.asarray(curve[name], float) for name in ("soc", "discharge_volt"))
    below_full = 1.0 - np.interp(rest_volt, curve["ocv_volt"], soc)
    beyond_empty = np.interp(curve["charge_volt"][0], discharge_volt, soc)
    return np.nan_to_num(below_full), beyond_empty


def _own_capacity(capacities, lender, stated, state_of_health):
    rows = telling_capacity(capacities)
    if not rows:
        if not stated[0]:
            raise Refusal("no complete discharge, no slow test and no rating: no capacity is known")
        return sized(stated[0], stated_std_ampere_hour(stated[0], state_of_health), stated[1])
    row = min(rows, key=lambda row: (*first_choice(row), is_unsure(row), row["c_rate"]))
    row = min([other for other in rows if same_condition(row, other)], key=_youngest_rested)
    source, lent = capacity_in_words(row), lender.capacities if lender else []
    alike, doubt = [other for other in lent if same_condition(row, other)], row.get("doubt") or ""
    if not alike:
        return sized(row["capacity_ampere_hour"], row.get(CAPACITY[1]), source) | {DOUBT: doubt}
    young = min(lender.curves, key=first_choice)
    own = carried(row, min(alike, key=_youngest_rested), slow_capacity(young, lent), young)
    ratio = own[CAPACITY[0]] / row["capacity_ampere_hour"]
    return own | {
        DOUBT: doubt,
        CAPACITY[2]: f"{source}, carried to the slow rate as in {lender.cell} (×{ratio:.4f}"
        f"{own[CAPACITY[2]]})",
    }


def _youngest_rested(row):
    """Sort key of tests made alike: age, then one between rests, which tell what it left."""
    return row["cycle"] or 0, is_unsure(row), not np.isfinite(row.get(RESTED, np.nan))


# ASSUME: A cell loses the same share of its capacity to the rate as the cell or age that it is
# compared with, corrected by what both still hold after their rests.
def carried(row, other, slow, curve):
    """Slow capacity of a cell from its discharge at a rate, by another's discharge made alike.

    Without more, the ratio of slow to fast capacity is that of the other. But a cell of a higher
    resistance meets its cut-off earlier, and is held less full: what each moved from rest to rest,
    over the SoC between these rests, tells its own, where both rested. The rests of both relax
    alike, so only the ratio of the two counts. Where they claim more than the whole loss to rate
    (on a plateau), they tell nothing. The standard deviation holds each one's own, and, as of even
    odds between none of it and all, what the rests changed; without rests the whole loss to rate.

    Parameters
    ----------
    row, other : dict, rows of the capacity stage made alike (`same_condition`).
    slow : dict as of `sized`, slow capacity of the other. curve : dict, OCV of both, or None.

    Returns
    -------
    capacity : dict as of `sized`; the source only says whether rests told it.
    """
    ratio = slow[CAPACITY[0]] / other[CAPACITY[0]]
    scales = [_scale_of_rests(one, curve) for one in (row, other)]
    own = ratio * scales[0] / scales[1]
    told = abs(own - ratio) < abs(ratio - 1)  # not where any is NaN
    change = own - ratio if told else ratio - 1
    sizes = (RESTED, "rested_std_ampere_hour") if told else CAPACITY[:2]
    pairs = [(row, *sizes), (other, *sizes), (slow, *CAPACITY[:2])]
    shares = [(one.get(std) or 0.0) / one[size] for one, size, std in pairs]
    ratio = own if told else ratio
    size = row[CAPACITY[0]] * ratio
    std = size * float(np.linalg.norm(np.nan_to_num([*shares, change / ratio / np.sqrt(3)])))
    return sized(size, std, ", by the rests of both" if told else "")


def _scale_of_rests(row, curve):
    """Charge per SoC between the rests of a row of the capacity stage, over its capacity [1]."""
    volts = [row.get(f"rest_{side}_volt") for side in ("before", "after")]
    if None in volts or not curve:
        return np.nan
    passed = abs(np.subtract(*np.interp(volts, curve["ocv_volt"], curve["soc"])))
    return row[RESTED] / max(passed, 1e-9) / row[CAPACITY[0]]


def same_condition(row, other):
    """Whether two rows have one direction, rate and temperature.

    Parameters
    ----------
    row, other : dict, rows of the capacity stage with ambient_temperature_celsius.
    """
    return (
        other["direction"] == row["direction"]
        and same_rate(other["c_rate"], row["c_rate"])
        and same_temperature(_celsius(row), _celsius(other))
    )


def at_cycle(basis, cycle):
    """The basis as it is at a cycle: capacity and OCV of that check-up.

    Within 5 cycles of a check-up they are that one's. Between two check-ups the capacity is
    interpolated over cycles and the curves are those of the nearer one; after the last one
    they are the last one's. What that may be wrong by is in `capacity_std_ampere_hour`: the line's
    change to the nearer check-up, as of even odds between none of it and all.

    Parameters
    ----------
    basis : dict, from `checkups.basis`, or a model that holds the same.
    cycle : of the test; None as 0.

    Returns
    -------
    basis : dict; the same one where it has no check-ups.
    """
    checkups = basis.get("checkups")
    if not checkups:
        return basis
    age = cycle or 0.0
    nearest = min(checkups, key=lambda checkup: abs(checkup["cycle"] - age))
    content = basis | {"ocv": nearest.get("ocv") or basis["ocv"]}
    if -SAME_CHECKUP_CYCLES <= age - nearest["cycle"] <= SAME_CHECKUP_CYCLES:
        return content | {name: nearest[name] for name in CAPACITY}
    return content | _between(checkups, nearest, age)


def basis_at(basis, cycle):
    """The basis of a cell at one of its check-ups: that capacity and OCV, for a model of that age.

    cycle : of the check-up.

    Returns dict, content as of `basis`, without check-ups. Source: docs/state-of-charge.md.
    """
    return at_cycle(inputs.basis(basis), cycle) | {"checkups": []}


def capacities_of_checkups(basis):
    """Check-ups of a basis without their curves, for a model of the cell, which has its own.

    Parameters
    ----------
    basis : dict, from `checkups.basis`.
    """
    return [
        {name: value for name, value in checkup.items() if not name.startswith("ocv")}
        for checkup in basis.get("checkups", [])
    ]


def _between(checkups, nearest, age):
    """Capacity at an age between check-ups, as `sized`."""
    cycles = [checkup["cycle"] for checkup in checkups]
    sizes = [checkup["capacity_ampere_hour"] for checkup in checkups]
    after = int(np.clip(np.searchsorted(cycles, age), 1, len(cycles) - 1))
    rate = (sizes[after] - sizes[after - 1]) / (cycles[after] - cycles[after - 1])
    changed = abs(rate * (age - nearest["cycle"])) / np.sqrt(3)
    std = float(np.hypot(changed, nearest["capacity_std_ampere_hour"] or 0.0))
    size = float(np.interp(age, cycles, sizes))
    place = f"between the check-ups at {cycles[after - 1]:g} and {cycles[after]:g}"
    if age < cycles[0]:
        place = f"before the first check-up at {cycles[0]:g}"
    elif age > cycles[-1]:
        place = f"after the last check-up at {cycles[-1]:g}"
    return sized(size, std, f"cycle {age:g} lies {place}: {size:.4g} ± {std:.2g} Ah")


def soc_of(series, basis, facts, cell):
    """State of charge over a record of a cell, on the scale of its basis.

    Parameters
    ----------
    series : dict of (n,) columns of a clean series.
    basis : dict, from `checkups.basis`.
    facts : TestFacts, of which the stated SoC at the start, the chamber's temperature and the cycle
        count.
    cell : CellFacts, of which the cut-off voltages count.

    Returns
    -------
    anchored : Anchored, soc (n,) and in words what it is counted from.

    Raises
    ------
    Refusal
        As `anchor.soc_series`.
    """
    basis = at_cycle(basis, facts.cycle)
    anchored = soc_series(
        series["charge_ampere_hour"],
        series["current_ampere"],
        series["voltage_volt"],
        capacity_ampere_hour=basis["capacity_ampere_hour"],
        lower_cutoff_volt=cell.lower_cutoff_volt,
        upper_cutoff_volt=cell.upper_cutoff_volt,
        soc_at_start=facts.soc,
        curve=curve_at(basis["ocv"], facts.ambient_temperature_celsius),
        test_time_second=series.get("test_time_second"),
    )
    if not basis.get("checkups"):
        return anchored
    # Of a cell with several check-ups it is said to which capacity its SoC refers.
    size = f"{basis['capacity_ampere_hour']:.4g} Ah ({basis['capacity_source']})"
    return anchored._replace(anchor=f"{anchored.anchor}; of {size}")


def on_scale(anchored, basis):
    """The same SoC, refused where it leaves the scale of its basis.

    Parameters
    ----------
    anchored : Anchored. basis : dict, at the age of the record.

    Raises
    ------
    Refusal : as `anchor.refuse_impossible_soc`.
    """
    size, source = basis["capacity_ampere_hour"], basis.get("capacity_source", "of the model")
    ends = float(np.min(anchored.soc)), float(np.max(anchored.soc))
    refuse_impossible_soc(*ends, anchored.anchor, capacity_ampere_hour=size, source=source)
    return anchored


def state_of_charge(series, basis, test, cell):
    """State of charge over a record of a cell, NaN with the reason where it cannot be known.

    For results that need no SoC, such as the resistance of a pulse. One that leaves −0.1 to 1.1 is
    not known: its anchor, its charge and the capacity contradict each other (`on_scale`).

    Returns `records.anchor.Anchored`: soc (n,) [1], NaN where it cannot be known, and in words what
    it is counted from.
    """
    columns, facts = inputs.columns(series, *inputs.COUNTED), inputs.test_facts(test)
    basis = inputs.basis(basis)
    try:
        anchored = soc_of(columns, basis, facts, inputs.cell_facts(cell))
        return on_scale(anchored, at_cycle(basis, facts.cycle))
    except Refusal as refusal:
        unknown = np.full(len(columns["test_time_second"]), np.nan)
        return Anchored(unknown, f"not known: {refusal}")
