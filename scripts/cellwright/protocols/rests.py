"""Every rest of a test: its two exponentials, and one rest with its fit as drawn."""

from collections import Counter

import numpy as np

from cellwright.numerics.noise import least_digit
from cellwright.protocols import counted, not_elsewhere
from cellwright.protocols.diffusion import diffusion_of_rest
from cellwright.protocols.relaxation import fit_relaxation, noise_volt, reasons_against
from cellwright.records import inputs
from cellwright.records.anchor import AS_STATED
from cellwright.records.basis import state_of_charge
from cellwright.records.conditions import LOW_C_RATE, low_current
from cellwright.records.repeats import steps_elsewhere
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.steps import follows_directly

# Two time constants of minutes are told from ten minutes on; the thesis rests 40.
SHORTEST_REST_SECOND = 600.0
R_SQUARED_LIMIT = 0.98  # thesis 3.3: every rest lies above it, and needs no reason

STEADY = ("CC", "pulse")  # loads of one current, whose polarisation is proportional to it
MOVED_KELVIN = 3.0  # from here on the rest is one of the chamber, not of the cell
# Of stage `relaxation`; said here for a table without rows, whose columns have their types too.
COLUMNS = dict.fromkeys(
    (
        *("rest", "start_time_second", "soc", "temperature_celsius", "direction", "load"),
        *("current_before_ampere", "load_second", "rest_second", "delay_second", "samples"),
        *("exponentials", "chosen", "a_volt", "a_std_volt", "tau1_second", "tau1_std_second"),
        *("b_volt", "b_std_volt", "tau2_second", "tau2_std_second", "fast_volt", "fast_std_volt"),
        *("fast_tau_second", "fast_tau_std_second", "r1_ohm", "r2_ohm", "ocv_volt"),
        *("ocv_std_volt", "ahead_volt", "drift_volt", "r_squared", "rmse_volt", "noise_volt"),
        *("reason", "diffusion_second", "diffusion_std_second", "diffusion_reason"),
    ),
    float,
)
COLUMNS |= {"direction": str, "load": str, "reason": str, "diffusion_reason": str, "chosen": bool}
COLUMNS |= dict.fromkeys(("rest", "samples", "exponentials"), int)
NO_DIFFUSION = {"diffusion_second": np.nan, "diffusion_std_second": np.nan, "diffusion_reason": ""}
# Names of an amplitude [V] and its time constant [s], those of the fastest exponential last.
PAIRS = {"a": "tau1", "b": "tau2", "fast": "fast_tau"}


def relaxation(series, steps, basis, test, cell, *, repeats=None):
    """Two exponentials fitted to the voltage of each rest of one test: amplitudes, time constants.

    Returns rows, `protocols.rests.RestRows`, (k,): amplitudes [V], time constants [s] and their
    uncertainty; curve: voltage over time of one rest. Raises Refusal: no rest after a load is long
    enough. Source: thesis 3.3; docs/relaxation.md.
    """
    columns = inputs.columns(series, *inputs.NAMES)
    test, steps = inputs.test_facts(test), inputs.steps(steps)
    time, current, voltage = inputs.quantities(columns)
    anchored = state_of_charge(columns, basis, test, cell)
    rests = rests_of(
        time,
        current,
        voltage,
        anchored.soc,
        steps,
        temperature_celsius=chamber_or_cell(columns),
        elsewhere=steps_elsewhere(repeats, test, steps),
    )
    # What a rest tells does not need the SoC: its origin is a note only where it is in doubt.
    stated = test.soc is not None
    doubted = np.isnan(anchored.soc).all() or (stated and not anchored.anchor.startswith(AS_STATED))
    where = [f"SoC: {anchored.anchor}"] if doubted else []
    where += filter(None, [diffusion_in_words(rests.rows)])
    tables = {"rows": rests.rows, "curve": example(rests.rows, time, voltage)}
    return Result(tables, notes=(*where, *rests.notes))


