"""What a check-up says of a cell in the terms of standards: ratings, and their change since new."""

import numpy as np

from cellwright.health.fleet import mean_over_soc
from cellwright.laws.points import (
    doubts_of_test,
    grouped,
    pulses_of_kind,
)
from cellwright.messages import doubt_columns
from cellwright.records import inputs
from cellwright.records.conditions import checkups_of, grouped_alike, same_rate, same_temperature
from cellwright.records.facts import stated_capacity
from cellwright.refusal import Refusal
from cellwright.result import Result

SAME_CAPACITY = 0.03  # of a capacity: what differs more is not one check-up [1]
STATED = "stated in cells.tsv"
# ASSUME: Measured capacities repeat within 0.2 %: their least standard deviation from test to test.
REPEAT_SHARE = 0.002
CHANGES = {
    "capacity_ampere_hour": "capacity_change",
    "energy_watt_hour": "energy_change",
    "resistance_10s_ohm": "resistance_change",
    "discharge_power_50_watt": "discharge_power_change",
    "charge_power_50_watt": "charge_power_change",
    "round_trip_efficiency": "round_trip_efficiency_change",
}


def check_ups(capacities, resistances, cell, throughputs=()):
    """Ratings of every check-up of a cell, and resistance over SoC with its growth.

    1. Tests within 5 cycles of the sheet are one check-up; blank is new. Where tests were made at
    several temperatures, those at the one that most check-ups have count. 2. The capacity that
    counts is at the rate that most check-ups have, discharges before charges, the slowest first.
    3. Power at a state of charge: what the cell gives at its lower cut-off (takes at its upper
    one) at the end of 10 s, U_low (U_rest − U_low)/R, U_high (U_high − U_rest)/R, with the rest
    voltage and the resistance 10 s into a pulse interpolated between pulses. 4. Round trip: ratio
    of mean voltages of a discharge and a charge of one test, for charges are rarely closed to a
    percent. 5. Where no test tells the capacity of the first check-up, a state of health that the
    sheet states does.

    throughputs : pairs (cycle, discharged up to there [Ah]) of its ageing records.

    Returns rows, one a check-up, each with its change since the first one, NaN where tests do not
    tell a rating; growth: one a pulse. Raises Refusal: no capacity and no resistance.
    Source: power from pulses: INL/EXT-07-12536, FreedomCAR Battery Test Manual (2008), 4.3;
    quantities: Regulation (EU) 2023/1542, annex IV, part A; docs/health.md.
    """
    sizes, pulses = inputs.entries(capacities), inputs.entries(resistances)
    rows, notes = ratings_of(sizes, pulses, inputs.cell_facts(cell), throughputs)
    # Ratings stand without pulses as well: a refusal of these is a note.
    try:
        growth = resistance_growth(pulses, sizes)
    except Refusal as refusal:
        growth, notes = [], [*notes, str(refusal)]
    return Result({"rows": rows, "growth": growth}, notes=tuple(notes))


def ratings_of(capacities, resistances, facts, throughputs):
    """Rows of `check_ups` and notes, from rows of capacities and resistances.

    facts : CellFacts. throughputs : as of `check_ups`.
    """
    rated = facts.rated_capacity_ampere_hour
    capacities, resistances, notes = _at_one_temperature(capacities, resistances)
    cycles = sorted({_cycle(row) for row in [*capacities, *resistances]})
    if not cycles:
        raise Refusal("no capacity and no resistance of any check-up")
    counted, doubts = _comparable(capacities)
    rows = []
    for cycle in cycles:
        tests = [row for row in capacities if _cycle(row) == cycle]
        pulses = [row for row in resistances if _cycle(row) == cycle]
        rows.append(
            {"cycle": cycle}
            | _capacity(counted.get(cycle))
            | {"soh": np.nan, "soh_std": np.nan, "soh_reference": ""}
            | _efficiency(tests, counted.get(cycle))
            | _power(pulses, facts.lower_cutoff_volt, facts.upper_cutoff_volt)
            | {"throughput_ampere_hour": _throughput(throughputs, cycle)}
            | {"doubts": _doubts_of([counted.get(cycle), *pulses])}
        )
    notes += _as_stated(rows[0], doubts, rated, facts.state_of_health)
    found = []
    for row in rows:
        reason = doubts.get(row["cycle"], "")
        soh, reason = _soh(row, rows[0], rated, reason)
        changes = {new: float(row[name] / rows[0][name] - 1) for name, new in CHANGES.items()}
        doubts_of_both = doubt_columns([*row["doubts"], *rows[0]["doubts"]])
        kept = {name: value for name, value in row.items() if name != "doubts"}
        found.append(kept | soh | changes | {"reason": reason} | doubts_of_both)
    return found, notes


