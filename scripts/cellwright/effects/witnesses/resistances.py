"""What pulses and impedance spectra tell of resistances: over SoC, temperature, direction, rate.

Pulses and spectra are read as the tables of the results have them, a dict a row.
"""

from collections import Counter
from itertools import pairwise

import numpy as np

from cellwright.effects.base import TAU_SECOND
from cellwright.effects.witnesses.statement import (
    FACTOR,
    LEAST_VOLT,
    Measured,
    celsius_of,
    cycle_of,
    is_material,
    silent,
    spread,
)
from cellwright.numerics.lines import FARADAY, GAS_CONSTANT, ZERO_CELSIUS_KELVIN
from cellwright.records.conditions import REFERENCE_CELSIUS, SAME_CELSIUS, same_rate

SOC_ENDS = (0.1, 0.9)
SOC_SPAN = 0.5  # least range of SoC over which a course is read
LEVELS = (0.2, 0.5, 0.8)  # of SoC at which temperatures are compared
ROOM_KELVIN = 8.0  # from 25 °C, within which directions and rates are compared
RATES_APART = 2.0  # ratio of two rates whose pulses are compared
# ASSUME: Charge transfer follows Butler–Volmer with a transfer coefficient of one half.
THERMAL_VOLT = GAS_CONSTANT * (25.0 + ZERO_CELSIUS_KELVIN) / FARADAY
OHMIC, RELAXING, ENERGY = "ohmic_over_soc", "relaxing_over_soc", "activation_energy"
TRANSFER, WITH_ARCS = "r_charge_transfer_ohm", "r_before_diffusion_ohm"  # columns of spectra
DIRECTIONS, RATES = "charge_over_discharge", "large_over_small"


def of_pulses(rows, *, capacity_ampere_hour):
    """What pulses tell of the resistance.

    Parameters
    ----------
    rows : list of dict, of the table of pulse resistances of one cell.
    capacity_ampere_hour : of the cell, its rated current is that of 1C.

    Returns
    -------
    measured : list of Measured: ohmic resistance over SoC, what builds up after it over SoC, over
        temperature, between directions, between rates.
    """
    rows = [row for row in _earliest(rows) if _known(row, "soc", "resistance_ohm")]
    rows = [row for row in rows if row["direction"] in ("discharge", "charge")]
    courses = _courses(rows)
    if not courses:
        read = (OHMIC, RELAXING, ENERGY, DIRECTIONS)
        return [silent("pulses", quantity, "no pulses of known SoC") for quantity in read]
    begin, end = _delays(rows)
    first = {key: one for key, one in courses.items() if key[-1] == begin}
    ampere, delay = capacity_ampere_hour, f"resistance {begin:g} s into the pulse"
    what = f"what a pulse builds up from {begin:g} to {end:g} s,"
    building = _differences(courses, begin, end)
    return [
        _over_soc("pulses", OHMIC, delay, first, ampere),
        _over_soc("pulses", RELAXING, what, building, ampere),
        _over_temperature("pulses", "resistance in pulses", courses),
        _directions(first, ampere),
        _rates(first, ampere),
    ]


def of_spectra(rows, *, capacity_ampere_hour):
    """What impedance spectra tell of the resistance.

    An arc that is over before the plain model's RC pairs begin (2 s) is part of its R0; a slower
    one is part of what relaxes. Its charge transfer tells, after Butler–Volmer, by how much the
    resistance falls under load.

    Parameters
    ----------
    rows : list of dict, of the table of spectra of one cell. capacity_ampere_hour : [Ah].

    Returns
    -------
    measured : list of Measured.
    """
    rows = [row for row in rows if _known(row, "soc", "r_ohmic_ohm")]
    arcs_known = [row for row in rows if row.get("charge_transfer_told") in (True, "True")]
    arcs_known = [row for row in arcs_known if _known(row, TRANSFER, WITH_ARCS)]
    if not rows:
        read = (OHMIC, RELAXING, ENERGY, RATES)
        return [silent("impedance", quantity, "no spectrum of known SoC") for quantity in read]
    fast, slow = _split_by_arc(arcs_known)
    ampere = capacity_ampere_hour
    if fast:
        quick = _spectral(fast, lambda row: float(row[WITH_ARCS]))
    else:
        quick = _spectral(slow or rows, _before_transfer if slow else _ohmic)
    what = "ohmic and charge-transfer resistance" if fast else "ohmic resistance"
    total = _spectral(arcs_known, lambda row: float(row[WITH_ARCS]))
    said = [
        _over_soc("impedance", OHMIC, what, quick, ampere),
        _over_temperature("impedance", "ohmic and charge-transfer resistance", total),
        _butler_volmer(fast or slow, ampere),
    ]
    if not slow:
        reason = "its arc is over before the model's RC pairs begin"
        return [*said, silent("impedance", RELAXING, reason)]
    arcs = _spectral(slow, lambda row: float(row[TRANSFER]))
    return [*said, _over_soc("impedance", RELAXING, "arc of the spectra", arcs, ampere)]


