"""Every rest of a test: its two exponentials, and one rest with its fit as drawn."""

from collections import Counter
from typing import NamedTuple

import numpy as np

from cellwright.numerics.noise import least_digit
from cellwright.protocols.relaxation import fit_relaxation, noise_volt, reasons_against
from cellwright.records.conditions import LOW_C_RATE, low_current
from cellwright.refusal import Refusal
from cellwright.settings import Relaxation

RELAXATION = Relaxation()

STEADY = ("CC", "pulse")  # loads of one current, whose polarisation is proportional to it
MOVED_KELVIN = 3.0  # from here on the rest is one of the chamber, not of the cell
EDGE = 3.0  # slopes: a first sample that moves on so much faster than the next is of the edge
EDGE_NOISES = 6.0  # and by so many noises
LATE_SAMPLES = 3  # at most, at the end of a rest, that already show the next load
LAST_ROWS = 5  # of a load without one current: their median is the current before the rest


class RestRows(NamedTuple):
    """One entry a rest and number of exponentials, arrays of shape (rows,).

    rest counts the rests of the test. soc [1] and temperature_celsius at its begin and over it.
    direction, load (kind of step), current_before_ampere (+ on charge), load_second: of the step
    before. delay_second : from the last sample under load to the rest's first, t = 0 of
    V = V∞ + a·exp(−t/tau1) + b·exp(−t/tau2), thesis (3.16) with V∞ = ocv_volt. fast_volt, fast_tau
    : a third, faster exponential where one is told (exponentials = 3), else NaN. chosen : the
    larger number told. r1_ohm, r2_ohm : a and b over the current, and over the share of its end
    value that each reaches within the load. noise_volt : of a sample. reason : why R² is below the
    limit, or what else stands against two exponentials; empty where nothing does.
    """

    rest: np.ndarray
    start_time_second: np.ndarray
    soc: np.ndarray
    temperature_celsius: np.ndarray
    direction: np.ndarray
    load: np.ndarray
    current_before_ampere: np.ndarray
    load_second: np.ndarray
    rest_second: np.ndarray
    delay_second: np.ndarray
    samples: np.ndarray
    exponentials: np.ndarray
    chosen: np.ndarray
    a_volt: np.ndarray
    a_std_volt: np.ndarray
    tau1_second: np.ndarray
    tau1_std_second: np.ndarray
    b_volt: np.ndarray
    b_std_volt: np.ndarray
    tau2_second: np.ndarray
    tau2_std_second: np.ndarray
    fast_volt: np.ndarray
    fast_std_volt: np.ndarray
    fast_tau_second: np.ndarray
    fast_tau_std_second: np.ndarray
    r1_ohm: np.ndarray
    r2_ohm: np.ndarray
    ocv_volt: np.ndarray
    ocv_std_volt: np.ndarray
    ahead_volt: np.ndarray
    drift_volt: np.ndarray
    r_squared: np.ndarray
    rmse_volt: np.ndarray
    noise_volt: np.ndarray
    reason: np.ndarray


class Rests(NamedTuple):
    """Rests with their fits, and a sentence with a count for each reason why one is missing."""

    rows: RestRows
    left_out: tuple


class _Series(NamedTuple):
    """Columns of a test (n,): time [s], current [A], voltage [V], SoC [1], temperature [°C]."""

    time: np.ndarray
    current: np.ndarray
    voltage: np.ndarray
    soc: np.ndarray
    celsius: np.ndarray