def _doubts_of(rows):
    """What speaks against rows of tests (None: no such row), each with its test: list of Said."""
    return [one for row in rows if row for one in doubts_of_test(row)]


def _cycle(row):
    return float(row["cycle"] or 0.0)


def _at_one_temperature(capacities, resistances):
    """Rows at the temperature that most check-ups have, and what was left out."""
    both = [*capacities, *resistances]
    first = checkups_of([_cycle(row) for row in both])
    both = [row | {"cycle": cycle} for row, cycle in zip(both, first, strict=True)]
    capacities, resistances = both[: len(capacities)], both[len(capacities) :]
    met = {}
    for row in both:
        celsius = row["ambient_temperature_celsius"]
        if celsius is not None:
            met.setdefault(celsius, set()).add(_cycle(row))
    if not met or same_temperature(min(met), max(met)):
        return capacities, resistances, []
    # Of temperatures as frequent the one nearest 25 °C, where most is known.
    usual = max(met, key=lambda celsius: (len(met[celsius]), -abs(celsius - 25.0)))

    def kept(rows):
        known = [row for row in rows if row["ambient_temperature_celsius"] is not None]
        # Tests without any stated temperature compare among themselves.
        near = [row for row in known if same_temperature(row["ambient_temperature_celsius"], usual)]
        return near if known else rows

    other = ", ".join(f"{c:g}" for c in sorted(met) if not same_temperature(c, usual))
    note = f"check-ups are compared at {usual:g} °C; tests at {other} °C are left out"
    return kept(capacities), kept(resistances), [note]


def _comparable(capacities):
    """Of each check-up the capacity row at the rate and direction that most have, and doubts."""
    sized = [row for row in capacities if row["capacity_ampere_hour"] and row["c_rate"]]
    kinds = grouped_alike(sized, _one_kind)
    if not kinds:
        return {}, {}
    usual = max(
        kinds,
        key=lambda rows: (
            len({_cycle(row) for row in rows}),
            rows[0]["direction"] == "discharge",
            -rows[0]["c_rate"],
        ),
    )
    by_cycle = grouped(usual, _cycle)
    doubts = {cycle: _doubt(cycle, rows) for cycle, rows in by_cycle.items()}
    return {cycle: rows[0] for cycle, rows in by_cycle.items() if not doubts[cycle]}, doubts


def _one_kind(first, row):
    same_direction = first["direction"] == row["direction"]
    return same_direction and same_rate(first["c_rate"], row["c_rate"])


def _doubt(cycle, rows):
    """Why tests of one check-up cannot be of one; "" where they can."""
    sizes = [row["capacity_ampere_hour"] for row in rows]
    if max(sizes) - min(sizes) <= SAME_CAPACITY * max(sizes):
        return ""
    names, listed = ", ".join(row["test"] for row in rows), ", ".join(f"{s:.4g}" for s in sizes)
    return (
        f"{names} stand at cycle {cycle:g} and give {listed} Ah: not one check-up; is their "
        "`cycle` blank or wrong?"
    )


def _capacity(row):
    """Capacity of a check-up and the facts of its test."""
    names = ("ambient_temperature_celsius", "c_rate", "direction")
    names += ("capacity_ampere_hour", "capacity_std_ampere_hour")
    if row is None:
        return dict.fromkeys(names, np.nan) | {"direction": ""}
    std = row["capacity_std_ampere_hour"]
    size, repeats = row["capacity_ampere_hour"], row["repeats"]
    spread = std / np.sqrt(repeats) if std is not None and np.isfinite(std) else 0.0
    celsius = row["ambient_temperature_celsius"]
    celsius = np.nan if celsius is None else celsius
    size_std = float(max(spread, REPEAT_SHARE * size))
    return dict(zip(names, (celsius, row["c_rate"], row["direction"], size, size_std), strict=True))


