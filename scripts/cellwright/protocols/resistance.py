"""Resistance from pulses: the answer of the voltage to a step of the current."""

from collections import Counter
from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.messages import Said, doubt_columns
from cellwright.numerics.noise import least_digit
from cellwright.numerics.relaxing import Drift, drift_of_rest
from cellwright.numerics.statistics import robust_std
from cellwright.protocols import counted, not_elsewhere
from cellwright.protocols.balance import SIGMAS
from cellwright.protocols.coarse import coarsest_digit_ampere, may_be_cut
from cellwright.protocols.messages import say
from cellwright.protocols.pulse_begin import Begin, begin_of, late_among_others
from cellwright.protocols.pulse_edges import (
    AT_A_ROW,
    NOT_SETTLED,
    UNKNOWN,
    Rows,
    clock_tells,
    edges_of,
    growth_ohm,
    rises_with_rate,
)
from cellwright.records import inputs
from cellwright.records.basis import state_of_charge
from cellwright.records.repeats import steps_elsewhere
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.doubts import Doubt, doubts_said, said, unlike_size
from cellwright.series.steps import (
    EDGE_C_RATE,
    EDGE_SHARE,
    constant_current_end,
    follows_directly,
)
from cellwright.settings import Instrument, Resistance

RESISTANCE, INSTRUMENT = Resistance(), Instrument()
LARGE_VOLT, PROMPT_SECOND = 0.2, 1.0
ROUND_C_RATES = (1 / 20, 1 / 10, 1 / 5, 1 / 4, 1 / 3, 1 / 2, 1, 1.5, 2, 3, 4, 5, 10)
SLOWEST_PULSE_C_RATE = 1 / 3  # that laboratories choose
ROUND_SHARE = 0.02  # within which a tester holds a current
FIRST_LEFT_OUT = "first row of a pulse had not settled: a faster one reads more at the same SoC"
SMALL_SHARE = 0.25  # of the record's median: cold and empty cells show more, none so much less


class _Pulse(NamedTuple):
    """One pulse: row of the voltage before it, start [s], level and step of the current [A]; its
    samples from arrival on, and whether the current is kept at each; how the voltage before it
    still moves; what is known of its begin; where its edge was by all pulses."""

    before: int
    start: float
    level: float
    step: float
    rows: Rows
    steady: np.ndarray
    drift: Drift
    begun: Begin
    edge: str = AT_A_ROW


def resistance(
    series, steps, basis, test, cell, settings=None, *, repeats=None, instrument=None, **changes
):
    """Resistance [ohm] at stated delays into each pulse of one test.

    settings : `settings.Resistance`, its key delay_second [s]. instrument : `settings.Instrument`.

    Returns rows, `protocols.resistance.ResistanceRows`, (k,): resistance_ohm and its standard
    deviation [ohm] by SoC [1], direction and delay [s]; SoC is NaN where not known. Raises Refusal:
    the record has no pulse from a rest, or none that can be read. Source: docs/resistance.md.
    """
    # Where SoC cannot be known the pulses count nevertheless: their SoC is then NaN.
    anchored = state_of_charge(series, basis, test, cell)
    series, steps = inputs.columns(series, *inputs.NAMES), inputs.steps(steps)
    shares = inputs.settings_of(Instrument, instrument, {})
    pulses = pulse_resistance(
        series,
        anchored.soc,
        steps,
        elsewhere=steps_elsewhere(repeats, inputs.test_facts(test), steps),
        against_soc=anchored.contradicted,
        rated_capacity_ampere_hour=inputs.basis(basis)["capacity_ampere_hour"],
        current_accuracy_share=shares.current_accuracy_share,
        **inputs.settings_of(Resistance, settings, changes)._asdict(),
    )
    notes = (f"SoC: {anchored.anchor}", *pulses.notes)
    return Result({"rows": pulses.rows}, notes=notes)


