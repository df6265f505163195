"""Polarisation over SoC and temperature: which rests compare, their course, and their laws."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.points import fresh
from cellwright.laws.temperature import rows_of
from cellwright.laws.tested_lines import FEWEST_TEMPERATURES, soc_lines, temperature_lines
from cellwright.refusal import Refusal

QUANTITIES = {"a": "V", "b": "V", "tau1": "s", "tau2": "s"}
COLUMN = {"a": "a_volt", "b": "b_volt", "tau1": "tau1_second", "tau2": "tau2_second"}
STD = {"a": "a_std_volt", "b": "b_std_volt", "tau1": "tau1_std_second", "tau2": "tau2_std_second"}
# How far two rests may lie apart, in ln, and still be of one protocol.
ALIKE = {"current_before_ampere": 0.15, "load_second": 0.2, "rest_second": 0.2, "samples": 0.5}
MIDDLE = (0.15, 0.95)  # SoC over which a temperature's value is the median
HALF = 0.52  # up to here "below 50 % SoC"
NOTHING = "no rest after a steady load tells two exponentials at a known SoC"
MOST_OF = 0.8  # of the rests: so many must tell three exponentials for three to be compared


class Point(NamedTuple):
    """One rest: a quantity [unit] with deviation at a SoC [1] and temperature [°C].

    Amplitudes are positive where the rest relaxes away from the load, as physics has it.
    """

    quantity: str
    unit: str
    temperature_celsius: float
    soc: float
    value: float
    std: float


class Compared(NamedTuple):
    """Points of the rests that compare, and the protocol in words."""

    points: list
    protocol: str
    exponentials: int
    r_squared: np.ndarray


# ASSUME: Rests compare over temperature after one direction, current and length of load, with one
# length of rest and one logging: a and b grow with the load, two time constants with the rest.
def compared(rows):
    """The rests of a cell that can be compared over SoC and temperature.

    1. Rests of the earliest check-up after a steady load are grouped by protocol. 2. The group
    with the most temperatures, then the most rests, is taken. 3. Its fits of three exponentials
    are compared where they are told in 80 % of its rests and at as many temperatures, for then
    charge transfer is out of a and b; else its fits of two.

    Parameters
    ----------
    rows : list of dict, rows of stage `relaxation` with ambient_temperature_celsius and cycle.

    Returns
    -------
    Compared : without a point, and the reason as protocol, where no rest after a steady load tells
        two exponentials at a known SoC: that is an answer, not a fault of the tests.
    """
    told = [row for row in fresh(rows) if row["exponentials"] >= 2 and np.isfinite(row["soc"])]
    told = [row for row in told if row["load"] in ("CC", "pulse")]
    if not told:
        return Compared([], NOTHING, 0, np.zeros(0))
    groups = _groups(told)
    best = max(groups, key=lambda group: (len(_celsius(group)), len(_rests(group))))
    kept = _of_one_number(best)
    points = [point for row in kept for point in _points(row)]
    r_squared = np.array([row["r_squared"] for row in kept])
    return Compared(points, _protocol(kept), kept[0]["exponentials"], r_squared)


def over_temperature(points):
    """Median over the middle SoC of each quantity and temperature.

    Returns
    -------
    courses : dict, quantity → (celsius, value) ascending.
    """
    courses = {}
    for quantity in QUANTITIES:
        mine = [p for p in points if p.quantity == quantity and MIDDLE[0] <= p.soc <= MIDDLE[1]]
        celsius = sorted({p.temperature_celsius for p in mine})
        value = [np.median([p.value for p in mine if p.temperature_celsius == t]) for t in celsius]
        courses[quantity] = (np.array(celsius), np.array(value))
    return courses


def laws_of(points):
    """Laws over temperature of a, b, tau1, tau2, and over SoC of a and b at each temperature.

    Parameters
    ----------
    points : list of Point.

    Returns
    -------
    laws : dict, quantity in words → tuple of `temperature.Law`.
    reasons : list of sentences for what is not known.
    """
    laws, reasons = {}, []
    count = len({point.temperature_celsius for point in points})
    if 0 < count < FEWEST_TEMPERATURES:
        reasons.append(f"polarisation over temperature: {count} temperature(s), a law needs three")
    many = count >= FEWEST_TEMPERATURES
    for quantity, (celsius, value) in over_temperature(points).items() if many else ():
        name = f"polarisation {quantity}, median over SoC"
        _try(laws, reasons, name, temperature_lines, celsius, value, QUANTITIES[quantity])
    for quantity in ("a", "b"):
        for celsius in sorted({p.temperature_celsius for p in points}):
            soc, value = _below_half(points, quantity, celsius)
            name = f"polarisation {quantity} below 50 % SoC at {celsius:g} °C"
            _try(laws, reasons, name, soc_lines, soc, value, QUANTITIES[quantity])
    return laws, reasons


def law_rows(laws):
    """The laws as rows of tables/temperature.csv."""
    return [row for name, pair in laws.items() for law in pair for row in rows_of(name, law)]


def _try(laws, reasons, name, fit, axis, value, unit):
    try:
        laws[name] = fit(axis, value, unit=unit)
    except Refusal as refusal:
        reasons.append(f"{name}: {refusal}")


def _below_half(points, quantity, celsius):
    mine = [p for p in points if p.quantity == quantity and p.temperature_celsius == celsius]
    mine = sorted((p.soc, p.value) for p in mine if p.soc <= HALF)
    return np.array(mine).reshape(-1, 2).T


def _groups(rows):
    """Rows by protocol: each joins the first group whose first row is alike."""
    groups = []
    for row in sorted(rows, key=lambda one: [abs(one[name]) for name in ALIKE]):
        near = next((group for group in groups if _alike(group[0], row)), None)
        if near is None:
            groups.append([row])
        else:
            near.append(row)
    return groups


def _alike(one, other):
    if (one["direction"], one["load"]) != (other["direction"], other["load"]):
        return False
    return all(abs(np.log(one[name] / other[name])) <= reach for name, reach in ALIKE.items())


def _of_one_number(group):
    """The fits of three exponentials, or those of two."""
    two, three = ([row for row in group if row["exponentials"] == n] for n in (2, 3))
    enough = len(three) >= MOST_OF * len(_rests(group))
    return three if enough and len(_celsius(three)) == len(_celsius(group)) else two or three


def _celsius(rows):
    return {row["ambient_temperature_celsius"] for row in rows}


def _rests(rows):
    return {(row["test"], row["rest"]) for row in rows}


def _points(row):
    sign = np.sign(row["current_before_ampere"])
    for name, unit in QUANTITIES.items():
        value = row[COLUMN[name]] * (sign if unit == "V" else 1.0)
        here = float(row["ambient_temperature_celsius"]), float(row["soc"])
        yield Point(name, unit, *here, float(value), float(row[STD[name]]))


def _protocol(rows):
    """`discharge of 16 A for 720 s, rests of 2400 s`, from the medians."""
    names = ("current_before_ampere", "load_second", "rest_second")
    current, load, rest = (np.median([abs(row[name]) for row in rows]) for name in names)
    return f"{rows[0]['direction']} of {current:.3g} A for {load:.3g} s, rests of {rest:.4g} s"
