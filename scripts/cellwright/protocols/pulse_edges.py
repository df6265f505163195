"""When the edge of a pulse was: at a row, anywhere between two, or before its second row only."""

from itertools import permutations
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import NORMAL_95, robust_std
from cellwright.records.conditions import SAME_SOC, grouped_alike, low_current, same_rate
from cellwright.series.edges import STEADY_SHARE, step_rows

AT_A_ROW, BETWEEN, UNKNOWN = "at a row", "between two rows", "at a row or between two"
NOT_SETTLED = "between two rows; the first after it had not settled"
NEXT_SOC = 0.12  # a course over SoC is followed from one pulse to the next this far away [1]
FIRST_ROWS = 4  # of a pulse, by which its edge is told
EVEN = 1.5  # intervals whose sizes differ by less are those of one clock that runs on
RISE_SHARE = 0.1  # kinetics and heat make a resistance fall with the rate; no cell's rises by more
LEAST_BENDS = 4  # of first rows over the order of pulses, by which their scatter is known
HALF_NORMAL, ITS_ERROR = 0.6745, 1.17  # median |x| of a standard normal x; its error times √n
# Median of |u1 − 2·u2 + u3| of numbers drawn between 0 and 1, where m − m³/6 = 1/2:
BEND = 0.5240


class Rows(NamedTuple):
    """Rows of one pulse from its first on.

    delay : (n,) after the row before the edge [s]. ratio : (n,) resistance [ohm]. noise_ohm : of
    one ratio [ohm]. apart_second : distance of the two rows that the edge lies between [s].
    told : whether the clock tells a row at the edge. soc : [1], NaN where not known. c_rate : of
    the step [1/h]. direction : of the pulse.
    """

    delay: np.ndarray
    ratio: np.ndarray
    noise_ohm: float
    apart_second: float
    told: bool
    soc: float
    c_rate: float
    direction: str


def clock_tells(time, first):
    """Whether the intervals of a clock (n,) [s] tell that a row was written at an edge.

    A tester that writes a row when its step ends breaks the even course of its rows there, or
    begins to write at another pace. first : row after the edge.
    """
    near = np.diff(time[max(first - 3, 0) : first + 2])
    return len(near) < 4 or bool(near.max() > EVEN * near.min())


def first_rows(time, current, voltage, soc, *, capacity_ampere_hour, least_digit_volt=0.0):
    """Rows of each load of a record that begins from rest and is held for them, a list.

    time, current, voltage, soc : (n,) [s], [A], [V], [1]. capacity_ampere_hour : what the SoC
    refers to [Ah]. least_digit_volt : of the reading [V].
    """
    rest = low_current(current, capacity_ampere_hour)
    still = np.diff(voltage)[rest[1:] & rest[:-1]]
    noise = np.hypot(robust_std(still), least_digit_volt / np.sqrt(6.0))
    found = []
    for first in step_rows(time, current):
        rows = np.arange(first, min(first + FIRST_ROWS, len(time)))
        step = current[rows] - current[first - 1]
        steady = np.abs(step - step[-1]) <= STEADY_SHARE * np.abs(step[-1])
        if len(rows) < FIRST_ROWS or not (rest[first - 1] and steady.all()):
            continue
        start = max(time[first - 1], 2.0 * time[first] - time[first + 1])
        found.append(
            Rows(
                time[rows] - start,
                (voltage[rows] - voltage[first - 1]) / step,
                noise / abs(step[0]),
                time[first] - start,
                clock_tells(time, first),
                soc[first - 1],
                abs(step[0]) / capacity_ampere_hour,
                "charge" if step[0] > 0 else "discharge",
            )
        )
    return found


def edges_of(pulses):
    """Where the edges of the pulses of one record were (k,), by their rows; one of the words above.

    1. No cell's resistance rises with the rate: a rate whose first rows read less than those of a
    faster one at the same SoC, by more than a tenth and more than edges anywhere between the
    rows allow, has first rows that had not settled. Then no clock of the record is believed.
    2. Else pulses of one rate are compared with the two beside them by R_first/R_late, of which a
    course over SoC is a line. Edges anywhere between two rows bend it by about half of what the
    resistance grows by from row to row. Where it bends by less than a third of that, a row lies
    at the edge; by more than two thirds of it, or where charge and discharge of one rate and SoC
    differ in it by more than half of that growth, none does.
    3. Where too few pulses tell, the clock does, or nothing.

    pulses : list of Rows.
    """
    if not pulses:
        return []
    unsettled = _not_settled(pulses)
    if unsettled.any():
        return np.where(unsettled, NOT_SETTLED, BETWEEN)
    word = _by_all(pulses)
    return np.full(len(pulses), word, dtype=np.array([NOT_SETTLED]).dtype)


