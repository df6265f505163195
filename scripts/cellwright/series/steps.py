"""A record cut into steps: rest, constant current, held voltage, pulse, dynamic load.

A run is a stretch between two edges, the raw material of a step. An edge is a step of current that
the voltage answers; where the current falls while the voltage stands still, the tester holds the
voltage and there is no edge.
"""

from typing import NamedTuple

import numpy as np

from cellwright.formats.pieces import rows_where, step_at
from cellwright.numerics.clock import refuse_backward
from cellwright.numerics.statistics import robust_std
from cellwright.refusal import Refusal
from cellwright.series.rest_current import EXCURSION_SECOND
from cellwright.settings import Segment

SEGMENT = Segment()

GAP_SECOND = 300.0  # no sample for so long, and for longer than is usual there, ends a step
EDGE_C_RATE = (0.01, 0.03)  # a step of current within six sigma of its noise is none; bounds
USUAL_SHARE = 0.05  # of the rows: at an interval that so many have, to the second, it is read
EDGE_SHARE = 0.05  # nor is one below this share of the current itself
SPECK_C_RATE = 0.05  # one or two samples off by less than this between equal levels are noise
HELD_SHARE, LEAST_HELD_ROWS = 0.005, 32  # so well a tester holds a power or a resistance
STEADY_SHARE = 0.10  # a steady current stays so near to its median, …
STEADY_C_RATE = 0.02  # … or so near in C, if that is more


class Sampled(NamedTuple):
    """Columns that segmentation reads, (n,) each: time [s], current [A], voltage [V]; masks of rows
    after a gap and of rows at rest."""

    time: np.ndarray
    current: np.ndarray
    voltage: np.ndarray
    gap: np.ndarray
    rest: np.ndarray


class Runs(NamedTuple):
    """One entry a run: first and last row (inclusive), mean current `level` [A], length `span` [s],
    whether it is a rest, whether it begins after a gap."""

    first: np.ndarray
    last: np.ndarray
    level: np.ndarray
    span: np.ndarray
    rest: np.ndarray
    gap: np.ndarray


def silent_before(time, gap_second):
    """Mask (n,) of rows before which the record is silent for longer than `gap_second` [s].

    A slow sampling rate is no gap: the interval must exceed five times both its neighbours, and
    that at which the record is read anyway, where a tester adds rows at the edges of its steps.
    """
    long = rows_where(lambda t: np.diff(t) > gap_second, time, beside=1)
    before = np.where(long > 0, step_at(time, np.maximum(long - 1, 0)), 0.0)
    after = step_at(time, np.minimum(long + 1, len(time) - 2))
    longest = np.maximum(before, np.where(long < len(time) - 2, after, 0.0))
    length = step_at(time, long)
    seconds, often = np.unique(np.rint(length), return_counts=True)
    usual = seconds[often >= max(USUAL_SHARE * len(time), 10)].max(initial=0.0)
    silent = np.zeros(len(time), bool)
    silent[long[(length > 5 * longest) & (length > usual + 1.0)] + 1] = True
    return silent


def rest_rows(time, current, *, threshold, rated):
    """Mask (n,) of rows at rest; to leave rest the current must exceed twice the threshold [A].

    A small and short excursion between two rests is an error of the sensor, not a load.
    """
    size = np.abs(current)
    decided = (size <= threshold) | (size > 2 * threshold)
    decided[0] = True
    latest = np.maximum.accumulate(np.where(decided, np.arange(len(size)), 0))
    rest = size[latest] <= threshold
    turns = np.flatnonzero(np.diff(rest))  # last rows of stretches, rest and load in turn
    leaves, returns = turns[rest[turns]], turns[~rest[turns]]
    returns = returns[returns > leaves[0]] if len(leaves) else returns[:0]
    for begin, end in zip(leaves + 1, returns, strict=False):
        if time[end] - time[begin] <= EXCURSION_SECOND:
            rest[begin : end + 1] = size[begin : end + 1].max() <= SPECK_C_RATE * rated
    return rest


