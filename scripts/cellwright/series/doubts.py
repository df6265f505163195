"""Where a clean series contradicts itself: a number from such rows says so beside it.

Nothing is corrected here. Each witness is looked at where it stands: the instrument's counter
against its current, the voltage against the current from row to row, a rest against what cells do.
"""

from collections.abc import Mapping
from enum import IntFlag
from itertools import product

import numpy as np

from cellwright.formats.fields import NET, SERIES
from cellwright.formats.pieces import (
    all_where,
    any_where,
    column_of,
    count_where,
    largest,
    median_of,
    pieces,
    rows_where,
    step_at,
    summed,
)
from cellwright.numerics.statistics import of_median
from cellwright.numerics.turns import turning_points
from cellwright.series.beside import (
    FLOOR_VOLT,
    SUDDEN,
    against_dates,
    exchanged,
    moved_over_pauses,
    pace_drifts,
)
from cellwright.series.gaps import OTHER_LOAD, UNKNOWN, load_went_on
from cellwright.series.messages import say
from cellwright.series.rest_current import near_zero_ampere, stretches
from cellwright.series.spikes import bend, bend_at, rows_around

LOAD_SHARE = 0.2  # of the largest current: a step of so much must move the voltage
SAME_SHARE = 0.02  # of the largest current: within so much it is the same
COUNTER_SHARE = 0.02  # by which current and counter of one instrument may differ
WINDOW_SHARE = 0.05  # of the charge's span, over which they are compared
AGAINST_VOLT = 0.030  # in a rest; the OCV moves by tenths of a mV/K
ANSWER_SHARE = 0.25  # of what the cell's other steps show: less is no answer
SILENT_VOLT = 0.001  # within a digit or two of common voltmeters nothing has answered
LONGEST_EDGE = 10.0  # s between the two rows of a step: in more the cell relaxes
# A slow load on beyond the cut-off by more is no overshoot, in more rows no spike.
SLOW_C_RATE, DRAWN_VOLT, DRAWN_ROWS = 0.1, 0.1, 3
REST_VOLT = 0.03  # a tester's overshoot and its voltmeter's offset
SHORTEST_REST = 60.0  # s
RELAXED_SECOND = 600.0  # of load before a rest, by which its direction is told
THERMOMETER_KELVIN = 10.0  # by which a cell at rest is no warmer or colder than its chamber
BLANK_INTERVALS = 20  # between a thermometer's readings: in more of them it showed nothing
MANY = 10  # places at which a channel fails: it is then trusted nowhere
# ASSUME: A good cell gives 0.5 to 1.15 times its rating; sheets hold nominal, minimal and typical
# capacities.
RATING_SHARE = (0.5, 1.15)
# ASSUME: No full cell ends below 2 V; none that ends below 3 V is discharged below 0.5 V. Negative
# electrodes are cycled so against a metal: lithium, sodium, potassium.
HALF_CELL_VOLT, HALF_CELL_LIMITS_VOLT = 2.0, (0.5, 3.0)
# Voltage [V] that one rated capacity an hour makes at once: from power cells to cold energy cells.
OHMIC_VOLT = (0.004, 10.0)


class Doubt(IntFlag):
    """Why a row is in doubt; the flag stands at the later row of what lies between two."""

    CLOCK = 1
    GAP = 2
    COUNTER = 4
    VOLTAGE_STEP = 8
    NO_ANSWER = 16
    AT_REST = 32
    SIZE = 64
    SIGN = 128
    BEYOND = 256
    ENERGY = 512
    CHAMBER = 1024
    THERMOMETER = 2048
    PACE = 4096
    DATES = 8192
    EXCHANGED = 16384


ALL = np.array([-1])  # every flag


def doubts_said(doubt: np.ndarray | None, rows=slice(None)) -> list:
    """What is in doubt in these rows of a `doubt` column: a sentence with its code each."""
    if doubt is None:
        return []
    doubt = np.asarray(doubt, int)[rows]
    flags = int(np.bitwise_or.reduce(doubt, initial=0))
    return [said(flag, doubt) for flag in Doubt if flags & flag]


def said(flag: Doubt, doubt: np.ndarray = ALL):
    """What a flag says of the rows (n,) of a `doubt` column; by default of each of them."""
    share = float(np.mean((doubt & int(flag)) > 0))
    return say(f"row.{flag.name.lower()}", kelvin=THERMOMETER_KELVIN, share=share)