# ASSUME: In a record without short pulses, longer loads that begin from rest serve as pulses.
def pulse_resistance(
    series,
    soc,
    steps,
    *,
    rated_capacity_ampere_hour,
    delay_second=RESISTANCE.delay_second,
    elsewhere=None,
    against_soc="",
    current_accuracy_share=INSTRUMENT.current_accuracy_share,
):
    """Resistance of every pulse of a record at the delays asked for.

    1. A pulse begins at the last sample before its edge, or one sampling step of the pulse before
    its first sample where that is later. The last sample's voltage and current are "before"; on a
    running load they are those of the load. Where its voltage has moved already while the current
    had not (channels not sampled together), the sample before it gives the voltage.
    2. Each sample k of the pulse gives R_k = (V_k − V_before − d_k) / (I_k − I_before); d_k is how
    far the relaxation of what was before would have gone on (`drift_of_rest`), where that is more
    than noise: after a short rest.
    3. Delay 0, "instantaneous", is the first sample at which at least 90 % of the step of the
    current has arrived: how instantaneous that is depends on the sampling, and
    actual_delay_second says so. Where the edge lies, and whether the first sample had settled, all
    pulses tell together (`edges_of`). 4. Any other delay is interpolated linearly between the two
    samples around it; beyond the last sample by up to half a sampling step, or 2 %, it is the
    last sample's. 5. The standard deviation holds the noise of voltage and current (robust, from
    the differences between successive samples), their least digits, the doubt of d_k, what R grows
    by within the interval of the edge, the stated accuracy of the ammeter as a gain, what it read
    at rest before the pulse, and of delay 0 when the pulse began (`pulse_begin`), not the drift of
    the open-circuit voltage.

    series : dict of (n,) columns of stage `clean`: test_time_second, current_ampere, voltage_volt;
        logged_current_ampere and doubt where there are.
    soc : (n,) state of charge [1]; the value before the pulse is reported.
    steps : Steps of the record.
    rated_capacity_ampere_hour : [Ah] for the C-rate.
    delay_second : delays from the edge [s].
    elsewhere : as of `not_elsewhere`.
    against_soc : in words, what contradicts the stated SoC of the record: it, the voltage or the
        cut-offs are wrong; or "".
    current_accuracy_share : as of `settings.Instrument`.

    Returns rows, which are columns of stage `resistance`, one entry a pulse and delay;
    relaxation_ohm is what d_k has taken off.
    direction is "discharge" or "charge", by the sign of the current in the pulse; "falling
    discharge" or "falling charge" where a running load only becomes smaller: its polarisation goes
    on building up and hides part of the answer, so laws leave these out. The reasons of missing
    values are counted. Raises Refusal: the record has no pulse, or none gives a value at any delay;
    the reasons are named.
    """
    time, current, voltage, soc = (
        np.asarray(column, float) for column in (*map(series.get, inputs.NAMES), soc)
    )
    logged = np.asarray(series.get("logged_current_ampere", current), float)
    chosen, rated = pulse_steps(steps), rated_capacity_ampere_hour
    if not len(chosen):
        raise Refusal("the record has no pulse, nor a constant-current load that begins from rest")
    digits = least_digit(voltage), coarsest_digit_ampere(current, rated)
    # Cut, not rounded, a current lacks up to a digit, and so does its step from a true zero.
    read = digits[1] * (np.sqrt(2) if may_be_cut(digits[1]) else 1.0)
    noise = _noise(voltage, steps, digits[0]), _noise(current, steps, read)
    rows, doubts, reasons = [], [], Counter()
    chosen = not_elsewhere(chosen, elsewhere, "pulse", reasons)
    least = np.sqrt(2) * noise[0]
    pulses = []
    for step in chosen:
        try:
            pulses.append(_pulse(time, current, voltage, soc, steps, step, least, rated))
        except Refusal as refusal:
            reasons[str(refusal)] += len(delay_second)
    edges = edges_of([pulse.rows for pulse in pulses])
    pulses = [_with_edge(pulse, str(edge)) for pulse, edge in zip(pulses, edges, strict=True)]
    late = late_among_others([pulse.begun.interval_second for pulse in pulses])
    for (pulse, later), delay in product(zip(pulses, late, strict=True), delay_second):
        try:
            value = _at(pulse, float(delay))
        except Refusal as refusal:
            reasons[str(refusal)] += 1
            continue
        row = _row(pulse, value, delay, voltage, noise)
        # What it reads at rest it may read too much under load as well, or not at all.
        offset = abs(logged[pulse.before] / pulse.step) if pulse.begun.from_rest else 0.0
        off = np.hypot(current_accuracy_share, offset) / np.sqrt(3.0) * row["resistance_ohm"]
        parts = [row["resistance_std_ohm"], off, pulse.begun.unsure_ohm * (delay == 0)]
        row["resistance_std_ohm"] = np.linalg.norm(parts)
        taken = slice(pulse.before, pulse.before + 2 + len(pulse.rows.delay))
        own = doubts_said(series.get("doubt"), taken)
        own += [pulse.begun.lacking or later, _too_coarse(digits[1], pulse.step)]
        doubts.append(list(filter(None, own)))
        rows.append(row)
    if not rows:
        raise Refusal(f"no pulse gives a resistance: {'; '.join(counted(reasons))}")
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    told = [doubt_columns(one) for one in _doubts(columns, doubts, rated, against_soc)]
    columns |= {name: np.array([row[name] for row in told], dtype=str) for name in told[0]}
    reasons.update(FIRST_LEFT_OUT for pulse in pulses if pulse.edge == NOT_SETTLED)
    return Result({"rows": columns}, notes=counted(reasons))