def _as_stated(first, doubts, rated, state_of_health):
    """Fill in the capacity of the first check-up where only the sheet tells it; notes."""
    stated, source = stated_capacity(rated, state_of_health)
    if not (stated and state_of_health):
        return []
    measured = first["capacity_ampere_hour"]
    if not np.isfinite(measured):
        first |= {"capacity_ampere_hour": stated, "soh_reference": STATED}
        doubts[first["cycle"]] = ""
        return [f"capacity of the first check-up: {stated:.4g} Ah, {source}; no test measures it"]
    # What was measured goes before what somebody stated.
    if abs(measured / stated - 1) > SAME_CAPACITY:
        return [
            f"cells.tsv states a state of health of {state_of_health:g}, {stated:.4g} Ah; the "
            f"first check-up measures {measured:.4g} Ah at {first['c_rate']:.2g}C, which counts"
        ]
    return []


def _efficiency(tests, counted):
    """Energy of the discharge, and round-trip efficiency at equal charge.

    Of the test whose rate is nearest to that of the capacity that counts.
    """
    pairs = {}
    for row in tests:
        pairs.setdefault(row["test"], {}).setdefault(row["direction"], row)
    whole = [pair for pair in pairs.values() if "discharge" in pair]
    if not whole:
        return {"energy_watt_hour": np.nan, "round_trip_efficiency": np.nan}
    rate = counted["c_rate"] if counted else 0.5
    # Efficiency falls with the rate: that of the capacity that counts.
    pair = min(whole, key=lambda one: abs(np.log(one["discharge"]["c_rate"] / rate)))
    discharge, charge = pair["discharge"], pair.get("charge")
    efficiency = np.nan
    if charge:
        mean = [
            row["energy_watt_hour"] / row["capacity_ampere_hour"] for row in (discharge, charge)
        ]
        # Mean voltages, for a charge is rarely closed to a percent of charge.
        efficiency = mean[0] / mean[1]
    return {"energy_watt_hour": discharge["energy_watt_hour"], "round_trip_efficiency": efficiency}


def _power(pulses, low, high):
    """Resistances at 50 % SoC and powers at 80, 50 and 20 %; NaN where pulses do not reach."""
    found = {"resistance_first_ohm": _at(pulses, "discharge", 0, 0.5)[0]}
    found["resistance_10s_ohm"] = _at(pulses, "discharge", 10, 0.5)[0]
    for delay, name in ((0, "resistance_mean_ohm"), (1, "resistance_mean_1s_ohm")):
        course = _course(pulses, "discharge", delay)
        socs, ohms = ([row[key] for row in course] for key in ("soc", "resistance_ohm"))
        found[name] = mean_over_soc(socs, ohms)
    first = [row["actual_delay_second"] for row in _course(pulses, "discharge", 0)]
    found["first_delay_second"] = float(np.median(first)) if first else np.nan
    for direction, limit, sign in (("discharge", low, 1), ("charge", high, -1)):
        for soc in (0.8, 0.5, 0.2):
            resistance, rest = _at(pulses, direction, 10, soc)
            power = np.nan if limit is None else limit * sign * (rest - limit) / resistance
            found[f"{direction}_power_{100 * soc:.0f}_watt"] = power
    return found


def _at(pulses, direction, delay, soc):
    """Resistance [Ω] and rest voltage [V] at a SoC, between the nearest pulses; NaN beyond them."""
    rows = _course(pulses, direction, delay)
    if len(rows) < 2:
        return np.nan, np.nan
    socs = np.array([row["soc"] for row in rows])
    after = int(np.searchsorted(socs, soc))
    # Pulses each 30 % of SoC or closer tell what lies between them.
    if not 0 < after < len(socs) or min(abs(socs - soc)) > 0.15:
        return np.nan, np.nan
    return tuple(
        float(np.interp(soc, socs, [row[name] for row in rows]))
        for name in ("resistance_ohm", "voltage_before_volt")
    )


