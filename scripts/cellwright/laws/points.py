"""The points over temperature that laws are fitted to, from the tables of tests."""

from typing import NamedTuple

import numpy as np

SAME_RATE = 0.1


class Point(NamedTuple):
    """One quantity at one temperature; `quantity` says what, at which SoC, delay and rate.

    std : of the value from its own measurement, NaN where not known. family : quantities that
    differ in SoC only. soc : NaN where the quantity has none.
    """

    quantity: str
    unit: str
    temperature_celsius: float
    value: float
    std: float = np.nan
    family: str = ""
    soc: float = np.nan


class Points(NamedTuple):
    """Points, and a sentence for each thing that was left out of them or mixed in them."""

    points: list
    notes: list


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
        found.append(Point(f"capacity at {rate:.2g}C", "Ah", celsius, value, family="capacity"))
    return found


def impedance_points(rows, *, soc_tolerance=0.02, most_relative_std=0.5):
    """Ohmic and charge-transfer resistance of the fitted circuits at each SoC and temperature.

    Parameters
    ----------
    rows : list of dict, rows of stage `eis` with ambient_temperature_celsius, soc and cycle of the
        sheet. The temperature is the sheet's: the channel in an impedance file may read
        differently from that of the other records, and curves must not mix the two.
    soc_tolerance : states of charge that lie no further apart are one [1].
    most_relative_std : a resistance that the spectrum determines no better is left out [1].

    Returns
    -------
    found : Points, each with the standard deviation of its fit; what was left out.
    """
    known = [row for row in fresh(rows) if row["soc"] is not None and np.isfinite(row["soc"])]
    groups = together([row["soc"] for row in known], apart=soc_tolerance)
    points, notes = [], []
    known.sort(key=lambda row: (row["soc"], row["ambient_temperature_celsius"]))
    for kind, column in (("ohmic", "r_ohmic_ohm"), ("charge-transfer", "r_charge_transfer_ohm")):
        told = [row for row in known if _determined(row, column, most_relative_std)]
        points += [_of_spectrum(kind, column, row, groups[row["soc"]]) for row in told]
        vague = len(known) - len(told)
        family = f"{kind} resistance, impedance"
        count = f"{vague} of {len(known)} spectra"
        notes += [f"{family}: {count} do not determine it"] if vague else []
    return Points(points, notes)


def _determined(row, column, most_relative_std):
    """Whether the fit tells the resistance, and can tell charge transfer from diffusion."""
    told = column == "r_ohmic_ohm" or row.get("charge_transfer_told", True)
    return told and row[column] > 0 and row[f"{column}_std"] <= most_relative_std * row[column]


def _of_spectrum(kind, column, row, soc):
    return Point(
        f"{kind} resistance at {100 * soc:.0f} % SoC, impedance",
        "Ohm",
        row["ambient_temperature_celsius"],
        row[column],
        row[f"{column}_std"],
        f"{kind} resistance, impedance",
        soc,
    )


def together(values, *, apart):
    """What each value is called: the mean of the run of values that lie no further `apart`."""
    runs = []
    for value in sorted(set(values)):
        if runs and value - runs[-1][0] <= apart:
            runs[-1].append(value)
        else:
            runs.append([value])
    return {value: float(np.mean(run)) for run in runs for value in run}


def fresh(rows):
    """Rows of known temperature from the earliest check-up: age must not pass for temperature."""
    known = [row for row in rows if row["ambient_temperature_celsius"] is not None]
    first = min((row["cycle"] or 0 for row in known), default=0)
    return [row for row in known if (row["cycle"] or 0) == first]


def one_a_temperature(points):
    """The mean of what was measured more than once at one temperature, per quantity.

    Three spectra at one temperature are three witnesses of the resistance there, not of how it
    moves with temperature: a chamber that is off and a law that bends move all three at once.
    """
    runs = {}
    for point in points:
        runs.setdefault((point.quantity, point.temperature_celsius), []).append(point)
    return [
        run[0]._replace(
            value=float(np.mean([point.value for point in run])),
            std=float(np.sqrt(np.sum([point.std**2 for point in run])) / len(run)),
        )
        for run in runs.values()
    ]


def enough(points, *, temperatures=3):
    """Points of the quantities that have at least so many temperatures."""
    seen = {}
    for point in points:
        seen.setdefault(point.quantity, set()).add(point.temperature_celsius)
    return [point for point in points if len(seen[point.quantity]) >= temperatures]
