"""Paired mode: a cell compared with healthy cells of its type in the same protocol.

A circuit errs by millivolts on any cell, and on healthy cells of one type in the same protocol it
errs alike. The mean of their residuals is a template that is part of the model from the start; only
the error beyond it is searched for an effect.

Two runs of one protocol differ in time where a voltage, not a clock, ended a step. Their times are
matched at the edges of long rests. Between these, time runs in proportion in a step at constant
current, and by the clock in a drive, which a cut-off voltage ends earlier in one cell than in
another: what one of the two has not is not compared.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, beginning
from cellwright.effects.columns import frees_of, neutral
from cellwright.effects.judge import unfitted
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.thermal import WARMED, without_growth
from cellwright.effects.records import lacking
from cellwright.effects.state import SIDES, state_of
from cellwright.numerics.least_squares import fit
from cellwright.numerics.noise import FIRST, read_volt
from cellwright.numerics.statistics import rms
from cellwright.records.conditions import low_current
from cellwright.refusal import Refusal

NEXT_ROWS = np.arange(-1, 3)
FITTED = (*base.LOGARITHMS, "soc0[")  # first letters of the parameters fitted to a reference
APART_KELVIN = 5.0  # between records; below it they are at one temperature
TOLD_BY = 3  # temperatures: whether the energy of resistances grows in the cold
CLEARLY = 0.5  # of the difference in proportion, below which that by the clock decides
# Largest differences between two runs of one protocol.
LEAST_REST_SECOND = 120.0  # of a rest whose edges are matched
# Of a stretch between two matched edges, up to which time may run in proportion: relative, or so
# much at least.
PROPORTIONAL, SLACK_SECOND = 0.08, 30.0
MOST_C_RATE, WINDOW_SECOND = 0.1, 600.0  # of the currents, root mean square over a window
MOST_KELVIN = 2.0  # of the mean temperatures
COVERED = 0.5  # of a record's rows that have a counterpart, of a role's that a reference shares
KNOWN_FROM = 3  # references, whose scatter tells how much healthy cells differ
# Of the template's factor, and by what healthy cells differ [V]; of fewer references, where both
# are declared and not read from them.
SCALE_STD, SCALE_STD_OF_FEW = 0.2, 0.4
MATERIAL_VOLT, MATERIAL_VOLT_OF_FEW = 1e-3, 2e-3
# Times the noise of a single reading, which a circuit of constants must leave of the references
# beyond that noise. Below it the circuit follows healthy cells well, and the template would add no
# more than its own noise.
NEEDED_RATIO = 2.0


class Part(NamedTuple):
    """One record of a stack: its rows, their time [s], current [A] and temperature [degC]."""

    test: str
    rows: np.ndarray
    second: np.ndarray
    current_ampere: np.ndarray
    celsius: np.ndarray
    capacity_ampere_hour: float


def part(stack, test, kind, capacity_ampere_hour):
    """The record of a test out of a stack, or a Refusal where no such test is there."""
    if (test, kind) not in zip(stack.tests, stack.kinds, strict=True):
        raise Refusal(f"{test}: no such {kind} test in this role, found {', '.join(stack.tests)}")
    rows = np.flatnonzero(stack.file == stack.tests.index(test))
    taken = (stack.second[rows], stack.current_ampere[rows], stack.celsius[rows])
    return Part(test, rows, *taken, capacity_ampere_hour)


def counterpart_second(record, reference):
    """Time in the reference's record of each row of a record of the same protocol.

    Parameters
    ----------
    record, reference : Part.

    Returns
    -------
    second : (n,) time within the reference [s]; NaN where one of the two had ended a stretch.

    Raises
    ------
    Refusal : too little in common, other currents or temperature; with test, row and difference.
    """
    edges, others = map(_rest_edges, (record, reference))
    count = min(len(edges), len(others))
    second = np.empty(len(record.second))
    for k in range(count):
        last = k + 1 == count
        rows = np.arange(edges[k], len(second) if last else edges[k + 1])
        ends = None if last else (record.second[edges[k + 1]], reference.second[others[k + 1]])
        second[rows] = _in_stretch(record, reference, rows, others[k], ends)
    _covers(record, second)
    matched = np.flatnonzero(np.isfinite(second))
    row, difference = _nearest(record, reference, second, matched)
    _same_currents(record, matched, difference)
    _same_temperature(record, reference)
    steps = _steps(reference, second[matched], record.capacity_ampere_hour)
    second[matched[steps]] = reference.second[row[steps]]
    return second


def _in_stretch(record, reference, rows, begin, ends):
    """Time in the reference of the rows between two edges of rests (m,) [s]; NaN: it has none.

    begin : row of the reference at the first edge. ends : time of the second edge in both records,
    None after the last one.
    """
    second = record.second[rows]
    clock = second - second[0] + reference.second[begin]
    if ends is None:
        return np.where(clock <= reference.second[-1], clock, np.nan)
    here, there = ends[0] - second[0], ends[1] - reference.second[begin]
    clock[clock > ends[1]] = np.nan
    if abs(there - here) > max(SLACK_SECOND, PROPORTIONAL * here):
        return clock
    proportional = reference.second[begin] + (second - second[0]) * (there / here)
    both = (_difference_ampere(record, reference, rows, s) for s in (clock, proportional))
    by_clock, in_proportion = both
    return clock if by_clock < CLEARLY * in_proportion else proportional


def _difference_ampere(record, reference, rows, second):
    """Root mean square difference of the currents at matched times [A]."""
    matched = np.isfinite(second)
    times = np.full(len(record.second), np.nan)
    times[rows] = second
    return rms(_nearest(record, reference, times, rows[matched])[1])


def _rest_edges(record):
    """First row, and the rows at which long rests begin and end.

    An offset of the sensor makes no load of a rest.
    """
    rest = low_current(record.current_ampere, record.capacity_ampere_hour)
    edges = np.flatnonzero(np.diff(np.r_[0, rest, 0])).reshape(-1, 2)
    last, second = len(record.second) - 1, record.second
    lasting = [e for e in edges if second[min(e[1], last)] - second[e[0]] >= LEAST_REST_SECOND]
    inner = {int(row) for pair in lasting for row in pair if row <= last}
    return np.array(sorted({0} | inner))


def _covers(record, second):
    share = np.isfinite(second).mean()
    if share < COVERED:
        row = int(np.flatnonzero(~np.isfinite(second))[0])
        raise Refusal(
            f"{record.test}: the reference has {100 * share:.0f} % of the rows, the first that it "
            f"has not is row {row}; wanted {100 * COVERED:.0f} %"
        )


def _nearest(record, reference, second, matched):
    """Row of the reference nearest in current, of those next in time, and the difference [A].

    Where the current steps, a time that is off by part of a row would compare load with rest.
    """
    spot = np.searchsorted(reference.second, second[matched], side="right") - 1
    near = np.clip(spot[:, None] + NEXT_ROWS, 0, len(reference.second) - 1)
    difference = np.abs(reference.current_ampere[near] - record.current_ampere[matched][:, None])
    return near[np.arange(len(spot)), np.argmin(difference, axis=1)], difference.min(axis=1)


def _steps(reference, second, capacity):
    """Whether the reference's current steps within the rows next to a time: (n,) bool."""
    step = np.abs(np.diff(reference.current_ampere, prepend=reference.current_ampere[0]))
    near = np.convolve(~low_current(step, capacity), np.ones(5), "same") > 0
    return near[np.clip(np.searchsorted(reference.second, second), 0, len(near) - 1)]


