"""Half cycles of a record: where each begins and ends, and whether it is complete.

One rule for every kind of test. What tells how a half cycle begins, in order: the half cycle before
it, the test before it in time, the half cycle after it (between the same two ends both move the
same charge), what the sheet states where the record does not contradict it, the voltage under load,
and the rest. A full cell rests below its upper cut-off, an aged one further below: how far is no
sign of how full it is. So a rest alone tells no more than how much charge may be missing.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.turns import turning_points
from cellwright.protocols.messages import say
from cellwright.records import inputs
from cellwright.records.anchor import STATED_SOC, FirstRest, contradiction

NEAR_VOLT = 0.010  # a limit counts as reached this near to it: sampling and lead drop
TURN_SHARE = 0.02  # of the rating: a smaller return of charge (regeneration, dither) is no turn
RETURN_SHARE = 0.03  # by which a charge and a discharge between the same two ends may differ
NAMES = {1: "charge", -1: "discharge"}
ENDS = {-1: "full", 1: "empty"}  # how a discharge (-1) and a charge (+1) are to begin


class HalfCycle(NamedTuple):
    """One charge or discharge between two turns of the counted charge.

    sign : +1 charge, -1 discharge. first_row : the last one before its load. turn_row : the last
    one of its last load. moved_ampere_hour : between the two [Ah]. reached : whether it reached its
    cut-off. under_load : the record begins with it, without a rest. loads : its steps under load,
    those to the cut-off first in `to_cutoff`. last_row : to which it is counted. fault : why it is
    not complete, "" where it is. missing_ampere_hour : standard deviation of the charge that it may
    lack at its start [Ah], 0 where what came before tells it. words : what an unsure start is known
    from. code : of messages.toml, what `fault` or `words` says.
    """

    sign: int
    first_row: int
    turn_row: int
    moved_ampere_hour: float
    reached: bool
    under_load: bool
    loads: tuple = ()
    to_cutoff: tuple = ()
    last_row: int = -1
    fault: str = ""
    missing_ampere_hour: float = 0.0
    words: str = ""
    code: str = ""


class Start(NamedTuple):
    """How a half cycle begins: fields as of `HalfCycle`; `fault` is that of its start alone."""

    fault: str = ""
    missing_ampere_hour: float = 0.0
    words: str = ""
    code: str = ""


def faulty_start(code, *, missing_ampere_hour=0.0, **fields):
    """Start that leaves its half cycle incomplete, for a reason of messages.toml."""
    return Start(say(f"half.{code}", **fields), missing_ampere_hour, code=code)


def unsure_start(code, *, missing_ampere_hour=0.0, **fields):
    """Start that is known from something less sure, as messages.toml says it."""
    return Start("", missing_ampere_hour, say(f"half.{code}", **fields), code)


class Before(NamedTuple):
    """What is known of a record's start besides the record.

    state_before : "full" or "empty", as the test before it in time left the cell; "": not known.
    soc_at_start : of the first row, as the sheet states it [1], or None. curve : open-circuit
    voltage of the cell that it is held against, see `anchor.contradiction`, or None. rest : how
    the record rests at its start.
    """

    state_before: str = ""
    soc_at_start: float | None = None
    curve: dict | None = None
    rest: FirstRest = FirstRest()


def known_of_start(course, test):
    """What the test before a test and the sheet tell of its start: first two fields of Before.

    course : result of `course` or its rows, or None. test : TestFacts, or mapping, or None.
    """
    rows = inputs.rows(course) if course is not None else []
    facts = inputs.test_facts(test) if test is not None else None
    name, soc = (None, None) if facts is None else (facts.test, facts.soc)
    state = next((row["state_at_begin"] for row in rows if row["test"] == name), "")
    return {"state_before": state, "soc_at_start": soc}


def columns_of(series):
    """Current [A], voltage [V] and charge [Ah] of a clean series, (n,) each, as used here."""
    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    return tuple(np.asarray(series[name], float) for name in names)


def half_cycles(columns, steps, limits, *, least_ampere_hour, dynamic=True):
    """Half cycles of a record, in time order, with the fault of their ends; their starts aside.

    A half cycle is complete at its end where a load in its direction reaches the cut-off within
    10 mV, or a line through its last samples does: the cut-off then lies between two.

    columns : (current [A] positive on charge, voltage [V], charge [Ah]), (n,) each.
    steps : Steps of the record. limits : lower and upper cut-off [V] or None.
    least_ampere_hour : a return of less than this is no turn [Ah].
    dynamic : whether a dynamic load may reach the cut-off too.

    Returns halves: list of HalfCycle, counted to the turn; without `loads` where only rests were
    counted.
    """
    spans = [
        part
        for span in turns(columns[2], steps, least_ampere_hour=least_ampere_hour)
        for part in _parts(span, columns, steps, limits)
    ]
    return [_half_cycle(span, columns, steps, limits, dynamic) for span in spans]


def _half_cycle(span, columns, steps, limits, dynamic):
    sign, first, last = span
    current, voltage, charge = columns
    limit = limits[sign > 0]
    loads = _loads(span, steps)
    if not loads:
        rows = int(steps.first_row[first]), int(steps.last_row[last])
        read = float(np.median(current[rows[0] : rows[1] + 1]))
        half = HalfCycle(sign, *rows, 0.0, False, first == 0, last_row=rows[1])
        return half._replace(fault=say("half.no_load", ampere=read), code="no_load")
    begin, turn = max(int(steps.first_row[loads[0]]) - 1, 0), int(steps.last_row[loads[-1]])
    at_limit = [k for k in loads if limit is not None and _reaches(k, sign, limit, voltage, steps)]
    if not dynamic:
        at_limit = [k for k in at_limit if steps.kind[k] != "dynamic"]
    last = _end_of_hold(at_limit[0], loads, limit, voltage, steps) if at_limit else None
    code, fault = "", ""
    if limit is None:
        code = "no_cutoff"
        fault = say("half.no_cutoff", name="upper" if sign > 0 else "lower")
    elif not at_limit:
        code = "short_of_cutoff"
        fault = say("half.short_of_cutoff", volt=voltage[turn], limit=limit)
    return HalfCycle(
        sign=sign,
        first_row=begin,
        turn_row=turn,
        moved_ampere_hour=abs(float(charge[turn] - charge[begin])),
        reached=bool(at_limit),
        under_load=loads[0] == 0,
        loads=tuple(loads),
        to_cutoff=tuple(k for k in loads if not at_limit or k <= last),
        last_row=turn,
        fault=fault,
        code=code,
    )


def _end_of_hold(step, loads, limit, voltage, steps):
    """The last load that goes on at the cut-off [V] after one that reached it, as over a gap."""
    while step + 1 in loads:
        ends = [int(rows[step + 1]) for rows in (steps.first_row, steps.last_row)]
        if np.any(np.abs(voltage[ends] - limit) > NEAR_VOLT):
            break
        step += 1
    return step


def _loads(span, steps):
    return [k for k in range(span[1], span[2] + 1) if steps.kind[k] != "rest"]


def _reaches(step, sign, limit, voltage, steps):
    """Whether a step that moves charge in its direction reaches the cut-off [V]."""
    first, last = int(steps.first_row[step]), int(steps.last_row[step])
    # Samples far apart step over the cut-off; five of them smooth the noise of the last one.
    earlier = max(last - 5, first)
    ahead = voltage[last] + (voltage[last] - voltage[earlier]) / max(last - earlier, 1)
    farthest = max(np.max(sign * voltage[first : last + 1]), sign * ahead)
    along = sign * steps.charge_ampere_hour[step] > 0
    return along and farthest >= sign * limit - NEAR_VOLT


def main_load(half, steps):
    """The load of a half cycle that moves the most, and what each of them moves [Ah]."""
    moved = np.abs(steps.charge_ampere_hour[list(half.loads)])
    return half.loads[int(np.argmax(moved))], moved


def charge_moved(half, charge):
    """Charge [Ah] that a half cycle moves, of the counted charge (n,)."""
    return abs(float(charge[half.last_row] - charge[half.first_row]))


def unsure_of_edges(half, variance, columns, limits):
    """Standard deviation [Ah] of what a half cycle moves by steps of current between two rows.

    Those inside it may lie anywhere between their rows. After its last row its load may have gone
    on, to the next row or to where a line through its last two reaches the cut-off.

    half : HalfCycle. variance : (n − 1,) of the charge of each interval, `edges.edge_variance`.
    columns, limits : as in `half_cycles`.
    """
    _, voltage, charge = columns
    inside, last = variance[half.first_row : half.last_row].sum(), half.last_row
    if last >= len(variance) or not variance[last]:
        return float(np.sqrt(inside))
    most, limit = np.sqrt(12.0 * variance[last]), limits[half.sign > 0]
    short = 0.0 if limit is None else max(half.sign * (limit - voltage[last]), 0.0)
    slope = (voltage[last] - voltage[last - 1]) / ((charge[last] - charge[last - 1]) or np.inf)
    beyond = min(short / slope, most) if slope > 0 else most * (short > 0)
    return float(np.sqrt(inside + beyond**2 / 3.0))


def reading_at_rest(logged_current_ampere, steps):
    """Median over a record's rests of what the current reads in each [A], 0 where it has none.

    logged_current_ampere : (n,) [A], with the readings that cleaning took out of the rests: that no
        rest counts them says nothing of the loads.
    """
    rests = zip(steps.first_row, steps.last_row, steps.kind, strict=True)
    read = [np.median(logged_current_ampere[a : b + 1]) for a, b, kind in rests if kind == "rest"]
    return float(np.median(read)) if read else 0.0


def unsure_of_instrument(
    half, test_time_second, current_ampere, accuracy_share, rest_ampere, *, clock_share=0.0
):
    """Standard deviation [Ah] of what a half cycle moves by the ammeter's errors and the clock's.

    Its reading may be off by up to a share of its range anywhere (a uniform distribution), and its
    range holds at least the record's largest current. What it reads in rests it may read too much
    under load as well, or not at all: nothing tells which.

    half : HalfCycle. test_time_second, current_ampere : (n,) [s], [A]. accuracy_share, clock_share
        : current_ and clock_ of `settings.Instrument`; 0 where two half cycles are compared, which
        one clock has measured. rest_ampere : `reading_at_rest` of the record.
    """
    hours = (test_time_second[half.last_row] - test_time_second[half.first_row]) / 3600.0
    ampere = accuracy_share * np.abs(current_ampere).max(), rest_ampere
    most = [one * hours for one in ampere] + [clock_share * half.moved_ampere_hour]
    return float(np.linalg.norm(most) / np.sqrt(3.0))


def weighted_median(values, weights):
    """Value below which half of the weight (n,) lies: of a current, half of the charge."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return values[order][np.searchsorted(total, total[-1] / 2)]


