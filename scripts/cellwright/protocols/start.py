"""Whether a discharge begins full and a charge empty: one rule for every kind of test.

The witnesses, in order: the half cycle before it, the test before it in time, the half cycle after
it (between the same two ends both move the same charge), what the sheet states where the record
does not contradict it, the voltage under load, and the rest. A full cell rests below its upper
cut-off, an aged one further below: how far is no sign of how full it is. So a rest alone tells no
more than how much charge may be missing.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.records.anchor import STATED_SOC, contradiction

NEAR_VOLT = 0.010  # a limit counts as reached this near to it
MOST_MISSING = 0.20  # of the charge moved: with more doubt no new cell is told from one at its end
RETURN_SHARE = 0.03  # by which a charge and a discharge between the same two ends may differ
ENDS = {-1: "full", 1: "empty"}  # how a discharge (-1) and a charge (+1) are to begin


class Start(NamedTuple):
    """How a half cycle begins.

    fault : why it does not begin full (discharge) or empty (charge), "" where it does.
    missing_ampere_hour : standard deviation of the charge that it may lack [Ah], 0 where what came
        before tells its start. words : what an unsure start is known from.
    """

    fault: str = ""
    missing_ampere_hour: float = 0.0
    words: str = ""


class Swing(NamedTuple):
    """A half cycle to its turn, as its start is judged by it and by those beside it.

    sign : +1 charge, -1 discharge. first_row : the last one before its load. last_row : inclusive.
    moved_ampere_hour : from turn to turn [Ah]. reached : whether it reached its cut-off.
    end_volt : of its last loaded row [V]. under_load : the record begins with it, without a rest.
    """

    sign: int
    first_row: int
    last_row: int
    moved_ampere_hour: float
    reached: bool
    end_volt: float
    under_load: bool


class Before(NamedTuple):
    """What is known of a record's start besides the record.

    state_before : "full" or "empty", as the test before it in time left the cell; "": not known.
    soc_at_start : of the first row, as the sheet states it [1], or None. curve : open-circuit
    voltage of the cell that it is held against, see `anchor.contradiction`, or None. rest_second :
    how long the record rests at its start [s].
    """

    state_before: str = ""
    soc_at_start: float | None = None
    curve: dict | None = None
    rest_second: float = 0.0


UNKNOWN = Before()


def starts_of(swings, columns, limits, known=UNKNOWN):
    """How each half cycle of a record begins.

    Parameters
    ----------
    swings : list of Swing, in time order.
    columns : (current [A] positive on charge, voltage [V], charge [Ah]), (n,) each.
    limits : lower and upper cut-off [V] or None. known : Before.

    Returns
    -------
    starts : list of Start.
    """
    told = [
        _told(swing, before) if before else _first(swing, after, columns, limits, known)
        for before, swing, after in zip([None, *swings], swings, [*swings[1:], None], strict=False)
    ]
    rests = {
        sign: [
            columns[1][swing.first_row]
            for swing, start in zip(swings, told, strict=True)
            if start and swing.sign == sign and not (start.fault or swing.under_load)
        ]
        for sign in ENDS
    }
    starts = [
        start or _by_rest(swing, before, columns, limits, rests[swing.sign])
        for before, swing, start in zip([None, *swings], swings, told, strict=False)
    ]
    wrong = _contradiction(swings, starts, columns, limits, known)
    return [_with_words(starts[0], wrong), *starts[1:]] if wrong else starts


def _with_words(start, words):
    """The start with a sentence more: behind its fault, or else behind what it is known from."""
    name = "fault" if start.fault else "words"
    return start._replace(**{name: "; ".join(filter(None, [getattr(start, name), words]))})


def _told(swing, before):
    """Start of a half cycle after another one that reached its cut-off; else None."""
    return Start() if before.sign != swing.sign and before.reached else None


def _first(swing, after, columns, limits, known):
    """Start of a record's first half cycle but by its rest, or None."""
    told = told_of_first(swing, after, columns, limits, known)
    if told is None and swing.under_load:
        return _under_load(swing, known.state_before)
    return told


def told_of_first(swing, after, columns, limits, known=UNKNOWN):
    """Start of a record's first half cycle, where anything tells it but the rest alone, or None.

    Parameters
    ----------
    swing, after : Swing, the first one and the one after it, or None.
    columns, limits, known : as in `starts_of`.
    """
    if known.state_before == ENDS[swing.sign] or _at_limit(swing, columns[1], limits):
        return Start()
    returned = _by_return(swing, after)
    room = np.inf if not (returned and returned.fault) else _room(swing, columns, limits)
    if returned and returned.missing_ampere_hour <= room:
        return returned
    if known.soc_at_start is not None and not _rest_contradicts(swing, columns, limits, known):
        return _as_stated(swing, known.soc_at_start)
    return None