def sentences(time: np.ndarray, doubt: np.ndarray) -> list[str]:
    """A sentence on each kind of doubt in a `doubt` column: how often, and from when on [s]."""
    found = []
    for flag in Doubt:
        rows = count_where(lambda d, flag=int(flag): d & flag, doubt)
        if rows:
            first = time[np.argmax(doubt & int(flag) > 0)]
            found.append(say("rows.from", what=said(flag, doubt), rows=rows, second=first))
    return found


def doubts(
    columns: Mapping[str, np.ndarray],
    *,
    jumps: np.ndarray,
    gaps: np.ndarray,
    silent: np.ndarray,
    rated_capacity_ampere_hour: float | None = None,
    cutoffs_volt: tuple = (None, None),
    ambient_temperature_celsius: float | None = None,
) -> np.ndarray:
    """Doubts of each row of a clean series.

    Parameters
    ----------
    columns : test_time_second [s], current_ampere [A], voltage_volt [V], charge_ampere_hour [Ah];
    columns : test_time_second [s], current_ampere [A], voltage_volt [V], charge_ampere_hour [Ah];
        net_capacity_ampere_hour [Ah], unix_time_second [s], temperatures [degC] where it has them.
    jumps : rows before which the clock was set anew. gaps : rows with a gap before them; silent :
        what the cell did in each, see `gaps.verdicts`.
    rated_capacity_ampere_hour : [Ah] or None: the size is not looked at then. cutoffs_volt : lower
        and upper [V], None where not stated. ambient_temperature_celsius : of the chamber, as the
        sheet states it [°C], or None.

    Returns
    -------
    array (n,) of int, a combination of `Doubt` for each row.
    """
    time, current, voltage = (columns[name] for name in SERIES)
    found = np.asarray(columns.get("doubt", np.zeros(len(time))), np.int16).copy()
    surface = columns.get("surface_temperature_celsius")
    if surface is not None:
        found[blank_stretches(time, surface)] |= Doubt.THERMOMETER
        ambient = columns.get("ambient_temperature_celsius", np.full(len(time), np.nan))
        stated = off_stated(surface, ambient_temperature_celsius)
        if stated or off_stated(surface - ambient, 0.0):
            found |= Doubt.CHAMBER
        if exchanged(time, current, ambient, surface):
            found |= Doubt.EXCHANGED
    unix = columns.get("unix_time_second")
    if unix is not None and against_dates(time, unix):
        found |= Doubt.DATES
    if pace_drifts(time):
        found |= Doubt.PACE
    found[_all_if_many(jumps)] |= Doubt.CLOCK
    counter = columns.get(NET)
    counted = np.zeros(len(time), bool) if counter is None else np.isfinite(counter)
    unknown = gaps[np.isin(silent, (UNKNOWN, OTHER_LOAD))]
    found[unknown[~counted[unknown]]] |= Doubt.GAP
    apart = np.zeros(len(time), bool)
    apart[np.r_[gaps, jumps].astype(int)] = True
    if counter is not None:
        found[against_counter(time, current, counter, apart)] |= Doubt.COUNTER
    if not np.any(current):
        return found
    edges, resistance = unanswered(time, current, voltage, apart)
    specks = unanswered_specks(current, voltage, apart, resistance)
    found[_all_if_many(np.union1d(edges, specks))] |= Doubt.NO_ANSWER
    alone = steps_alone(time, current, voltage, apart, resistance)
    found[alone] |= Doubt.VOLTAGE_STEP
    found[against_rest(time, current, voltage, apart)] |= Doubt.AT_REST
    found[_unlike_across_gaps(current, voltage, gaps, counted)] |= Doubt.GAP
    over_pauses = moved_over_pauses(time, current, voltage)
    found[over_pauses[~counted[over_pauses]]] |= Doubt.GAP
    beyond = beyond_cutoffs(current, voltage, cutoffs_volt)
    # Drawn too far a cell may rest too low for a while; above full nothing rests, and no tester
    # draws slowly on beyond the cut-off that it was set to.
    above = cutoffs_volt[1] is not None and np.any(voltage[beyond] > cutoffs_volt[1])
    drawn = drawn_beyond(current, voltage, cutoffs_volt[0], rated_capacity_ampere_hour)
    found[slice(None) if above or drawn else beyond] |= Doubt.BEYOND
    if rated := rated_capacity_ampere_hour:
        charge = columns["charge_ampere_hour"]
        # What was bridged over gaps is no measured charge.
        bridged = np.any(found & Doubt.GAP)
        if unlike_size(resistance, rated) or (not bridged and unlike_charge(charge, rated)):
            found |= Doubt.SIZE
    return found


