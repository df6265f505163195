"""What the current channel reads in rests, and what the cell's voltage says of that reading.

A current in a cell shows in its voltage twice: at once, by the ohmic resistance, and in a rest of
hours, by the charge it moves. A reading in rests that shows in neither is the sensor's own.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cellwright.formats.pieces import column_of, largest

SIGMAS = 4.0  # beyond which chance is ruled out, with some tens of rests to look at
PROMPT_SHARE = 0.5  # of the resistance that a step of load shows: there without delay
LEAST_CHARGE_SHARE = 0.01  # of the charge that a record moves: a load that the cell relaxes from
LEAST_ROWS = 8  # rows in each half of a rest
EXCURSION_SECOND = 10.0  # a longer reading beyond what is near zero is a load


def stretches(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First rows of the stretches in which a mask (n,) is true, and the rows after their last."""
    inner = np.flatnonzero(mask[1:] != mask[:-1]) + 1
    begins, ends = [0][: np.count_nonzero(mask[:1])], [len(mask)][: np.count_nonzero(mask[-1:])]
    turns = np.concatenate([begins, inner, ends]).astype(int)
    return turns[::2], turns[1::2]


def near_zero_ampere(current: np.ndarray) -> float:
    """Reading [A] below which a record's current is near zero: no step, as in `cleaning.flag`."""
    return 0.01 * largest(current)