def _by_all(pulses):
    """Where the edges of all pulses are, by the scatter of their first rows or by the clock."""
    bend, noise, count = _bends(pulses)
    few, many = np.hypot(noise, BEND / 3), np.hypot(noise, 2 * BEND / 3)
    tells = count >= LEAST_BENDS and few > noise * (1 + NORMAL_95 * ITS_ERROR / np.sqrt(count))
    if _directions_differ(pulses) or (tells and bend > many):
        return BETWEEN
    if (tells and bend <= few) or np.mean([pulse.told for pulse in pulses]) >= 0.5:
        return AT_A_ROW
    return UNKNOWN


def growth_ohm(delay, ratio, at_second, width_second, edge):
    """What a resistance grows by [ohm] while the delay passes the interval of an edge.

    delay, ratio : (n,) rows [s], [ohm]. at_second : delay asked for. width_second : of the
    interval. edge : as of `edges_of`; where the edge may lie at a row it can only be later.
    """
    low = at_second - (0.0 if edge == UNKNOWN else 0.5 * width_second)
    low = np.clip(low, delay[0], max(delay[-1] - width_second, delay[0]))
    known = np.isfinite(ratio)
    ends = np.interp([low, low + width_second], delay[known], ratio[known])
    return float(abs(ends[1] - ends[0]))


def rises_with_rate(soc, direction, c_rate, ohm, std, delay):
    """Numbers (slow, fast) of pulses of which the faster exceeds the slower as no cell does.

    By more than a tenth and more than 1.96 of both deviations, at one SoC: between the pulses of
    the slower rate on either side. A pulse is held against slower ones read no earlier than two
    thirds of its own delay.

    soc [1], direction, c_rate [1/h], ohm, std [ohm], delay [s] : (n,) of pulses at one delay.
    """
    found = []
    for fast in range(len(ohm)):
        alike = (direction == direction[fast]) & (c_rate < c_rate[fast])
        alike &= ~same_rate(c_rate, c_rate[fast]) & (delay[fast] <= EVEN * delay)
        for rate in np.unique(c_rate[alike]):
            of_rate = np.flatnonzero(alike & same_rate(c_rate, rate))
            value, near = _at_soc(soc[of_rate], ohm[of_rate], soc[fast])
            error = NORMAL_95 * np.hypot(std[fast], std[of_rate[near]])
            if ohm[fast] - value > max(RISE_SHARE * value, error):
                beside = np.abs(soc[of_rate] - soc[of_rate[near]]) <= SAME_SOC
                found += [(int(slow), fast) for slow in of_rate[beside]]
    return found


def _at_soc(soc, values, wanted):
    """Value at a SoC by the line through the two pulses beside it, and the nearest's number.

    NaN farther than `SAME_SOC` beyond the pulses, or where they are farther apart than `NEXT_SOC`.
    """
    if not np.isfinite(soc - wanted).any():
        return np.nan, 0
    near = int(np.nanargmin(np.abs(soc - wanted)))
    levels, first = np.unique(soc, return_index=True)
    after = int(np.clip(np.searchsorted(levels, wanted), 1, max(len(levels) - 1, 1)))
    beyond = max(levels[0] - wanted, wanted - levels[-1], 0.0)
    if len(levels) > 1 and levels[after] - levels[after - 1] <= NEXT_SOC and beyond <= SAME_SOC:
        low, high = values[first[after - 1]], values[first[after]]
        share = (wanted - levels[after - 1]) / (levels[after] - levels[after - 1])
        return float(low + share * (high - low)), near
    return (float(values[near]) if abs(soc[near] - wanted) <= SAME_SOC else np.nan), near


def _not_settled(pulses):
    """Mask (k,) of pulses whose first rows those of a faster rate show not to have settled.

    What has not settled after a step has not after a smaller one of the same record either.
    """
    pairs = [
        (slow, fast)
        for slow, fast in permutations(_alike(pulses), 2)
        if fast[0].direction == slow[0].direction and fast[0].c_rate > slow[0].c_rate
    ]
    rises = [(slow[-1], _rise_of_first(slow, fast)) for slow, fast in pairs]
    # Of many pairs one exceeds 1.96 deviations by chance; where one does by more, others may.
    sure = NormalDist().inv_cdf(1.0 - 0.025 / max(len(pairs), 1))
    certain = any(deviations > sure for _, deviations in rises)
    shown = [slow for slow, deviations in rises if certain and deviations > NORMAL_95]
    return np.array([any(_no_larger_step(pulse, one) for one in shown) for pulse in pulses])


