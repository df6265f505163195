"""The points over temperature that laws are fitted to, from the tables of tests."""

from typing import NamedTuple

import numpy as np

MIDDLE_SOC = 0.5
REACH_SOC = 0.12
SAME_RATE = 0.1


class Point(NamedTuple):
    """One quantity at one temperature; `quantity` says what, at which SoC, delay and rate."""

    quantity: str
    unit: str
    temperature_celsius: float
    value: float


def resistance_points(rows, *, delay_second=(0.0, 10.0), c_rate=1.0):
    """Discharge resistance at 50 % SoC and each temperature, from the pulses nearest `c_rate`.

    Parameters
    ----------
    rows : list of dict, rows of stage `resistance` with ambient_temperature_celsius and cycle.
    delay_second : delays that are followed over temperature [s].
    c_rate : rate that is preferred, for resistance depends on current in the cold [1/h].

    Returns
    -------
    points : list of Point; temperatures without a pulse within 12 % of 50 % SoC are absent.
    """
    known = [row for row in fresh(rows) if np.isfinite(row["soc"])]
    mine = [row for row in known if row["direction"] == "discharge"]
    return [point for delay in delay_second for point in _course(mine, delay, c_rate)]


def _course(rows, delay, c_rate):
    name = "first sample" if delay == 0 else f"{delay:g} s"
    mine = [row for row in rows if row["delay_second"] == delay]
    for celsius in sorted({row["ambient_temperature_celsius"] for row in mine}):
        here = [row for row in mine if row["ambient_temperature_celsius"] == celsius]
        value = _interpolated(_nearest_rate(here, c_rate))
        if value is not None:
            yield Point(f"resistance at 50 % SoC, {name}", "Ohm", celsius, value)


def capacity_points(rows):
    """Discharge capacity at each temperature, one quantity per rate.

    Parameters
    ----------
    rows : list of dict, rows of stage `capacity` with ambient_temperature_celsius and cycle.

    Returns
    -------
    points : list of Point.
    """
    found, rates = [], []
    for row in sorted(fresh(rows), key=lambda r: (r["ambient_temperature_celsius"], r["c_rate"])):
        if row["direction"] != "discharge":
            continue
        near = [rate for rate in rates if abs(row["c_rate"] / rate - 1) < SAME_RATE]
        rates += [] if near else [row["c_rate"]]
        rate = near[0] if near else row["c_rate"]
        celsius, value = row["ambient_temperature_celsius"], row["capacity_ampere_hour"]
        found.append(Point(f"capacity at {rate:.2g}C", "Ah", celsius, value))
    return found


def fresh(rows):
    """Rows of known temperature from the earliest check-up: age must not pass for temperature."""
    known = [row for row in rows if row["ambient_temperature_celsius"] is not None]
    first = min((row["cycle"] or 0 for row in known), default=0)
    return [row for row in known if (row["cycle"] or 0) == first]


def enough(points, *, temperatures=3):
    """Points of the quantities that have at least so many temperatures."""
    seen = {}
    for point in points:
        seen.setdefault(point.quantity, set()).add(point.temperature_celsius)
    return [point for point in points if len(seen[point.quantity]) >= temperatures]


def _nearest_rate(rows, c_rate):
    best = min((abs(np.log(row["c_rate"] / c_rate)) for row in rows), default=0.0)
    return [row for row in rows if abs(np.log(row["c_rate"] / c_rate)) < best + SAME_RATE]


def _interpolated(rows):
    """Resistance at 50 % SoC between the nearest pulses; a single one close by serves as well."""
    rows = sorted(rows, key=lambda row: row["soc"])
    soc = np.array([row["soc"] for row in rows])
    if not len(soc) or np.abs(soc - MIDDLE_SOC).min() > REACH_SOC:
        return None
    return float(np.interp(MIDDLE_SOC, soc, [row["resistance_ohm"] for row in rows]))