# ASSUME: The cell had relaxed before the load that a rest follows.
def rests_of(
    test_time_second,
    current_ampere,
    voltage_volt,
    soc,
    steps,
    *,
    temperature_celsius=None,
    shortest_rest_second=RELAXATION.shortest_rest_second,
    r_squared_limit=0.98,  # thesis 3.3: every rest lies above it
    elsewhere=None,
):
    """Depolarisation of every rest that follows a load, by two exponentials.

    1. A rest counts from `shortest_rest_second` on, where the record has no gap before it and the
    load was no low current (C/37); its first sample is left out where it still shows the edge; it
    ends where the temperature has moved by 3 K. 2. Two exponentials
    are fitted, or one where two are not told. 3. Where a third, faster one is told as well, it has
    a row of its own and is chosen. 4. What falls short of the limit says why.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt : (n,) [s], [A] positive on charge, [V].
    soc : (n,) [1], NaN where not known.
    steps : series.steps.Steps.
    temperature_celsius : (n,) of the chamber, else of the cell, or None [°C].
    shortest_rest_second : [s].
    r_squared_limit : R² from which a rest needs no reason [1].
    elsewhere : (steps,) name of the test in which a step counts, as of `pulse_resistance`.

    Returns
    -------
    Rests : without a row where no rest is long enough; `left_out` then says so.

    Source: thesis sec. 3.3, (3.14)–(3.16); dU/dt = −U/tau + i/c, the minus is missing in print.
    """
    time, voltage = np.asarray(test_time_second, float), np.asarray(voltage_volt, float)
    celsius = np.full(len(time), np.nan) if temperature_celsius is None else temperature_celsius
    current, soc = np.asarray(current_ampere, float), np.asarray(soc, float)
    series = _Series(time, current, voltage, soc, celsius)
    kind = np.asarray(steps.kind)
    # Of rests those that follow a load without a gap between.
    follows = np.append(False, steps.start_time_second[1:] == steps.end_time_second[:-1])
    follows &= (kind == "rest") & (np.roll(kind, 1) != "rest")
    rests = np.flatnonzero(follows & (np.asarray(steps.duration_second) >= shortest_rest_second))
    rows, reasons = [], Counter()
    if elsewhere is not None:
        reasons.update(f"rest of the same measurement as in {of}" for of in elsewhere[rests] if of)
        rests = rests[elsewhere[rests] == ""]
    for number, step in enumerate(rests):
        try:
            rows += _rows_of(number, series, steps, step, shortest_rest_second, r_squared_limit)
        except Refusal as refusal:
            reasons[str(refusal)] += 1
    left_out = [f"{count} × {reason}" for reason, count in sorted(reasons.items())]
    if not len(rests):
        left_out = [f"no rest after a load lasts {shortest_rest_second:g} s: no depolarisation"]
    columns = {
        # Of the right type also where there is no row.
        name: np.array([row[name] for row in rows], dtype=TYPES.get(name, float))
        for name in RestRows._fields
    }
    return Rests(RestRows(**columns), tuple(left_out))


TYPES = dict.fromkeys(("direction", "load", "reason"), str)
TYPES |= dict.fromkeys(("rest", "samples", "exponentials"), int) | {"chosen": bool}


def chamber_or_cell(series):
    """Recorded temperature of the chamber, else of the cell's surface (n,) [°C]; None without.

    Parameters
    ----------
    series : dict of columns; the cell's own warms in a load and cools in the rest.
    """
    chamber = series.get("ambient_temperature_celsius")
    return series.get("surface_temperature_celsius") if chamber is None else chamber


def _rows_of(number, series, steps, step, shortest, limit):
    """Rows of RestRows of one rest: of two exponentials or one, and of three where determined."""
    if low_current(steps.c_rate[step - 1], 1.0):
        raise Refusal(f"load before the rest is below {LOW_C_RATE:.2g} C")
    time, voltage, celsius = series.time, series.voltage, series.celsius
    rows = np.arange(int(steps.first_row[step]), int(steps.last_row[step]) + 1)
    moved = np.abs(celsius[rows] - celsius[rows[0]]) > MOVED_KELVIN
    rows = rows[: int(np.argmax(moved))] if moved.any() else rows
    if rows[-1] < steps.last_row[step] and time[rows[-1]] - time[rows[0]] < shortest:
        raise Refusal(f"temperature moves by {MOVED_KELVIN:g} K within the first {shortest:g} s")
    rows = rows[_edge_samples(time[rows], voltage[rows]) :]
    back = rows[::-1]
    rows = back[_edge_samples(-time[back], voltage[back], at_most=LATE_SAMPLES) :][::-1]
    t, v = time[rows], voltage[rows]
    two, three = fit_relaxation(t, v), fit_relaxation(t, v, most=3)
    fits = [two, three] if len(three.tau_second) == 3 else [two]
    common = _load(series, steps, step, rows) | {"rest": number, "noise_volt": noise_volt(v)}
    reason = reasons_against(
        two, three, v, limit=limit, grain=least_digit(v), noise=common["noise_volt"]
    )
    return [
        common | _fit(fit, common) | {"chosen": fit is fits[-1], "reason": reason} for fit in fits
    ]


def _edge_samples(time, voltage, *, at_most=1):
    """Number of first samples to leave out, those that show an edge of the current.

    No time constant can be told from one sample, but it would draw those of the rest to itself.
    Backwards from the end of a rest they show the next load, where the clock of the voltage is
    ahead of that of the current: up to its first step from one sample to the next, `at_most`.
    """
    moved, passed = np.diff(voltage[: at_most + 2]), np.diff(time[: at_most + 2])
    steep = np.abs(moved / passed)
    steps = np.flatnonzero(
        (steep[:-1] > EDGE * steep[1:]) & (np.abs(moved[:-1]) > EDGE_NOISES * noise_volt(voltage))
    )
    return int(steps[-1]) + 1 if len(steps) else 0


