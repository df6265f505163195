"""Shape of the voltage after a load, at the begin of a load, and dQ/dV of a slow charge."""

import numpy as np
from scipy import ndimage, signal
from scipy.optimize import least_squares

from virtual_lab.reality.noise import white_level
from virtual_lab.reality.records import Curve, number_rows

ENDS_SECOND = (40.0, 180.0, 600.0, 3500.0)
RELAXATION_SECOND = (1.0, 10.0, 100.0, 1000.0)
FIT_SECOND = 600.0
LOADED_SECOND = 60.0
SLOWEST_FIRST_SAMPLE = 12.0
SAME, WIDEST = 0.1, 3.0
EARLY_SECOND, FEWEST_EARLY = 31.0, 3
LONGEST_INTERVAL = 65.0
LEAST_VOLT, LEAST_OVER_NOISE = 0.002, 20.0


def shares(second: np.ndarray, volt: np.ndarray, *, until_second: float) -> dict[float, float]:
    """Share [1] of the voltage change until `until_second` that is done after 1, 10, … s.

    Parameters
    ----------
    second : (n,) [s] since the load ended; the first one is the last loaded sample, at 0.
    volt : (n,) [V].
    until_second : end of the change that counts as whole [s].

    Between samples the line is straight in log t; a time is left out where no sample lies within a
    tenth of it and the one after it is more than three times later than the one before.
    """
    whole = np.interp(until_second, second, volt) - volt[0]
    at, level = np.log(second[1:]), volt[1:] - volt[0]
    times = [
        time for time in RELAXATION_SECOND if time < until_second and _is_seen(second[1:], time)
    ]
    return {time: float(np.interp(np.log(time), at, level) / whole) for time in times}


def _is_seen(second, time) -> bool:
    """A sample within a tenth of the time, or one on each side not far from the other."""
    if np.min(np.abs(second - time)) <= SAME * time:
        return True
    after = np.searchsorted(second, time)
    return 0 < after < second.size and second[after] <= WIDEST * second[after - 1]


def stretched(second: np.ndarray, volt: np.ndarray) -> tuple[float, float, float]:
    """Exponent [1], time constant [s] and residual [1] of a fit of V∞ − A·exp(−(t/τ)^β).

    The residual is the RMS error over A. Samples are thinned to be even in log t, so that early
    and late times weigh alike. (Kohlrausch's law; β = 1 is one RC pair, 0.5 many of them.)
    """
    usable = second > 0
    at = np.geomspace(second[usable][0], second[-1], 60)
    wanted = np.interp(at, second, volt)
    size = wanted[-1] - wanted[0]

    def curve(p):
        with np.errstate(over="ignore"):
            return p[0] - p[1] * np.exp(-((at / np.exp(p[2])) ** p[3]))

    starts = [(wanted[-1], size, np.log(tau), 0.6) for tau in (20.0, 200.0, 1000.0)]
    bounds = ([-np.inf, -np.inf, np.log(0.1), 0.1], [np.inf, np.inf, np.log(1e5), 1.5])
    fits = [
        least_squares(lambda p: (curve(p) - wanted) / abs(size), start, bounds=bounds)
        for start in starts
    ]
    best = min(fits, key=lambda fit: fit.cost)
    rms = np.sqrt(2 * best.cost / at.size) * abs(size) / abs(best.x[1])
    return float(best.x[3]), float(np.exp(best.x[2])), float(rms)


def rests(record):
    """(step, condition, second, volt) of each rest after a load; rests in a row count as one."""
    steps = record.steps
    for index in np.flatnonzero(steps.kind == "rest"):
        before = index - 1
        if before < 0 or steps.kind[before] == "rest":
            continue
        others = np.flatnonzero(steps.kind[index:] != "rest")
        last = steps.last_row[index + others[0] - 1] if others.size else steps.last_row[-1]
        rows = np.arange(steps.first_row[index] - 1, last + 1)
        second, rows = _unbroken(record.second[rows] - record.second[rows[0]], rows)
        if _begins_densely(second):
            yield index, _load_before(steps, before), second, record.volt[rows]