def off_stated(surface_celsius, ambient_celsius) -> bool:
    """Whether a cell is never near the temperature that is stated of its chamber.

    A load warms it, but before the load, and in its rests, it comes near.
    surface_celsius : (n,) [°C], NaN where not known. ambient_celsius : [°C] or None.
    """
    if ambient_celsius is None or not any_where(np.isfinite, surface_celsius):
        return False
    return not any_where(
        lambda shown: np.abs(shown - ambient_celsius) <= THERMOMETER_KELVIN, surface_celsius
    )


def blank_stretches(time, celsius) -> np.ndarray:
    """Rows (n,) in which a thermometer shows nothing for longer than between its readings.

    Some instruments log a temperature every few rows: there nothing is missing.
    """
    if all_where(np.isfinite, celsius):
        return np.zeros(len(time), bool)
    known = np.flatnonzero(np.isfinite(celsius))
    blank = np.ones(len(time), bool)
    if len(known) < 2:
        return blank & bool(len(known))
    interval = np.diff(time[known])
    longest = BLANK_INTERVALS * max(np.median(interval), np.median(np.diff(time)))
    blank[: known[0]] = time[known[0]] - time[0] > longest
    blank[known[-1] + 1 :] = time[-1] - time[known[-1]] > longest
    blank[known[0] : known[-1]] = np.repeat(interval > longest, np.diff(known))
    blank[known] = False
    return blank


def beyond_cutoffs(current, voltage, cutoffs) -> np.ndarray:
    """Rows at which the voltage lies beyond a stated cut-off [V], as that of no cell does.

    At rest beyond either; above the upper one also under a discharge, which lowers it. A negative
    electrode against a metal begins above the upper one, for nothing was ever inserted.
    """
    low, high = (np.nan if limit is None else limit for limit in cutoffs)
    rows = rows_where(lambda v: (v > high + REST_VOLT) | (v < low - REST_VOLT), voltage)
    # Right after a load the voltage is still its own, and before the first row there may be one.
    rows = rows[rows >= 5]
    if is_negative_electrode(cutoffs):
        rows = rows[np.logical_or.accumulate(voltage <= high)[rows]]
    zero = near_zero_ampere(current)

    def idle(rows):
        near, above = current[rows_around(rows, 11, len(current))], voltage[rows] > high + REST_VOLT
        return np.all(np.where(above[:, None], near, np.abs(near)) <= zero, axis=1)

    return rows[column_of(idle, rows, dtype=bool)]


def is_negative_electrode(cutoffs) -> bool:
    """Whether lower and upper cut-off [V], None where not stated, are those of a half cell."""
    low, high = (np.nan if limit is None else limit for limit in cutoffs)
    below = low < HALF_CELL_LIMITS_VOLT[0] and high <= HALF_CELL_LIMITS_VOLT[1]
    return bool(below or high < HALF_CELL_VOLT)


def drawn_beyond(current, voltage, lower_cutoff_volt, rated_capacity_ampere_hour) -> bool:
    """Whether a slow discharge runs on below the lower cut-off, which no overpotential explains."""
    if lower_cutoff_volt is None or not rated_capacity_ampere_hour:
        return False
    slow, low = -SLOW_C_RATE * rated_capacity_ampere_hour, lower_cutoff_volt - DRAWN_VOLT
    drawn = count_where(lambda i, v: (i < 0) & (i >= slow) & (v < low), current, voltage)
    return drawn >= DRAWN_ROWS


def _all_if_many(rows):
    """Rows at which a channel fails; all of the record where there are many such places."""
    return rows if len(rows) < MANY else slice(None)


def unlike_size(resistance_ohm: float, rated_capacity_ampere_hour: float) -> bool:
    """Whether no cell of this rating has this resistance: 20 µohm is none of 3 Ah."""
    answer = resistance_ohm * rated_capacity_ampere_hour
    return bool(np.isfinite(answer) and not OHMIC_VOLT[0] <= answer <= OHMIC_VOLT[1])


def unlike_charge(charge, rated) -> bool:
    """Whether one half cycle moves more than a cell of this rating holds."""
    rows = turning_points(charge, least=0.1 * rated)
    return bool(np.max(np.abs(np.diff(charge[rows])), initial=0.0) > RATING_SHARE[1] * rated)


