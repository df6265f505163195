"""A pack through phases as a cycler runs them, ended or limited by the first cell at its limit."""

from functools import partial
from typing import NamedTuple

import numpy as np

from cellwright.numerics.clock import refuse_backward
from cellwright.packs.kernel import joined
from cellwright.packs.simulate import TOLERANCE_VOLT, ambient_of, plant_of, stepped
from cellwright.packs.steps import CURRENT, POWER, VOLTAGE, NoPower, start
from cellwright.refusal import Refusal

MODES = {"rest": CURRENT, "current": CURRENT, "drive": CURRENT, "power": POWER, "voltage": VOLTAGE}
AT_LIMIT = 1e-6  # [V], [A], [1], [s]: nearer to its end than this, a phase has reached it
AT_ONCE = 256  # steps that are tried before their limits are looked at
NOT_HELD = -2  # no limit is held


class Phase(NamedTuple):
    """One phase. It ends at whatever comes first; what is None or infinite does not end it.

    kind : "rest", "current" [A], "power" [W], "voltage" [V] or "drive"; positive on charge.
    value : of the current, power or voltage; of a drive the pair (test_time_second from 0 on,
        current_ampere), a straight line between its samples.
    second : its length [s].
    lowest_volt, highest_volt : of the pack [V].
    lowest_cell_volt, highest_cell_volt : scalar or (cells,); the first cell there ends it [V].
    lowest_soc, highest_soc : of any cell [1].
    least_ampere : a total current no larger than this ends a phase whose current falls: of kind
        "voltage", or one that is held at a limit [A].
    held : a voltage limit does not end the phase: the current falls such that the first cell (or
        the pack) stays at it. Then `second` or `least_ampere` ends it.
    step_second : at most so long a step [s]; a drive has its own.
    """

    kind: str
    value: object = 0.0
    second: float = np.inf
    lowest_volt: float = -np.inf
    highest_volt: float = np.inf
    lowest_cell_volt: object = -np.inf
    highest_cell_volt: object = np.inf
    lowest_soc: float = -np.inf
    highest_soc: float = np.inf
    least_ampere: float = 0.0
    held: bool = False
    step_second: float = 1.0


class PhasesRun(NamedTuple):
    """A pack through its phases; (n,) and (n, cells), positive on charge.

    phase : index of the phase of each sample; a new one begins with a sample at the time at which
    the one before ended. ends : of each phase a dict: `phase`; `second` since the first
    began [s]; `reason` ("time", "pack voltage", "cell voltage", "soc", "current", or "power" where
    the pack cannot give it: a last sample is at rest); `cell`, the first one there, None where it
    is no single cell's; `held_from_second` and `held_cell`, since when a limit was held and whose
    first, NaN and None where none was.
    """

    test_time_second: np.ndarray
    phase: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    cell_current_ampere: np.ndarray
    cell_voltage_volt: np.ndarray
    soc: np.ndarray
    temperature_celsius: np.ndarray
    ends: tuple


class Part(NamedTuple):
    """Samples of a phase: seconds since its begin (m,), PackRun, and the cell whose limit was held
    (m,): -1 the pack's, -2 none."""

    second: np.ndarray
    run: object
    held: np.ndarray


def run_phases(
    phases,
    cells,
    wiring,
    *,
    initial_soc,
    ambient_celsius=None,
    thermal=None,
    tolerance_volt=TOLERANCE_VOLT,
):
    """A pack through phases: constant current, power or voltage, rest, drive, with limits by cell.

    1. A phase begins with a sample at the current that it asks for. 2. Steps follow, of
    `step_second` or the drive's own. 3. Where a step leads beyond an end it is shortened to the
    moment at which the first limit is met; a phase that is `held` goes on instead, with the largest
    current at which no limit is passed.

    Parameters
    ----------
    phases : sequence of Phase.
    cells, wiring, initial_soc, ambient_celsius, thermal, tolerance_volt : as in
        `simulate.simulate_pack`; the ambient is one temperature.

    Returns
    -------
    run : PhasesRun.

    Raises
    ------
    Refusal : no phase, one of an unknown kind or without any end, or as `simulate_pack`.

    Source: docs/packs.md.
    """
    for index, phase in enumerate(phases):
        _check(index, phase)
    if not len(phases):
        raise Refusal("no phase is given")
    ambient = ambient_of(cells, thermal, ambient_celsius, 1)[0]
    plant = plant_of(cells, wiring, thermal, hold="first_order", tolerance_volt=tolerance_volt)
    state = start(cells, plant.network, initial_soc, ambient, thermal)
    pack = partial(stepped, plant, ambient_celsius=ambient)
    at_once = AT_ONCE if thermal is None else 1  # each step of cells that warm has temperatures
    wholes, ends, begin = [], [], 0.0
    for index, phase in enumerate(phases):
        parts, (reason, cell), state = _through(pack, state, phase, at_once)
        whole = _together(parts)
        ends.append(_end(cells.names, index, begin, whole, reason, cell))
        wholes.append(whole._replace(second=begin + whole.second))
        begin += whole.second[-1]
    whole = _together(wholes)
    counts = [len(part.second) for part in wholes]
    about = (whole.run.current_ampere, whole.run.voltage_volt, *whole.run[:4], tuple(ends))
    return PhasesRun(whole.second, np.repeat(np.arange(len(wholes)), counts), *about)


