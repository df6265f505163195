"""Open-circuit voltage over temperature from rests in a chamber that steps.

The protocol, in steps: (1) bring the cell to a state of charge and let it rest for hours at the
first temperature; (2) let the chamber step, the cell still at rest, and stay at each temperature
until the cell is there; (3) let it come back to the first temperature; (4) go on to the next
state of charge. What the voltage would have done at the first temperature is extrapolated from
(1) and, where measured, (3); what it did besides is the shift of the open-circuit voltage.
"""

from typing import NamedTuple

import numpy as np

from cellwright.records import inputs
from cellwright.records.basis import state_of_charge
from cellwright.refusal import Refusal
from cellwright.result import Result

LEAST_PLATEAU_SECOND = 1200.0  # of steady temperature; a shorter one is not read
LEAST_REFERENCE_SECOND = 7200.0  # by which a relaxation can be carried on (thesis 3.3: 10 h)
SETTLED_KELVIN_PER_HOUR = 1.0  # slower, and the cell has reached a temperature
SKIP_SECOND = 3600.0  # of a rest: faster processes of the relaxation have ended by then
BIN_SECOND = 600.0  # a chamber swings about its set point within minutes


class Plateau(NamedTuple):
    """Rows first to last (inclusive) of one temperature [degC], and how many bins of 600 s."""

    first: int
    last: int
    celsius: float
    bins: int


def joined_rests(steps):
    """First and last row (inclusive) of each rest; successive rest steps count as one rest.

    steps : `series.steps.Steps`.
    """
    rests = []
    for kind, first, last in zip(steps.kind, steps.first_row, steps.last_row, strict=True):
        if kind != "rest":
            continue
        if rests and rests[-1][1] == first - 1:
            rests[-1] = (rests[-1][0], int(last))
        else:
            rests.append((int(first), int(last)))
    return rests