def hold_tolerance(voltage, rest):
    """Largest deviation of a held voltage [V]: four sigma of the noise at rest, 3 to 10 mV."""
    noise = robust_std(np.diff(voltage)[rest[1:] & rest[:-1]])
    return float(np.clip(4 * noise, 0.003, 0.010))


def held_rows(record, tolerance):
    """Mask (n,) of rows at which the current falls and the voltage does not: a held voltage.

    One sample more on either side is compared, for testers that do not sample their two channels
    together.
    """
    current, voltage, rows = record.current, record.voltage, np.arange(len(record.current))
    falls = np.abs(current) <= np.abs(np.roll(current, 1))
    same_sign = np.sign(current) == np.sign(np.roll(current, 1))
    move = voltage[np.minimum(rows + 1, len(rows) - 1)] - voltage[np.maximum(rows - 2, 0)]
    near = voltage - np.roll(voltage, 1)
    gives = np.minimum(np.sign(current) * move, np.sign(current) * near) < -tolerance
    return falls & same_sign & ~gives


def edge_rows(record, rated, tolerance):
    """Mask (n,) of rows that begin a run; the first row always does."""
    size = np.abs(record.current)
    change = np.diff(record.current, prepend=record.current[0])
    noise = 1.05 * np.median(np.abs(change[~record.rest])) if not record.rest.all() else 0.0
    least = np.clip(6 * noise, EDGE_C_RATE[0] * rated, EDGE_C_RATE[1] * rated)
    bar = np.maximum(least, EDGE_SHARE * np.maximum(size, np.roll(size, 1)))
    stepped = np.abs(change) > bar
    turned = np.diff(record.rest, prepend=record.rest[0])
    edges = (stepped & ~held_rows(record, tolerance) & ~(record.rest & ~turned)) | turned
    edges |= record.gap
    edges[0] = True
    return edges


def runs(record, edges):
    """Runs between the edges; a run lasts from the last sample before it to its own last."""
    first = np.flatnonzero(edges)
    last = np.append(first[1:], len(edges)) - 1
    level = np.add.reduceat(record.current, first) / (last - first + 1)
    gap = record.gap[first] | (first == 0)
    begin = record.time[np.where(gap, first, first - 1)]
    return Runs(first, last, level, record.time[last] - begin, record.rest[first], gap)


def drop_noise(record, edges, rated):
    """Record with its rests corrected, and edges without those that stray samples made."""
    for _ in range(3):
        record, edges = _drop_specks(record, edges, rated)
        stretches = runs(record, edges)
        before = np.roll(stretches.level, 1)
        bar = np.maximum(EDGE_C_RATE[0] * rated, EDGE_SHARE * np.abs(before))
        equal = (np.abs(stretches.level - before) < bar) & (
            stretches.rest == np.roll(stretches.rest, 1)
        )
        edges[stretches.first[equal & ~stretches.gap]] = False
    return record, edges


def _drop_specks(record, edges, rated):
    """Record and edges with one or two stray samples joined to equal levels or a rest beside."""
    stretches = runs(record, edges)
    before, after = np.roll(stretches.level, 1), np.roll(stretches.level, -1)
    bar = np.maximum(SPECK_C_RATE * rated, 0.2 * np.abs(before))
    brief = (stretches.last - stretches.first < 2) & (np.arange(len(bar)) < len(bar) - 1)
    speck = brief & ~stretches.gap & ~np.roll(stretches.gap, -1)
    speck &= (np.abs(stretches.level - before) < bar) & (np.abs(before - after) < bar / 2)
    faint = brief & ~stretches.rest & (np.abs(stretches.level) < SPECK_C_RATE * rated) & ~speck
    faint &= np.maximum(np.abs(before), np.abs(after)) > 5 * np.abs(stretches.level)
    onset = faint & np.where(stretches.first == 0, ~np.roll(stretches.rest, -1), False)
    trail = faint & np.roll(stretches.rest & ~stretches.gap, -1)
    lead = faint & np.roll(stretches.rest, 1) & ~stretches.gap & ~trail
    edges, rest = edges.copy(), record.rest.copy()
    edges[stretches.first[speck | lead]] = edges[stretches.first[np.roll(speck | trail, 1)]] = False
    rest_after = np.where(speck, np.roll(stretches.rest, 1), True)
    chosen = speck | onset | trail | lead
    size = stretches.last - stretches.first + 1
    rest[np.repeat(chosen, size)] = np.repeat(rest_after[chosen], size[chosen])
    return record._replace(rest=rest), edges