def relaxing_rests(voltage: np.ndarray, first: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Mask (k,) of rests in which the voltage moves by more than its scatter: no charger holds it.

    A small current at a held voltage is a current, though the voltage knows nothing of it.

    voltage : (n,) array [V]
    first, stop : (k,) rows of each rest

    Returns (k,) array of bool.
    """
    moves = np.zeros(len(first), dtype=bool)
    for rest, (a, b) in enumerate(zip(first, stop, strict=True)):
        late = voltage[(a + b) // 2 : b]
        moves[rest] = abs(voltage[a] - late.mean()) > SIGMAS * late.std()
    return moves


def judge_by_response(
    columns: Mapping[str, np.ndarray], first: np.ndarray, stop: np.ndarray
) -> tuple[str, str, float]:
    """Verdict by the voltage's answer to changes of the reading in rests, compared with a load.

    From sample to sample a current moves the voltage by its ohmic resistance. Compared is the
    slope of the voltage's changes over the reading's, in the second halves of the rests, with the
    resistance that steps of load show within 2 s; also at a lag of one sample to either side.

    columns : mapping of arrays, as in `rest_reading`
    first, stop : (k,) rows of each rest

    Returns verdict ("sensor", "current" or "none"), why, and the largest share of the reading's
    changes [1] that may be a current.
    """
    # ASSUME: Of the resistance two seconds after a step of load, at least half is there at once.
    current, voltage = columns["current_ampere"], columns["voltage_volt"]
    step, answer = np.diff(current), np.diff(voltage)
    prompt = np.diff(columns["test_time_second"]) <= 2.0
    large = prompt & (np.abs(step) > 0.2 * np.abs(current).max())
    late = np.zeros(len(step), bool)
    for a, b in zip((first + stop) // 2, stop, strict=True):
        late[a + 1 : b - 2] = True
    power = float(np.sum(step[late] ** 2))
    late_rows = np.flatnonzero(late)
    if not large.any() or not power > 0 or not np.any(answer[late]):
        return "none", "the voltage answers no change that could be compared", 1.0
    load = float(np.median(answer[large] / step[large]))
    slopes = [float(step[late_rows] @ answer[late_rows + lag]) / power for lag in (-1, 0, 1)]
    std = float(answer[late].std()) / np.sqrt(power)
    slope, bound = max(slopes), max(slopes) + SIGMAS * std
    share = float(np.clip(bound / (PROMPT_SHARE * load), 0.0, 1.0)) if load > 0 else 1.0
    seen = f"its changes move the voltage by {1e3 * slope:.2g} ± {1e3 * std:.1g} mOhm"
    why = f"{seen}, where steps of load show {1e3 * load:.3g} mOhm"
    if slope - SIGMAS * std > PROMPT_SHARE * load:
        return "current", why, share
    return "sensor" if share < 1.0 else "none", why, share


def judge_by_drift(
    columns: Mapping[str, np.ndarray], first: np.ndarray, stop: np.ndarray
) -> tuple[str, str]:
    """Verdict by the voltage's drift in rests, compared with what the reading's charge would do.

    Over the second half of a rest a real current moves the voltage by charge times the slope of
    the open-circuit voltage, taken from the ends of the rests beside, the flattest of them. What
    had not relaxed adds to that, after a discharge upwards and after a charge downwards, never the
    other way. So a reading whose charge should have moved the voltage further than it went, that
    way, is no current; a voltage that turns against its relaxation, where the reading asks for
    it, proves one. Only rests that follow a load of one sign that moved a hundredth of the
    record's charge are looked at: after a brief pulse nobody knows which way the cell relaxes. Two
    of them must say so: one may be disturbed.

    columns : mapping of arrays, as in `rest_reading`
    first, stop : (k,) rows of each rest

    Returns verdict ("sensor", "current" or "none"), and why.
    """
    voltage, charge = columns["voltage_volt"], columns["charge_ampere_hour"]
    before = np.r_[0, stop[:-1] - 1]
    pairs = list(zip(first, stop, strict=True))
    ends = np.array([np.median(voltage[max(a, b - LEAST_ROWS) : b]) for a, b in pairs])
    unmoved = turned = 0
    for rest, (a, b) in enumerate(pairs):
        slope = _least_slope(charge[stop - 1], ends, rest, stop - first)
        load = charge[before[rest] : a + 1]
        moved, way = abs(load[-1] - load[0]), np.abs(np.diff(load)).sum()
        one_way = way - moved < LEAST_CHARGE_SHARE * moved
        enough = moved > LEAST_CHARGE_SHARE * np.ptp(charge)
        relaxes = float(np.sign(load[0] - load[-1])) if enough and one_way else 0.0
        if slope is None or relaxes == 0 or b - a < 4 * LEAST_ROWS:
            continue
        late = slice((a + b) // 2, b)
        expected = slope * _change(charge[late])[0]
        moved, std = _change(voltage[late])
        # ASSUME: The open-circuit voltage changes by at most half a millivolt a kelvin.
        std = float(np.hypot(std, 5e-4 * _temperature_change(columns, late)))
        expected, moved = relaxes * expected / std, relaxes * moved / std
        unmoved += expected > SIGMAS and moved < expected - SIGMAS
        turned += expected < -SIGMAS and moved < -SIGMAS
    if unmoved >= 2 and not turned:
        why = f"in {unmoved} of them its charge would have moved the voltage further than it went"
        return "sensor", why
    if turned >= 2 and not unmoved:
        why = f"in {turned} of them the voltage turns against its relaxation, as a load makes it"
        return "current", why
    return "none", "the voltage of the rests tells neither"


def _temperature_change(columns: Mapping, late: slice) -> float:
    """Change of temperature over a stretch [K], of cell or chamber; 0 where not measured."""
    names = ("surface_temperature_celsius", "ambient_temperature_celsius")
    temperatures = [columns[name][late] for name in names if name in columns]
    return max((float(np.nan_to_num(abs(_change(c)[0]))) for c in temperatures), default=0.0)


def _least_slope(charge: np.ndarray, volt: np.ndarray, rest: int, rows: np.ndarray) -> float | None:
    """Smallest slope of the OCV [V/Ah] between the ends of a rest and its neighbours, or None.

    Neighbours count that are at least half as long and at least a hundredth of the record's charge
    away. A negative slope counts as 0.
    """
    slopes = []
    far = np.abs(charge - charge[rest]) > LEAST_CHARGE_SHARE * np.ptp(charge)
    for others in (np.arange(rest)[::-1], np.arange(rest + 1, len(charge))):
        chosen = others[far[others] & (rows[others] >= rows[rest] / 2)]
        if chosen.size:
            slopes.append((volt[chosen[0]] - volt[rest]) / (charge[chosen[0]] - charge[rest]))
    return max(min(slopes), 0.0) if slopes else None


def _change(values: np.ndarray) -> tuple[float, float]:
    """Change from the first to the last quarter of a stretch, and its standard deviation.

    The deviation is the scatter about a parabola, widened for correlated neighbours, and the
    resolution of the values.
    """
    quarter = max(len(values) // 4, 2)
    position = np.linspace(-1.0, 1.0, len(values))
    residual = values - np.polyval(np.polyfit(position, values, 2), position)
    power = float(residual @ residual)
    lags = np.array([residual[k:] @ residual[:-k] for k in range(1, max(len(residual) // 4, 2))])
    zero = int(np.argmax(lags <= 0)) if np.any(lags <= 0) else len(lags)
    widened = 1.0 + 2.0 * lags[:zero].sum() / power if power > 0 else 1.0
    digit = np.diff(np.unique(values)).min(initial=np.ptp(values) or 0.0)
    std = np.sqrt(residual.var() * widened * 2.0 / quarter + digit**2 / 12.0)
    return float(values[-quarter:].mean() - values[:quarter].mean()), float(std)


class RestReading(NamedTuple):
    """The reading in the rests of a record.

    first, stop : (k,) rows of each rest, `stop` not in it. mean_ampere : (k,) of each [A].
    verdict : "none" (too small to matter), "sensor", "current" or "unknown". note : what a person
    should know, or "".
    """

    first: np.ndarray
    stop: np.ndarray
    mean_ampere: np.ndarray
    verdict: str
    note: str


def rest_reading(columns: Mapping[str, np.ndarray]) -> RestReading:
    """Reading of the current in the rests of a record, and whether it is a current.

    1. A rest is a stretch of a minute or more within 1 % of the record's largest current that a
    load steps into, and in which the voltage is free to relax. 2. What its readings move must
    matter: more than 0.3 % of the charge that the record moves. 3. Where the instrument counts
    ampere-hours itself, its counter decides. 4. Else the reading is the sensor's where it changes,
    the voltage does not answer, and its mean is no larger than those changes; or where its charge
    should have moved the voltage, and did not. 5. A reading that the voltage confirms is a current,
    and of any other it is said that nobody can tell: both are counted.

    columns : mapping of arrays
        A clean series: test_time_second [s], current_ampere [A], voltage_volt [V],
        charge_ampere_hour [Ah], net_capacity_ampere_hour [Ah] where the instrument has a counter.

    Returns RestReading.
    """
    time, current = columns["test_time_second"], columns["current_ampere"]
    first, stop = open_circuit(time, current)
    relaxing = relaxing_rests(columns["voltage_volt"], first, stop)
    first, stop = first[relaxing], stop[relaxing]
    means = np.array([current[a:b].mean() for a, b in zip(first, stop, strict=True)])
    span = float(np.ptp(columns["charge_ampere_hour"]))
    read = [np.trapezoid(current[a:b], time[a:b] / 3600) for a, b in zip(first, stop, strict=True)]
    moved = float(np.sum(read))
    rests = RestReading(first, stop, means, "none", "")
    # A counted SoC is taken to be as sure as 0.3 % of the charge that a record moves.
    if any(name.startswith("branch_") for name in columns) or not abs(moved) > 0.003 * span:
        return rests
    readings = np.concatenate([current[a:b] for a, b in zip(first, stop, strict=True)])
    verdict, why = _verdict(columns, rests, readings)
    seen = (
        f"in {len(first)} rests the current reads {1e3 * readings.mean():+.3g} mA in the mean "
        f"(scatter {1e3 * readings.std():.2g} mA), {moved:+.3g} Ah in all, {abs(moved) / span:.1%} "
        "of the charge that the record moves"
    )
    done = "counted"
    if verdict == "sensor":
        resting = float(np.sum(time[stop - 1] / 3600.0 - time[first] / 3600.0))
        under_load = time[-1] / 3600.0 - time[0] / 3600.0 - resting
        more = readings.mean() * under_load / span
        done = f"not counted (if it is there under load too, which no rest tells, {more:+.1%} more)"
    return rests._replace(verdict=verdict, note=f"{seen}; {done}: {why}")


def as_logged(series: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A clean series with the current as it was logged, for the search for faults of the sensor.

    series : mapping of arrays, with logged_current_ampere [A] where that is another

    Returns a dict of arrays; current_ampere and charge_ampere_hour with the readings in rests.
    """
    if "logged_current_ampere" not in series:
        return dict(series)
    logged, hours = series["logged_current_ampere"], series["test_time_second"] / 3600.0
    removed = logged - series["current_ampere"]
    added = np.concatenate([[0.0], np.cumsum((removed[1:] + removed[:-1]) / 2 * np.diff(hours))])
    charge = series["charge_ampere_hour"] + added
    return {**series, "current_ampere": logged, "charge_ampere_hour": charge}


def open_circuit(time: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First rows of the rests of a record, and the rows after their last.

    The current must step into a rest, from more than twice what is near zero: the end of a charge
    at constant voltage fades into smallness, and is a load to the last.

    time, current : (n,) arrays [s], [A]
    """
    limit = near_zero_ampere(current)
    first, stop = stretches(column_of(lambda i: np.abs(i) <= limit, current, dtype=bool))
    brief = time[first[1:]] - time[stop[:-1] - 1] <= EXCURSION_SECOND
    small = [np.abs(current[a:b]).max() <= 5 * limit for a, b in zip(stop, first[1:], strict=False)]
    parted = ~(brief & np.array(small, dtype=bool))
    first = first[np.r_[True, parted]] if first.size else first
    stop = stop[np.r_[parted, True]] if stop.size else stop
    stepped = np.abs(current[first - 1]) > 2 * limit
    kept = stepped & (time[stop - 1] - time[first] >= 60.0) & (first > 0)
    return first[kept], stop[kept]


def hidden_rest_level(time: np.ndarray, current: np.ndarray, rest_ampere: float) -> float:
    """Median current that a record logs at rest [A] where it exceeds `rest_ampere`, else 0.

    An offset of the reading larger than what counts as rest would turn every rest into a load.

    time, current : (n,) arrays [s], [A]
    rest_ampere : largest reading that counts as rest [A]
    """
    rests = list(zip(*open_circuit(time, current), strict=True))
    level = float(np.median([np.median(current[a:b]) for a, b in rests])) if rests else 0.0
    return level if abs(level) > rest_ampere else 0.0


def offset_at_rest(
    time: np.ndarray,
    current: np.ndarray,
    voltage: np.ndarray,
    *,
    least_ampere: float,
    most_ampere: float,
) -> float:
    """Current that a record logs in rests [A] where that is above what counts as rest, else 0.

    A rest is a long stretch after a larger load in which a small current stays the same and the
    voltage settles: it moves more in the first half than in the second, as after a load and not as
    under one, or as at a held voltage, where the current fades.

    time, current, voltage : (n,) arrays [s], [A], [V]
    least_ampere, most_ampere : limits of such a reading [A]

    Returns the median over the rests of their median reading [A].
    """
    levels = []
    for first, stop in zip(*stretches(np.abs(current) <= most_ampere), strict=True):
        if first == 0 or time[stop - 1] - time[first] < 600.0 or stop - first < LEAST_ROWS:
            continue
        read, volt = current[first:stop], voltage[first:stop]
        level = float(np.median(read))
        middle = int(np.searchsorted(time[first:stop], (time[first] + time[stop - 1]) / 2))
        # Medians: a cell that hardly relaxes moves by no more than its readings scatter.
        near = max(len(volt) // 8, 1)
        parts = volt[:3], volt[max(middle - near, 0) : middle + near], volt[-near:]
        begun, halfway, end = map(np.median, parts)
        settles = abs(halfway - begun) >= 2.0 * abs(end - halfway)
        # An offset wanders and scatters by less than a quarter of itself.
        steady = np.percentile(np.abs(read - level), 90) <= 0.25 * abs(level)
        if settles and (steady or abs(level) <= least_ampere):
            levels.append(level)
    level = float(np.median(levels)) if levels else 0.0
    return level if abs(level) > least_ampere else 0.0


def _verdict(columns: Mapping, rests: RestReading, readings: np.ndarray) -> tuple[str, str]:
    """Verdict "sensor", "current" or "unknown" on the reading in rests, and its reason."""
    if by_counter := _judge_by_counter(columns, rests):
        return by_counter
    verdict, why, share = judge_by_response(columns, rests.first, rests.stop)
    by_drift = judge_by_drift(columns, rests.first, rests.stop)
    if verdict == "current":
        return verdict, why
    if by_drift[0] != "none":
        return by_drift
    # ASSUME: A tester's output is open between loads, unless its reading or the voltage say else.
    if verdict == "sensor" and abs(readings.mean()) <= readings.std() * np.sqrt(1.0 - share):
        return "sensor", why
    return "unknown", f"nothing tells a small load from an offset of the sensor ({why})"


def _judge_by_counter(columns: Mapping, rests: RestReading) -> tuple[str, str] | None:
    """Verdict and reason by the instrument's own counter; None where it has none."""
    counter = columns.get("net_capacity_ampere_hour")
    if counter is None or not np.any(np.diff(counter[np.isfinite(counter)])):
        return None
    counted = float(np.nansum(counter[rests.stop - 1] - counter[rests.first]))
    # ASSUME: A counter that stands still knows that the output is open.
    if counted == 0.0:
        return "sensor", "the instrument's own counter stands still in all of them"
    return "current", f"the instrument's own counter counts {counted:+.3g} Ah in them"