def _same_currents(record, matched, difference):
    window = (record.second[matched] // WINDOW_SECOND).astype(int)
    window -= window[0]
    count = np.maximum(np.bincount(window), 1)
    size = np.sqrt(np.bincount(window, difference**2) / count) / record.capacity_ampere_hour
    worst = int(np.argmax(size))
    if size[worst] > MOST_C_RATE:
        row = int(matched[np.argmax(window == worst)])
        raise Refusal(
            f"{record.test}: from row {row} on the current differs from the reference's by "
            f"{size[worst]:.3f} C (root mean square over {WINDOW_SECOND:g} s); wanted at "
            f"most {MOST_C_RATE:g} C"
        )


def _same_temperature(record, reference):
    celsius = float(np.mean(record.celsius))
    at_reference = float(np.mean(reference.celsius))
    if abs(celsius - at_reference) > MOST_KELVIN:
        raise Refusal(
            f"{record.test}: from row 0 on at {celsius:.1f} degC in the mean, the reference at "
            f"{at_reference:.1f} degC; wanted a difference of at most {MOST_KELVIN:g} K"
        )


class Paired(NamedTuple):
    """A case with the template of healthy cells.

    case : case.Case, its stacks with the template, its gates with what healthy cells differ by.
    references : names used. left_out : reasons why others were not, by name. unshared : reasons why
    single tests of the references used were not, by their names.
    needed : whether what a circuit of constants leaves of the references exceeds the noise of their
    readings by `NEEDED_RATIO`; else the case is better searched alone.
    """

    case: object
    references: tuple
    left_out: dict
    unshared: dict
    needed: bool


def paired(case, references):
    """A case with the template of healthy cells that went through the same protocol.

    Each test is compared with the references that ran it alike; what none of them ran is not
    compared.

    Parameters
    ----------
    case : case.Case. references : dict name → case.Case of healthy cells, same settings.

    Returns
    -------
    paired : Paired; search its case as any other.

    Raises
    ------
    Refusal : no reference ran the same protocol, or too little of it; with test, row and difference
        of each.
    """
    seconds, left_out, unshared = _same(case, references)
    if not seconds:
        reasons = "; ".join(f"{name}: {why}" for name, why in left_out.items())
        raise Refusal(f"no healthy reference cell ran the same protocol; {reasons}")
    shared = {name: _shared_part(references[name], times) for name, times in seconds.items()}
    states = {name: healthy_state(one) for name, one in shared.items()}
    misfits = [_misfit_volt(case, references[n], states[n], times) for n, times in seconds.items()]
    rows = {side: np.stack([misfit[side] for misfit in misfits], axis=1) for side in SIDES}
    stacks = {side: _with_template(case.stack(side), rows[side]) for side in SIDES}
    stacks = {side: _with_courses(case, stack, states.values()) for side, stack in stacks.items()}
    for side, stack in stacks.items():
        _enough(side, stack, case.stack(side), unshared)
    few = len(seconds) < KNOWN_FROM
    material_volt = MATERIAL_VOLT_OF_FEW if few else MATERIAL_VOLT
    healthy = material_volt if few else _healthy_volt(case, rows)
    gates = case.gates._replace(
        material_volt=max(case.gates.material_volt, material_volt),
        unknown_volt=float(np.hypot(case.gates.unknown_volt, healthy)),
    )
    with_template = case._replace(
        **stacks,
        gates=gates,
        tolerance=case.tolerance._replace(known=SCALE_STD_OF_FEW if few else SCALE_STD),
        healthy=_healthy_effects(case, states.values()),
        otherwise=None,
    )
    steady = {"steady_ampere": case.steady_ampere}
    read = rms([read_volt(np.nan_to_num(one), case.fit, **steady) for one in rows["fit"].T])
    constant = [healthy_state(one, ()) for one in shared.values()]
    needed = rms([one.worst_volt for one in constant]) >= np.hypot(1.0, NEEDED_RATIO) * read
    return Paired(with_template, tuple(seconds), left_out, unshared, needed)


def _with_template(stack, rows):
    """A stack with the mean residual of the references that ran each test.

    Rows that one of these lacks are not compared, so that the template makes no step where the
    number of references changes.
    """
    template, complete = np.zeros(len(stack.file)), np.zeros(len(stack.file), bool)
    for k in range(len(stack.first)):
        of_test = stack.file == k
        part = rows[of_test]
        part = part[:, np.isfinite(part).any(axis=0)]
        complete[of_test] = np.isfinite(part).all(axis=1) & (part.shape[1] > 0)
        template[of_test] = part.mean(axis=1) if part.shape[1] else 0.0
    template = np.where(complete, template, 0.0)
    return stack._replace(template_volt=template, used=stack.used & complete)


def _healthy_volt(case, rows):
    """What the mean of the other references, its scale free, leaves of one [V], the larger side's.

    By so much healthy cells differ: no more of a cell's error is unknown. rows : (n, references)
    residuals by side [V]. Rows on a steep end of the OCV do not count: there healthy cells differ
    by far more than elsewhere, and an effect is not looked for.
    """
    values = beginning.first_values(case.cell, case.fit)
    filters = case.filters(FIRST, values)
    return max(_left_of_one(rows[side][filters.rows_on(side)]) for side in SIDES)


def _left_of_one(rows):
    """What the mean of the other columns, its scale free, leaves of one, root mean square."""
    shared = rows[np.isfinite(rows).all(axis=1)]
    if not len(shared):
        return 0.0
    remainders = []
    for k in range(shared.shape[1]):
        own, others = shared[:, k], np.delete(shared, k, axis=1).mean(axis=1)
        scale = own @ others / max(others @ others, np.finfo(float).tiny)
        remainders.append(own - scale * others)
    return rms(np.concatenate(remainders))


def _enough(side, stack, whole, unshared):
    """Refuse a case of which the references share too small a part."""
    share = stack.used.sum() / max(whole.used.sum(), 1)
    if share < COVERED:
        reasons = "; ".join(f"{name}: {why}" for name, why in unshared.items())
        raise Refusal(
            f"the references ran {100 * share:.0f} % of the {side} rows alike; wanted "
            f"{100 * COVERED:.0f} %; {reasons}"
        )


def _same(case, references):
    """Times in the references that ran tests alike, by name, and reasons of the others.

    Reasons are of two kinds: of references that share no test to fit or none that judges, and of
    single tests of the references used.
    """
    seconds, left_out, unshared = {}, {}, {}
    for name, reference in references.items():
        times, reasons = _counterparts(case, reference)
        if all(times.values()):
            seconds[name] = times
        (unshared if all(times.values()) else left_out).update({name: reasons} if reasons else {})
    return seconds, left_out, unshared


def _counterparts(case, reference):
    """Time of each row within the reference's record (n,) [s], by role and test; and reasons."""
    capacity = case.cell.capacity_ampere_hour
    seconds, reasons = {side: {} for side in SIDES}, []
    for side in SIDES:
        stacks = case.stack(side), reference.stack(side)
        for test, kind in zip(stacks[0].tests, stacks[0].kinds, strict=True):
            try:
                parts = [part(stack, test, kind, capacity) for stack in stacks]
                seconds[side][test] = counterpart_second(*parts)
            except Refusal as reason:
                reasons.append(str(reason))
    return seconds, "; ".join(reasons)


def _shared_part(reference, seconds):
    """A reference without the tests that the case has not: they are not fitted either."""
    for side in SIDES:
        stack = reference.stack(side)
        shared = np.isin(np.array(stack.tests)[stack.file], list(seconds[side]))
        reference = reference._replace(**{side: stack._replace(used=stack.used & shared)})
    return reference


def _misfit_volt(case, reference, state, seconds):
    """Residual of a fitted reference at the times of the case's rows [V], by role.

    NaN in tests that they do not share.
    """
    misfit = {}
    for side in SIDES:
        whole, stack, residual = case.stack(side), reference.stack(side), state.residual_on(side)
        misfit[side] = np.full(len(whole.file), np.nan)
        for test, second in seconds[side].items():
            rows = stack.file == stack.tests.index(test)
            volt = np.interp(np.nan_to_num(second), stack.second[rows], residual[rows])
            volt = np.where(np.isfinite(second), volt, np.nan)
            misfit[side][whole.file == whole.tests.index(test)] = volt
    return misfit


def _with_courses(case, stack, states):
    """A stack with the circuit of the references at each row's SoC and temperature.

    Resistances and time constants relative to those at half charge and 25 °C; the geometric mean
    over the references.
    """
    starts = base.stated_starts(stack)
    logs = []
    for state in states:
        values = state.solution.values | starts
        fields = base.fields_of(case.cell, stack, values, state.effects)
        factors = fields.r0 / np.exp(values["log_r0"]), *fields.slow, fields.tau_factor
        logs.append(np.log(np.broadcast_arrays(*factors, stack.second)[:4]))
    ohmic, quicker, slower, tau = np.exp(np.mean(logs, axis=0))
    slow = {"slow_courses": (quicker, slower), "tau_course": tau}
    return stack._replace(ohmic_course=ohmic, **slow, courses={})


def _healthy_effects(case, states):
    """Effects that all references were fitted with, id and mean parameters by name.

    The logarithms of their courses go in proportion with nearly all of these: this is, but for
    that, the geometric mean of `_with_courses`.
    """
    shared = set.intersection(*({effect.id for effect in state.effects} for state in states))
    sizes = {}
    for state in states:
        for effect in state.effects:
            sizes.setdefault(effect.id, []).append(effect.sizes_of(state.solution.values))
    means = {
        key: {name: float(np.mean([p[name] for p in each])) for name in each[0]}
        for key, each in sizes.items()
        if key in shared
    }
    temperatures = _temperatures(case.fit)
    if WARMED in means and len(temperatures) < TOLD_BY:
        means[WARMED] = without_growth(means[WARMED], (temperatures[0], temperatures[-1]))
    return tuple(means.items())


def _temperatures(stack):
    """Temperatures of records, of those less than `APART_KELVIN` apart the lowest (t,) [degC]."""
    means = np.sort(stack.mean_celsius)
    return means[np.diff(means, prepend=-np.inf) > APART_KELVIN]


def healthy_state(case, courses=None):
    """The plain circuit, its resistances over SoC and temperature, fitted to a healthy reference.

    OCV and capacity stay as they were measured: fitted, they would take up part of the circuit's
    error, and the template would lack that part.

    Parameters
    ----------
    case : case.Case. courses : Effects whose forms the resistances may follow, as far as the
        records excite them; None: those that they follow in any cell. An effect acts on the
        resistance as it is at a SoC and a temperature, which a circuit of constants does not know.

    Returns
    -------
    state : case.State.
    """
    if courses is None:
        courses = [effect for effect in LIBRARY.values() if effect.in_healthy_cells]
    ampere_hour = case.cell.capacity_ampere_hour
    effects = tuple(e for e in courses if not lacking(e, case.fit, ampere_hour))
    values, free = unfitted(case)
    for effect in effects:
        values |= neutral(effect)
    filters = case.filters(FIRST, values)
    fitted = tuple(parameter for parameter in free if parameter.name.startswith(FITTED))
    fitted = (*fitted, *(parameter for effect in effects for parameter in frees_of(effect)))
    problem = case.problem(effects, free, filters)
    solution = fit(problem._replace(free=fitted, coupling=None), values)
    return state_of(case, effects, solution, filters)
