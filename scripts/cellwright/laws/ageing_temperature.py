"""Capacity over cycles and temperature in one ageing record, and its daily cycle."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.coloured_line import coloured_line
from cellwright.laws.daily import daily_sine, periods
from cellwright.refusal import Refusal
from cellwright.uncertainty import t_interval

LEAST_CYCLES = 8
HIGHEST_DEGREE = 4
CYCLES_A_DEGREE = 6
OUTLIER = 6.0  # robust standard deviations from the course over cycles
ROOM, START = "room", "cell as the discharge begins"


class CycleFit(NamedTuple):
    """What temperature and age do to the discharge capacity of one record.

    summary : numbers as in artefact `ageing_temperature`. Slope in percent of
    capacity_start_ampere_hour, the fade's course at the first cycle and reference_celsius; losses
    from the first cycle to the last; periods as of `daily.Period`; reason : what is not known.
    cycles : columns, one row a discharge: measured, fitted, fade alone at the reference, measured
    with the temperature taken out, and whether it was used. periodogram : period_hour, power.
    """

    summary: dict
    cycles: dict
    periodogram: dict


def cycle_temperature(rows, *, least_kelvin=0.3, level=0.95):
    """Fade, temperature slope and daily cycle of the discharge capacities of one record.

    capacity = fade(cycle) + slope · (T − mean T) + lag · dT/dt + noise: the fade a polynomial of
    degree 1 to 4, the lag (a cell follows its room later) in or out, both by the Bayesian
    information criterion; the noise exponentially correlated in time, its memory averaged over
    what the data allow. Discharges whose charge before is not in the record are set aside, for
    they did not begin like the others, and so are those further than six robust standard
    deviations from the course. The temperature is the room's where recorded, else the cell's as
    a discharge begins, before its own heat.

    Parameters
    ----------
    rows : AgeingCycles. least_kelvin : RMS that the temperature must move beside the fade [K].
    level : coverage of the interval.

    Returns
    -------
    CycleFit

    Raises
    ------
    Refusal : fewer than eight complete discharges after complete charges.

    Source: thesis 3.1 (figures 3.2 and 3.3: 29 cycles, 4 K, about 1 %).
    """
    record = _record(rows)
    fade, beside = _columns(record)
    moved, reason = _moved(record, fade, least_kelvin)
    columns = np.column_stack([fade, *([] if reason else beside)])
    used, count = record.used, fade.shape[1]
    line = coloured_line(columns[used], record.capacity[used], record.place)
    plain = coloured_line(fade[used], record.capacity[used], record.place)
    shift = columns[:, count:] @ line.values[count:]
    # A trend chosen by the data would make what is left whiter than noise is: the fullest one.
    trend = _basis(record.cycle, used, _highest_degree(used))[used]
    found = periods(record.hour[used], record.capacity[used], trend)
    summary = {
        "temperature_source": record.source,
        "cycles": int(used.sum()),
        "set_aside": int((~used).sum()),
        "reference_celsius": float(record.celsius[used].mean()),
        "swing_kelvin": float(np.diff(np.quantile(record.celsius[used], [0.05, 0.95]))[0]),
        "moved_kelvin": moved,
        **_slope(line, count, level),
        "capacity_start_ampere_hour": float(line.values[0]),
        **_loss(line, plain),
        "explained": np.nan if reason else _explained(record.capacity, fade, shift, used),
        "correlation": line.correlation,
        **_daily(found, line.values[0]),
        "daily_left_percent": _left(record, fade, shift)
        if not (reason or found.reason)
        else np.nan,
        "reason": "; ".join(dict.fromkeys(filter(None, [reason, found.reason]))),
    }
    table = {
        "cycle": record.cycle,
        "start_time_second": 3600 * record.hour,
        "capacity_ampere_hour": record.capacity,
        "temperature_celsius": record.celsius,
        "used": used,
        "fitted_ampere_hour": columns @ line.values,
        "fade_ampere_hour": columns @ line.values - shift,
        "capacity_at_reference_ampere_hour": record.capacity - shift,
    }
    return CycleFit(summary, table, {"period_hour": found.period_hour, "power": found.power})


class _Record(NamedTuple):
    """Discharges of a record (n,), which are used, and the places of these [typical interval]."""

    cycle: np.ndarray
    hour: np.ndarray
    capacity: np.ndarray
    celsius: np.ndarray
    source: str
    used: np.ndarray
    place: np.ndarray


def _record(rows):
    mine = np.flatnonzero(rows.direction == "discharge")
    cycle, capacity = rows.cycle[mine], rows.capacity_ampere_hour[mine]
    used = _inliers(cycle, capacity, np.isfinite(rows.coulombic_efficiency[mine]))
    hour = rows.start_time_second[mine] / 3600
    place = (hour[used] - hour[used][0]) / np.median(np.diff(hour[used]))
    return _Record(cycle, hour, capacity, *_temperature(rows, mine), used, place)


def _temperature(rows, mine):
    """The temperature that capacity is held against, and whose it is."""
    for name, source in (
        ("room_temperature_celsius", ROOM),
        ("temperature_start_celsius", START),
    ):
        celsius = getattr(rows, name)[mine]
        if np.isfinite(celsius).mean() > 0.9:
            known = np.isfinite(celsius)
            return np.interp(rows.cycle[mine], rows.cycle[mine][known], celsius[known]), source
    return np.full(len(mine), np.nan), ""


def _inliers(cycle, capacity, followed):
    """Which cycles follow a charge of the record and lie on the course, found in two rounds."""
    if followed.sum() < LEAST_CYCLES:
        raise Refusal(
            f"{followed.sum()} complete discharge(s) after a complete charge; fade and temperature "
            f"need {LEAST_CYCLES}"
        )
    used = followed
    for _ in range(2):
        basis = _basis(cycle, used, _highest_degree(used))
        values = np.linalg.lstsq(basis[used], capacity[used], rcond=None)[0]
        residual = capacity - basis @ values
        spread = 1.4826 * np.median(np.abs(residual[used]))
        near = np.abs(residual) <= max(OUTLIER * spread, 1e-4 * np.abs(capacity).max())
        used = followed & near
    return used


def _highest_degree(used):
    return max(min(HIGHEST_DEGREE, int(used.sum()) // CYCLES_A_DEGREE), 1)


def _basis(cycle, used, degree):
    """Columns whose coefficients are the value at the first cycle, the change to the last, and
    bends that vanish at both."""
    first, last = cycle[used][0], cycle[used][-1]
    x = (cycle - first) / (last - first)
    bends = [x * (1 - x) * (2 * x - 1) ** k for k in range(degree - 1)]
    return np.column_stack([np.ones(len(x)), x, *bends])


def _columns(record):
    """Columns of the fade and those of the temperature, by the Bayesian information criterion."""
    used, celsius = record.used, record.celsius
    degrees = range(1, _highest_degree(used) + 1)
    options = [[]]
    if np.isfinite(celsius).all() and np.ptp(celsius) > 0:
        level, rate = celsius - celsius[used].mean(), np.gradient(celsius, record.hour)
        options = [[level], [level, rate]]

    def criterion(choice):
        columns = np.column_stack([_basis(record.cycle, used, choice[0]), *choice[1]])[used]
        line = coloured_line(columns, record.capacity[used], record.place)
        return -2 * line.log_likelihood + columns.shape[1] * np.log(used.sum())

    degree, beside = min(((d, one) for d in degrees for one in options), key=criterion)
    return _basis(record.cycle, used, degree), beside


def _moved(record, fade, least):
    """RMS of the temperature beside the fade, and why no slope can be told ("" where it can)."""
    if not record.source:
        return np.nan, "no temperature was recorded, so its slope is not knowable"
    columns, celsius = fade[record.used], record.celsius[record.used]
    moved = float(np.std(celsius - columns @ np.linalg.lstsq(columns, celsius, rcond=None)[0]))
    if moved < least:
        return moved, (
            f"the temperature moves by {moved:.2g} K beside the fade, less than {least:g} K: "
            "not excited, its slope is not knowable"
        )
    return moved, ""


def _slope(line, place, level):
    """Slope in percent of the capacity at the start; NaN where no temperature was fitted."""
    pairs = [100 / line.values[0] * array[place:] for array in (line.values, line.std)]
    value, std = (float(array[0]) if len(array) else np.nan for array in pairs)
    lower, upper = t_interval(value, std, line.degrees_of_freedom, level=level)
    return {
        "slope_percent_per_kelvin": value,
        "slope_std_percent_per_kelvin": std,
        "slope_lower_percent_per_kelvin": float(lower),
        "slope_upper_percent_per_kelvin": float(upper),
    }


def _loss(line, plain):
    return {
        "loss_percent": float(-100 * line.values[1] / line.values[0]),
        "loss_std_percent": float(100 * line.std[1] / line.values[0]),
        "plain_loss_percent": float(-100 * plain.values[1] / plain.values[0]),
    }


def _explained(capacity, fade, shift, used):
    """Share of the variance beside the fade that goes with the temperature."""
    both = np.column_stack([capacity, capacity - shift])[used]
    beside = both - fade[used] @ np.linalg.lstsq(fade[used], both, rcond=None)[0]
    whole, left = np.sum(beside**2, axis=0)
    return float(1 - left / whole) if whole > 0 else np.nan


def _left(record, fade, shift):
    """Amplitude of the daily cycle once the temperature is out [%]."""
    used = record.used
    rest = (record.capacity - shift)[used]
    amplitude = daily_sine(rest, fade[used], record.place, record.hour[used])[0]
    return 100 * amplitude / float(rest[0])


def _daily(found, capacity):
    scale = 100 / capacity
    return {
        "best_period_hour": found.best_period_hour,
        "false_alarm": found.false_alarm,
        "daily_percent": found.daily_amplitude * scale,
        "daily_std_percent": found.daily_std * scale,
        "daily_peak_hour": found.daily_peak_hour,
        "daily_false_alarm": found.daily_false_alarm,
    }