def join_transients(record, edges):
    """Edges without those within the rise or fall of the tester's output."""
    for _ in range(8):
        stretches = runs(record, edges)
        onward, backward = _transients(stretches)
        edges = edges.copy()
        edges[stretches.first[np.roll(onward, 1)]] = edges[stretches.first[backward]] = False
        if not (onward.any() or backward.any()):
            return edges
    return edges


def _transients(stretches):
    """Masks of runs that are the rise of the next run, and the fall of the one before."""
    before, after = np.roll(stretches.level, 1), np.roll(stretches.level, -1)
    between = (stretches.level - before) * (after - stretches.level) >= 0
    rise = between | (np.roll(stretches.rest, 1) & (stretches.level * after > 0))
    under_load = ~stretches.rest & ~stretches.gap
    # The tester's output rises and falls within 1 s, or two samples of a slow logger.
    brief = under_load & (stretches.span <= 1.0)
    few = under_load & (stretches.last - stretches.first < 2)

    def short_beside(neighbour):
        beside = np.roll(stretches.span, neighbour)
        return (brief & (beside >= 5 * stretches.span)) | (few & (beside >= 20 * stretches.span))

    onward = rise & ~np.roll(stretches.rest | stretches.gap, -1) & short_beside(-1)
    backward = between & np.roll(stretches.rest, -1) & ~np.roll(stretches.rest, 1) & ~onward
    backward &= short_beside(1)
    onward[[0, -1]] = backward[[0, -1]] = False
    return onward, backward


def dynamic_chains(record, edges, short_second):
    """Edges without those inside dynamic loads, and the mask (n,) of rows of these loads."""
    stretches = runs(record, edges)
    short = stretches.span <= short_second
    pair = (short & ~stretches.rest) & np.roll(short & ~stretches.rest, -1)
    isolated = np.roll(pair, -1) | np.roll(pair, 2)  # two equal runs of a chain look like one
    short |= isolated & ~stretches.rest & (stretches.span <= 2 * short_second)
    begins = np.flatnonzero(np.diff(short, prepend=False) | stretches.gap)
    ends = np.append(begins[1:], len(short))
    edges, dynamic = edges.copy(), np.zeros(len(edges), bool)
    for begin, end in zip(begins, ends, strict=True):
        begin, end = _trim(stretches, begin, end)
        if short[begin] and _many_levels(stretches.level[begin:end], stretches.rest[begin:end]):
            edges[stretches.first[begin] + 1 : stretches.last[end - 1] + 1] = False
            dynamic[stretches.first[begin] : stretches.last[end - 1] + 1] = True
    return edges, dynamic


def _trim(stretches, begin, end):
    """First run and end of a chain of runs without the rests above 10 s at its two ends."""
    inside = ~(stretches.rest[begin:end] & (stretches.span[begin:end] > 10.0))
    kept = np.flatnonzero(inside)
    return (begin + kept[0], begin + kept[-1] + 1) if len(kept) else (begin, begin + 1)


def _many_levels(level, rest):
    """Whether runs (k,) [A] change load directly, often, and between many levels.

    Eight changes or more, between five levels that lie a tenth of the largest apart.
    """
    if np.count_nonzero(~rest[1:] & ~rest[:-1]) < 8:
        return False
    return len(np.unique(np.round(level / (0.1 * np.abs(level).max())))) >= 5


