"""The pulses of a cell identified by each method: the thesis' three, lmfit, and this project's."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import simulate
from cellwright.circuits.circuit import rc_circuit
from cellwright.circuits.temperature import celsius_of
from cellwright.numerics.statistics import delta_method
from cellwright.protocols.relaxation import fit_relaxation
from cellwright.refusal import Refusal
from pulse_methods.autoregressive import (
    circuit_of_coefficients,
    track,
)
from pulse_methods.genetic import evolve_by_genes
from pulse_methods.pulse import fit_circuit, names_of, profile_interval
from pulse_methods.pulse_records import pulse_records
from pulse_methods.with_lmfit import fit_by_lmfit, lmfit_parameters

PAIRS = 2
HOLD = "zero_order"  # the current of a pulse stays until the next sample
NAMES = names_of(PAIRS)
TYPES = dict.fromkeys(("test", "direction", "method", "reason"), str)
TYPES |= {"samples": int, "evaluations": int}
RESISTANCE_SHARES = 1e-3, 2.0  # of the largest polarisation over the current: bounds of a search
MOST_STEPS = 500  # of the uniform steps that the autoregressive form is given
LONGEST = 3.0  # lengths of the record: a time constant that is searched
EDGE_SHARE = 0.02  # of the pulse: samples of a rest no older show the edge, not the relaxation


class Identified(NamedTuple):
    """A circuit of one pulse by one method.

    values, std : (5,) R0, R1, R2 [ohm], tau1, tau2 [s], tau1 < tau2; NaN where the method does not
    tell them. evaluations : passes over the samples of the pulse. tau2_interval_second : 95 %, NaN
    at an open end. reason : what the method does not tell and why; empty where it tells all.
    """

    values: np.ndarray
    std: np.ndarray
    evaluations: int
    tau2_interval_second: tuple
    reason: str


class MethodRows(NamedTuple):
    """One entry a pulse and method, arrays of shape (rows,).

    direction, current_ampere (+ on charge), pulse_second, rest_second, samples : of the pulse.
    r0_ohm … tau2_second : the circuit, each with _std, NaN where the method has none or does not
    tell the parameter. …_spread : standard deviation about the straight line between the pulses of
    the same test next in SoC, from this and those two. tau2_lower_second, tau2_upper_second : 95 %
    by profile likelihood, of method "separable" only, NaN where open. pulse_resistance_ohm : of the
    circuit, from the rest to the pulse's end, with what the OCV moves by the pulse's charge.
    rmse_volt : of the circuit over pulse and rest. evaluations : passes over the samples of the
    pulse. reason : why parameters are missing.
    """

    test: np.ndarray
    ambient_temperature_celsius: np.ndarray
    start_time_second: np.ndarray
    soc: np.ndarray
    direction: np.ndarray
    current_ampere: np.ndarray
    pulse_second: np.ndarray
    rest_second: np.ndarray
    samples: np.ndarray
    method: np.ndarray
    r0_ohm: np.ndarray
    r0_std_ohm: np.ndarray
    r0_spread_ohm: np.ndarray
    r1_ohm: np.ndarray
    r1_std_ohm: np.ndarray
    r1_spread_ohm: np.ndarray
    tau1_second: np.ndarray
    tau1_std_second: np.ndarray
    tau1_spread_second: np.ndarray
    r2_ohm: np.ndarray
    r2_std_ohm: np.ndarray
    r2_spread_ohm: np.ndarray
    tau2_second: np.ndarray
    tau2_std_second: np.ndarray
    tau2_spread_second: np.ndarray
    tau2_lower_second: np.ndarray
    tau2_upper_second: np.ndarray
    pulse_resistance_ohm: np.ndarray
    rmse_volt: np.ndarray
    evaluations: np.ndarray
    reason: np.ndarray


class Comparison(NamedTuple):
    """The table, and sentences about pulses that were not taken."""

    rows: MethodRows
    left_out: tuple


def compare_methods(tests, basis, cell, **settings):
    """Identify R0 and two RC pairs from the pulses of a cell by each method in `METHODS`.

    Parameters
    ----------
    tests, basis, cell, settings : as in `pulse_records.pulse_records`.

    Returns
    -------
    comparison : Comparison; a pulse that a method cannot identify has a row with the reason, and
        without any pulse that counts there is no row, for which `left_out` has the reasons.
    """
    records, left_out = pulse_records(tests, basis, cell, **settings)
    identified = [
        (record, method, identify_pulse(record, method)) for record in records for method in METHODS
    ]
    columns = {name: [] for name in MethodRows._fields if "_spread" not in name}
    for record, method, circuit in identified:
        row = _row(record, method, circuit)
        for name in columns:
            columns[name].append(row[name])
    arrays = {name: np.array(v, dtype=TYPES.get(name, float)) for name, v in columns.items()}
    return Comparison(MethodRows(**arrays, **_spreads(arrays)), left_out)


def identify_pulse(record, method):
    """Circuit of one pulse by one method; without values, with the reason, where it has none.

    Parameters
    ----------
    record : PulseRecord.
    method : name in `METHODS`.

    Returns
    -------
    identified : Identified.
    """
    try:
        identified = METHODS[method](record)
        _check_positive(identified.values)
    except Refusal as refusal:
        unknown = np.full(len(NAMES), np.nan)
        return Identified(unknown, unknown, 0, (np.nan, np.nan), str(refusal))
    return identified


def _check_positive(values):
    for name, value in zip(NAMES, values, strict=True):
        if value < 0:
            raise Refusal(f"{name} is {value:.3g}: no resistor and no RC pair has that")


def _columns(record):
    return record.time_second, record.current_ampere, record.voltage_volt, record.ocv_volt


def _genetic(record):
    """The thesis' genetic algorithm over 100 generations; it gives no standard deviations."""
    bounds = _search_bounds(record)
    evolved = evolve_by_genes(_columns(record), bounds, hold=HOLD, n_rc=PAIRS)
    values = _ascending(evolved.values)
    lower, upper = np.array([bounds[name] for name in NAMES]).T
    return _with_bounds_noted(
        values, np.full(len(NAMES), np.nan), evolved.evaluations, lower, upper
    )