def _too_coarse(digit_ampere, step_ampere):
    """That two readings may be off by more than a tester's current is."""
    share = digit_ampere / abs(step_ampere)
    return say("resistance.coarse", share=share) if share > ROUND_SHARE else ""


def _doubts(columns, of_rows, rated, against_soc):
    """Doubts of each row: of its rows, of the resistance itself, and of the record; lists of Said.

    of_rows : list of Said of each, what is in doubt in the rows of its pulse.
    """
    of_record = [Said(against_soc, "half.contradicted"), _as_c_rates(columns, rated)]
    found = []
    for resistance, std, delay, own, rises in zip(
        columns["resistance_ohm"],
        columns["resistance_std_ohm"],
        columns["delay_second"],
        of_rows,
        _rises(columns),
        strict=True,
    ):
        alike = columns["resistance_ohm"][columns["delay_second"] == delay]
        # What the noise of its voltage leaves open is no doubt.
        near = resistance + SIGMAS * std * np.array([-1.0, 0.0, 1.0])
        unlike = not own and all(unlike_size(one, rated) for one in near)
        of_size = [said(Doubt.SIZE)] * unlike
        if near[-1] < SMALL_SHARE * np.median(alike):
            of_size.append(say("resistance.small"))
        found.append([*own, *of_size, rises, *of_record])
    return found


# ASSUME: Kinetics and heat make a resistance fall as the rate rises; it never rises by a tenth.
def _rises(columns):
    """In words for each row, that a prompt resistance rises with the rate at one SoC; at both."""
    found = np.full(len(columns["soc"]), "", dtype=object)
    prompt = columns["actual_delay_second"] <= PROMPT_SECOND
    names = ("soc", "direction", "c_rate", "resistance_ohm", "resistance_std_ohm")
    for delay in np.unique(columns["delay_second"]):
        rows = np.flatnonzero(prompt & (columns["delay_second"] == delay))
        at = [columns[name][rows] for name in (*names, "actual_delay_second")]
        for numbers in rises_with_rate(*at):
            pair = rows[list(numbers)]
            ohm, rate = columns["resistance_ohm"][pair], columns["c_rate"][pair]
            milliohm = dict(zip(("low", "high"), 1e3 * ohm, strict=True))
            rates = dict(zip(("slow", "fast"), rate, strict=True))
            rises = say("resistance.rises", **milliohm, **rates)
            found[pair[0]] = found[pair[1]] = rises
    return found


# ASSUME: A load of 1C moves the voltage by less than 0.2 V at once, except in the cold or near
# empty.
def _as_c_rates(columns, rated):
    """In words, that the currents may be C-rates: round as such, not as multiples of the rating."""
    prompt = columns["actual_delay_second"] <= PROMPT_SECOND
    if not prompt.any():
        return ""
    answer = rated * np.median(columns["resistance_ohm"][prompt])
    sizes = np.abs(columns["current_ampere"])
    round_alone = all(map(_is_round, sizes)) and not any(map(_is_round, sizes / rated))
    # Slower loads meet kinetics at their largest, and their capacity tells.
    if not (answer > LARGE_VOLT and round_alone and sizes.max() >= SLOWEST_PULSE_C_RATE):
        return ""
    return say("resistance.c_rates", volt=answer)


def _is_round(rate):
    """Whether a rate [1/h] is one that laboratories choose."""
    return bool(np.any(np.abs(rate / np.array(ROUND_C_RATES) - 1) <= ROUND_SHARE))


