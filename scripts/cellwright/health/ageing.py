"""Capacity over cycles and temperature in one ageing record, and its daily cycle."""

from typing import NamedTuple

import numpy as np

from cellwright.health.fade import LEAST_CYCLES
from cellwright.laws.law import law_row
from cellwright.numerics.lines import coloured_line, residuals
from cellwright.numerics.periods import daily_sine, periods
from cellwright.numerics.statistics import rms, robust_std, t_interval
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result

LAGS_HOUR = np.array([*np.arange(11) / 10, 1.25, 1.5, 2.0, 2.5, 3.0])
ROOM, START = "room", "cell as the discharge begins"
NEEDED = (
    *("cycle", "direction", "start_time_second", "duration_second", "capacity_ampere_hour"),
    *("coulombic_efficiency", "room_temperature_celsius", "temperature_start_celsius"),
)


def lagged_temperatures(course_hour, course_celsius, hour):
    """Temperature [°C] that may act on a cell, one course for each lag behind the readings tried.

    Both extremes of how a cell follows: at once but later (a delay), and as one heat capacity
    behind one resistance does (an exponential memory). A slope by dT/dt beside T knows neither:
    over a day it loses (2π lag/24 h)² of a slope, 7 % at one hour.

    Parameters
    ----------
    course_hour, course_celsius : (m,) rising hours of the readings, and readings [h], [°C].
    hour : (n,) times at which the temperature is wanted [h].

    Returns
    -------
    courses : list of (n,) [°C], one a lag and kind of following, the first without any lag.
    """
    from scipy.interpolate import Akima1DInterpolator

    # Unlike a cubic spline it does not swing across the pauses of a record.
    spline = Akima1DInterpolator(course_hour, course_celsius)
    # Before its first reading the course is held.
    courses = [spline(np.maximum(hour - lag, course_hour[0])) for lag in LAGS_HOUR]
    places, weights = np.polynomial.laguerre.laggauss(8)
    for lag in LAGS_HOUR[1:]:
        back = np.maximum(hour[:, None] - lag * places, course_hour[0])
        courses.append(spline(back) @ weights)
    return courses


def reading_noise(hour, celsius):
    """Standard deviation of single readings [K] about a cubic through their four neighbours.

    As if all that its neighbours do not predict were a reading's error, though part of it may be
    the temperature itself.

    Parameters
    ----------
    hour, celsius : (m,) rising hours and readings [h], [°C]; fewer than five give NaN.
    """
    errors = []
    for k in range(2, len(hour) - 2):
        near = [k + step for step in (-2, -1, 1, 2)]
        # Weights of the neighbours in the cubic's value here, from its value at 0.
        weights = np.linalg.inv(np.vander(hour[near] - hour[k]))[-1]
        errors.append((celsius[k] - weights @ celsius[near]) / np.sqrt(1 + weights @ weights))
    return rms(errors)


def ageing_over_temperature(cycles, test):
    """Fade, temperature and daily cycle of the capacities of one ageing record.

    cycles : result of `ageing_cycles`, or its columns.

    Returns cycles; rows: the laws; periodogram; content: summary. Raises Refusal: too few cycles.
    Source: docs/health.md.
    """
    columns = inputs.columns(getattr(cycles, "rows", cycles), *NEEDED)
    summary, compensated, periodogram = cycle_temperature(columns)
    rows = law_rows(summary, test=inputs.test_facts(test).test)
    notes = tuple(filter(None, [summary["reason"]]))
    tables = {"cycles": compensated, "rows": rows, "periodogram": periodogram}
    return Result(tables, {"summary": summary}, notes)