def _known(row, *names):
    values = [row.get(name) for name in names]
    return all(value is not None and np.isfinite(float(value)) for value in values)


def _earliest(rows):
    """Rows of the first check-up."""
    first = min(map(cycle_of, rows), default=0.0)
    return [row for row in rows if cycle_of(row) == first]


def _delays(rows):
    """The delay at which the model's R0 is read, before its RC pairs begin, and the longest [s].

    A delay that fewer than half of the pulses reach compares too little.
    """
    counts = Counter(float(row["delay_second"]) for row in rows)
    usual = sorted(delay for delay, count in counts.items() if 2 * count >= max(counts.values()))
    quick = [delay for delay in usual if delay <= TAU_SECOND["tau1"][0]]
    return (quick[-1] if quick else usual[0]), usual[-1]


def _courses(rows):
    """Resistance over SoC: (celsius, direction, rate, delay) → (SoC rising, ohm)."""
    found, rates = {}, []
    for row in rows:
        own = float(row["c_rate"])
        rate = next((known for known in rates if same_rate(known, own)), own)
        rates += [] if rate in rates else [rate]
        key = (celsius_of(row), row["direction"], rate, float(row["delay_second"]))
        found.setdefault(key, []).append((float(row["soc"]), float(row["resistance_ohm"])))
    return {key: np.array(sorted(pairs)).T for key, pairs in found.items()}


def _differences(courses, first, last):
    """What builds up between two delays [s] of the same pulses."""
    found = {}
    for key, (soc, ohm) in courses.items():
        late = courses.get((*key[:-1], last))
        if key[-1] == first and last > first and late is not None:
            grown = np.interp(soc, *late) - ohm
            found[key] = np.array([soc[grown > 0], grown[grown > 0]])
    return found


def _ohmic(row):
    return float(row["r_ohmic_ohm"])


def _before_transfer(row):
    """Ohmic resistance of a spectrum and its arcs faster than charge transfer."""
    return float(row[WITH_ARCS]) - float(row[TRANSFER])


def _spectral(rows, ohm):
    """As `_courses`, of what `ohm` says of a row of spectra."""
    found = {}
    for row in rows:
        pair = float(row["soc"]), ohm(row)
        found.setdefault((celsius_of(row), "", 0.0, 0.0), []).append(pair)
    return {key: np.array(sorted(pairs)).T for key, pairs in found.items()}


def _wide(course):
    soc = course[0]
    return len(soc) >= 3 and min(soc[-1], SOC_ENDS[1]) - max(soc[0], SOC_ENDS[0]) >= SOC_SPAN


def _over_soc(name, quantity, what, courses, ampere):
    """Factor from the upper to the lower end of SoC that was measured, nearest to 25 °C."""
    wide = {key: one for key, one in courses.items() if _wide(one)}
    if not wide:
        return silent(name, quantity, f"{what}: fewer than three SoC, or too near each other")
    nearest = min(wide, key=lambda k: (abs(k[0] - REFERENCE_CELSIUS), k[1] != "discharge", k[2]))
    low = max(SOC_ENDS[0], wide[nearest][0][0])
    high = min(SOC_ENDS[1], wide[nearest][0][-1])
    reach = [one for one in wide.values() if one[0][0] <= low + 0.03 and one[0][-1] >= high - 0.03]
    ends = np.array([np.interp([low, high], *one) for one in reach])
    at_low, at_high = np.interp([low, high], *wide[nearest])
    factor = at_low / at_high
    return Measured(
        *(name, quantity, f"{what} at {100 * low:.0f} % over that at {100 * high:.0f} % SoC"),
        *((low, high), float(factor), spread(ends[:, 0] / ends[:, 1]), "1", 1.0),
        material=is_material(factor, ampere * (at_low - at_high)),
    )


def _over_temperature(name, what, courses):
    """Activation energy at fixed SoC; its deviation is the spread over SoC and temperatures."""
    families = {}
    for (celsius, *family), course in courses.items():
        families.setdefault(tuple(family), {})[celsius] = course
    # At the longest delay, for the effect changes all resistances by one factor.
    order = sorted(families, key=lambda key: key[-1])
    best = families[max(order, key=lambda key: (_temperatures(families[key]), key[-1]))]
    if _temperatures(best) < 2:
        return silent(name, ENERGY, f"{what}: one temperature, or no SoC at two of them")
    local, whole = [], []
    for soc in LEVELS:
        known = [(c, np.interp(soc, *one)) for c, one in sorted(best.items()) if _holds(one, soc)]
        pairs = [(a, b) for a, b in pairwise(known) if b[0] - a[0] >= SAME_CELSIUS]
        local += [_energy(a, b) for a, b in pairs]
        whole += [(_energy(known[0], known[-1]), known[0], known[-1])] if pairs else []
    if not whole:
        return silent(name, ENERGY, f"{what}: no SoC was measured at two temperatures")
    cold, warm = min(one[1][0] for one in whole), max(one[2][0] for one in whole)
    energy = float(np.mean([one[0] for one in whole]))
    factor = float(np.mean([a[1] / b[1] for _, a, b in whole]))
    return Measured(
        *(name, ENERGY, f"activation energy of the {what}, {cold:g} to {warm:g} °C"),
        *((cold, warm), energy, spread(local), "J/mol", 0.0),
        material=bool(abs(np.log(factor)) > np.log(FACTOR)),
    )