def run_kinds(record, stretches, dynamic, tolerance, pulse_max_second, rated):
    """Kind of each run (runs,) and the row from which its voltage is held (−1: never)."""
    kind = np.where(stretches.rest, "rest", "CC").astype("<U7")
    held = np.full(len(kind), -1)
    kind[dynamic[stretches.first]] = "dynamic"
    for run in np.flatnonzero(kind == "CC"):
        kind[run], held[run] = _load_kind(
            record, stretches.first[run], stretches.last[run], tolerance, STEADY_C_RATE * rated
        )
    brief = (stretches.span <= pulse_max_second) & ~stretches.rest & ~dynamic[stretches.first]
    beside_rest = stretches.gap | np.roll(stretches.rest, 1) | np.roll(stretches.rest, -1)
    kind[brief & (beside_rest | _on_load(stretches))] = "pulse"
    return kind, held


def _load_kind(record, first, last, tolerance, slack):
    """Kind of one load run, and its first row of held voltage (−1: none)."""
    size, voltage = np.abs(record.current[first : last + 1]), record.voltage[first : last + 1]
    level = np.median(size)
    if np.median(size[-3:]) >= 0.9 * level and _steady(size, voltage, slack):
        return "CC", -1
    away = np.flatnonzero(np.abs(voltage - np.median(voltage[-3:])) > tolerance)
    hold = away[-1] + 1 if len(away) else 0
    if hold >= len(size) or size[hold:].max() < 1.1 * size[-1]:
        return ("CC" if _steady(size, voltage, slack) else "dynamic"), -1
    before = slice(np.argmax(size >= (1 - STEADY_SHARE) * level), hold)
    if hold <= max(2, 0.02 * len(size)):
        return "CV", first + hold
    one_load = _steady(size[before], voltage[before], slack)
    return ("CCCV", first + hold) if one_load else ("dynamic", -1)


def _steady(size, voltage, slack):
    """Whether currents (k,) [A] stay near their median, 15 % for rise and overshoot aside.

    Or whether their power or resistance was held, at voltages (k,) [V].
    """
    level = np.median(size)
    near = np.abs(size - level) <= np.maximum(STEADY_SHARE * level, slack)
    return np.mean(near) >= 0.85 or bool(held_quantity(size[1:-1], voltage[1:-1]))


# ASSUME: A current that moves so that current times voltage (or voltage over current) stays within
# 0.5 % all the way was not held: power (or resistance) was.
def held_quantity(current, voltage):
    """Power or resistance that was held, over eight parts of (n,) [A], [V]: (name, level, unit).

    Returns () where neither was, or of fewer than 32 rows.
    """
    size = np.abs(current)
    if len(size) < LEAST_HELD_ROWS or not size.all():
        return ()
    found = ("power", size * voltage, "W"), ("resistance", voltage / size, "Ohm")
    for name, values, unit in found:
        levels = np.array([np.median(part) for part in np.array_split(values, 8)])
        if np.ptp(levels) <= HELD_SHARE * abs(levels.mean()):
            return name, float(levels.mean()), unit
    return ()


def _on_load(stretches):
    """Mask of short runs between two much longer runs of the same current."""
    before, after = np.roll(stretches.level, 1), np.roll(stretches.level, -1)
    same = np.abs(before - after) <= STEADY_SHARE * np.abs(before)
    shorter_neighbour = np.minimum(np.roll(stretches.span, 1), np.roll(stretches.span, -1))
    return same & (stretches.span <= 0.5 * shorter_neighbour)