def energy_counted(voltage_volt, charge_ampere_hour):
    """Energy put in since the first row (n,) [Wh], by trapezoids of (n,) [V], [Ah]."""
    middle = (voltage_volt[1:] + voltage_volt[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(middle * np.diff(charge_ampere_hour))])


def turns(charge_ampere_hour, steps, *, least_ampere_hour):
    """Spans of steps between turning points of the counted charge.

    charge_ampere_hour : (n,) net charge since the first row [Ah].
    steps : Steps of the record.
    least_ampere_hour : a return of less than this is no turn [Ah].

    Returns list of (sign, first step, last step); empty where less than that is moved.
    """
    level = np.append(charge_ampere_hour[0], charge_ampere_hour[steps.last_row])
    points = turning_points(level, least=least_ampere_hour).tolist()
    return [(1 if level[b] > level[a] else -1, a, b - 1) for a, b in pairwise(points)]


def with_starts(halves, columns, limits, known):
    """Half cycles, those whose end has no fault with what `starts_of` says of their starts."""
    begun, found = [k for k, half in enumerate(halves) if half.loads], list(halves)
    starts = starts_of([halves[k] for k in begun], columns, limits, known)
    for k, start in zip(begun, starts, strict=True):
        if not found[k].fault:
            found[k] = found[k]._replace(**start._asdict())
    return found