def cycle_temperature(rows):
    """Fade, temperature slope and daily cycle of the discharge capacities of one record.

    ln capacity = fade(cycle) + slope · (T − mean T) [+ bend · (T − mean T)²] + noise: a cell that
    has lost a tenth moves by a tenth less with temperature. The fade is a polynomial of degree 1
    to 4; T is what the cell feels of its room, at once or up to 3 h later; the noise is
    exponentially correlated in time. Degree, lag, bend and memory are averaged over what the data
    allow (Bayesian information criterion), so that not knowing them widens the interval. A slope
    over a temperature that is read with an error comes out too small and is corrected for it (see
    `_corrected_for_reading_error`).
    Discharges whose charge before, or the one before that, is not in the record are set aside, for
    they did not begin like the others (unless most are without), and so are those further than six
    robust standard deviations from the course. The temperature is the room's where recorded, else
    the cell's as a discharge begins, before its own heat.

    Parameters
    ----------
    rows : columns of `protocols.ageing.ageing_cycles`. A slope, with its 95 % interval, is given
        where the RMS of the temperature about its trend along the fade is 0.3 K or more.

    Returns
    -------
    summary : dict, the row of artefact `ageing_temperature`: slope in percent of the capacity of
        the moment; capacity at the start by the fade's course at the first used cycle and
        reference_celsius; losses from that cycle to the last; periods as of `periods.Period`.
    cycles : dict of columns, one entry a discharge: measured, fitted, fade alone at the reference,
        measured with the temperature taken out, and whether it was used.
    periodogram : dict of columns, period_hour and power.

    Raises
    ------
    Refusal : fewer than eight complete discharges after complete cycles.

    Source: thesis 3.1 (figures 3.2 and 3.3: 29 cycles, 4 K, about 1 %).
    """
    record = _record(rows)
    (fade, temperature_columns), models = _models(record)
    moved, reason = _temperature_movement(record, fade)
    columns = np.column_stack([fade, *([] if reason else temperature_columns)])
    line = _line(record, columns)
    fitted, carried = np.exp(columns @ line.values), np.exp(fade @ line.values[: fade.shape[1]])
    # In Ah of this discharge, so that its own scatter is kept.
    compensated = record.capacity - record.capacity * (1 - carried / fitted)
    table = {
        "cycle": record.cycle,
        "start_time_second": 3600 * record.hour,
        "capacity_ampere_hour": record.capacity,
        "temperature_celsius": record.celsius,
        "used": record.used,
        "fitted_ampere_hour": fitted,
        "fade_ampere_hour": carried,
        "capacity_at_reference_ampere_hour": compensated,
    }
    # A trend chosen by the data would make what is left whiter than noise is: the fullest one.
    trend = _basis(record.cycle, record.used, _highest_degree(record.used))[record.used]
    period = periods(record.hour[record.used], record.capacity[record.used], trend)
    error = record.noise / moved
    slope = _slope(None if reason else models, line.degrees_of_freedom, error)
    summary = (
        _conditions(record, moved)
        | slope
        | _losses(line, _line(record, fade))
        | {"explained": np.nan if reason else _explained(record, fade, compensated)}
        | _daily_cycle(record, fade, compensated, period, line, compares=not reason)
        | {"reason": "; ".join(dict.fromkeys(filter(None, [reason, period.reason])))}
    )
    return summary, table, {"period_hour": period.period_hour, "power": period.power}


def _line(record, columns):
    """Logarithm of the used capacities by columns (n, p): Line.

    Temperature and age act on what is left: factors, sums of logarithms.
    """
    used = record.used
    return coloured_line(columns[used], np.log(record.capacity[used]), record.place)


def _conditions(record, moved_kelvin):
    """What the slope rests on: discharges, and the temperatures that they saw."""
    used = record.used
    return {
        "temperature_source": record.source,
        "cycles": int(used.sum()),
        "set_aside": int((~used).sum()),
        "reference_celsius": float(record.celsius[used].mean()),
        "swing_kelvin": float(np.diff(np.quantile(record.celsius[used], [0.05, 0.95]))[0]),
        "moved_kelvin": moved_kelvin,
    }


def _losses(line, plain):
    """Capacity at the start, and losses from there with the temperature taken out and without."""
    return {
        "capacity_start_ampere_hour": float(np.exp(line.values[0])),
        "loss_percent": float(-100 * np.expm1(line.values[1])),
        "loss_std_percent": float(100 * np.exp(line.values[1]) * line.std[1]),
        "plain_loss_percent": float(-100 * np.expm1(plain.values[1])),
    }


def _explained(record, fade, compensated):
    """Share of the variance about the fade that the temperature explains [1]."""
    both = np.column_stack([record.capacity, compensated])[record.used]
    whole, rest = np.sum(residuals(fade[record.used], both) ** 2, axis=0)
    return float(1 - rest / whole) if whole > 0 else np.nan


def _daily_cycle(record, fade, compensated, period, line, *, compares):
    """The strongest period and the day's, and the day's swing once the temperature is taken out."""
    percent, left = 100 / float(np.exp(line.values[0])), np.nan
    if compares and not period.reason:
        used, rest = record.used, compensated[record.used]
        swing = daily_sine(rest, fade[used], record.place, record.hour[used])[0]
        left = 100 * swing / float(rest[0])
    return {
        "correlation": line.correlation,
        "best_period_hour": period.best_period_hour,
        "false_alarm": period.false_alarm,
        "daily_percent": period.daily_amplitude * percent,
        "daily_std_percent": period.daily_std * percent,
        "daily_peak_hour": period.daily_peak_hour,
        "daily_false_alarm": period.daily_false_alarm,
        "daily_left_percent": left,
    }