def _no_larger_step(pulse, other):
    """Whether a pulse steps one way with another, by no more, with its first row at that delay."""
    one_way = pulse.direction == other.direction and pulse.delay[0] <= EVEN * other.delay[0]
    return one_way and (pulse.c_rate <= other.c_rate or same_rate(pulse.c_rate, other.c_rate))


def _rise_of_first(slow, fast):
    """By how many deviations first rows of a faster rate read more, at a slower one's SoCs; or 0.

    Deviations are of edges that lie anywhere between the rows; none where it is less than a tenth.
    """
    soc = np.array([pulse.soc for pulse in fast])
    first, error = (np.array([_first(pulse)[k] for pulse in fast]) for k in (0, 1))
    rises = []
    for pulse in slow:
        value, near = _at_soc(soc, first, pulse.soc)
        own, own_error = _first(pulse)
        if fast[near].delay[0] <= EVEN * pulse.delay[0] and np.isfinite(value - own) and own > 0:
            rises.append([(value - own) / own, np.hypot(error[near], own_error) / own])
    if not rises:
        return 0.0
    share, error = np.transpose(rises)
    if np.median(share) <= RISE_SHARE:
        return 0.0
    return float(np.sum(share / error**2) / np.linalg.norm(1.0 / error))


def _first(pulse):
    """First ratio of a pulse [ohm]; its deviation if the edge lies anywhere between the rows."""
    grown = pulse.ratio[1] - pulse.ratio[0] if len(pulse.ratio) > 1 else 0.0
    return pulse.ratio[0], np.hypot(pulse.noise_ohm, grown / np.sqrt(12.0))


def _alike(pulses):
    """Lists of pulses of one direction and rate, in the order of the record."""
    return grouped_alike(
        pulses, lambda a, b: a.direction == b.direction and same_rate(a.c_rate, b.c_rate)
    )


def _bends(pulses):
    """Median |second difference| of R_first/R_late over pulses, what noise makes of it, and count.

    In what the resistance grows by from the first row to the next.
    """
    weights = np.array([1.0, -2.0, 1.0])
    triples = [
        triple
        for alike in _alike(pulses)
        for triple in zip(alike[:-2], alike[1:-1], alike[2:], strict=True)
    ]
    found = np.array(list(_differences(triples, weights)))
    # Where rows do not grow by more than noise their growth is no measure.
    found = found[found[:, 1] < 1.0] if len(found) else np.empty((0, 2))
    bend, noise = np.median(found, axis=0) if len(found) else (np.nan, np.nan)
    return bend, HALF_NORMAL * noise, len(found)


def _directions_differ(pulses):
    """Whether R_first/R_late of charges and of discharges differ by half of what rows grow by."""
    soc = np.array([pulse.soc for pulse in pulses])
    pairs = []
    for pulse in pulses:
        other = np.array([one.direction != pulse.direction for one in pulses])
        near = np.flatnonzero(other & (np.abs(soc - pulse.soc) <= SAME_SOC))
        near = [k for k in near if same_rate(pulses[k].c_rate, pulse.c_rate)]
        if pulse.direction == "discharge" and near:
            pairs.append((pulse, pulses[min(near, key=lambda k: abs(soc[k] - pulse.soc))]))
    found = list(_differences(pairs, np.array([1.0, -1.0])))
    apart = [apart for apart, noise in found if NORMAL_95 * noise < 0.5]
    return len(apart) >= LEAST_BENDS and bool(np.median(apart) > 0.5)


def _differences(groups, weights):
    """|Weighted sum| of R_first/R_late of each group of pulses and its noise.

    In what that ratio moves by where edges lie one row earlier: both rows grow, the first by more.
    """
    for group in groups:
        if min(len(pulse.ratio) for pulse in group) < 4 or not _comparable(group):
            continue
        rows = np.array([pulse.ratio[:4] for pulse in group])
        if not np.all(rows > 0):
            continue
        share = rows[:, 0] / rows[:, 2]
        moved = (rows[:, 1] - rows[:, 0] - share * (rows[:, 3] - rows[:, 2])) / rows[:, 2]
        noise = np.array([pulse.noise_ohm for pulse in group]) / rows[:, 2]
        if np.mean(moved) > 0:
            sizes = np.abs(weights @ share), np.linalg.norm(weights * noise)
            yield sizes[0] / np.mean(moved), sizes[1] / np.mean(moved)


def _comparable(near):
    """Whether pulses follow at SoCs near to each other, with first rows at one delay."""
    first, soc = [pulse.delay[0] for pulse in near], [pulse.soc for pulse in near]
    apart = np.abs(np.diff(soc))
    return max(first) <= EVEN * min(first) and not np.any(apart > NEXT_SOC)