def starts_of(halves, columns, limits, known):
    """How each half cycle of a record begins.

    halves : list of HalfCycle, in time order.
    columns, limits : as in `half_cycles`. known : Before.

    Returns starts: list of Start.
    """
    if not halves:
        return []
    starts = [start_of_first(halves[0], halves[1] if halves[1:] else None, columns, limits, known)]
    if starts[0] is None and halves[0].under_load:
        starts[0] = start_under_load(halves[0], columns, limits, known.state_before)
    # What follows a half cycle that reached its cut-off begins there.
    starts += [
        Start() if before.sign != half.sign and before.reached else None
        for before, half in pairwise(halves)
    ]
    rests = {sign: [] for sign in ENDS}
    for half, start in zip(halves, starts, strict=True):
        if start and not (start.fault or half.under_load):
            rests[half.sign].append(columns[1][half.first_row])
    starts = [
        start or start_by_rest(half, before, columns, limits, rests[half.sign])
        for before, half, start in zip([None, *halves], halves, starts, strict=False)
    ]
    if contradicted := _contradiction(halves[0], starts[0], columns, limits, known):
        name = "fault" if starts[0].fault else "words"
        said = "; ".join(filter(None, [getattr(starts[0], name), contradicted]))
        code = ";".join(filter(None, [starts[0].code, "contradicted"]))
        starts[0] = starts[0]._replace(**{name: said, "code": code})
    return starts


