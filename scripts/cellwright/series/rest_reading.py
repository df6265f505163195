"""What the current channel reads in the rests of a record, and whether it can be a current.

A current in a cell shows in its voltage twice: at once, by the ohmic resistance, and in a rest of
hours, by the charge it moves. A reading in rests that shows in neither is the sensor's own.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .rest_evidence import Evidence, answered, drifted, free

NEAR_ZERO = 0.01  # of a record's largest current: what is no step of it, as in `flags.flag`
REST_SECOND = 60.0
EXCURSION_SECOND = 10.0  # a longer reading beyond that is a load, as in `runs.rest_rows`
LEAST_SHARE = 0.003  # of the charge a record moves: as sure as a counted SoC is taken to be


class RestReading(NamedTuple):
    """The reading in the rests of a record.

    first, stop : (k,) rows of each rest, `stop` not in it. mean_ampere : (k,) of each [A].
    charge_ampere_hour : what all of them would have moved [Ah]. verdict : "none" (too small to
    matter), "sensor", "current" or "unknown". note : what a person should know, or "".
    """

    first: np.ndarray
    stop: np.ndarray
    mean_ampere: np.ndarray
    charge_ampere_hour: float
    verdict: str
    note: str


def rest_reading(columns: Mapping[str, np.ndarray]) -> RestReading:
    """Find what a record reads in its rests, and whether the cell's voltage knows of it.

    1. A rest is a stretch of a minute or more within 1 % of the record's largest current that a
    load steps into, and in which the voltage is free to relax. 2. What its readings move must
    matter: more than 0.3 % of the charge that the record moves. 3. Where the instrument counts
    ampere-hours itself, its counter decides. 4. Else the reading is the sensor's where it changes,
    the voltage does not answer, and its mean is no larger than those changes; or where its charge
    should have moved the voltage, and did not. 5. A reading that the voltage confirms is a current,
    and of any other it is said that nobody can tell: both are counted.

    Parameters
    ----------
    columns : mapping of arrays
        A clean series: test_time_second [s], current_ampere [A], voltage_volt [V],
        charge_ampere_hour [Ah], net_capacity_ampere_hour [Ah] where the instrument has a counter.

    Returns
    -------
    RestReading
    """
    time, current, charge = (
        columns[name] for name in ("test_time_second", "current_ampere", "charge_ampere_hour")
    )
    first, stop = open_circuit(time, current)
    relaxing = free(columns["voltage_volt"], first, stop)
    first, stop = first[relaxing], stop[relaxing]
    means = np.array([current[a:b].mean() for a, b in zip(first, stop, strict=True)])
    hours = time / 3600.0
    read = [np.trapezoid(current[a:b], hours[a:b]) for a, b in zip(first, stop, strict=True)]
    moved = float(np.sum(read))
    span = float(np.ptp(charge))
    rests = RestReading(first, stop, means, moved, "none", "")
    if any(name.startswith("branch_") for name in columns) or not abs(moved) > LEAST_SHARE * span:
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
        loaded = readings.mean() * (hours[-1] - hours[0] - _length(hours, rests)) / span
        done = (
            f"not counted (if it is there under load too, which no rest tells, {loaded:+.1%} more)"
        )
    return rests._replace(verdict=verdict, note=f"{seen}; {done}: {why}")


def as_logged(series: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A clean series as its instrument read it: for whoever searches for faults of the reading.

    Parameters
    ----------
    series : mapping of arrays, with logged_current_ampere [A] where that is another

    Returns
    -------
    dict of arrays; current_ampere and charge_ampere_hour with the readings in rests.
    """
    if "logged_current_ampere" not in series:
        return dict(series)
    logged, hours = series["logged_current_ampere"], series["test_time_second"] / 3600.0
    more = logged - series["current_ampere"]
    added = np.concatenate([[0.0], np.cumsum((more[1:] + more[:-1]) / 2 * np.diff(hours))])
    charge = series["charge_ampere_hour"] + added
    return {**series, "current_ampere": logged, "charge_ampere_hour": charge}


def _length(hours: np.ndarray, rests: RestReading) -> float:
    return float(np.sum(hours[rests.stop - 1] - hours[rests.first]))


def open_circuit(time: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First rows of the rests of a record, and the rows after their last.

    The current must step into a rest, from more than twice what is near zero: the end of a charge
    at constant voltage fades into smallness, and is a load to the last.

    Parameters
    ----------
    time, current : (n,) arrays [s], [A]
    """
    limit = NEAR_ZERO * float(np.max(np.abs(current), initial=0.0))
    low = np.abs(current) <= limit
    turns = np.flatnonzero(np.diff(np.r_[False, low, False].astype(int)))
    first, stop = turns[::2], turns[1::2]
    brief = time[first[1:]] - time[stop[:-1] - 1] <= EXCURSION_SECOND
    small = [np.abs(current[a:b]).max() <= 5 * limit for a, b in zip(stop, first[1:], strict=False)]
    parted = ~(brief & np.array(small, dtype=bool))
    first = first[np.r_[True, parted]] if first.size else first
    stop = stop[np.r_[parted, True]] if stop.size else stop
    stepped = np.abs(current[first - 1]) > 2 * limit
    long = time[stop - 1] - time[first] >= REST_SECOND
    kept = stepped & long & (first > 0)
    return first[kept], stop[kept]


def hidden_rest_level(time: np.ndarray, current: np.ndarray, rest_ampere: float) -> float:
    """What a record reads at rest [A] where that is above `rest_ampere`, else 0.

    An offset of the reading larger than what counts as rest would turn every rest into a load.

    Parameters
    ----------
    time, current : (n,) arrays [s], [A]
    rest_ampere : largest reading that counts as rest [A]
    """
    rests = list(zip(*open_circuit(time, current), strict=True))
    level = float(np.median([np.median(current[a:b]) for a, b in rests])) if rests else 0.0
    return level if abs(level) > rest_ampere else 0.0


def _verdict(columns: Mapping, rests: RestReading, readings: np.ndarray) -> tuple[str, str]:
    """Whether the reading is the sensor's, a current, or unknown; and why."""
    by_counter = _counted(columns, rests)
    if by_counter:
        return by_counter
    answer = answered(columns, rests.first, rests.stop)
    drift = drifted(columns, rests.first, rests.stop)
    mean = abs(readings.mean())
    error = readings.std() * np.sqrt(1.0 - answer.share)
    if answer.verdict == Evidence.CURRENT or drift.verdict == Evidence.CURRENT:
        told = answer if answer.verdict == Evidence.CURRENT else drift
        return "current", told.why
    if drift.verdict == Evidence.SENSOR:
        return "sensor", drift.why
    # ASSUME: A tester's output is open between loads, unless its reading or the voltage say else.
    if answer.verdict == Evidence.SENSOR and mean <= error:
        return "sensor", answer.why
    return "unknown", f"nothing tells a small load from an offset of the sensor ({answer.why})"


def _counted(columns: Mapping, rests: RestReading) -> tuple[str, str] | None:
    """What the instrument's own counter says of the rests, None without one."""
    counter = columns.get("net_capacity_ampere_hour")
    if counter is None or not np.any(np.diff(counter[np.isfinite(counter)])):
        return None
    counted = float(np.nansum(counter[rests.stop - 1] - counter[rests.first]))
    # ASSUME: A counter that stands still knows that the output is open.
    if counted == 0.0:
        return "sensor", "the instrument's own counter stands still in all of them"
    return "current", f"the instrument's own counter counts {counted:+.3g} Ah in them"
