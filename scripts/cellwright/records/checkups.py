"""Basis of the SoC of a cell that ages: the capacity and the OCV of each of its check-ups."""

import numpy as np

from cellwright.records import inputs
from cellwright.records.anchor import is_unsure, telling_capacity, tells_repeats
from cellwright.records.basis import (
    CAPACITY,
    basis_of_one_age,
    carried,
    curve_at,
    first_choice,
    same_condition,
    slow_capacity,
)
from cellwright.records.conditions import SAME_CHECKUP_CYCLES, checkups_of, same_temperature
from cellwright.result import Result


def basis(cell, curves=(), capacities=(), lenders=(), *, rests=(), shifts=()):
    """The capacity and OCV curves that the SoC of a cell refers to, its own or borrowed.

    Over a life each check-up has its own capacity and curves, so that SoC 1 stays "full".

    1. Discharges and slow tests whose cycles lie within 5 of each other make one check-up; a blank
    cycle is 0. 2. A later one counts where it can be compared with the first: it has a slow
    test at its temperature, or a discharge at the rate and temperature of one of the first.
    Every other test belongs to the check-up nearest in cycles. 3. The first check-up gives the
    basis of the cell, as `basis.basis_of_one_age` says. 4. The capacity of a later one is that of
    its own slow test; else it is carried from the first one by the same discharge since
    (`basis.carried`). 5. Its OCV curves are those of its slow tests, else those of the rests of its
    pulse tests, else those of the first check-up with their shift since, else those of the
    check-up before it, as its text says.

    curves : (test, result of `ocv`) each.
    lenders : result of `lender` of each cell of the same type.
    rests : (test, result of `ocv_from_rests`, or of `ocv_from_load`) each.
    shifts : result of `ocv_shifts`, or its rows.

    Returns content: cell, capacity_ampere_hour, capacity_std_ampere_hour [Ah] (None: nothing tells
    it), capacity_source, borrowed_from, ocv, the curves over SoC [1], and checkups, the same for
    each of several check-ups; curves: one row a curve and SoC. Raises Refusal: no capacity test, no
    slow test and no rating.
    Source: docs/state-of-charge.md.
    """
    facts, shifts = inputs.cell_facts(cell), inputs.rows(shifts)
    curves, rests = (inputs.entries(table, inputs.curves_of) for table in (curves, rests))
    limits = {
        "rated_capacity_ampere_hour": facts.rated_capacity_ampere_hour,
        "state_of_health": facts.state_of_health,
        "lower_cutoff_volt": facts.lower_cutoff_volt,
    }
    content = _of_life(
        facts.cell, curves, inputs.entries(capacities), lenders, rests, shifts, limits
    )
    rows = [
        {name: curve[name] for name in ("test", "ambient_temperature_celsius")}
        | {"soc": soc, "ocv_volt": volt}
        for curve in content["ocv"]
        for soc, volt in zip(curve["soc"], curve["ocv_volt"], strict=True)
    ]
    return Result({"curves": rows}, content, tuple(basis_in_words(content)))


def basis_in_words(basis):
    """Sentences on where capacity [Ah] and OCV come from; with ± where over 3 % of it is open."""
    size = f"{basis['capacity_ampere_hour']:.4g}"
    if is_unsure(basis):
        size += f" ± {basis['capacity_std_ampere_hour']:.2g}"
    notes = [f"SoC refers to {size} Ah: {basis['capacity_source']}"]
    if basis["borrowed_from"]:
        notes.append(f"OCV borrowed from {basis['borrowed_from']}: no usable slow test of its own")
    elif not basis["ocv"]:
        notes.append("no OCV: no slow test of its own, and no cell of its type has one")
    notes += [
        f"check-up at cycle {checkup['cycle']:g}: SoC refers to "
        f"{checkup['capacity_ampere_hour']:.4g} Ah: {checkup['capacity_source']}; OCV "
        f"{checkup['ocv_source']}"
        for checkup in basis.get("checkups", [])[1:]
    ]
    tests = [curve["test"] for curve in basis["ocv"] if curve["branches"] == "rests"]
    if tests and not basis["borrowed_from"]:
        notes.append(
            f"OCV from the rests of {', '.join(tests)}: no slow test of its or of its type"
        )
    return notes


def _of_life(cell, curves, capacities, lenders, rests, shifts, limits):
    """Content of a basis with the capacity and the OCV of each of its check-ups."""
    capacities = telling_capacity(capacities)
    kinds = (curves, capacities)
    cycles = sorted(set(checkups_of([row["cycle"] for rows in kinds for row in rows])))
    alike = [
        cycle for cycle in cycles[1:] if _comparable(*[_within(k, cycles, cycle) for k in kinds])
    ]
    cycles = [*cycles[:1], *alike]
    first, *others = [
        tuple(_nearest(rows, cycles, cycle) for rows in (curves, capacities, rests))
        for cycle in cycles or [0]
    ]
    content = basis_of_one_age(cell, *first[:2], lenders, rests=first[2], **limits)
    if not others:
        return content | {"checkups": []}
    checkups = [_first_checkup(cycles[0], content, *first[:2])]
    for cycle, group in zip(cycles[1:], others, strict=True):
        of_cycle = [row for row in shifts if abs(row["cycle"] - cycle) <= SAME_CHECKUP_CYCLES]
        checkups.append(_later(cycle, (*group, of_cycle), first[1], checkups, limits))
    return content | {"checkups": checkups}