def _course(pulses, direction, delay):
    """Pulses of one direction and delay whose SoC is known, by SoC."""
    return sorted(pulses_of_kind(pulses, direction, delay), key=lambda row: row["soc"])


def _throughput(throughputs, cycle):
    """Charge discharged up to a cycle [Ah]; NaN where no ageing record tells it."""
    if cycle == 0:
        return 0.0
    reached = [size for at, size in throughputs if at <= cycle + 1]
    beyond = any(at >= cycle - 1 for at, _ in throughputs)
    return float(max(reached)) if reached and beyond else np.nan


def _soh(row, first, rated, reason):
    """State of health of a check-up with what it refers to, and why it is not known."""
    own, fresh = row["capacity_ampere_hour"], first["capacity_ampere_hour"]
    if row["soh_reference"] == STATED:
        # How well the sheet's number is known it does not say.
        return {"soh": own / rated, "soh_std": np.nan}, reason
    reference, word = (fresh, "first check-up") if first["cycle"] == 0 else (rated, "rating")
    if first["soh_reference"] == STATED:  # the rate of that capacity is not known
        reference, word = rated, "rating"
    if not reason and not np.isfinite(own):
        reason = "no capacity at the rate and direction that the other check-ups have"
    elif not reason and (reference is None or not np.isfinite(reference)):
        reason, word = "neither a fresh capacity nor a rating: state of health not knowable", ""
    soh = std = np.nan
    if not reason:
        soh = own / reference
        # Over a measured capacity both scatter; the first check-up is what it refers to.
        std = soh * row["capacity_std_ampere_hour"] / own
        std *= np.sqrt(2) if word == "first check-up" else 1.0
        std = 0.0 if row is first and first["cycle"] == 0 else std
    return {"soh": soh, "soh_std": std, "soh_reference": word}, reason


def resistance_growth(resistances, capacities=()):
    """Resistance over SoC at every check-up, and its growth since the first one.

    Parameters
    ----------
    resistances : rows of stage `resistance` with cycle and ambient_temperature_celsius.
    capacities : rows of stage `capacity` of the same cell: check-ups and their temperature are then
        those of `check_ups`.

    Returns
    -------
    rows : list of dict as of stage `resistance_growth`; the first check-up's resistance is
        interpolated over SoC between its pulses, no further, so that its factor may be NaN.

    Raises
    ------
    Refusal : no pulse with a known SoC.

    Source: thesis 4.3 (fourfold at the end of life).
    """
    _, rows, _ = _at_one_temperature(list(capacities), resistances)
    by_cycle, found = sorted(grouped(rows, _cycle).items()), []
    for kind in sorted({(row["direction"], row["delay_second"]) for row in rows}, reverse=True):
        courses = [(cycle, _course(pulses, *kind)) for cycle, pulses in by_cycle]
        fresh = courses[0][1]
        unsure = _doubts_of(fresh)
        found += [_growth(cycle, row, fresh, unsure) for cycle, course in courses for row in course]
    if not found:
        raise Refusal("no pulse of any check-up has a known state of charge")
    return found


def _growth(cycle, row, fresh, unsure):
    """One pulse beside the first check-up's resistance at its SoC, of which `unsure` is said."""
    socs = [other["soc"] for other in fresh]
    factor, std = np.nan, np.nan
    if fresh and socs[0] - 0.02 <= row["soc"] <= socs[-1] + 0.02:
        base = np.interp(row["soc"], socs, [other["resistance_ohm"] for other in fresh])
        base_std = np.interp(row["soc"], socs, [other["resistance_std_ohm"] for other in fresh])
        factor = row["resistance_ohm"] / base
        std = factor * np.hypot(row["resistance_std_ohm"] / row["resistance_ohm"], base_std / base)
    return {
        "cycle": cycle,
        "direction": row["direction"],
        "delay_second": float(row["delay_second"]),
        "soc": row["soc"],
        "resistance_ohm": row["resistance_ohm"],
        "factor": float(factor),
        "factor_std": float(std),
        **doubt_columns([*_doubts_of([row]), *unsure]),
    }