def against_counter(time, current, counter, apart) -> np.ndarray:
    """Mask (n,) of rows over which charge by current and clock differs from the counter's.

    Or energy, of a power in place of the current and its counter.
    Compared are stretches that move a twentieth of the charge's span; within an interval in which
    the current steps the trapezoid only guesses, and what it may be off by is allowed for.
    """
    known = np.isfinite(counter)
    if np.count_nonzero(known) < 2:
        return np.zeros(len(time), bool)
    if not known.all():
        counter = np.interp(np.arange(len(time)), np.flatnonzero(known), counter[known])
    if not any_where(_counted, counter, apart, beside=1):
        return np.zeros(len(time), bool)
    digit = counter_digit(_counted, counter, apart, beside=1)
    last, lowest, highest = None, np.inf, -np.inf
    for rows in pieces(len(time), beside=1):
        moved, _ = _moved(time[rows], current[rows], apart[rows])
        last = summed(moved, last)
        lowest, highest = min(lowest, moved.min()), max(highest, moved.max())
    window = max(WINDOW_SHARE * float(highest - lowest), 20 * digit, 1e-12)
    first, sums = _by_windows(time, current, counter, apart, window)
    off = _off_counter(sums, 2 * digit)
    # Over all that one direction moves a coarse counter tells more than over any part of it.
    sign, everywhere = np.sign(sums[0]), not off.any()
    for of in (sign > 0, sign < 0) if everywhere else ():
        begins = np.count_nonzero(of & ~np.append(False, of[:-1]))
        off |= of & _off_counter(sums[:, of].sum(axis=1), 2 * digit * begins)
    return np.append(False, np.repeat(off, np.diff(np.append(first, len(time) - 1))))


def _off_counter(sums, digits):
    """Whether charge by the current and by the counter differ: sums as of `_by_windows`, [Ah]."""
    by_current, by_counter, travel, guessed = sums
    allowed = COUNTER_SHARE * np.maximum(travel, np.abs(by_counter)) + 0.5 * guessed + digits
    return np.abs(by_current - by_counter) > allowed


def _moved(time, current, apart):
    """Charge [Ah] that flowed between rows, none where these are apart, and the hours between."""
    hour = np.where(apart[1:], 0.0, np.diff(time)) / 3600
    return 0.5 * (current[1:] + current[:-1]) * hour, hour


def _counted(counter, apart):
    """Steps of a counter between rows, none where these are apart."""
    return np.where(apart[1:], 0.0, np.diff(counter))


def _by_windows(time, current, counter, apart, window):
    """First intervals (k,) of stretches that move a `window` [Ah] each, and sums over them (4, k).

    Sums: what moved by the current and by the counter, what moved to and fro, and what the steps of
    the current leave open [Ah].
    """
    firsts, stretch, sums, count, last, latest = [], [], [], 0, None, -1.0
    for rows in pieces(len(time), beside=1):
        moved, hour = _moved(time[rows], current[rows], apart[rows])
        step, guessed = _counted(counter[rows], apart[rows]), np.abs(np.diff(current[rows])) * hour
        travelled = np.abs(moved)
        values = np.stack([moved, step, travelled, guessed])
        last = summed(travelled, last)
        number = np.floor(travelled / window)
        first = np.flatnonzero(np.diff(number, prepend=latest))
        latest = number[-1]
        # The first part of a piece may belong to the last stretch of the piece before.
        begins = np.union1d(0, first)
        stretch.append(count + np.arange(len(begins)) - (len(begins) > len(first)))
        count += len(first)
        firsts.append(first + rows.start)
        sums.append(np.add.reduceat(values, begins, axis=1))
    stretch, sums = np.concatenate(stretch), np.concatenate(sums, axis=1)
    return np.concatenate(firsts), np.stack([np.bincount(stretch, part) for part in sums])


def counter_digit(steps, *columns, beside=0) -> float:
    """Resolution of a counter [Ah], a power of ten from 1 to 1e-9.

    steps : function of pieces of the columns → steps of the counter [Ah]; NaN where there is none.
    columns, beside : as of `pieces.rows_where`.
    """
    powers = 10.0 ** -np.arange(10)
    shown = (
        digit
        for digit in powers[:-1]
        if all_where(lambda *x, digit=digit: _whole(steps(*x) / digit), *columns, beside=beside)
        and not _creeps(lambda *x, digit=digit: steps(*x) / digit, columns, beside)
    )
    return float(next(shown, powers[-1]))