def _within(rows, cycles, cycle):
    """Rows of the first check-up, and those of the one at `cycle`."""
    ages = [row["cycle"] or 0 for row in rows]
    return [
        [row for row, age in zip(rows, ages, strict=True) if 0 <= age - of <= SAME_CHECKUP_CYCLES]
        for of in (cycles[0], cycle)
    ]


def _comparable(curves, discharges):
    """Whether a check-up can be compared with the first; each is a pair (first, it)."""
    young = min([*curves[0], *discharges[0]], key=first_choice)
    if any(_as_warm(curve, young) for curve in curves[1]):
        return True
    return any(same_condition(row, old) for row in discharges[1] for old in discharges[0])


def _as_warm(row, other):
    return same_temperature(*(r["ambient_temperature_celsius"] for r in (row, other)))


def _nearest(rows, cycles, cycle):
    """Rows of which `cycle` is the nearest of the check-ups' cycles."""
    if len(cycles) < 2:
        return rows
    ages = [row["cycle"] or 0 for row in rows]
    nearest = [cycles[int(np.argmin(np.abs(np.array(cycles) - age)))] for age in ages]
    return [row for row, of in zip(rows, nearest, strict=True) if of == cycle]


def _first_checkup(cycle, content, curves, capacities):
    """The first check-up, whose numbers are those of the basis itself."""
    chosen = min([*curves, *capacities], key=first_choice)
    return {
        "cycle": cycle,
        "ambient_temperature_celsius": chosen["ambient_temperature_celsius"],
        **{name: content[name] for name in CAPACITY},
        "ocv": content["ocv"],
        "ocv_source": "of this check-up" if not content["borrowed_from"] else "borrowed",
    }


def repeat_std(capacities, size):
    """Standard deviation of a capacity that repeats of discharges show [Ah]; None without repeats.

    Parameters
    ----------
    capacities : list of dict with capacity_ampere_hour and capacity_std_ampere_hour [Ah].
    size : the capacity [Ah].
    """
    shares = [
        row["capacity_std_ampere_hour"] / row["capacity_ampere_hour"]
        for row in capacities
        if tells_repeats(row)
    ]
    return float(np.sqrt(np.mean(np.square(shares))) * size) if shares else None


def _later(cycle, group, first_capacities, before, limits):
    """A later check-up from its (curves, capacities, rests, shifts) and those before it."""
    curves, capacities, rests, shifts = group
    content = {
        "cycle": cycle,
        "ambient_temperature_celsius": before[0]["ambient_temperature_celsius"],
        **_later_capacity(curves, capacities, first_capacities, before[0]),
    }
    if curves:
        names = ", ".join(curve["test"] for curve in curves)
        return content | {"ocv": curves, "ocv_source": f"slow test {names}"}
    if rests:
        found = basis_of_one_age("", [], [], [], rests=rests, **limits)
        names = ", ".join(curve["test"] for curve in found["ocv"])
        return content | {"ocv": found["ocv"], "ocv_source": f"rests of {names}"}
    if shifts and before[0]["ocv"]:
        std = float(np.sqrt(np.mean([row["shift_std_volt"] ** 2 for row in shifts])))
        words = f"carried over from cycle {before[0]['cycle']:g} with its shift since, "
        words += f"± {1e3 * std:.1f} mV"
        shifted = [_shifted(curve, shifts) for curve in before[0]["ocv"]]
        return content | {"ocv": shifted, "ocv_source": words}
    if not before[-1]["ocv"]:
        return content | {"ocv": [], "ocv_source": "none, nor at any check-up before it"}
    # ASSUME: A check-up without any of these has the OCV over SoC of the one before it.
    words = f"carried over from cycle {before[-1]['cycle']:g}; its shift since is not known"
    return content | {"ocv": before[-1]["ocv"], "ocv_source": words}


def _shifted(curve, shifts):
    """An OCV curve with its shift over SoC added, still rising."""
    rows = sorted(shifts, key=lambda row: row["soc"])
    soc = np.asarray(curve["soc"], float)
    moved = np.interp(soc, [row["soc"] for row in rows], [row["shift_volt"] for row in rows])
    volt = np.maximum.accumulate(np.asarray(curve["ocv_volt"], float) + moved) + 1e-6 * soc
    return curve | {"ocv_volt": volt.tolist()}


def _later_capacity(curves, capacities, first_capacities, first):
    """Capacity of a later check-up, as `basis.sized`: of its slow test, else carried from then."""
    if any(_as_warm(curve, first) for curve in curves):
        return slow_capacity(min(curves, key=first_choice), capacities)
    own = sorted(capacities, key=lambda row: (*first_choice(row), row["c_rate"]))
    pairs = [(row, old) for row in own for old in first_capacities if same_condition(row, old)]
    row, old = pairs[0]
    share = row["capacity_ampere_hour"] / old["capacity_ampere_hour"]
    found = carried(row, old, first, curve_at(first["ocv"], row["ambient_temperature_celsius"]))
    words = f"{row['direction']} of {row['test']} at {row['c_rate']:.2g}C, {share:.4f} of that of "
    words += f"{old['test']}, times the capacity then{found['capacity_source']}"
    return found | {"capacity_source": words}