def _autoregressive(record):
    """Recursive least squares on uniform steps: two pairs, or one where two have no circuit."""
    step, current, voltage = _uniform(record)
    try:
        return _by_recurrence(step, current, voltage, PAIRS, "")
    except Refusal as refusal:
        return _by_recurrence(step, current, voltage, 1, f"one pair is given; of two, {refusal}")


def _rest_exponentials(record):
    """Two exponentials of the rest (thesis, table 2.2), R0 from the edge less their voltage."""
    since = record.time_second[record.edge :] - record.time_second[record.edge]
    pulse = record.time_second[record.edge] - record.time_second[1]
    relaxed = np.flatnonzero(since >= EDGE_SHARE * pulse)
    polarisation_volt = record.voltage_volt - record.ocv_volt
    rest = polarisation_volt[record.edge :]
    fit = fit_relaxation(since[relaxed], rest[relaxed])
    tau, level = fit.tau_second, record.level_ampere
    # What a pair shows at the first sample that was fitted has grown within the pulse and has
    # decayed since its end.
    share = -np.expm1(-pulse / tau) * np.exp(-since[relaxed[0]] / tau)
    r = fit.amplitude_volt / (level * share)
    r_std = fit.amplitude_std_volt / abs(level * share)
    last = polarisation_volt[record.edge - 1] - fit.ocv_volt
    r0 = (last - level * (r @ -np.expm1(-pulse / tau))) / level
    values, std = _two_pairs(r0, r, tau), _two_pairs(np.nan, r_std, fit.tau_std_second)
    return Identified(values, std, fit.passes, (np.nan, np.nan), fit.verdict)


def _lmfit(record):
    """Levenberg–Marquardt of lmfit from a start that an engineer would read off the pulse."""
    time, _, voltage, ocv = _columns(record)
    step = (voltage - ocv)[1 : record.edge] / record.level_ampere
    r0, grown, pulse = step[0], max(step[-1] - step[0], 0.1 * step[0]), time[record.edge]
    circuit = rc_circuit(r0, [grown / 2, grown / 2], [pulse / 10, pulse])
    parameters = lmfit_parameters(circuit)
    shortest, longest = _tau_bounds(record)
    for name in ("tau_second_1", "tau_second_2"):
        parameters[name].set(min=shortest, max=longest)
    fit = fit_by_lmfit(circuit, parameters, _columns(record), hold=HOLD)
    order = [fit.names.index(f"{name}_{k}") for name, k in LMFIT_ORDER]
    values, std = _ascending(fit.values[order], fit.std[order])
    lower, upper = np.array([(0.0, np.inf)] * (1 + PAIRS) + [(shortest, longest)] * PAIRS).T
    return _with_bounds_noted(values, std, int(fit.result.nfev), lower, upper)