class _Record(NamedTuple):
    """Discharges of a record (n,), which are used, and their positions [typical interval].

    lagged : temperature that may act on the cell, one (n,) a lag [°C]; empty: none recorded.
    noise : of a reading of the temperature, at most [K].
    """

    cycle: np.ndarray
    hour: np.ndarray
    capacity: np.ndarray
    celsius: np.ndarray
    source: str
    used: np.ndarray
    place: np.ndarray
    lagged: list
    noise: float


def _record(rows):
    """Discharges of a record with their temperature, and which of them are used."""
    discharges = np.flatnonzero(rows["direction"] == "discharge")
    cycle, capacity = rows["cycle"][discharges], rows["capacity_ampere_hour"][discharges]
    complete = np.isfinite(rows["coulombic_efficiency"][discharges])
    usual = complete & np.append(False, complete[:-1])
    # Where most charges are not in the record, most discharges begin alike without them.
    if len(usual) >= LEAST_CYCLES and 2 * usual.sum() < len(usual):
        usual = np.ones(len(usual), bool)
    used = _inliers(cycle, capacity, usual)
    hour = rows["start_time_second"][discharges] / 3600
    place = (hour[used] - hour[used][0]) / np.median(np.diff(hour[used]))
    celsius, source = _temperature(rows, discharges)
    lagged, noise = _lagged(rows, discharges, celsius, source)
    return _Record(cycle, hour, capacity, celsius, source, used, place, lagged, noise)


def _lagged(rows, discharges, celsius, source):
    """Temperature courses for each lag, and the largest error of a reading [K].

    A cell's own temperature needs no lag; its reading error cannot be estimated from its
    neighbours, which are hours of load away.
    """
    if source != ROOM:
        return [celsius] if source else [], 0.0
    middle = (rows["start_time_second"] + rows["duration_second"] / 2) / 3600
    # The room's temperature is taken during charges as well as discharges.
    recorded = np.isfinite(rows["room_temperature_celsius"])
    hour, course = middle[recorded], rows["room_temperature_celsius"][recorded]
    courses = lagged_temperatures(hour, course, middle[discharges])
    return [celsius, *courses[1:]], reading_noise(hour, course)


def _temperature(rows, discharges):
    """Temperature of each discharge [°C] and its source, room or cell; NaN and "": none."""
    cycle = rows["cycle"][discharges]
    sources = {ROOM: rows["room_temperature_celsius"], START: rows["temperature_start_celsius"]}
    for source, recorded in sources.items():
        celsius = recorded[discharges]
        known = np.isfinite(celsius)
        if known.mean() > 0.9:
            return np.interp(cycle, cycle[known], celsius[known]), source
    return np.full(len(discharges), np.nan), ""


def _inliers(cycle, capacity, followed):
    """Which discharges follow a charge of the record and lie near the fade, in two rounds."""
    if followed.sum() < LEAST_CYCLES:
        raise Refusal(
            f"{followed.sum()} complete discharge(s) after a complete cycle; fade and temperature "
            f"need {LEAST_CYCLES}"
        )
    used = followed
    for _ in range(2):
        basis = _basis(cycle, used, _highest_degree(used))
        values = np.linalg.lstsq(basis[used], capacity[used], rcond=None)[0]
        residual = capacity - basis @ values
        spread = robust_std(residual[used])
        near = np.abs(residual) <= max(6.0 * spread, 1e-4 * np.abs(capacity).max())
        used = followed & near
    return used