def _check(index, phase):
    number = index + 1
    if phase.kind not in MODES:
        raise Refusal(f"phase {number} is of kind {phase.kind!r}; allowed are {', '.join(MODES)}")
    if phase.kind == "drive":
        time, current = (np.asarray(column, float) for column in phase.value)
        if time.shape != current.shape or time.ndim != 1 or len(time) < 2 or time[0] != 0:
            raise Refusal(f"the drive of phase {number} has no two samples from 0 s on")
        refuse_backward(time, of=f"the drive of phase {number}")
        if not np.isfinite([time, current]).all():
            raise Refusal(f"the drive of phase {number} is not finite")
        return
    falls = phase.least_ampere > 0 and (phase.held or phase.kind == "voltage")
    ends = [phase.second, phase.lowest_soc, phase.highest_soc, 0.0 if falls else np.inf]
    if not phase.held:  # else the voltage limits do not end it
        ends += [phase.lowest_volt, phase.highest_volt]
        ends += [phase.lowest_cell_volt, phase.highest_cell_volt]
    if not any(np.isfinite(end).any() for end in ends):
        raise Refusal(f"phase {number} of kind {phase.kind} has no end")
    if not phase.step_second > 0:
        raise Refusal(f"phase {number} has steps of {phase.step_second} s")


def _through(pack, state, phase, at_once):
    """One phase: its Parts, (reason, cell) of its end, and the PackState then.

    `pack` is `simulate.stepped` of the pack in its ambient: (state, load) to (PackRun, state).
    """
    parts, elapsed = [], 0.0
    try:
        # A step of no length: the current jumps before time passes, and a limit may be met at once.
        state, part = _step(pack, state, phase, 0.0, 0.0)
        parts.append(part)
        while (end := _reached(phase, part)) is None:
            free = part.held[-1] == NOT_HELD
            leapt = _leap(pack, state, phase, elapsed, at_once) if free else None
            state, part = leapt or _to_the_limit(pack, state, phase, elapsed)
            elapsed = part.second[-1]
            parts.append(part)
    except NoPower:
        # A pack that cannot give the power is left at rest.
        state, part = _moved(pack, state, elapsed, 0.0, CURRENT, 0.0)
        return [*parts, part], ("power", -1), state
    return parts, end, state


def _leap(pack, state, phase, elapsed, at_once):
    """Many steps at once, all before the first limit; None where the next one leads there."""
    seconds = _next_seconds(phase, elapsed, at_once)
    modes = np.full(len(seconds), MODES[phase.kind])
    load = np.array([np.diff(seconds, prepend=elapsed), modes, _asked(phase, seconds)])
    try:
        run, after = pack(state, load)
    except NoPower:
        return None
    part = _part(seconds, run)
    limits = _limits(phase, part) | (_volt_limits(phase, run) if phase.held else {})
    ahead = np.min([distance for _, distance in limits.values()], axis=0) > AT_LIMIT
    # Samples up to the first that is near a limit are kept; from there it goes step by step.
    free = len(ahead) if ahead.all() else int(np.argmin(ahead))
    if free == 0:
        return None
    if free < len(ahead):
        run, after = pack(state, load[:, :free])
    return after, _part(seconds[:free], run)


def _to_the_limit(pack, state, phase, elapsed):
    """The next step, shortened where it leads beyond an end."""
    from scipy.optimize import brentq

    second = _next_seconds(phase, elapsed, 1)[0] - elapsed

    def distance(left):
        return _nearest(_limits(phase, _step(pack, state, phase, elapsed, left)[1]))[2]

    after, part = _step(pack, state, phase, elapsed, second)
    if _nearest(_limits(phase, part))[2] >= -AT_LIMIT:
        return after, part
    passed = distance(0.0) <= 0
    left = 0.0 if passed else brentq(distance, 0.0, second, xtol=1e-7, rtol=1e-12)
    return _step(pack, state, phase, elapsed, left)


