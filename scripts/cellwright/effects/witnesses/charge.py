"""What capacities, logged currents at rest and thermometers tell."""

from datetime import datetime
from itertools import permutations

import numpy as np

from cellwright.effects.ties import steady_rests
from cellwright.effects.witnesses.statement import (
    LEAST_SHARE,
    Measured,
    celsius_of,
    cycle_of,
    silent,
    spread,
)
from cellwright.numerics.lags import lag
from cellwright.records.conditions import (
    REFERENCE_CELSIUS,
    SAME_CELSIUS,
    same_rate,
    same_temperature,
)

SLOW_C_RATE = 0.1  # up to which the polarisation ends a discharge at nearly the OCV
WARM_KELVIN = 3.0  # of rise, from which it is held against the heat
DAY_HOUR, DAY_SECOND = 24.0, 86400.0
# What passes the ammeter at rest, and what passes it by.
AT_REST = ("current_at_rest", "no_current_at_rest")
SURFACE = "core_rise"  # no sensor tells the core's temperature
TAU_SECOND = np.geomspace(60.0, 6000.0, 9)


def of_capacities(rows):
    """What capacities tell: over temperature, from check-up to check-up, and from date to date.

    Parameters
    ----------
    rows : list of dict, of the table of capacities of one cell; `started`, the date of the test,
        where it is known.

    Returns
    -------
    measured : list of Measured, three.
    """
    rows = [row for row in rows if row["direction"] == "discharge"]
    return [_over_temperature(rows), _capacity_change(rows), _over_days(rows)]


def _over_temperature(rows):
    quantity, name = "capacity_per_kelvin", "capacities"
    first = min((cycle_of(row) for row in rows), default=0.0)
    slow = [row for row in rows if row["c_rate"] <= SLOW_C_RATE and cycle_of(row) == first]
    slowest = min((row["c_rate"] for row in slow), default=0.0)
    points = [
        (celsius_of(row), row["capacity_ampere_hour"])
        for row in slow
        if same_rate(row["c_rate"], slowest)
    ]
    if np.ptp([c for c, _ in points] or [0.0]) < SAME_CELSIUS:
        reason = (
            "no discharges of C/10 or slower at two temperatures: faster ones end by resistance"
        )
        return silent(name, quantity, reason)
    celsius, ampere_hour = np.array(sorted(points)).T
    line = np.polyfit(celsius - REFERENCE_CELSIUS, ampere_hour, 1)
    local = np.diff(ampere_hour) / np.maximum(np.diff(celsius), 1e-9) / line[1]
    slope, at = float(line[0] / line[1]), (float(celsius[0]), float(celsius[-1]))
    return Measured(
        *(name, quantity, f"change of the slow capacity, {at[0]:g} to {at[1]:g} °C"),
        *(at, slope, spread(local[np.diff(celsius) >= SAME_CELSIUS])),
        *("1/K", 0.0),
        material=bool(abs(slope) * (at[1] - at[0]) > LEAST_SHARE),
    )


def _capacity_change(rows):
    """Change of the capacity from the first check-up to the last, of discharges that compare."""
    quantity, name = "capacity_change", "check-ups"
    known = sorted(rows, key=cycle_of)
    before = [row for row in known if _comparable(row, known[-1])]
    if not before:
        return silent(name, quantity, "no capacities of two check-ups at one rate and temperature")
    last = known[-1]
    share = last["capacity_ampere_hour"] / before[0]["capacity_ampere_hour"] - 1.0
    words = f"change of the capacity from cycle {cycle_of(before[0]):g} to {cycle_of(last):g}"
    return Measured(
        *(name, quantity, words, (), float(share), np.nan, "share", 0.0),
        material=bool(abs(share) > LEAST_SHARE),
    )


def _over_days(rows):
    """Change of the capacity between the first and the last dated discharge that compare."""
    quantity, name = "capacity_over_days", "capacities by date"
    dated = [(datetime.fromisoformat(row["started"]), row) for row in rows if row.get("started")]
    pairs = [
        ((later - first).total_seconds() / DAY_SECOND, before, after)
        for (first, before), (later, after) in permutations(dated, 2)
        if first < later and _alike(before, after)
    ]
    if not pairs:
        reason = "no two dated discharges at one rate and temperature"
        return silent(name, quantity, reason)
    days, before, after = max(pairs, key=lambda pair: pair[0])
    share = after["capacity_ampere_hour"] / before["capacity_ampere_hour"] - 1.0
    words = f"change of the capacity in {days:.0f} days at {before['c_rate']:.2g}C"
    return Measured(
        *(name, quantity, words, (days,), float(share), np.nan, "share", 0.0),
        material=bool(abs(share) > LEAST_SHARE),
    )