def pulse_steps(steps):
    """Numbers of the steps that are pulses without a gap before them, else of loads from rest."""
    follows = follows_directly(steps)
    pulses = np.flatnonzero((steps.kind == "pulse") & follows)
    if len(pulses):
        return pulses
    from_rest = np.roll(steps.kind, 1) == "rest"
    return np.flatnonzero(np.isin(steps.kind, ("CC", "CCCV")) & from_rest & follows)


def _pulse(time, current, voltage, soc, steps, step, least_volt, rated):
    """One pulse from its step, of its samples from arrival on.

    A relaxation that moves the voltage by less than `least_volt` over all of it is none. A sample
    whose current is that before the pulse has no ratio, NaN. Raises Refusal: the current does not
    step.
    """
    first, last = int(steps.first_row[step]), int(steps.last_row[step])
    end = constant_current_end(first, last, steps.cv_first_row[step])
    level = float(np.median(current[first:end]))
    rise = level - current[first - 1]
    _check_step(level, rise, rated)
    gone = (current[first : last + 1] - current[first - 1]) / rise
    # From nine tenths of the step on a sample belongs to the pulse, not to its rise.
    arrival = first + int(np.argmax(gone >= 0.9))
    before = _before(time, voltage, steps, step, first, voltage[arrival])
    rows = np.arange(arrival, last + 1)
    pace = np.median(np.diff(time[first : last + 1])) if last > first else np.inf
    start = max(time[first - 1], time[first] - pace) if before == first - 1 else time[before]
    delay, drift = time[rows] - start, Drift()
    if steps.kind[step - 1] == "rest":
        rest = slice(int(steps.first_row[step - 1]), before + 1)
        drift = drift_of_rest(time[rest], voltage[rest], steps.start_time_second[step - 1])
    if abs(drift.moved_volt(delay[-1])) <= least_volt:
        drift = Drift()
    moved = voltage[rows] - voltage[before] - drift.moved_volt(delay)
    change = current[rows] - current[first - 1]
    ratio = np.divide(moved, change, out=np.full(len(rows), np.nan), where=change != 0)
    # A ratio to a current that has moved on is no resistance at this delay.
    steady = np.abs(gone[rows - first] - 1) <= 0.1
    rest = time[int(steps.first_row[step - 1]) : first]
    rest = rest if steps.kind[step - 1] == "rest" else rest[:0]
    begun = begin_of(rest, time[first], pace, delay, ratio)
    apart, told = time[first] - max(time[first - 1], time[first] - pace), clock_tells(time, first)
    # By the sign of the current; falling where a running load only becomes smaller.
    flows = "charge" if level > 0 else "discharge"
    flows = flows if level * rise > 0 else f"falling {flows}"
    noise_ohm, c_rate = least_volt / abs(rise), abs(rise) / rated
    samples = Rows(delay, ratio, noise_ohm, apart, told, soc[before], c_rate, flows)
    return _Pulse(before, start, level, rise, samples, steady, drift, begun)


def _with_edge(pulse, edge):
    """A pulse whose edge is known to be so; without a first row that had not settled.

    An edge between two rows is in the middle, and every delay is less by that.
    """
    rows = pulse.rows
    if edge in (AT_A_ROW, UNKNOWN) or len(rows.delay) < 3:
        return pulse._replace(edge=AT_A_ROW if edge == AT_A_ROW else UNKNOWN)
    kept = slice(int(edge == NOT_SETTLED), None)
    delay = rows.delay[kept] - rows.apart_second / 2
    rows = rows._replace(delay=delay, ratio=rows.ratio[kept])
    return pulse._replace(edge=edge, rows=rows, steady=pulse.steady[kept])


def _before(time, voltage, steps, step, first, arrived):
    """Row of the voltage before the pulse: the last one that the pulse has not moved.

    A sample that has gone a fifth of the way has moved by a skew of the channels, of 1 s at most.
    """
    earliest = max(int(steps.first_row[step - 1]), first - 5)
    rows = np.arange(earliest, first)
    rows = rows[time[rows] >= time[first - 1] - 1.0]
    total = arrived - voltage[rows]
    share = np.divide(voltage[first - 1] - voltage[rows], total, out=0 * total, where=total != 0)
    unmoved = rows[share >= 0.2]
    return int(unmoved[-1]) if len(unmoved) else first - 1


def _check_step(level, rise, rated):
    """Refuses a pulse whose current differs from that before it by less than any edge does."""
    least = max(EDGE_C_RATE[0] * rated, EDGE_SHARE * max(abs(level - rise), abs(level)))
    if abs(rise) < least:
        raise Refusal("current does not step into the pulse")