def _whole(values):
    return ~(np.abs(values - np.rint(values)) >= 1e-3)


def _creeps(steps, columns, beside):
    """Whether a counter moves by less than a digit: never by one, or by small steps to half of it.

    steps : function of pieces of the columns → steps of the counter, in digits.
    """
    before, whole = None, False
    for rows in pieces(len(columns[0]), beside=beside):
        small = np.nan_to_num(steps(*(column[rows] for column in columns)))
        ticks = np.abs(small) >= 0.5
        whole, small[ticks] = whole or bool(ticks.any()), 0.0
        before = summed(small, before)
        if largest(small) >= 0.5:
            return True
    return not whole


def steps_alone(time, current, voltage, apart, resistance=np.nan) -> np.ndarray:
    """Rows at which the voltage steps out of its curve for good while the current stays the same.

    Rows are missing there with the clock closed up, or one channel was another's. The step is told
    by those of three rows at each side, and by their pace where rows lie farther apart; what the
    current's small changes there make of it, by the cell's resistance [ohm] where known, is none.
    """
    if len(time) < 8:
        return np.empty(0, int)

    def sudden(voltage):
        step = np.abs(np.diff(voltage))
        return step[1:-1] > np.maximum(FLOOR_VOLT, SUDDEN * np.maximum(step[:-2], step[2:]))

    rows = rows_where(sudden, voltage, beside=3) + 1
    near = rows_around(rows, 7, len(time) - 1)
    around = near[:, [0, 1, 2, 4, 5, 6]]
    step, change = np.abs(step_at(voltage, around)), np.abs(step_at(current, near))
    interval = np.maximum(step_at(time, around), 1e-9)
    usual = np.max(step, axis=1)
    pace = np.max(step / interval, axis=1) * np.maximum(step_at(time, rows), 1e-9)
    disturbed = np.any((change > SAME_SHARE * largest(current)) | apart[near + 1], axis=1)
    limit = np.maximum(FLOOR_VOLT, SUDDEN * np.maximum(usual, pace))
    limit += 3 * np.nan_to_num(resistance) * np.max(change[:, 2:5], axis=1)
    return rows[(np.abs(step_at(voltage, rows)) > limit) & ~disturbed] + 1


def unanswered(time, current, voltage, apart) -> tuple[np.ndarray, float]:
    """Rows at which the current steps and the voltage does not, and the cell's resistance [ohm].

    Looked at are steps between currents that stay for three rows at each side; the channels may lag
    by two. What an answer is, the other steps of the same record show within ten seconds: the lower
    quartile of those whose voltage moves beyond its noise, for an empty cell answers by several
    times as much. NaN where no step is answered. Near its end a load moves the
    voltage by more than the answer until it stops, between two rows: there nothing can be missed.
    """
    least = LOAD_SHARE * largest(current)
    edges = rows_where(lambda i: np.abs(np.diff(i)) > least, current, beside=1)
    edges = edges[(edges >= 3) & (edges < len(current) - 4)]
    around, change = edges[:, None] + np.array([-2, -1, 1, 2]), step_at(current, edges)
    steady = np.all(np.abs(step_at(current, around)) <= 0.1 * np.abs(change)[:, None], axis=1)
    steady &= (step_at(time, edges) <= LONGEST_EDGE) & ~apart[edges + 1]
    edges, change = edges[steady], change[steady]
    if not len(edges):
        return np.empty(0, int), np.nan
    sign, answers, prompt = np.sign(change), [], []
    for after, before in product((1, 2, 3), (0, 1)):
        near = time[edges + after] - time[edges - before] <= LONGEST_EDGE
        answers.append(sign * (voltage[edges + after] - voltage[edges - before]))
        prompt.append(np.where(near | (after == 1) & (before == 0), answers[-1], -np.inf))
    answer, prompt = np.max(answers, axis=0), np.max(prompt, axis=0)
    hidden = np.maximum(-sign * step_at(voltage, edges - 1), 0.0)
    noise = of_median(median_of(lambda v: np.abs(np.diff(v)), voltage, beside=1)) / np.sqrt(2)
    chance = max(5 * noise, SILENT_VOLT)
    floor = FLOOR_VOLT / 2 + chance
    # An answer of which the load's last fall may hide the most is no measure.
    clear = (prompt > floor) & (hidden < 0.5 * prompt)
    if not clear.any():
        return np.empty(0, int), np.nan
    ratios = (prompt / np.abs(change))[clear]
    resistance = float(np.quantile(ratios, 0.25, method="lower"))
    expected = resistance * np.abs(change)
    none = max(3 * noise, SILENT_VOLT)
    told = expected > 2 * (floor + hidden)
    missing = told & (answer < np.minimum(ANSWER_SHARE * expected, none))
    return edges[missing] + 1, resistance