def join_holds(record, stretches, kind, held, tolerance):
    """Runs, kinds and first held rows with a load and the held voltage at its end as one run."""
    ends, level = np.roll(record.voltage[stretches.last], 1), np.roll(stretches.level, 1)
    low = np.minimum(np.minimum.reduceat(record.voltage, stretches.first), ends)
    high = np.maximum(np.maximum.reduceat(record.voltage, stretches.first), ends)
    least = np.minimum.reduceat(record.current, stretches.first)
    most = np.maximum.reduceat(record.current, stretches.first)
    onward = (least * most > 0) & (stretches.level * level > 0) & ~stretches.rest
    falls = np.abs(stretches.level) < np.abs(level)
    again = (high - low <= 2 * tolerance) & onward & falls & ~stretches.gap
    again &= np.isin(np.roll(kind, 1), ("CC", "CV", "CCCV")) | np.roll(again, 1)
    again[0] = False
    kind, held = kind.copy(), held.copy()
    for run in np.flatnonzero(again)[::-1]:
        before = held[run - 1] if held[run - 1] >= 0 else stretches.first[run]
        held[run - 1] = before
        kind[run - 1] = "CCCV" if kind[run - 1] == "CC" else kind[run - 1]
    return join(record, stretches, kind, held, again)


def join(record, stretches, kind, held, again):
    """Runs, kinds and first held rows with the marked runs joined to the run before."""
    edges = np.zeros(len(record.time), bool)
    edges[stretches.first[~again]] = True
    return runs(record, edges), kind[~again], held[~again]


class Steps(NamedTuple):
    """One entry a step, arrays of shape (steps,). Rows count into the record, both inclusive.

    kind is "rest", "CC", "CV", "CCCV", "pulse" or "dynamic"; cv_first_row is −1 where voltage is
    never held; c_rate is the size of the mean current over the rating; charge is positive on
    charge. A step starts at the last sample before it (the edge lies after it), after a gap at its
    own first sample.
    """

    step: np.ndarray
    kind: np.ndarray
    first_row: np.ndarray
    last_row: np.ndarray
    start_time_second: np.ndarray
    end_time_second: np.ndarray
    duration_second: np.ndarray
    current_mean_ampere: np.ndarray
    voltage_before_volt: np.ndarray
    voltage_start_volt: np.ndarray
    voltage_end_volt: np.ndarray
    voltage_min_volt: np.ndarray
    voltage_max_volt: np.ndarray
    charge_ampere_hour: np.ndarray
    cv_first_row: np.ndarray
    c_rate: np.ndarray


def constant_current_end(first_row, last_row, cv_first_row):
    """Row after the last one of a step before its voltage is held, an int or (steps,)."""
    end = np.where(np.greater(cv_first_row, first_row), cv_first_row, np.add(last_row, 1))
    return end if end.ndim else int(end)


def follows_directly(steps):
    """Mask (steps,) of steps without a gap of the record before them."""
    return np.append(False, steps.start_time_second[1:] == steps.end_time_second[:-1])


# ASSUME: Without a rating, C-rates and thresholds refer to the charge that the record moves.
def assumed_rating(current_ampere, charge_ampere_hour):
    """Rating [Ah] that segmentation uses where none is stated, from the record (n,) [A], [Ah].

    The larger of the charge that the record moves and a third of its largest current times 1 h.

    Returns it [Ah]. Raises Refusal: no current flows in the record.
    """
    rating = max(np.ptp(charge_ampere_hour), np.abs(current_ampere).max() / 3.0)
    if not rating > 0:
        raise Refusal("no current flows in the record, and no rating is stated")
    return float(rating)