def _at_limit(swing, voltage, limits):
    """Whether the first voltage, at rest or under load, is at the cut-off that it is to leave."""
    limit, first = limits[swing.sign < 0], float(voltage[swing.first_row])
    return limit is not None and swing.sign * (first - limit) <= NEAR_VOLT


def _by_return(swing, after):
    """Start of a first half cycle by the one after it, which runs from end to end; or None.

    The one after it moves what lies between both cut-offs; what the first one moves less it lacked.
    """
    if after is None or after.sign == swing.sign or not (after.reached and swing.reached):
        return None
    lacking = after.moved_ampere_hour - swing.moved_ampere_hour
    share = lacking / after.moved_ampere_hour
    if abs(share) <= RETURN_SHARE:
        # A charge takes more than it gives back: what a discharge gives beyond it was there before.
        return Start("", max(lacking, 0.0) if swing.sign > 0 else 0.0)
    if share < 0:
        return None
    lacked, after_it = ("lacked", "charge") if swing.sign < 0 else ("already held", "discharge")
    moved = f"the {after_it} after it moves {after.moved_ampere_hour:.4g} Ah between the same ends"
    fault = f"it does not start {ENDS[swing.sign]}: it {lacked} {share:.1%}, for {moved}"
    return Start(fault, lacking)


def _room(swing, columns, limits):
    """Most charge that a first half cycle may lack by its first voltage [Ah].

    Where the half cycle after it moves more than that leaves room for, the current has an offset.
    """
    by_rest = _by_rest(swing, None, columns, limits, ())
    return np.inf if by_rest.fault else by_rest.missing_ampere_hour


def _rest_contradicts(swing, columns, limits, known):
    """Why the first rest contradicts the stated SoC, "" where it does not."""
    rest = np.nan if swing.under_load else float(columns[1][swing.first_row])
    second = known.rest_second
    return contradiction(known.soc_at_start, rest, limits, known.curve, rest_second=second)


# ASSUME: A cell that the sheet states full or empty was so by its protocol, without a doubt.
def _as_stated(swing, soc):
    """Start of a first half cycle by the sheet's SoC."""
    missing = 1 - soc if swing.sign < 0 else soc
    if not missing <= RETURN_SHARE:
        return Start(f"it does not start {ENDS[swing.sign]}: the sheet states an SoC of {soc:g}")
    return Start("", missing * swing.moved_ampere_hour)


def _contradiction(swings, starts, columns, limits, known):
    """In words, what contradicts the stated SoC: the first rest, or an end that others tell."""
    if not swings or known.soc_at_start is None:
        return ""
    by_rest = _rest_contradicts(swings[0], columns, limits, known)
    missing = 1 - known.soc_at_start if swings[0].sign < 0 else known.soc_at_start
    if by_rest or starts[0].fault or missing <= STATED_SOC:
        return by_rest
    return f"the stated SoC of {known.soc_at_start:g} is not used: it starts {ENDS[swings[0].sign]}"


# ASSUME: A record that begins under load with a discharge begins with a full cell.
def _under_load(swing, state_before):
    """Start of a record that begins under load, not at a cut-off."""
    if swing.sign > 0:
        return Start("the record begins with it, from an unknown state of charge")
    if state_before == "empty":
        return Start("it does not start full: the test before it left the cell empty")
    return Start()


def _by_rest(swing, before, columns, limits, known_rests_volt):
    """Start of a half cycle by the voltage at which the cell rests before it."""
    if None in limits:
        return Start(
            f"whether it starts {ENDS[swing.sign]} cannot be told: a cut-off is not stated"
        )
    turned = before is not None and before.sign != swing.sign
    return start_at_rest(
        columns,
        (swing.first_row, swing.last_row),
        swing.sign,
        limits,
        known_rests_volt=known_rests_volt,
        cut_short_volt=before.end_volt if turned else None,
    )