def unanswered_specks(current, voltage, apart, resistance) -> np.ndarray:
    """Rows whose current alone is another than before and after, and whose voltage is not.

    Drop-outs and spikes of the current's channel. Where the cell's resistance is not known, a
    voltage that stays within its own scatter is no answer.
    """
    least = LOAD_SHARE * largest(current)

    def twice(current):
        large = np.abs(np.diff(current)) > least
        return large[:-1] & large[1:]

    rows = rows_where(twice, current, beside=2) + 1
    rows = rows[(rows > 2) & (rows < len(current) - 3)]
    before, after = current[rows] - current[rows - 1], current[rows] - current[rows + 1]
    alone = np.ones(len(rows), bool)
    for side in (-2, 2):
        alone &= np.abs(current[rows + side] - current[rows + side // 2]) < 0.1 * np.abs(before)
    alone &= np.abs(before - after) < 0.1 * np.abs(before)
    rows = rows[alone & ~apart[rows] & ~apart[rows + 1]]
    if not len(rows):
        return rows
    # The voltage's channel may lead by one row or lag by two.
    answer = np.max([np.abs(bend_at(voltage, rows + lag)) for lag in (-1, 0, 1, 2)], axis=0)
    usual = median_of(lambda v: np.abs(bend(v)), voltage, beside=2)
    chance = max(5 * of_median(usual), SILENT_VOLT)
    size = np.abs(current[rows] - current[rows - 1])
    expected = np.nan_to_num(resistance * size, nan=np.inf)
    return rows[(expected > 2 * chance) & (answer < np.minimum(ANSWER_SHARE * expected, chance))]


def against_rest(time, current, voltage, apart) -> np.ndarray:
    """Rows of rests in which the voltage goes on as the load before moved it.

    After a discharge a resting cell's voltage rises, after a charge it falls; and where the load
    comes back it is not by as much further on as if it had never gone.
    """
    zero = near_zero_ampere(current)
    parts = np.flatnonzero(apart)
    found = []
    rests = stretches(column_of(lambda i: np.abs(i) <= zero, current, dtype=bool))
    for first, stop in zip(*rests, strict=True):
        # Beyond a gap it is another rest: what came between them is not in the record.
        cut = np.searchsorted(parts, first)
        whole = cut == len(parts) or parts[cut] > stop
        if whole and load_went_on(time, current, voltage, first, stop):
            found.append(np.arange(first, stop))
            continue
        cut = np.searchsorted(parts, first + 1)
        stop = min(stop, parts[cut]) if cut < len(parts) else stop
        if first < 5 or stop - first < 5 or time[stop - 1] - time[first] < SHORTEST_REST:
            continue
        before = current[first - 5 : first]
        sign = np.sign(before[-1])
        if np.any(np.sign(before) != sign) or abs(before.mean()) < 5 * zero:
            continue
        # What a drive did in the ten minutes before is what the cell relaxes from.
        since = np.searchsorted(time, time[first] - RELAXED_SECOND)
        if sign * np.trapezoid(current[since:first], time[since:first]) <= 0 or np.any(
            np.sign(current[since:first]) == -sign
        ):
            continue
        # The first rows may still hold the load's drop.
        course = sign * (voltage[first + 2 : stop] - voltage[first + 2])
        if course.max() > AGAINST_VOLT and course[-1] > 0.5 * AGAINST_VOLT:
            found.append(np.arange(first, stop))
    return np.concatenate(found) if found else np.empty(0, int)


def _unlike_across_gaps(current, voltage, gaps, counted) -> np.ndarray:
    """Rows after a gap between two rests whose voltages differ as no rest lets them."""
    idle = np.maximum(np.abs(current[gaps]), np.abs(current[gaps - 1])) <= near_zero_ampere(current)
    moved = np.abs(voltage[gaps] - voltage[gaps - 1])
    return gaps[idle & (moved > AGAINST_VOLT) & ~counted[gaps]]