def start_of_first(half, after, columns, limits, known):
    """Start of a record's first half cycle, where anything but the rest alone says it, or None.

    half, after : HalfCycle, the first one and the one after it, or None.
    columns, limits, known : as in `starts_of`.
    """
    limit, first_volt = limits[half.sign < 0], float(columns[1][half.first_row])
    at_limit = limit is not None and half.sign * (first_volt - limit) <= NEAR_VOLT
    if known.state_before == ENDS[half.sign] or at_limit:
        return Start()
    returned = _by_return(half, after)
    by_rest = (
        start_by_rest(half, None, columns, limits, ()) if returned and returned.fault else None
    )
    # Where its first voltage leaves no room for what it lacks, the current has an offset.
    room = np.inf if by_rest is None or by_rest.fault else by_rest.missing_ampere_hour
    if returned and returned.missing_ampere_hour <= room:
        return returned
    if known.soc_at_start is not None and not _rest_contradicts(half, columns, limits, known):
        return _as_stated(half, known.soc_at_start)
    return None


def _by_return(half, after):
    """Start of a first half cycle by the one after it, which runs from end to end; or None.

    The one after it moves what lies between both cut-offs; what the first one moves less it lacked.
    """
    if after is None or after.sign == half.sign or not (after.reached and half.reached):
        return None
    lacking = after.moved_ampere_hour - half.moved_ampere_hour
    share = lacking / after.moved_ampere_hour
    if abs(share) <= RETURN_SHARE:
        # A charge takes more than it gives back: what a discharge gives beyond it was there before.
        return Start("", max(lacking, 0.0) if half.sign > 0 else 0.0)
    if share < 0:
        return None
    code = "lacked" if half.sign < 0 else "held"
    about = {"share": share, "moved": after.moved_ampere_hour}
    return faulty_start(code, missing_ampere_hour=lacking, **about)


def _rest_contradicts(half, columns, limits, known):
    """Why the first rest contradicts the stated SoC, "" where it does not."""
    rest = np.nan if half.under_load else float(columns[1][half.first_row])
    return contradiction(known.soc_at_start, rest, limits, known.curve, rest=known.rest)


# ASSUME: A cell that the sheet states full or empty was so by its protocol, without a doubt.
def _as_stated(half, soc):
    """Start of a first half cycle by the sheet's SoC."""
    missing = _missing(half, soc)
    if not missing <= RETURN_SHARE:
        return faulty_start("stated", end=ENDS[half.sign], soc=soc)
    return Start("", missing * half.moved_ampere_hour)


def _missing(half, soc):
    """Share of the charge that a half cycle lacks which begins at this SoC [1]."""
    return 1 - soc if half.sign < 0 else soc


def _contradiction(half, start, columns, limits, known):
    """In words, what contradicts the stated SoC: the first rest, or a start that others tell."""
    soc = known.soc_at_start
    if soc is None:
        return ""
    by_rest = _rest_contradicts(half, columns, limits, known)
    if by_rest or start.fault or _missing(half, soc) <= STATED_SOC:
        return by_rest
    return say("half.stated_not_used", soc=soc, end=ENDS[half.sign])


# ASSUME: A record that begins under load with a discharge begins with a full cell. What its first
# voltage is below full by holds the load's own drop, and only says how much it may lack at most.
def start_under_load(half, columns, limits, state_before):
    """Start of a record that begins under load, not at a cut-off."""
    if half.sign > 0:
        return faulty_start("starts_under_load")
    if state_before == "empty":
        return faulty_start("left_empty")
    if limits[1] is None:
        return Start()
    rows = slice(half.first_row, half.turn_row + 1)
    current, voltage, charge = (column[rows] for column in columns)
    lacking = limits[1] - float(voltage[0]) - NEAR_VOLT
    missing = charge_of_fall(np.abs(current), -voltage, charge, lacking) if lacking > 0 else 0.0
    if missing <= 0.01 * half.moved_ampere_hour:
        return Start()
    return unsure_start("uncounted", volt=voltage[0], missing=missing)