def start_at_rest(columns, rows, sign, limits, *, known_rests_volt=(), cut_short_volt=None):
    """How a half cycle begins whose cell rests before it, by the voltage of that rest.

    1. Resting no lower than the same cell did before half cycles of which the start is known (for a
    charge: no higher), it begins as they did. 2. Else the voltage that lacks to the cut-off bounds
    the charge that may be missing: open-circuit curves are steepest at their ends, so it is no more
    than what it takes to lower the voltage as far again. Under load this is counted from the first
    loaded sample on; it is then somewhat too small, for the load's own polarisation still grows,
    and stands for the standard deviation instead of a bound. 3. Where that exceeds 20 % of the
    charge moved, the start is not known.

    Parameters
    ----------
    columns : (current [A] positive on charge, voltage [V], charge [Ah]), (n,) each.
    rows : first row, at rest, and last row of the half cycle.
    sign : +1 charge, -1 discharge. limits : lower and upper cut-off [V], not None.
    known_rests_volt : rest voltages before half cycles whose start is known [V].
    cut_short_volt : loaded voltage at which the half cycle before ended short of its cut-off [V].

    Returns
    -------
    start : Start.
    """
    current, voltage, charge = (column[rows[0] : rows[1] + 1] for column in columns)
    rest, end = float(voltage[0]), ENDS[sign]
    if cut_short_volt is not None and sign * (rest - cut_short_volt) >= 0:
        return Start(f"it does not start {end}: what came before was cut short")
    lacking = sign * (rest - limits[sign < 0]) - NEAR_VOLT
    if lacking <= 0:
        return Start()
    if any(sign * (rest - known) <= NEAR_VOLT for known in known_rests_volt):
        return Start(words=f"rests at {rest:.3f} V as before cycles that start {end}")
    missing = _charge_of_fall(np.abs(current), sign * voltage, charge, lacking)
    moved = abs(float(charge[-1] - charge[0]))
    if missing > MOST_MISSING * moved:
        share = f"{min(missing / moved, 1):.0%} of its charge" if moved else "all of its charge"
        may = f"may lack {share}" if sign < 0 else f"may already hold {share}"
        words = (
            f"it does not start {end} or is not known to: with a rest voltage of {rest:.3f} V it "
        )
        return Start(f"{words}{may}, and no test before it tells more")
    return Start("", missing, f"start by a rest voltage of {rest:.3f} V, ± {missing:.2g} Ah")


def _charge_of_fall(size, along, charge, fall_volt):
    """Charge [Ah] until the loaded voltage has gone on by `fall_volt` since the load was on.

    size, along : current [A] without its sign; voltage, rising in the direction of the load [V].
    """
    loaded = np.flatnonzero(size >= np.median(size[1:]) / 2)
    loaded = loaded[loaded > 0]
    if not len(loaded):
        return abs(float(charge[-1] - charge[0]))
    beyond = np.flatnonzero(along[loaded] - along[loaded[0]] >= fall_volt)
    last = loaded[beyond[0]] if len(beyond) else -1
    return abs(float(charge[last] - charge[0]))


ANEW_SHARE = 0.3  # of the charge to the cut-off: more after it than this was never left in the cell
RISEN_SHARE = 0.5  # of the way back from the cut-off to the rest before: a cell charged in between


def spans_with_lost_charges(spans, columns, steps, limits):
    """Half cycles cut where the one between them was not logged.

    Without the charge between them two discharges look like one. They are two where the first has
    reached its cut-off, the cell then rests at more than half of the way back to the rest that the
    first began with, and the second moves at least 30 % of the first's charge: no cell gives that
    after its cut-off. Likewise two charges.

    Parameters
    ----------
    spans : list of (sign, first step, last step), from `capacity.turns`.
    columns : (current [A], voltage [V], charge [Ah]), (n,) each. steps : Steps of the record.
    limits : lower and upper cut-off [V]; one that is None cuts nothing.

    Returns
    -------
    spans : list of the same.
    """
    return [part for span in spans for part in _parts(span, columns, steps, limits)]


def _parts(span, columns, steps, limits):
    sign, first, last = span
    limit = limits[sign > 0]
    if limit is None:
        return [span]
    _, voltage, charge = columns
    loads = [k for k in range(first, last + 1) if steps.kind[k] != "rest"]
    begins = [loads[0]] if loads else []
    for earlier, load in pairwise(loads):
        row, start = steps.last_row[earlier], steps.first_row[begins[-1]] - 1
        if sign * voltage[row] < sign * limit - NEAR_VOLT:
            continue
        rest, rest_before = voltage[steps.first_row[load] - 1], voltage[max(start, 0)]
        back = (rest - voltage[row]) / ((rest_before - voltage[row]) or np.inf)
        moved = abs(charge[row] - charge[max(start, 0)])
        after = _to_cutoff(sign, load, loads, (voltage, charge), steps, limit)
        if back >= RISEN_SHARE and after >= ANEW_SHARE * moved:
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