def _comparable(row, other):
    return cycle_of(row) < cycle_of(other) and _alike(row, other)


def _alike(row, other):
    """Whether two discharges are at one rate and one temperature."""
    return same_rate(row["c_rate"], other["c_rate"]) and same_temperature(
        celsius_of(row), celsius_of(other)
    )


def of_records(series, ambient, values):
    """What the logged current at rest and the surface's temperature tell.

    Parameters
    ----------
    series : dict of columns of the records that were searched: test, test_time_second,
        current_ampere, voltage_volt, soc, celsius; empty where nothing was searched.
    ambient : dict of the chamber's stated temperature by test [degC].
    values : dict of the model: ocv_soc, ocv_volt, capacity_ampere_hour.

    Returns
    -------
    measured : list of Measured, three.
    """
    if not len(series.get("test", ())):
        read = (*AT_REST, SURFACE)
        return [silent("records", quantity, "the records were not searched") for quantity in read]
    tests = np.asarray(series["test"])
    parts = [
        (test, {name: np.asarray(column)[tests == test] for name, column in series.items()})
        for test in dict.fromkeys(tests.tolist())
    ]
    return [*_at_rest(parts, values["capacity_ampere_hour"]), _surface(parts, ambient, values)]


def _at_rest(parts, capacity):
    name = "current at rest"
    means = [_rest_means(one, capacity) for _, one in parts]
    logged = [np.mean(one) for one in ([m for m in some if m != 0.0] for some in means) if one]
    if not logged:
        reason = "the log reads exactly zero in every rest: switched off, or not resolved"
        reason = reason if any(means) else "no rest of a minute in the records"
        return [silent(name, quantity, reason) for quantity in AT_REST]
    # A reading drifts from test to test, by more than the noise of each: that is its deviation.
    mean, std = float(np.mean(logged)), spread(logged)
    words, share = f"logged current at rest in {len(logged)} tests", abs(mean) * DAY_HOUR / capacity
    read = (words, (), mean, std, "A", 0.0)
    logged_there, by_passing = AT_REST
    return [
        Measured(name, logged_there, *read, material=share > LEAST_SHARE),
        Measured(name, by_passing, *read),
    ]


def _rest_means(one, capacity):
    """Mean logged current of each steady stretch near zero of a record [A]."""
    current = one["current_ampere"]
    rests = steady_rests(current, one["test_time_second"], capacity)
    return [float(np.mean(current[begin:end])) for begin, end in rests]


def _surface(parts, ambient, values):
    """How far the surface warms above the chamber, and by how much a watt of loss warms it."""
    name = "surface temperature"
    rises, fitted = [], []
    for test, one in parts:
        rise = one["celsius"] - one["celsius"][0]
        if ambient.get(test) is None or np.ptp(one["celsius"]) == 0.0:
            continue
        rises.append(float(np.max(rise)))
        if rises[-1] >= WARM_KELVIN:
            fitted.append(_kelvin_per_watt(one, rise, values))
    if not rises:
        return silent(name, SURFACE, "no temperature of the surface was logged")
    words = f"the surface warms by up to {max(rises):.1f} K"
    if fitted:
        words += f", {np.median(fitted):.2g} K for each watt of loss"
    reason = f"{words}; the model runs at the surface's temperature, and no sensor tells the core's"
    return silent(name, SURFACE, reason)


def _kelvin_per_watt(one, rise, values):
    """Thermal resistance from the surface to the chamber [K/W], the best of several lags."""
    ocv = np.interp(one["soc"], values["ocv_soc"], values["ocv_volt"])
    loss = np.maximum(one["current_ampere"] * (one["voltage_volt"] - ocv), 0.0)
    steps = np.maximum(np.diff(one["test_time_second"]), 0.0)
    best = np.inf, np.nan
    for tau in TAU_SECOND:
        shape = lag(steps, tau, loss, hold="first_order")
        gain = float(shape @ rise / max(shape @ shape, 1e-12))
        best = min(best, (float(np.mean((rise - gain * shape) ** 2)), gain))
    return best[1]