def _at(pulse, wanted):
    """Actual delay [s] and resistance [ohm] at a delay; 0 asks for the first sample."""
    delay, ratio = pulse.rows.delay, pulse.rows.ratio
    if wanted == 0:
        # Between two rows, the first delay that has a row at or before and one at or after it.
        first = delay[0] + (
            0.0 if pulse.edge in (AT_A_ROW, UNKNOWN) else pulse.rows.apart_second / 2
        )
        return _positive(first, np.interp(first, delay, ratio))
    if delay[0] > wanted:
        which = "settled sample" if pulse.edge == NOT_SETTLED else "sample"
        raise Refusal(f"first {which} of the pulse later than {wanted:g} s")
    half_step = (delay[-1] - delay[0]) / (len(delay) - 1) / 2 if len(delay) > 1 else 0.0
    if delay[-1] + max(half_step, 0.02 * wanted) < wanted:
        raise Refusal(f"pulse ends before {wanted:g} s")
    after = min(int(np.searchsorted(delay, wanted)), len(delay) - 1)
    around = [max(after - (delay[after] > wanted), 0), after]
    # Between samples further apart a line does not follow the polarisation's bend.
    if delay[around[1]] - delay[around[0]] > 1.5 * wanted:
        raise Refusal(f"no sample of the pulse near {wanted:g} s")
    if not pulse.steady[around].all():
        raise Refusal(f"current of the pulse not held until {wanted:g} s")
    actual = min(wanted, delay[-1])
    return _positive(actual, np.interp(actual, delay[around], ratio[around]))


def _positive(delay, resistance):
    """Delay [s] and resistance [ohm]; refuses a resistance that is not positive."""
    if not (np.isfinite(resistance) and resistance > 0):
        raise Refusal("voltage does not move with the current")
    return float(delay), float(resistance)


def _noise(values, steps, digit):
    """Standard deviation of one sample, from differences within rests and pulses, and its digit."""
    # A drive's own changes are no noise.
    kept = np.isin(steps.kind, ("rest", "pulse"))
    spans = zip(steps.first_row[kept], steps.last_row[kept] + 1, strict=True)
    change = np.concatenate([np.diff(values[first:last]) for first, last in spans] or [[0.0]])
    if not len(change):
        return 0.0
    spread = robust_std(change - np.median(change)) / np.sqrt(2)
    if not (spread or digit) and np.any(change):
        # A converter of several ranges: its usual step, for most rows repeat the one before.
        digit = float(np.median(np.abs(change[change != 0])))
    return float(np.hypot(spread, digit / np.sqrt(12)))


def _row(pulse, value, delay, voltage, noise):
    """Columns of one pulse and delay; the deviation is that of two voltages and two currents, and
    of the relaxation that went on."""
    actual, resistance = value
    error = np.sqrt(2) * np.hypot(noise[0], resistance * noise[1]) / abs(pulse.step)
    error = np.hypot(error, pulse.drift.moved_std_volt(actual) / abs(pulse.step))
    error = np.hypot(error, _edge_std_ohm(pulse, actual))
    return {
        "soc": pulse.rows.soc,
        "direction": pulse.rows.direction,
        "delay_second": delay,
        "actual_delay_second": actual,
        "resistance_ohm": resistance,
        "resistance_std_ohm": error,
        "relaxation_ohm": pulse.drift.moved_volt(actual) / pulse.step,
        "current_ampere": pulse.level,
        "c_rate": pulse.rows.c_rate,
        "voltage_before_volt": voltage[pulse.before],
        "start_time_second": pulse.start,
        "edge": pulse.edge,
    }


def _edge_std_ohm(pulse, actual_second):
    """Standard deviation [ohm] by the time of the edge, uniform over its interval."""
    rows = pulse.rows
    if pulse.edge == AT_A_ROW or len(rows.delay) < 2:
        return 0.0
    where = rows.delay, rows.ratio, actual_second, rows.apart_second, pulse.edge
    grown = np.sqrt(max(growth_ohm(*where) ** 2 - rows.noise_ohm**2, 0.0))
    # In the middle of its interval, or at its end where a row may have been at the edge.
    return grown / np.sqrt(3.0 if pulse.edge == UNKNOWN else 12.0)