def _next_seconds(phase, elapsed, at_once):
    """Ends of the next steps, since the phase's begin (m,) [s]."""
    if phase.kind == "drive":
        time = np.asarray(phase.value[0], float)
        ahead = time[time > elapsed + AT_LIMIT][:at_once]
    else:
        ahead = elapsed + phase.step_second * np.arange(1, at_once + 1)
    # A sample next to the phase's end would only be a step of rounding.
    within = ahead[ahead < phase.second - AT_LIMIT]
    # The phase's end is a sample of its own.
    return within if len(within) == len(ahead) else np.append(within, phase.second)


def _asked(phase, second):
    """Current, power or voltage that a phase asks for at times (m,) after its begin."""
    if phase.kind == "drive":
        return np.interp(second, *phase.value)
    return np.full(len(second), 0.0 if phase.kind == "rest" else float(phase.value))


def _step(pack, state, phase, elapsed, second):
    """The pack a step later, at what the phase asks for or at the limit that it holds."""
    end = elapsed + second
    asked = float(_asked(phase, np.array([end]))[0])
    after, part = _moved(pack, state, end, second, MODES[phase.kind], asked)
    if not phase.held or phase.kind == "voltage":
        return after, part
    if _nearest(_volt_limits(phase, part.run))[2] >= 0:
        return after, part
    return _at_the_limit(pack, state, phase, end, second, part.run.current_ampere[0])


def _moved(pack, state, end, second, mode, value):
    run, after = pack(state, np.array([[second], [mode], [value]], float))
    return after, _part(np.array([end]), run)


def _part(second, run):
    return Part(second, run, np.full(len(second), NOT_HELD))


def _at_the_limit(pack, state, phase, end, second, beyond_ampere):
    """The step with the largest current at which no voltage limit is passed.

    The distance to the nearest limit falls with the current, as every cell's voltage rises with it.
    """
    from scipy.optimize import brentq

    def tried(total):
        return _moved(pack, state, end, second, CURRENT, total)

    def distance(total):
        return _nearest(_volt_limits(phase, tried(total)[1].run))[2]

    # A cell beyond its limit even at rest gets no current: nothing lower is asked for.
    rest = distance(0.0) <= 0.0
    total = 0.0 if rest else brentq(distance, 0.0, beyond_ampere, xtol=1e-9, rtol=1e-12)
    after, part = tried(total)
    return after, part._replace(held=np.array([_nearest(_volt_limits(phase, part.run))[1]]))


def _within(values, lowest, highest):
    """Which of the values (m, cells) is nearest to its limits, and how far within them (m,)."""
    distance = np.minimum(values - lowest, highest - values)
    return distance.argmin(axis=1), distance.min(axis=1)


def _volt_limits(phase, run):
    """Limits of voltages, by reason: whose it is (m,), -1 the pack's, and how far it is (m,)."""
    pack = run.voltage_volt[:, None]
    _, distance = _within(pack, phase.lowest_volt, phase.highest_volt)
    of_cells = _within(run.cell_voltage_volt, phase.lowest_cell_volt, phase.highest_cell_volt)
    return {"pack voltage": (np.full(len(pack), -1), distance), "cell voltage": of_cells}


def _limits(phase, part):
    """All that ends a phase, as `_volt_limits`; a distance below zero is beyond it."""
    total = np.abs(part.run.current_ampere)
    none = np.full(len(total), -1)
    last = min(phase.second, phase.value[0][-1]) if phase.kind == "drive" else phase.second
    limits = {"soc": _within(part.run.soc, phase.lowest_soc, phase.highest_soc)}
    limits["time"] = none, last - part.second
    if phase.least_ampere > 0:
        falls = (phase.kind == "voltage") | (part.held != NOT_HELD)
        limits["current"] = none, np.where(falls, total - phase.least_ampere, np.inf)
    return limits | ({} if phase.held else _volt_limits(phase, part.run))


def _nearest(limits):
    """Reason, cell and distance of the limit that is nearest at the last sample."""
    reason = min(limits, key=lambda name: limits[name][1][-1])
    cell, distance = limits[reason]
    return reason, int(cell[-1]), float(distance[-1])


def _reached(phase, part):
    """(reason, cell) of the end that a phase has reached, or None."""
    reason, cell, distance = _nearest(_limits(phase, part))
    return (reason, cell) if distance <= AT_LIMIT else None


def _together(parts):
    second, runs, held = zip(*parts, strict=True)
    return Part(np.concatenate(second), joined(runs), np.concatenate(held))


def _end(names, index, begin, whole, reason, cell):
    rows = np.flatnonzero(whole.held != NOT_HELD)
    since, by = (begin + whole.second[rows[0]], whole.held[rows[0]]) if len(rows) else (np.nan, -1)
    stopped, holding = (names[k] if k >= 0 else None for k in (cell, by))
    return {
        "phase": index,
        "second": float(begin + whole.second[-1]),
        "reason": reason,
        "cell": stopped,
        "held_from_second": float(since),
        "held_cell": holding,
    }