def _holds(course, soc):
    return course[0][0] - 0.05 <= soc <= course[0][-1] + 0.05


def _temperatures(courses):
    return len({c for c, one in courses.items() if any(_holds(one, soc) for soc in LEVELS)})


def _energy(cold, warm):
    """Between two temperatures and their resistances [J/mol]."""
    inverse = [1.0 / (celsius + ZERO_CELSIUS_KELVIN) for celsius, _ in (cold, warm)]
    return float(GAS_CONSTANT * np.log(cold[1] / warm[1]) / (inverse[0] - inverse[1]))


def _directions(courses, ampere):
    """Charge over discharge at the same SoC, temperature and rate."""
    ratios, volts = [], []
    for (celsius, direction, rate, delay), (soc, ohm) in courses.items():
        other = courses.get((celsius, "charge", rate, delay))
        if (
            direction != "discharge"
            or other is None
            or abs(celsius - REFERENCE_CELSIUS) > ROOM_KELVIN
        ):
            continue
        inside = [k for k, one in enumerate(soc) if 0.15 < one < 0.85 and _holds(other, one)]
        ratios += [float(np.interp(soc[k], *other) / ohm[k]) for k in inside]
        volts += [rate * ampere * float(np.interp(soc[k], *other) - ohm[k]) for k in inside]
    if not ratios:
        reason = "no pulses of both directions at one SoC, rate and temperature"
        return silent("pulses", DIRECTIONS, reason)
    return Measured(
        *("pulses", DIRECTIONS, "resistance on charge over that on discharge"),
        *((ampere,), float(np.median(ratios)), spread(ratios), "1", 1.0),
        material=bool(abs(np.median(volts)) > LEAST_VOLT),
    )


def _rates(courses, ampere):
    """Resistance of the largest over that of the smallest pulses at the same SoC."""
    families = {}
    for (celsius, direction, rate, _), course in courses.items():
        if abs(celsius - REFERENCE_CELSIUS) <= ROOM_KELVIN:
            families.setdefault((celsius, direction), {})[rate] = course
    best = max(families.values(), key=lambda one: max(one) / min(one), default={})
    if not best or max(best) / min(best) < RATES_APART:
        return silent("pulses", RATES, "no pulses of two rates, one twice the other")
    small, large = best[min(best)], best[max(best)]
    ratios = [np.interp(s, *large) / np.interp(s, *small) for s in LEVELS if _both(small, large, s)]
    if not ratios:
        return silent("pulses", RATES, "pulses of two rates share no SoC")
    at = min(best) * ampere, max(best) * ampere
    fall = (1 - np.mean(ratios)) * np.interp(0.5, *small) * at[1]
    return Measured(
        *("pulses", RATES, f"resistance at {max(best):.2g}C over that at {min(best):.2g}C"),
        *(at, float(np.mean(ratios)), spread(ratios), "1", 1.0),
        material=bool(fall > LEAST_VOLT),
    )


def _both(one, other, soc):
    return _holds(one, soc) and _holds(other, soc)


def _split_by_arc(rows):
    """Spectra whose arc is faster than the model's RC pairs, and those with a slower one."""
    limit = 1.0 / (2 * np.pi * TAU_SECOND["tau1"][0])
    known = [(row, row.get("characteristic_frequency_hertz")) for row in rows]
    known = [(row, float(hertz)) for row, hertz in known if hertz not in (None, "")]
    fast = [row for row, hertz in known if hertz >= limit]
    return fast, [row for row, hertz in known if hertz < limit]


def _butler_volmer(rows, ampere):
    """Resistance at 1C over that at small currents, from the charge transfer near 50 % SoC."""
    near = [row for row in rows if abs(celsius_of(row) - REFERENCE_CELSIUS) <= SAME_CELSIUS]
    near = [row for row in near if abs(float(row["soc"]) - 0.5) <= 0.2]
    if not near:
        return silent("impedance", RATES, "no charge-transfer arc near 25 °C and 50 % SoC")
    row = min(near, key=lambda one: abs(float(one["soc"]) - 0.5))
    transfer, ohmic = float(row[TRANSFER]), _before_transfer(row)
    drive = ampere * transfer / (2 * THERMAL_VOLT)
    factor = (ohmic + transfer * np.arcsinh(drive) / drive) / (ohmic + transfer)
    return Measured(
        *("impedance", RATES, "resistance at 1C over that at C/50, after Butler–Volmer"),
        *((ampere / 50, ampere), float(factor), np.nan, "1", 1.0),
        material=bool((1 - factor) * (ohmic + transfer) * ampere > LEAST_VOLT),
    )