# ASSUME: The cell had relaxed before the load that a rest follows.
def rests_of(
    test_time_second,
    current_ampere,
    voltage_volt,
    soc,
    steps,
    *,
    temperature_celsius=None,
    elsewhere=None,
    diffusion=True,
):
    """Depolarisation of every rest that follows a load, by two exponentials.

    1. A rest counts from `SHORTEST_REST_SECOND` on, where the record has no gap before it and the
    load was no low current (C/37); its first sample is left out where it still shows the edge; it
    ends where the temperature has moved by 3 K. 2. Two exponentials are fitted, or one where two
    are not told. 3. Where a third, faster one is told as well, it has a row of its own and is
    chosen. 4. What falls short of the limit says why.

    test_time_second, current_ampere, voltage_volt : (n,) [s], [A] positive on charge, [V].
    soc : (n,) [1], NaN where not known.
    steps : series.steps.Steps.
    temperature_celsius : (n,) of the chamber, else of the cell, or None [°C].
    elsewhere : as of `not_elsewhere`. diffusion : whether R²/D is asked for, which takes longest.

    Returns rows, which are columns of stage `relaxation`, one entry a rest and number of
    exponentials. rest counts the rests of the test; direction, load (kind of step),
    current_before_ampere and load_second are of the step before. delay_second : from its last
    sample to the rest's first, t = 0 of V = V∞ + a·exp(−t/tau1) + b·exp(−t/tau2), thesis (3.16)
    with V∞ = ocv_volt. fast_… : a third, faster exponential where one is told, else NaN. chosen :
    the larger number told. r1_ohm, r2_ohm : a and b over the current, and over the share of its end
    value that each reaches within the load. reason : why R² is below the limit, or what else stands
    against two exponentials; empty where nothing does. diffusion_… : R²/D and its deviation, or
    why neither (`diffusion_of_rest`). Without a row where no rest is long enough; `left_out` then
    says so.

    Source: thesis sec. 3.3, (3.14)–(3.16); dU/dt = −U/tau + i/c, the minus is missing in print.
    """
    celsius = np.full(len(soc), np.nan) if temperature_celsius is None else temperature_celsius
    columns = (test_time_second, current_ampere, voltage_volt, soc, celsius)
    series = tuple(np.asarray(column, float) for column in columns)
    kind = np.asarray(steps.kind)
    after_load = follows_directly(steps) & (kind == "rest") & (np.roll(kind, 1) != "rest")
    long = np.asarray(steps.duration_second) >= SHORTEST_REST_SECOND
    rests, rows, reasons = np.flatnonzero(after_load & long), [], Counter()
    rests = not_elsewhere(rests, elsewhere, "rest", reasons)
    for number, step in enumerate(rests):
        try:
            rows += _rows_of(number, series, steps, step, diffusion)
        except Refusal as refusal:
            reasons[str(refusal)] += 1
    left_out = counted(reasons)
    if not len(rests):
        left_out = (f"no rest after a load lasts {SHORTEST_REST_SECOND:g} s: no depolarisation",)
    table = {n: np.array([row[n] for row in rows], dtype=of) for n, of in COLUMNS.items()}
    return Result({"rows": table}, notes=left_out)


def chamber_or_cell(series):
    """Recorded temperature of the chamber, else of the cell's surface (n,) [°C]; None without.

    series : dict of columns; the cell's own warms in a load and cools in the rest.
    """
    chamber = series.get("ambient_temperature_celsius")
    return series.get("surface_temperature_celsius") if chamber is None else chamber


def _rows_of(number, series, steps, step, diffusion):
    """Rows of one rest: of two exponentials or one, and of three where determined."""
    if low_current(steps.c_rate[step - 1], 1.0):
        raise Refusal(f"load before the rest is below {LOW_C_RATE:.2g} C")
    time, _, voltage, _, celsius = series
    shortest = SHORTEST_REST_SECOND
    rows = np.arange(int(steps.first_row[step]), int(steps.last_row[step]) + 1)
    moved = np.abs(celsius[rows] - celsius[rows[0]]) > MOVED_KELVIN
    rows = rows[: int(np.argmax(moved))] if moved.any() else rows
    if rows[-1] < steps.last_row[step] and time[rows[-1]] - time[rows[0]] < shortest:
        raise Refusal(f"temperature moves by {MOVED_KELVIN:g} K within the first {shortest:g} s")
    rows = rows[_edge_samples(time[rows], voltage[rows]) :]
    back = rows[::-1]
    rows = back[_edge_samples(-time[back], voltage[back], at_most=3) :][::-1]
    t, v = time[rows], voltage[rows]
    two, three = fit_relaxation(t, v), fit_relaxation(t, v, most=3)
    fits = [two, three] if len(three.tau_second) == 3 else [two]
    noise = noise_volt(v)
    reason = reasons_against(
        two, three, v, limit=R_SQUARED_LIMIT, grain=least_digit(v), noise=noise
    )
    common = _load(series, steps, step, rows)
    common |= {"rest": number, "noise_volt": noise, "reason": reason}
    common |= _diffusion(common, series, steps, step, (t, v), two) if diffusion else NO_DIFFUSION
    return [common | _fit(fit, common) | {"chosen": fit is fits[-1]} for fit in fits]


def _edge_samples(time, voltage, *, at_most=1):
    """Number of first samples to leave out, those that show an edge of the current.

    A first sample is one where it moves on three times as fast as the next, and by six noises: no
    time constant can be told from one sample, but it would draw those of the rest to itself.
    Backwards from the end of a rest they show the next load, where the clock of the voltage is
    ahead of that of the current: up to its first step from one sample to the next, `at_most`.
    """
    moved, passed = np.diff(voltage[: at_most + 2]), np.diff(time[: at_most + 2])
    steep = np.abs(moved / passed)
    far = np.abs(moved[:-1]) > 6.0 * noise_volt(voltage)
    steps = np.flatnonzero((steep[:-1] > 3.0 * steep[1:]) & far)
    return int(steps[-1]) + 1 if len(steps) else 0