LMFIT_ORDER = [("r_ohm", 0), ("r_ohm", 1), ("r_ohm", 2), ("tau_second", 1), ("tau_second", 2)]


def _separable(record):
    """This project's fit: resistances solved for, time constants by Levenberg–Marquardt."""
    bounds = dict.fromkeys(NAMES[1 + PAIRS :], _tau_bounds(record))
    fit = fit_circuit(*_columns(record), hold=HOLD, n_rc=PAIRS, bounds=bounds)
    interval = (np.nan, np.nan)
    if fit.values[PAIRS] > 0:
        profile = profile_interval(_columns(record), fit, "tau2_second", hold=HOLD, bounds=bounds)
        interval = profile.lower, profile.upper
    return Identified(fit.values, fit.std, fit.iterations, interval, fit.verdict)


METHODS = {
    "genetic": _genetic,
    "autoregressive": _autoregressive,
    "rest_exponentials": _rest_exponentials,
    "lmfit": _lmfit,
    "separable": _separable,
}


def _tau_bounds(record):
    """Bounds of both time constants [s]: the shortest step, and a few lengths of the record."""
    step = np.diff(record.time_second)
    return float(step[step > 0].min()), LONGEST * float(record.time_second[-1])


def _search_bounds(record):
    """Bounds of the genetic algorithm for every parameter, by name."""
    total = np.abs(record.voltage_volt - record.ocv_volt).max() / abs(record.level_ampere)
    shares = RESISTANCE_SHARES[0] * total, RESISTANCE_SHARES[1] * total
    return {name: shares if name[0] == "r" else _tau_bounds(record) for name in NAMES}


def _by_recurrence(step, current, voltage, pairs, reason):
    estimate = track(current, voltage, 0.0, n_rc=pairs)
    last = estimate.coefficient[-1]

    def numbers(coefficient):
        circuit = circuit_of_coefficients(coefficient, step, hold=HOLD, n_rc=pairs)
        return np.array([circuit.r0_ohm, *circuit.r_ohm, *circuit.tau_second])

    order = np.argsort(numbers(last)[1 + pairs :], kind="stable")
    values, std = delta_method(numbers, last, estimate.covariance)
    parts = [
        _two_pairs(numbers_of[0], numbers_of[1 : 1 + pairs][order], numbers_of[1 + pairs :][order])
        for numbers_of in (values, std)
    ]
    _check_positive(parts[0])
    return Identified(*parts, 1, (np.nan, np.nan), reason)


def _uniform(record):
    """Step [s], current and polarisation on uniform steps that both edges of the pulse fall on.

    The current is the mean over each step, the voltage that at its beginning.
    """
    time, length = record.time_second, record.time_second[record.edge] - record.time_second[1]
    usual = max(float(np.median(np.diff(time[1:]))), (time[-1] - time[1]) / MOST_STEPS)
    step = length / max(round(length / usual), 1)
    grid = time[1] + step * np.arange(-1, int((time[-1] - time[1]) / step + 1e-9) + 1)
    inside = np.concatenate([[grid[0]], time[1:]])
    passed = np.concatenate([[0.0], np.cumsum(record.current_ampere[1:-1] * np.diff(time[1:]))])
    charge = np.concatenate([[0.0], passed])
    ends = np.interp(np.append(grid, grid[-1] + step), inside, charge)
    polarisation_volt = np.concatenate([[0.0], (record.voltage_volt - record.ocv_volt)[1:]])
    return step, np.diff(ends) / step, np.interp(grid + 1e-6 * step, inside, polarisation_volt)


def _ascending(values, *others):
    """R0, R1, R2, tau1, tau2 with the pairs in the order of their time constants."""
    order = np.array([0, 1, 2, 3, 4] if values[3] <= values[4] else [0, 2, 1, 4, 3])
    ordered = [column[order] for column in (values, *others)]
    return ordered if others else ordered[0]


def _two_pairs(r0, r, tau):
    """R0, R1, R2, tau1, tau2 of one or two pairs; NaN for the pair that is not there."""
    missing = [np.nan] * (PAIRS - len(r))
    return np.array([r0, *r, *missing, *tau, *missing])