def _unbroken(second, rows):
    """The samples up to the first gap, one for each instant."""
    hole = np.flatnonzero(np.diff(second) > LONGEST_INTERVAL)
    stop = hole[0] + 1 if hole.size else second.size
    second, rows = second[:stop], rows[:stop]
    new = np.concatenate([[True], np.diff(second) > 0])
    return second[new], rows[new]


def _begins_densely(second) -> bool:
    """Whether sampling begins at once, with enough early samples to draw a line."""
    early = second[1:] <= EARLY_SECOND
    return np.sum(early) >= FEWEST_EARLY and second[1] <= SLOWEST_FIRST_SAMPLE


def _is_large_enough(second, volt, end_second) -> bool:
    """Whether the rest lasts that long, and its voltage changes by clearly more than noise."""
    moved = np.interp(end_second, second, volt) - volt[0]
    return second[-1] >= 0.95 * end_second and abs(moved) > _least_change(volt)


def _least_change(volt) -> float:
    """Change [V] below which noise would shape the curve."""
    return max(LEAST_VOLT, LEAST_OVER_NOISE * white_level(volt[volt.size // 2 :]))


def _load_before(steps, before) -> str:
    """The load before a rest, in words."""
    kind = steps.kind[before]
    way = "charge" if steps.current_mean_ampere[before] > 0 else "discharge"
    if kind == "dynamic":
        return "after a dynamic load"
    if kind in ("CV", "CCCV"):
        return f"after a {way} and hold"
    if steps.duration_second[before] < LOADED_SECOND:
        return f"after a {way} pulse"
    return (
        f"after a {way} to the end"
        if steps.duration_second[before] > 1500
        else f"after a {way} step"
    )


def look_at_rests(record):
    """Numbers and curves of a record's rests."""
    numbers, curves = [], []
    for step, condition, second, volt in rests(record):
        row = {}
        for end in (e for e in ENDS_SECOND if _is_large_enough(second, volt, e)):
            row |= _voltage_shares(second, volt, min(end, second[-1]), f"{end:g} s")
            about = (record.source.name, record.cell, record.test, f"{condition}, to {end:g} s")
            curves.append(Curve(*about, *_remaining(second, volt, end)))
        row |= _stretched_fit(second, volt)
        numbers += number_rows(record, step, "relaxation", condition, row)
    return numbers, curves


def _voltage_shares(second, volt, until, name) -> dict:
    """Numbers about the voltage change until a time [s]."""
    part = shares(second, volt, until_second=until)
    row = {f"share of {name} by {time:g} s": (value, "1") for time, value in part.items()}
    return row | {f"way of {name}": (1e3 * (np.interp(until, second, volt) - volt[0]), "mV")}


def _stretched_fit(second, volt) -> dict:
    """Numbers of the stretched exponential over the first ten minutes."""
    inside = (second >= 1.0) & (second <= 1.5 * FIT_SECOND)
    whole = volt[inside][[0, -1]]
    if second[-1] < 0.95 * FIT_SECOND or abs(np.diff(whole)[0]) < _least_change(volt):
        return {}
    exponent, tau, rms = stretched(second[inside], volt[inside])
    return {
        "stretched exponent": (exponent, "1"),
        "stretched time constant": (tau, "s"),
        "rest of the stretched fit": (rms, "1"),
    }


def _remaining(second, volt, until):
    """Times [s] up to an end, and the share [1] of the voltage change that is still to come."""
    at = second[(second > 0) & (second <= until)]
    whole = np.interp(until, second, volt) - volt[0]
    return at, 1 - (np.interp(at, second, volt) - volt[0]) / whole


FINEST_SECOND = 1.1
SHORTEST_SECOND = 9.5
PULSE_SECOND = (0.1, 1.0, 3.0)
WHOLE_SECOND = 10.0
FAST_CURRENT = 0.98
LEAST_C_RATE = 0.25


def pulse_response(record, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds since the edge, and resistance [ohm], of one step's samples.

    The edge lies between the last sample at rest and the first under load, not further back than
    the next interval is long; its middle is taken. The current of each sample divides. The voltage
    at rest is that of the last three samples that is furthest from the load's, since with some
    instruments it drops a sample before the current shows.
    """
    first, last = record.steps.first_row[step], record.steps.last_row[step]
    rows = np.arange(first, last + 1)
    furthest = np.min if record.steps.current_mean_ampere[step] > 0 else np.max
    level = furthest(record.volt[max(first - 3, 0) : first])
    rows = rows[np.abs(record.ampere[rows]) > 0.5 * abs(record.steps.current_mean_ampere[step])]
    begin = record.second[first] - 0.5 * np.diff(record.second[first - 1 : first + 2]).min()
    return record.second[rows] - begin, (record.volt[rows] - level) / record.ampere[rows]


def pulse_steps(record):
    """Steps of constant current that begin after a rest, sampled densely for 10 s."""
    steps = record.steps
    for index in np.flatnonzero(np.isin(steps.kind, ("pulse", "CC"))):
        first, last = steps.first_row[index], steps.last_row[index]
        calm = index > 0 and steps.kind[index - 1] == "rest"
        if not calm or steps.c_rate[index] < LEAST_C_RATE or last - first < 8:
            continue
        second = record.second[first - 1 : last + 1]
        if second[-1] - second[1] < SHORTEST_SECOND or second[1] - second[0] > 60.0:
            continue
        if np.diff(second[1:9]).max() <= FINEST_SECOND:
            yield index


def describe_pulse(second: np.ndarray, ohm: np.ndarray, *, rating_ampere_hour: float) -> dict:
    """Resistance after 0.1, 1 and 3 s over that after 10 s, and the size of that one.

    Times before the first sample are left out.
    """
    whole = float(np.interp(min(WHOLE_SECOND, second[-1]), second, ohm))
    times = [time for time in PULSE_SECOND if second[0] <= time]
    name = "resistance after {:g} s over that after 10 s"
    ratios = {name.format(time): (np.interp(time, second, ohm) / whole, "1") for time in times}
    return ratios | {
        "resistance after 10 s": (1e3 * whole, "mohm"),
        "resistance after 10 s times rating": (1e3 * whole * rating_ampere_hour, "mohm·Ah"),
    }


def look_at_pulses(record):
    """Numbers and curves of a record's loads after a rest."""
    numbers, curves = [], []
    about = (record.source.name, record.cell, record.test)
    for step in pulse_steps(record):
        second, ohm = pulse_response(record, step)
        c_rate = record.steps.c_rate[step]
        way = "charge" if record.steps.current_mean_ampere[step] > 0 else "discharge"
        row = describe_pulse(second, ohm, rating_ampere_hour=record.rating_ampere_hour)
        row |= {
            "C-rate": (c_rate, "1/h"),
            "time to full current": (_rise_millisecond(record, step), "ms"),
        }
        numbers += number_rows(record, step, "pulse", f"{way} out of a rest", row)
        inside = (second > 0) & (second <= 1.02 * WHOLE_SECOND)
        whole = row["resistance after 10 s"][0] / 1e3
        curves.append(Curve(*about, way, second[inside], ohm[inside] / whole))
    return numbers, curves


def _rise_millisecond(record, step) -> float:
    """Time [ms] from the first sample under load to the first at 98 % of the current."""
    rows = np.arange(record.steps.first_row[step], record.steps.last_row[step] + 1)
    plateau = np.median(record.ampere[rows])
    full = rows[np.argmax(record.ampere[rows] / plateau >= FAST_CURRENT)]
    return 1e3 * float(record.second[full] - record.second[rows[0]])


BIN_VOLT = 0.001
SMOOTH_VOLT = {"LFP": 0.002}
USUAL_SMOOTH_VOLT = 0.005
LEAST_RANGE = 0.6
PROMINENCE = 0.05
FASTEST_C_RATE, SLOW_C_RATE = 0.6, 0.07


def incremental_capacity(
    volt: np.ndarray, ampere_hour: np.ndarray, *, smooth_volt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Voltages [V] at the middle of bins of 1 mV and dQ/dV [Ah/V] of a charge.

    Charge is counted into narrow bins of voltage, which noise does not upset as it upsets a
    quotient of differences, and smoothed by a Gaussian; the same for every record.

    Parameters
    ----------
    volt, ampere_hour : (n,) [V], [Ah], in the order of time.
    smooth_volt : standard deviation of the Gaussian [V].
    """
    edges = np.arange(volt.min() - 5 * BIN_VOLT, volt.max() + 6 * BIN_VOLT, BIN_VOLT)
    between, gained = 0.5 * (volt[1:] + volt[:-1]), np.diff(ampere_hour)
    low, high = np.minimum(volt[1:], volt[:-1]), np.maximum(volt[1:], volt[:-1])
    width = np.maximum(high - low, 1e-6)
    low, high = between - 0.5 * width, between + 0.5 * width
    ramp = [np.sum(gained * np.clip((edge - low) / (high - low), 0, 1)) for edge in edges]
    raw = np.diff(ramp) / BIN_VOLT
    return edges[:-1] + 0.5 * BIN_VOLT, ndimage.gaussian_filter1d(raw, smooth_volt / BIN_VOLT)


def found_peaks(volt: np.ndarray, per_volt: np.ndarray) -> list[tuple[float, float, float]]:
    """(voltage [V], height, width [V] at half prominence) of each peak.

    The prominence of a peak is 5 % of the highest value or more.
    """
    least = PROMINENCE * per_volt.max()
    at, about = signal.find_peaks(per_volt, prominence=least, width=1, rel_height=0.5)
    step = volt[1] - volt[0]
    return [
        (float(volt[row]), float(per_volt[row]), float(step * width))
        for row, width in zip(at, about["widths"], strict=True)
    ]


def slow_charges(record):
    """(step, rows) of constant-current charges up to 0.6C through most of the charge."""
    steps = record.steps
    for index in np.flatnonzero(np.isin(steps.kind, ("CC", "CCCV"))):
        first, last = steps.first_row[index], steps.last_row[index]
        held = steps.cv_first_row[index]
        rows = np.arange(first + 1, (held if held > first else last) + 1)
        if rows.size < 60 or steps.current_mean_ampere[index] <= 0:
            continue
        moved = np.ptp(record.ampere_hour[rows])
        if (
            moved > LEAST_RANGE * np.ptp(record.ampere_hour)
            and _c_rate(record, rows) < FASTEST_C_RATE
        ):
            yield index, rows


def describe_peaks(peaks: list[tuple[float, float, float]]) -> dict:
    """Number of peaks, the narrowest and the highest, and each by rising voltage."""
    row = {"peaks": (len(peaks), "1")}
    if peaks:
        row["narrowest peak, width"] = (1e3 * min(width for _, _, width in peaks), "mV")
        row["highest peak, height over capacity"] = (max(height for _, height, _ in peaks), "1/V")
    for number, (place, height, width) in enumerate(peaks, 1):
        row[f"peak {number}, voltage"] = (place, "V")
        row[f"peak {number}, height over capacity"] = (height, "1/V")
        row[f"peak {number}, width"] = (1e3 * width, "mV")
    return row


def _c_rate(record, rows) -> float:
    return float(np.median(record.ampere[rows]) / record.rating_ampere_hour)


def look_at_charges(record):
    """Numbers and curves of a record's slow charges, heights over the charge that went in."""
    numbers, curves = [], []
    smooth = SMOOTH_VOLT.get(record.chemistry, USUAL_SMOOTH_VOLT)
    for step, rows in slow_charges(record):
        c_rate = _c_rate(record, rows)
        moved = np.ptp(record.ampere_hour[rows])
        volt, per_volt = incremental_capacity(
            record.volt[rows], record.ampere_hour[rows] / moved, smooth_volt=smooth
        )
        row = {
            "C-rate": (c_rate, "1/h"),
            "interval": (np.median(np.diff(record.second[rows])), "s"),
        }
        row |= describe_peaks(found_peaks(volt, per_volt))
        condition = "slow charge" if c_rate < SLOW_C_RATE else "charge"
        numbers += number_rows(record, step, "peaks", condition, row)
        panel = f"{record.chemistry} {condition} at C/{1 / c_rate:.0f}"
        about = (record.source.name, record.cell, record.test, panel)
        curves.append(Curve(*about, volt, per_volt))
    return numbers, curves