def _binned(time, values, begin):
    """First row of each bin of 600 s since `begin` [s] and the row after the last; bins' means."""
    number = ((time - begin) // BIN_SECOND).astype(int)
    edges = np.append(np.flatnonzero(np.diff(number, prepend=-1)), len(time))
    return edges, *(np.add.reduceat(c, edges[:-1]) / np.diff(edges) for c in (time, values))


def plateaus_of(test_time_second, temperature_celsius):
    """Stretches in which the temperature moves slower than 1 K/h over 20 minutes, for 20 minutes.

    test_time_second, temperature_celsius : (n,) [s], [degC].

    Returns plateaus: list of Plateau, in order of time.
    """
    time = np.asarray(test_time_second, float)
    celsius = np.asarray(temperature_celsius, float)
    edges, middle, means = _binned(time, celsius, time[0])
    if len(means) < 2:
        return []
    still = np.abs(np.gradient(means, middle / 3600)) < SETTLED_KELVIN_PER_HOUR
    turns = np.flatnonzero(np.diff(still.astype(int), prepend=0, append=0))
    rows = [(edges[a], edges[b] - 1, b - a) for a, b in zip(turns[::2], turns[1::2], strict=True)]
    return [
        Plateau(int(a), int(b), float(np.mean(celsius[a : b + 1])), int(bins))
        for a, b, bins in rows
        if time[b] - time[a] >= LEAST_PLATEAU_SECOND
    ]


def extrapolated(test_time_second, voltage_volt, used, at_second, *, known_until):
    """Voltage of a rest continued at the reference temperature, by one exponential.

    The mean over time constants, each weighted by its likelihood.

    test_time_second, voltage_volt : (n,) of one rest [s], [V].
    used : list of (first, last) rows, inclusive, that are at the reference temperature.
    at_second : (m,) where the voltage is wanted [s].
    known_until : end of the first stretch; what relaxes afterwards is extrapolated [s].

    Returns volt, std_volt: (m,) [V]; the deviation holds the scatter, the choice of the time
    constant, and that in the cold the relaxation may have stood still (rectangular, from nothing to
    what was extrapolated); noise_volt : scatter of one bin [V].

    Source: thesis 3.3 (the dotted lines of fig. 3.9); weighting by likelihood is ours.
    """
    time, volt = (np.asarray(column, float) for column in (test_time_second, voltage_volt))
    # Bins weigh alike, however many samples they hold.
    rows = np.concatenate([np.arange(first, last + 1) for first, last in used])
    _, seen, means = _binned(time[rows], volt[rows], time[0])
    # From half an hour to ten lengths of the rest, beyond which an exponential is a line.
    taus = np.geomspace(1800.0, max(10.0 * (time[-1] - time[0]), 3600.0), 120)
    wanted = np.append(np.asarray(at_second, float), known_until)
    fits = [_exponential_fit(tau, seen - time[0], means, wanted - time[0]) for tau in taus]
    errors = np.array([error for error, _, _ in fits])
    # A record without any scatter still does not tell voltages below a microvolt apart.
    variance = max(errors.min() / max(len(seen) - 3, 1), 1e-12)
    # Likelihoods relative to the best, so that none underflows.
    weights = np.exp(-(errors - errors.min()) / (2 * variance))
    weights /= weights.sum()
    values = np.array([value for _, value, _ in fits])
    mean = weights @ values
    within = weights @ (variance * np.array([leverage for _, _, leverage in fits]))
    spread = within + weights @ (values - mean) ** 2
    later = np.asarray(at_second, float) > known_until
    # ASSUME: The cold slows a relaxation down, so it lies between its extrapolation and a halt.
    drift = np.where(later, mean[:-1] - mean[-1], 0.0)
    std = np.sqrt(spread[:-1] + drift**2 / 3)
    return mean[:-1], std, float(np.sqrt(variance))


def _exponential_fit(tau, seen, volt, wanted):
    """Squared error [V²], values at the wanted times [V] and their leverage for one time constant.

    The column is so scaled that a long time constant becomes a straight line, not a constant.
    """
    columns, asked = (
        np.stack([np.ones(len(t)), np.expm1(-(t - seen[0]) / tau)], axis=1) for t in (seen, wanted)
    )
    scale = np.abs(columns[:, 1]).max()
    columns[:, 1] /= scale
    asked[:, 1] /= scale
    weights = np.linalg.pinv(columns)
    coefficients = weights @ volt
    leverage = np.sum((asked @ weights) ** 2, axis=1)
    return np.sum((columns @ coefficients - volt) ** 2), asked @ coefficients, leverage


PLATEAU_KELVIN = 1.0  # plateaus so near to the first are at its temperature again


def chamber_steps(series, steps, basis, test, cell):
    """Shifts [V] of the open-circuit voltage in rests while the chamber temperature steps.

    series : with surface_temperature_celsius [°C].

    Returns rows, one a plateau: shift [V] and its uncertainty, temperatures [°C], SoC [1]. Raises
    Refusal: no rest with two steady temperatures. Source: thesis 3.3; docs/charge-temperature.md.
    """
    # The shift of the OCV by temperature changes its sign over SoC, so that must be known.
    columns = inputs.columns(series, *inputs.NAMES)
    anchored = state_of_charge(series, basis, test, cell)
    shifts = chamber_shifts(columns, anchored.soc, inputs.steps(steps))
    notes = (f"SoC: {anchored.anchor}", *shifts.notes)
    return Result({"rows": shifts.rows}, notes=notes)


def chamber_shifts(series, soc, steps):
    """Shift of the open-circuit voltage at every temperature of every rest.

    series : dict of (n,) columns of stage `clean`: test_time_second, voltage_volt, and the
        temperature of the cell, else of the chamber (`cell_temperature`).
    soc : (n,) state of charge [1], NaN where it is not known.
    steps : `series.steps.Steps` of the record.

    Returns rows of stage `ocv_step`, one a plateau; reference_volt is extrapolated for the first
    temperature. Raises Refusal: no temperature was recorded, or no rest in which it steps; each
    with its reason.

    Source: thesis 3.3 and fig. 3.9.
    """
    columns = [np.asarray(series[name], float) for name in ("test_time_second", "voltage_volt")]
    columns.append(cell_temperature(series))
    soc, rows, left_out = np.asarray(soc, float), [], []
    for first, last in joined_rests(steps):
        rest_rows = slice(first, last + 1)
        try:
            shifts = _shifts_of_rest(*(column[rest_rows] for column in columns))
        except Refusal as refusal:
            left_out.append(f"rest from {columns[0][first] / 3600:.1f} h: {refusal}")
            continue
        number = rows[-1]["rest"] + 1 if rows else 1
        level = float(np.median(soc[rest_rows]))
        rows += [{"rest": number, "soc": level} | row for row in shifts]
    if not rows:
        raise Refusal("; ".join(left_out) or "no rest in the record")
    return Result({"rows": rows}, notes=tuple(left_out))


def cell_temperature(series):
    """Temperature of the cell along a record [degC]: its surface's, else the chamber's.

    series : dict of (n,) columns of a clean series.

    Raises Refusal: neither was recorded; the stated temperature does not tell when the chamber
    stepped.
    """
    # ASSUME: At rest a cell is as warm inside as on its surface.
    for name in ("surface_temperature_celsius", "ambient_temperature_celsius"):
        values = series.get(name)
        if values is not None and np.isfinite(np.asarray(values, float)).any():
            return np.asarray(values, float)
    raise Refusal("no temperature was recorded: found neither the cell's nor the chamber's")


def _kept(time, plateaus):
    """First row of the first plateau after `SKIP_SECOND`; refuses a rest without a usable one."""
    if all(abs(p.celsius - plateaus[0].celsius) <= PLATEAU_KELVIN for p in plateaus):
        raise Refusal(f"{len(plateaus)} plateau(s) of temperature, none away from the first")
    first = plateaus[0]
    kept = max(first.first, int(np.searchsorted(time, time[0] + SKIP_SECOND)))
    if time[first.last] - time[min(kept, len(time) - 1)] < LEAST_REFERENCE_SECOND:
        held = (time[first.last] - time[first.first]) / 3600
        wanted = (SKIP_SECOND + LEAST_REFERENCE_SECOND) / 3600
        raise Refusal(f"{held:.1f} h at the first temperature; wanted {wanted:.1f} h")
    return kept


def _shifts_of_rest(time, voltage, celsius):
    """Rows of one rest, one a plateau."""
    plateaus = plateaus_of(time, celsius)
    kept = _kept(time, plateaus)
    first = plateaus[0]
    first = first._replace(first=kept, celsius=float(celsius[kept : first.last + 1].mean()))
    at_reference = [abs(p.celsius - first.celsius) <= PLATEAU_KELVIN for p in plateaus]
    used = [(kept, first.last)]
    later = zip(plateaus[1:], at_reference[1:], strict=True)
    used += [(p.first, p.last) for p, same in later if same]
    # Of hours at the first temperature only the end is a plateau of voltage as well.
    end = int(np.searchsorted(time, time[first.last] - LEAST_REFERENCE_SECOND))
    plateaus[0] = first._replace(first=end, celsius=float(celsius[end : first.last + 1].mean()))
    means = np.array([[p.celsius, voltage[p.first : p.last + 1].mean()] for p in plateaus])
    # The last tenths of a kelvin that a plateau lacks are taken off by the rest's own mean slope.
    slope = np.polyfit(means[:, 0], means[:, 1], 1)[0]
    level = voltage - slope * (celsius - first.celsius)
    middles = [(time[p.first] + time[p.last]) / 2 for p in plateaus]
    relaxed = extrapolated(time, level, used, np.array(middles), known_until=time[first.last])
    return [
        {
            "temperature_celsius": p.celsius,
            "time_second": middle,
            "voltage_volt": float(mean),
            "reference_volt": float(reference),
            "shift_volt": float(mean - reference),
            "noise_std_volt": float(relaxed[2] / np.sqrt(p.bins)),
            "relaxation_std_volt": float(std),
            "reference_temperature_celsius": first.celsius,
            "returned": bool(same and k > 0),
        }
        for k, (p, middle, mean, reference, std, same) in enumerate(
            zip(plateaus, middles, means[:, 1], *relaxed[:2], at_reference, strict=True)
        )
    ]
