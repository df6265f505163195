"""Pulse resistance over temperature: at one SoC, one delay and one current."""

from itertools import product

import numpy as np

from cellwright.laws.points import SAME_RATE, Point, Points, fresh

REACH_SOC = 0.12  # how far the pulses on either side of a state of charge may lie
NEAR_SOC = 0.05  # how far a single pulse may lie
DELAYS = (0.0, 10.0)


def resistance_points(rows, *, delay_second=DELAYS, c_rate=1.0, soc=(0.5,)):
    """Pulse resistance at stated SoC and each temperature, discharge and charge apart.

    Resistance depends on the current where charge transfer is slow, in the cold most of all. So
    all temperatures of a quantity come from pulses of one rate (within 10 %): the one that most
    temperatures have, and of those the nearest to `c_rate`. Where no rate reaches three
    temperatures, each temperature gives its nearest, and a note says so.

    Parameters
    ----------
    rows : list of dict, rows of stage `resistance` with ambient_temperature_celsius and cycle.
    delay_second : delays that are followed over temperature [s].
    c_rate : rate that is preferred [1/h].
    soc : states of charge [1]; between two pulses no further than 12 % away the resistance is
        interpolated, a single one serves within 5 %.

    Returns
    -------
    found : Points, and what was left out or mixed.
    """
    known = [row for row in fresh(rows) if np.isfinite(row["soc"])]
    points, notes = [], []
    for direction, delay, level in product(("discharge", "charge"), delay_second, soc):
        mine = [r for r in known if r["direction"] == direction and r["delay_second"] == delay]
        courses = _courses(mine, level)
        chosen, note = _one_rate(courses, c_rate)
        quantity, family = _names(direction, delay, level)
        points += [
            Point(quantity, "Ohm", celsius, *chosen[celsius], family, level)
            for celsius in sorted(chosen)
        ]
        notes += [f"{quantity}: {note}"] if note else []
    return Points(points, notes)


def name_of(direction, delay_second):
    """What a pulse resistance is called, without its SoC: that of discharges has no prefix."""
    when = "first sample" if delay_second == 0 else f"{delay_second:g} s"
    return f"{'charge ' if direction == 'charge' else ''}resistance", when


def rate_classes(rows):
    """Rows by rate: a class ends where the next rate is more than 10 % higher."""
    classes = []
    for row in sorted(rows, key=lambda row: row["c_rate"]):
        if row["c_rate"] <= 0:
            continue
        if not classes or np.log(row["c_rate"] / classes[-1][-1]["c_rate"]) > SAME_RATE:
            classes.append([])
        classes[-1].append(row)
    return {float(np.median([row["c_rate"] for row in one])): one for one in classes}


def _names(direction, delay, level):
    what, when = name_of(direction, delay)
    return f"{what} at {100 * level:.0f} % SoC, {when}", f"{what}, {when}"


def _courses(rows, level):
    """Rate → temperature → (resistance, std), where pulses lie around the level."""
    courses = {rate: _course(mine, level) for rate, mine in rate_classes(rows).items()}
    return {rate: course for rate, course in courses.items() if course}


def _course(rows, level):
    by_temperature = {}
    for row in rows:
        by_temperature.setdefault(row["ambient_temperature_celsius"], []).append(row)
    found = {celsius: _interpolated(here, level) for celsius, here in by_temperature.items()}
    return {celsius: value for celsius, value in found.items() if value is not None}


def _one_rate(courses, c_rate):
    """Temperature → (resistance, std) at one rate for all, and what was left out or mixed."""
    if not courses:
        return {}, ""
    everywhere = sorted({celsius for course in courses.values() for celsius in course})
    nearest = sorted(courses, key=lambda rate: abs(np.log(rate / c_rate)))
    rate = max(nearest, key=lambda rate: len(courses[rate]))
    missing = [celsius for celsius in everywhere if celsius not in courses[rate]]
    if not missing:
        return courses[rate], ""
    if len(courses[rate]) >= 3:
        where = ", ".join(f"{celsius:g}" for celsius in missing)
        return courses[rate], f"no pulse at {rate:.2g}C at {where} °C, left out"
    used = {c: next(rate for rate in nearest if c in courses[rate]) for c in everywhere}
    rates = f"{min(used.values()):.2g}C to {max(used.values()):.2g}C"
    mixed = {celsius: courses[rate][celsius] for celsius, rate in used.items()}
    note = f"pulses of {rates} at different temperatures: current and temperature are mixed"
    return mixed, note if len(everywhere) >= 3 else ""


def _interpolated(rows, level):
    """Resistance and its std at a SoC, between the pulses on either side of it."""
    rows = sorted(rows, key=lambda row: row["soc"])
    below = [row for row in rows if level - REACH_SOC <= row["soc"] <= level]
    above = [row for row in rows if level <= row["soc"] <= level + REACH_SOC]
    if below and above:
        return _between(below[-1], above[0], level)
    nearest = min(rows, key=lambda row: abs(row["soc"] - level))
    if abs(nearest["soc"] - level) > NEAR_SOC:
        return None
    return nearest["resistance_ohm"], nearest["resistance_std_ohm"]


def _between(low, high, level):
    width = high["soc"] - low["soc"]
    share = (level - low["soc"]) / width if width > 0 else 0.5
    values = (1 - share) * low["resistance_ohm"] + share * high["resistance_ohm"]
    std = np.hypot((1 - share) * low["resistance_std_ohm"], share * high["resistance_std_ohm"])
    return float(values), float(std)