def segment(
    test_time_second,
    current_ampere,
    voltage_volt,
    charge_ampere_hour,
    *,
    rated_capacity_ampere_hour=None,
    file_index=None,
    rest_c_rate=SEGMENT.rest_c_rate,
    pulse_max_second=SEGMENT.pulse_max_second,
):
    """Cut a record into steps by what the current and the voltage do, never by step numbers.

    1. Rest is where |current| stays below `rest_c_rate`. 2. An edge is a step of current that the
    voltage answers, a change between rest and load, a gap, or the joint of two files. 3. Lone
    samples of noise and the rise of the tester's output join the run they belong to. 4. Chains
    of short runs with many levels are one dynamic step. 5. A steady short load next to a rest, or
    on top of a running load, is a pulse. 6. What is left is CC, CV or CCCV, by whether the
    current decays while the voltage is held.

    test_time_second : (n,) [s], not decreasing.
    current_ampere : (n,) [A], positive on charge.
    voltage_volt : (n,) [V].
    charge_ampere_hour : (n,) net charge since the first row [Ah].
    rated_capacity_ampere_hour : [Ah]; None: `assumed_rating` of the record.
    file_index : (n,) number of the joined file of each row [1]; None: one file.
    rest_c_rate : largest current at rest over the rating [1/h].
    pulse_max_second : longest pulse, and longest run of a dynamic load (with a quarter more) [s].

    Returns Steps. Raises Refusal: fewer than three rows, time that runs backwards, or no rating and
    no current.
    """
    time, current = np.asarray(test_time_second, float), np.asarray(current_ampere, float)
    voltage, charge = np.asarray(voltage_volt, float), np.asarray(charge_ampere_hour, float)
    if len(time) < 3:
        raise Refusal(f"the record has {len(time)} rows; steps need at least 3")
    refuse_backward(time)
    rated = rated_capacity_ampere_hour or assumed_rating(current, charge)
    files = np.zeros(len(time), int) if file_index is None else np.asarray(file_index)
    gap = silent_before(time, GAP_SECOND) | (np.diff(files, prepend=0) > 0)
    rest = rest_rows(time, current, threshold=rest_c_rate * rated, rated=rated)
    record = Sampled(time, current, voltage, gap, rest)
    tolerance = hold_tolerance(voltage, record.rest)
    record, edges = drop_noise(record, edge_rows(record, rated, tolerance), rated)
    edges = join_transients(record, edges)
    edges, dynamic = dynamic_chains(record, edges, 1.25 * pulse_max_second)
    stretches = runs(record, edges)
    kind, held = run_kinds(record, stretches, dynamic, tolerance, pulse_max_second, rated)
    stretches, kind, held = join_holds(record, stretches, kind, held, tolerance)
    # Dynamic loads and rests that follow one of their kind without a gap are one.
    again = (kind == np.roll(kind, 1)) & np.isin(kind, ("dynamic", "rest")) & ~stretches.gap
    again[0] = False
    stretches, kind, held = join(record, stretches, kind, held, again)
    return _steps(record, charge, stretches, kind, held, rated)


def _steps(record, charge, stretches, kind, held, rated):
    """The table of steps (columns of `Steps`) from the runs and their kinds."""
    first, last = stretches.first, stretches.last
    begin = np.where(stretches.gap, first, first - 1)
    # What was counted between a run's own samples is surer than the mean of a coarse sampling.
    hour = (record.time[last] - record.time[first]) / 3600
    timed = (hour > 0) & (last - first > 2)
    mean = np.divide(charge[last] - charge[first], hour, out=stretches.level.copy(), where=timed)
    return Steps(
        step=np.arange(len(first)),
        kind=kind,
        first_row=first,
        last_row=last,
        start_time_second=record.time[begin],
        end_time_second=record.time[last],
        duration_second=stretches.span,
        current_mean_ampere=mean,
        voltage_before_volt=np.where(first == 0, np.nan, record.voltage[first - 1]),
        voltage_start_volt=record.voltage[first],
        voltage_end_volt=record.voltage[last],
        voltage_min_volt=np.minimum.reduceat(record.voltage, first),
        voltage_max_volt=np.maximum.reduceat(record.voltage, first),
        charge_ampere_hour=_charge(charge, stretches),
        cv_first_row=held,
        c_rate=np.abs(mean) / rated,
    )


def _charge(charge, stretches):
    """Net charge of each run [Ah]: an interval between rest and load belongs to the load."""
    leads_in = ~stretches.gap & ~(stretches.rest & ~np.roll(stretches.rest, 1))
    begin = charge[np.where(leads_in, stretches.first - 1, stretches.first)]
    rest_follows = np.roll(stretches.rest & ~stretches.gap, -1) & ~stretches.rest
    rest_follows[-1] = False
    after = np.minimum(stretches.last + 1, len(charge) - 1)
    return charge[np.where(rest_follows, after, stretches.last)] - begin