def start_by_rest(half, before, columns, limits, known_rests_volt):
    """Start of a half cycle by the voltage at which the cell rests before it.

    1. Not beyond where the half cycle before was cut short. 2. Resting no lower than the same cell
    did before half cycles of which the start is known (for a charge: no higher), it begins as they
    did. 3. Else the voltage that lacks to the cut-off bounds the charge that may be missing:
    open-circuit curves are steepest at their ends, so it is no more than what it takes to lower the
    voltage as far again. Under load this is counted from the first loaded sample on; it is then
    somewhat too small, for the load's own polarisation still grows, and stands for the standard
    deviation instead of a bound. 4. Where that exceeds 20 % of the charge moved, the start is not
    known: with more doubt no new cell is told from one at its end.
    """
    sign, end = half.sign, ENDS[half.sign]
    # Without both cut-offs the range of a rest voltage says nothing of how full a cell is.
    if None in limits:
        return faulty_start("start_unknown", end=end)
    rows = slice(half.first_row, half.turn_row + 1)
    current, voltage, charge = (column[rows] for column in columns)
    rest = float(voltage[0])
    turned = before is not None and before.sign != sign
    if turned and sign * (rest - columns[1][before.turn_row]) >= 0:
        return faulty_start("cut_short", end=end)
    lacking = sign * (rest - limits[sign < 0]) - NEAR_VOLT
    if lacking <= 0:
        return Start()
    if any(sign * (rest - known) <= NEAR_VOLT for known in known_rests_volt):
        return unsure_start("rests_alike", rest=rest, end=end)
    missing = charge_of_fall(np.abs(current), sign * voltage, charge, lacking)
    moved = half.moved_ampere_hour
    if missing > 0.20 * moved:
        share = f"{min(missing / moved, 1):.0%}" if moved else "all"
        code = "may_lack" if sign < 0 else "may_hold"
        return faulty_start(code, end=end, rest=rest, share=share)
    return unsure_start("by_rest", missing_ampere_hour=missing, rest=rest, missing=missing)


def charge_of_fall(size, along, charge, fall_volt):
    """Charge [Ah] until the loaded voltage has gone on by `fall_volt` since the load was on.

    size, along : current [A] without its sign; voltage, rising in the direction of the load [V].
    """
    # From half of the usual current on the load is on: before it, the voltage rises to its drop.
    loaded = np.flatnonzero(size >= np.median(size[1:]) / 2)
    loaded = loaded[loaded > 0]
    if not len(loaded):
        return abs(float(charge[-1] - charge[0]))
    beyond = np.flatnonzero(along[loaded] - along[loaded[0]] >= fall_volt)
    last = loaded[beyond[0]] if len(beyond) else -1
    return abs(float(charge[last] - charge[0]))


def _parts(span, columns, steps, limits):
    """Half cycle (sign, first step, last step) cut where the one between was not logged.

    Without the charge between them two discharges look like one. They are two where the first has
    reached its cut-off, the cell then rests at more than half of the way back to the rest that the
    first began with (it was charged in between), and the second moves at least 30 % of the first's
    charge: no cell gives that after its cut-off. Likewise two charges.
    """
    sign, first, last = span
    limit = limits[sign > 0]
    if limit is None:
        return [span]
    _, voltage, charge = columns
    loads = _loads(span, steps)
    begins = [loads[0]] if loads else []
    for earlier, load in pairwise(loads):
        row, start = steps.last_row[earlier], steps.first_row[begins[-1]] - 1
        if sign * voltage[row] < sign * limit - NEAR_VOLT:
            continue
        rest, rest_before = voltage[steps.first_row[load] - 1], voltage[max(start, 0)]
        # A cell only relaxes part of the way back; what goes further was charged.
        back = (rest - voltage[row]) / ((rest_before - voltage[row]) or np.inf)
        moved = abs(charge[row] - charge[max(start, 0)])
        after = _to_cutoff(sign, load, loads, (voltage, charge), steps, limit)
        if back >= 0.5 and after >= 0.3 * moved:
            begins.append(load)
    ends = [*[k - 1 for k in begins[1:]], last]
    return [(sign, k, end) for k, end in zip([first, *begins[1:]], ends, strict=True)]


def _to_cutoff(sign, load, loads, columns, steps, limit):
    """Charge [Ah] from a load to the first end of one that reaches the cut-off, or to the last."""
    voltage, charge = columns
    later = loads[loads.index(load) :]
    ends = [steps.last_row[k] for k in later]
    reached = [row for row in ends if sign * voltage[row] >= sign * limit - NEAR_VOLT]
    begin = max(steps.first_row[load] - 1, 0)
    return abs(charge[(reached or ends[-1:])[0]] - charge[begin])