def _highest_degree(used):
    """Highest degree of the fade that so many cycles bear: six a degree, up to the fourth."""
    return max(min(4, int(used.sum()) // 6), 1)


def _basis(cycle, used, degree):
    """Columns of the fade (n, degree + 1): first value, change to the last, bends in between."""
    first, last = cycle[used][0], cycle[used][-1]
    x = (cycle - first) / (last - first)
    bends = [x * (1 - x) * (2 * x - 1) ** k for k in range(degree - 1)]
    return np.column_stack([np.ones(len(x)), x, *bends])


def _models(record):
    """Models of every degree of the fade and every lag, with and without bend.

    Returns columns (n, p) of fade and of temperature of the likeliest; weight, slope and variance
    of the slope of each (3, m).
    """
    used, logarithm = record.used, np.log(record.capacity[record.used])
    levels = [celsius - celsius[used].mean() for celsius in record.lagged]
    options = [[]]
    if levels and np.ptp(levels[0]) > 0:
        courses = _plausible_lags(record, levels)
        options = [choice for course in courses for choice in ([course], [course, course**2])]
    columns_of, found = [], []
    for degree in range(1, _highest_degree(used) + 1):
        fade = _basis(record.cycle, used, degree)
        for temperature_columns in options:
            columns = np.column_stack([fade, *temperature_columns])[used]
            line = coloured_line(columns, logarithm, record.place)
            # Bayesian information criterion: each coefficient has its price.
            score = line.log_likelihood - 0.5 * columns.shape[1] * np.log(used.sum())
            # The slope stands behind the coefficients of the fade, if there is a temperature.
            slope, std = (
                (x[fade.shape[1]] if temperature_columns else np.nan)
                for x in (line.values, line.std)
            )
            columns_of.append((fade, temperature_columns))
            found.append((score, slope, std**2))
    score, slopes, variances = map(np.array, zip(*found, strict=True))
    weight = np.exp(score - score.max())
    return columns_of[int(np.argmax(weight))], (weight / sum(weight), slopes, variances)


def _plausible_lags(record, levels):
    """Temperature courses of lags that the data do not rule out, at most eight, evenly taken."""
    if len(levels) == 1:
        return levels
    used, logarithm = record.used, np.log(record.capacity[record.used])
    fade = _basis(record.cycle, used, _highest_degree(used))
    columns = [np.column_stack([fade, course, course**2])[used] for course in levels]
    likely = [coloured_line(x, logarithm, record.place).log_likelihood for x in columns]
    # Eight in log-likelihood: what is 3,000 times less likely weighs nothing.
    kept = np.flatnonzero(np.array(likely) > max(likely) - 8.0)
    return [levels[k] for k in kept[:: -(-len(kept) // 8)]]


def _temperature_movement(record, fade, *, least=0.3):
    """RMS of the temperature about its trend [K], and why no slope is determined, or ""."""
    if not record.source:
        return np.nan, "no temperature was recorded, so its slope is not knowable"
    moved = float(np.std(residuals(fade[record.used], record.celsius[record.used])))
    if moved**2 - record.noise**2 < least**2:
        blurred = f", read to {record.noise:.2g} K" if record.noise > 0.5 * least else ""
        return moved, (
            f"the temperature moves by {moved:.2g} K beside the fade{blurred}, less than {least:g} "
            "K: not excited, its slope is not knowable"
        )
    return moved, ""


def _slope(models, freedom, noise_share):
    """Slope in percent of the capacity per kelvin, averaged over the models; NaN without models.

    models : weight, slope and its variance of each, (m,), or None. noise_share : largest error of a
    temperature reading over the RMS of the temperature [1].
    """
    mean = std = np.nan
    if models is not None:
        weight, slopes, variance = models
        mean = weight @ slopes
        std = np.sqrt(weight @ (variance + (slopes - mean) ** 2))
    value, std = (100 * number for number in _corrected_for_reading_error(mean, std, noise_share))
    numbers = {"": value, "_std": std}
    numbers |= zip(("_lower", "_upper"), t_interval(value, std, freedom), strict=True)
    return {f"slope{end}_percent_per_kelvin": float(x) for end, x in numbers.items()}


def _corrected_for_reading_error(slope, std, noise_share):
    """Slope and its std corrected for the error of the temperature reading, which shrinks a slope.

    The slope is too small by the factor 1 − (noise/movement)² if all that a reading's neighbours do
    not predict is its error, and correct if it is the temperature itself. The data do not determine
    which: every share between the two is taken as equally likely.

    Source: W. A. Fuller, Measurement Error Models, Wiley 1987, section 1.1.
    """
    # ASSUME: Any share of the room temperature's change from one half cycle to the next may be an
    # error of reading.
    factor = 1 / (1 - noise_share**2)
    spread = slope * (factor - 1) / np.sqrt(12)
    return slope * (1 + factor) / 2, np.hypot(std * factor, spread)


def law_rows(summary, *, test):
    """Rows of the table of laws over temperature: slope, start, loss and daily cycle.

    Parameters
    ----------
    summary : of `cycle_temperature`. test : name of the record.
    """
    entries = (
        ("capacity_at_start", "Ah", "capacity_start_ampere_hour", ""),
        ("temperature_slope", "%/degC", "slope_percent_per_kelvin", "slope_std_percent_per_kelvin"),
        ("reference_temperature", "degC", "reference_celsius", ""),
        ("loss_over_record", "%", "loss_percent", "loss_std_percent"),
        ("daily_amplitude", "%", "daily_percent", "daily_std_percent"),
    )
    head = f"discharge capacity over the cycles of {test}", "fade and temperature"
    about, r_squared = summary | {"": np.nan}, summary["explained"]
    return [
        law_row(*head, name, about[value], about[std], unit=unit, r_squared=r_squared)
        for name, unit, value, std in entries
        if np.isfinite(about[value])
    ]