def _load(series, steps, step, rows):
    """Columns of RestRows that describe the rest and the load before it."""
    time, current, _, soc, celsius = series
    load, measured = steps.kind[step - 1], np.isfinite(celsius[rows])
    last = current[max(int(steps.last_row[step - 1]) - LAST_ROWS + 1, 0) : rows[0]]
    before = steps.current_mean_ampere[step - 1] if load in STEADY else float(np.median(last))
    return {
        "start_time_second": float(time[rows[0]]),
        "soc": float(soc[rows[0]]),
        "temperature_celsius": float(celsius[rows][measured].mean()) if measured.any() else np.nan,
        "direction": "charge" if steps.current_mean_ampere[step - 1] > 0 else "discharge",
        "load": str(load),
        "current_before_ampere": float(before),
        "load_second": float(steps.duration_second[step - 1]),
        "rest_second": float(time[rows[-1]] - steps.start_time_second[step]),
        "delay_second": float(time[rows[0]] - steps.start_time_second[step]),
        "samples": len(rows),
    }


def _fit(fit, load):
    """Columns of RestRows of one fit; the two slowest exponentials are a and b."""
    count = len(fit.tau_second)
    place = {"a": max(count - 2, 0), "b": count - 1 if count > 1 else None}
    place["fast"] = 0 if count == 3 else None
    tau = {"a": "tau1", "b": "tau2", "fast": "fast_tau"}
    row = {"exponentials": count}
    for name, index in place.items():
        values = [np.nan if index is None else float(part[index]) for part in fit[2:6]]
        names = (
            f"{name}_volt",
            f"{name}_std_volt",
            f"{tau[name]}_second",
            f"{tau[name]}_std_second",
        )
        row |= dict(zip(names, values, strict=True))
    for name, volt, second in (
        ("r1_ohm", "a_volt", "tau1_second"),
        ("r2_ohm", "b_volt", "tau2_second"),
    ):
        row[name] = _pair_resistance(row[volt], row[second], load)
    same = ("ocv_volt", "ocv_std_volt", "ahead_volt", "drift_volt", "r_squared", "rmse_volt")
    return row | {name: float(getattr(fit, name)) for name in same}


def _pair_resistance(volt, tau, load):
    """Resistance of an RC pair that the load charged to `volt` [ohm]; NaN unless it was steady."""
    if load["load"] not in STEADY:
        return np.nan
    return volt / load["current_before_ampere"] / -np.expm1(-load["load_second"] / tau)


MIDDLE_SOC = 0.5
POINTS = 400  # more than a panel shows


class Curve(NamedTuple):
    """One rest over time, arrays (n,) from its first sample on; empty where none was fitted.

    soc : of the rest, the same in each row.
    """

    time_second: np.ndarray
    voltage_volt: np.ndarray
    fitted_volt: np.ndarray
    soc: np.ndarray


def example(rows, test_time_second, voltage_volt):
    """Voltage and chosen fit of the rest nearest 50 % SoC, or of the middle rest without SoC.

    Parameters
    ----------
    rows : RestRows. test_time_second, voltage_volt : (n,) of the test [s], [V].

    Returns
    -------
    Curve
    """
    chosen = np.flatnonzero(rows.chosen)
    if not len(chosen):
        return Curve(*[np.zeros(0)] * len(Curve._fields))
    distance = np.abs(rows.soc[chosen] - MIDDLE_SOC)
    k = chosen[np.nanargmin(distance)] if np.isfinite(distance).any() else chosen[len(chosen) // 2]
    since = np.asarray(test_time_second, float) - rows.start_time_second[k]
    inside = np.flatnonzero((since >= 0) & (since <= rows.rest_second[k] - rows.delay_second[k]))
    # Dense at first, where the voltage moves.
    kept = inside[np.unique(np.geomspace(1, len(inside), POINTS).astype(int)) - 1]
    fitted = np.full(len(kept), rows.ocv_volt[k])
    pairs = {"a_volt": "tau1_second", "b_volt": "tau2_second", "fast_volt": "fast_tau_second"}
    for volt, tau in pairs.items():
        amplitude = np.nan_to_num(getattr(rows, volt)[k])
        fitted += amplitude * np.exp(-since[kept] / np.nan_to_num(getattr(rows, tau)[k], nan=1.0))
    volts = np.asarray(voltage_volt, float)[kept]
    return Curve(since[kept], volts, fitted, np.full(len(kept), rows.soc[k]))