def _with_bounds_noted(values, std, evaluations, lower, upper):
    """Identified whose reason names the parameters at a bound of their search."""
    smallest = np.where(lower > 0, lower * 1.001, 1e-6 * np.nansum(values[: 1 + PAIRS]))
    limited = (values <= smallest) | (values >= upper * 0.999)
    reasons = [
        f"{name} lies at the bound of its search"
        for name, at_limit in zip(NAMES, limited, strict=True)
        if at_limit
    ]
    return Identified(values, std, evaluations, (np.nan, np.nan), "; ".join(reasons))


def _row(record, method, identified):
    """One row of the table, without the spread, which needs the neighbours."""
    values, std, edge = identified.values, identified.std, record.edge
    lower, upper = identified.tau2_interval_second
    pulse = float(record.time_second[edge] - record.time_second[1])
    row = {
        "test": record.test,
        "ambient_temperature_celsius": celsius_of(record.ambient_temperature_celsius),
        "start_time_second": record.start_time_second,
        "soc": record.soc,
        "direction": "charge" if record.level_ampere > 0 else "discharge",
        "current_ampere": record.level_ampere,
        "pulse_second": pulse,
        "rest_second": float(record.time_second[-1] - record.time_second[edge]),
        "samples": len(record.time_second),
        "method": method,
        "tau2_lower_second": lower,
        "tau2_upper_second": upper,
        "evaluations": identified.evaluations,
        "reason": identified.reason,
    }
    for name, value, deviation in zip(NAMES, values, std, strict=True):
        quantity, unit = name.split("_")
        row |= {name: float(value), f"{quantity}_std_{unit}": float(deviation)}
    return row | _error_and_resistance(record, values, pulse)


def _error_and_resistance(record, values, pulse):
    """Error of the circuit over the record, and resistance from the rest to the pulse's end."""
    if not np.isfinite(values[0]):
        return {"rmse_volt": np.nan, "pulse_resistance_ohm": np.nan}
    resolved = np.isfinite(values[1 : 1 + PAIRS])
    r, tau = values[1 : 1 + PAIRS][resolved], values[1 + PAIRS :][resolved]
    circuit = rc_circuit(values[0], r, tau)
    time, current, voltage, ocv = _columns(record)
    error = simulate(circuit, time, current, ocv, hold=HOLD) - voltage
    ocv_ohm = (ocv[record.edge] - ocv[0]) / record.level_ampere
    return {
        "rmse_volt": float(np.sqrt(np.mean(error[1:] ** 2))),
        "pulse_resistance_ohm": float(values[0] + r @ -np.expm1(-pulse / tau) + ocv_ohm),
    }


def _spreads(columns):
    """Columns of …_spread: of each test and method, from neighbours in SoC."""
    spreads = {}
    keys = list(zip(columns["test"], columns["method"], strict=True))
    of_key = {
        key: [k for k, other in enumerate(keys) if other == key] for key in dict.fromkeys(keys)
    }
    for name in NAMES:
        quantity, unit = name.split("_")
        spread = np.full(len(keys), np.nan)
        for rows in of_key.values():
            spread[rows] = local_spread(columns["soc"][rows], columns[name][rows])
        spreads[f"{quantity}_spread_{unit}"] = spread
    return spreads


def local_spread(soc, value):
    """Standard deviation of each value about the line through its neighbours in SoC.

    Three neighbouring values that scatter alike about a straight line leave a distance of the
    middle one whose variance is 1 + w² + (1 − w)² of theirs, w being its place between the others.

    Parameters
    ----------
    soc, value : (n,) in any order; pairs that are not finite are left out.

    Returns
    -------
    spread : (n,) in the unit of the value; NaN at the ends and where it is not known.
    """
    spread = np.full(len(value), np.nan)
    finite = np.flatnonzero(np.isfinite(soc) & np.isfinite(value))
    order = finite[np.argsort(soc[finite], kind="stable")]
    for below, middle, above in zip(order, order[1:], order[2:], strict=False):
        width = soc[above] - soc[below]
        if width <= 0:
            continue
        place = (soc[middle] - soc[below]) / width
        line = (1 - place) * value[below] + place * value[above]
        spread[middle] = abs(value[middle] - line) / np.sqrt(1 + place**2 + (1 - place) ** 2)
    return spread