def _load(series, steps, step, rows):
    """Columns that describe the rest and the load before it."""
    time, current, _, soc, celsius = series
    load, measured = steps.kind[step - 1], np.isfinite(celsius[rows])
    # Of a load without one current its last five rows tell what flowed before the rest.
    last = current[max(int(steps.last_row[step - 1]) - 4, 0) : rows[0]]
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
    """Columns of one fit; the two slowest exponentials are a and b."""
    count = len(fit.tau_second)
    place = {"a": max(count - 2, 0), "b": count - 1 if count > 1 else None}
    place["fast"] = 0 if count == 3 else None
    row = {"exponentials": count}
    for name, index in place.items():
        values = fit.amplitude_volt, fit.amplitude_std_volt, fit.tau_second, fit.tau_std_second
        tau = PAIRS[name]
        names = f"{name}_volt", f"{name}_std_volt", f"{tau}_second", f"{tau}_std_second"
        for column, part in zip(names, values, strict=True):
            row[column] = np.nan if index is None else float(part[index])
    row["r1_ohm"] = _pair_resistance(row["a_volt"], row["tau1_second"], load)
    row["r2_ohm"] = _pair_resistance(row["b_volt"], row["tau2_second"], load)
    same = ("ocv_volt", "ocv_std_volt", "ahead_volt", "drift_volt", "r_squared", "rmse_volt")
    return row | {name: float(getattr(fit, name)) for name in same}


def _diffusion(load, series, steps, step, rest, exponentials):
    """Columns on R²/D, by diffusion after a long constant current; else why it is not told.

    rest : time [s], voltage [V] (n,) of its rows. exponentials : Relaxation of the same.
    """
    if load["load"] != "CC":
        return NO_DIFFUSION | {
            "diffusion_reason": f"its load is no long constant current: {load['load']}"
        }
    rested = step > 1 and steps.kind[step - 2] == "rest"
    before = series[2][int(steps.first_row[step - 1]) - 1] if rested else np.nan
    try:
        found = diffusion_of_rest(
            rest[0] - load["start_time_second"] + load["delay_second"],
            rest[1],
            exponentials,
            load_second=load["load_second"],
            current_ampere=load["current_before_ampere"],
            before_volt=before,
        )
    except Refusal as refusal:
        return NO_DIFFUSION | {"diffusion_reason": str(refusal)}
    told = {"diffusion_second": found.second, "diffusion_std_second": found.std_second}
    return NO_DIFFUSION | told


def diffusion_in_words(rows):
    """Sentence on R²/D of a test's rests, "" where none tells it.

    Mean weighted by their deviations. It is no surer than the typical rest: what the sphere and the
    straight open-circuit voltage do not hold is the same in all of them.
    rows : of `rests_of`.
    """
    told = np.isfinite(rows["diffusion_second"]) & rows["chosen"]
    if not told.any():
        return ""
    second, std = rows["diffusion_second"][told], rows["diffusion_std_second"][told]
    weight = std**-2 / np.sum(std**-2)
    mean = float(weight @ second)
    chi = np.sqrt(np.sum(((second - mean) / std) ** 2) / max(len(second) - 1, 1))
    off = float(np.median(std)) * max(float(chi), 1.0)
    return (
        f"diffusion time R²/D: {mean:.4g} ± {off:.2g} s over {len(second)} rests, "
        f"{second.min():.4g} to {second.max():.4g} s"
    )


def _pair_resistance(volt, tau, load):
    """Resistance of an RC pair that the load charged to `volt` [ohm]; NaN unless it was steady."""
    if load["load"] not in STEADY:
        return np.nan
    return volt / load["current_before_ampere"] / -np.expm1(-load["load_second"] / tau)


def example(rows, test_time_second, voltage_volt):
    """Voltage and chosen fit of the rest nearest 50 % SoC, or of the middle rest without SoC.

    rows : of `rests_of`. test_time_second, voltage_volt : (n,) of the test [s], [V].

    Returns curve: dict of (m,) columns time_second, voltage_volt, fitted_volt and soc (of the
    rest, in each row); empty where no rest was fitted.
    """
    chosen = np.flatnonzero(rows["chosen"])
    names = ("time_second", "voltage_volt", "fitted_volt", "soc")
    if not len(chosen):
        return {name: np.zeros(0) for name in names}
    off = np.abs(rows["soc"][chosen] - 0.5)
    k = chosen[np.nanargmin(off)] if np.isfinite(off).any() else chosen[len(chosen) // 2]
    rest = {name: column[k] for name, column in rows.items()}
    since = np.asarray(test_time_second, float) - rest["start_time_second"]
    length = rest["rest_second"] - rest["delay_second"]
    inside = np.flatnonzero((since >= 0) & (since <= length))
    # As many points as a panel shows, dense at first, where the voltage moves.
    kept = inside[np.unique(np.geomspace(1, len(inside), 400).astype(int)) - 1]
    fitted = np.full(len(kept), rest["ocv_volt"])
    for name, tau in PAIRS.items():
        tau_second = np.nan_to_num(rest[f"{tau}_second"], nan=1.0)
        fitted += np.nan_to_num(rest[f"{name}_volt"]) * np.exp(-since[kept] / tau_second)
    volts = np.asarray(voltage_volt, float)[kept]
    soc = np.full(len(kept), rest["soc"])
    return dict(zip(names, (since[kept], volts, fitted, soc), strict=True))
