"""A pack through phases as a cycler runs them, ended or limited by the first cell at its limit."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.clock import refuse_backward
from cellwright.packs.kernel import Keep, Load, Steps
from cellwright.packs.simulate import (
    TOLERANCE_VOLT,
    Plant,
    ambient_of,
    many_steps,
    plant_of,
    stepped,
)
from cellwright.packs.steps import CURRENT, POWER, VOLTAGE, NoPower, start
from cellwright.refusal import Refusal

MODES = {"rest": CURRENT, "current": CURRENT, "drive": CURRENT, "power": POWER, "voltage": VOLTAGE}
AT_LIMIT = 1e-6  # [V], [A], [1]: nearer to its end than this, a phase has reached it
SAME_SECOND = 1e-6
AT_ONCE = 256  # steps that are tried at once
NOT_HELD = -2


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


class PhaseEnd(NamedTuple):
    """How a phase ended.

    second : since the first phase began [s]. reason : "time", "pack voltage", "cell voltage",
    "soc", "current", or "power" where the pack cannot give it (any more): a last sample is at rest.
    cell : the first one there, None where it is no single cell's.
    held_from_second, held_cell : since when a limit was held, and which cell's first; NaN and None
    where none was.
    """

    phase: int
    second: float
    reason: str
    cell: str | None
    held_from_second: float
    held_cell: str | None


class PhasesRun(NamedTuple):
    """A pack through its phases; (n,) and (n, cells), positive on charge.

    phase : index of the phase of each sample; a new one begins with a sample at the time at which
    the one before ended. ends : tuple of PhaseEnd, one a phase.
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


class Moment(NamedTuple):
    """The pack at one moment: its state, and the heat of its cells (cells,) [W]."""

    state: object
    heat_watt: np.ndarray


class Part(NamedTuple):
    """Samples of a phase: seconds since its begin (m,), Steps of m, temperatures (m, cells), and
    the cell whose limit was held (m,): -1 the pack's, -2 none."""

    second: np.ndarray
    steps: object
    celsius: np.ndarray
    held: np.ndarray


class Ambient(NamedTuple):
    """A pack and the temperature around it [degC]."""

    plant: Plant
    celsius: float


class Margin(NamedTuple):
    """How far a limit is at each sample (m,): reason, cell (-1: none's), distance (below zero:
    beyond)."""

    reason: str
    cell: np.ndarray
    distance: np.ndarray


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
    pack = Ambient(plant, float(ambient))
    state = start(cells, plant.network, initial_soc, ambient, thermal)
    at, parts, ends, begin = Moment(state, np.zeros(plant.network.cells)), [], [], 0.0
    for index, phase in enumerate(phases):
        found, (reason, cell), at = _through(pack, at, phase)
        whole = _together(found)
        parts.append((index, begin, whole))
        ends.append(_end(cells.names, index, begin, whole, reason, cell))
        begin += whole.second[-1]
    return _joined(parts, tuple(ends))


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
    if not any(np.isfinite(end).any() for end in _ends(phase)):
        raise Refusal(f"phase {number} of kind {phase.kind} has no end")
    if not phase.step_second > 0:
        raise Refusal(f"phase {number} has steps of {phase.step_second} s")


def _ends(phase):
    """All that may end a phase; infinite where it does not."""
    falls = phase.least_ampere > 0 and (phase.held or phase.kind == "voltage")
    ends = [phase.second, phase.lowest_soc, phase.highest_soc, 0.0 if falls else np.inf]
    if phase.held:
        return ends
    of_cells = (phase.lowest_cell_volt, phase.highest_cell_volt)
    return [*ends, phase.lowest_volt, phase.highest_volt, *of_cells]


def _through(pack, at, phase):
    """One phase: its Parts, (reason, cell) of its end, and the Moment then."""
    parts, elapsed = [], 0.0
    try:
        at, part = _step(pack, at, phase, 0.0, 0.0)
        parts.append(part)
        while (end := _reached(phase, part)) is None:
            free = part.held[-1] == NOT_HELD
            leapt = _leap(pack, at, phase, elapsed) if free else None
            at, part = _to_the_limit(pack, at, phase, elapsed) if leapt is None else leapt
            elapsed = part.second[-1]
            parts.append(part)
    except NoPower:
        at, part = _moved(pack, at, np.array([elapsed]), 0.0, CURRENT, 0.0)
        return [*parts, part], ("power", -1), at
    return parts, end, at


def _leap(pack, at, phase, elapsed):
    """Many steps at once, all before the first limit; None where the next one leads there.

    Only where temperatures do not change in between.
    """
    if pack.plant.modes is not None:
        return None
    seconds = _next_seconds(phase, elapsed)
    load = Load(
        np.diff(seconds, prepend=elapsed),
        np.full(len(seconds), MODES[phase.kind]),
        _asked(phase, seconds),
    )
    try:
        steps, state = many_steps(pack.plant, at.state, load, Keep())
    except NoPower:
        return None
    found = _part(pack, seconds, steps)
    limits = _margins(phase, found) + (_voltage_margins(phase, steps) if phase.held else [])
    ahead = np.array([margin.distance for margin in limits]).min(axis=0) > AT_LIMIT
    free = len(ahead) if ahead.all() else int(np.argmin(ahead))
    if free == 0:
        return None
    if free < len(ahead):
        steps, state = many_steps(pack.plant, at.state, Load(*(c[:free] for c in load)), Keep())
    return at._replace(state=state), _part(pack, seconds[:free], steps)


def _to_the_limit(pack, at, phase, elapsed):
    """The next step, shortened where it leads beyond an end."""
    second = _next_seconds(phase, elapsed)[0] - elapsed
    after, part = _step(pack, at, phase, elapsed, second)
    if _least(_margins(phase, part)).distance[-1] >= -AT_LIMIT:
        return after, part
    return _step(pack, at, phase, elapsed, _until(pack, at, phase, elapsed, second))


def _next_seconds(phase, elapsed):
    """Ends of the next steps, since the phase's begin (m,) [s]."""
    if phase.kind == "drive":
        time = np.asarray(phase.value[0], float)
        ahead = time[time > elapsed + SAME_SECOND][:AT_ONCE]
    else:
        ahead = elapsed + phase.step_second * np.arange(1, AT_ONCE + 1)
    within = ahead[ahead < phase.second - SAME_SECOND]
    return within if len(within) == len(ahead) else np.append(within, phase.second)


def _asked(phase, second):
    """Current, power or voltage that a phase asks for at times (m,) after its begin."""
    if phase.kind == "drive":
        return np.interp(second, *phase.value)
    return np.full(len(second), 0.0 if phase.kind == "rest" else float(phase.value))


def _step(pack, at, phase, elapsed, second):
    """The pack a step later, at what the phase asks for or at the limit that it holds."""
    end = np.array([elapsed + second])
    after, part = _moved(pack, at, end, second, MODES[phase.kind], _asked(phase, end)[0])
    if not phase.held or phase.kind == "voltage":
        return after, part
    if _least(_voltage_margins(phase, part.steps)).distance[0] >= 0:
        return after, part
    return _at_the_limit(pack, at, phase, end, second, part.steps.total_ampere[0])


def _moved(pack, at, end, second, mode, value):
    load = Load(*(np.array([float(number)]) for number in (second, mode, value)))
    state, heat, steps = stepped(pack.plant, at.state, at.heat_watt, load, pack.celsius)
    return Moment(state, heat), _part(pack, end, steps, state.temperature_celsius)


def _part(pack, second, steps, celsius=None):
    around = np.full(pack.plant.network.cells, pack.celsius) if celsius is None else celsius
    shape = (len(second), len(around))
    return Part(second, steps, np.broadcast_to(around, shape), np.full(len(second), NOT_HELD))


def _at_the_limit(pack, at, phase, end, second, beyond_ampere):
    """The step with the largest current at which no voltage limit is passed.

    The distance to the nearest limit falls with the current, as every cell's voltage rises with it.
    """
    from scipy.optimize import brentq

    def tried(total):
        return _moved(pack, at, end, second, CURRENT, total)

    def distance(total):
        return _least(_voltage_margins(phase, tried(total)[1].steps)).distance[0]

    rest = distance(0.0) <= 0.0
    total = 0.0 if rest else brentq(distance, 0.0, beyond_ampere, xtol=1e-9, rtol=1e-12)
    after, part = tried(total)
    nearest = _least(_voltage_margins(phase, part.steps))
    return after, part._replace(held=nearest.cell)


def _voltage_margins(phase, steps):
    """Distances of the pack's and the cells' voltages to their limits."""
    volt, pack = steps.voltage_volt, steps.sensed_volt
    none = np.full(len(pack), -1)
    low, high = volt - phase.lowest_cell_volt, phase.highest_cell_volt - volt
    return [
        Margin("pack voltage", none, pack - phase.lowest_volt),
        Margin("pack voltage", none, phase.highest_volt - pack),
        Margin("cell voltage", low.argmin(axis=1), low.min(axis=1)),
        Margin("cell voltage", high.argmin(axis=1), high.min(axis=1)),
    ]


def _margins(phase, part):
    """Distances to all that ends a phase."""
    soc, total = part.steps.soc, np.abs(part.steps.total_ampere)
    none, last = np.full(len(total), -1), _last_second(phase)
    low, high = soc - phase.lowest_soc, phase.highest_soc - soc
    margins = [
        Margin("soc", low.argmin(axis=1), low.min(axis=1)),
        Margin("soc", high.argmin(axis=1), high.min(axis=1)),
        Margin("time", none, last - part.second),
    ]
    if phase.least_ampere > 0:
        falls = (phase.kind == "voltage") | (part.held != NOT_HELD)
        margins.append(Margin("current", none, np.where(falls, total - phase.least_ampere, np.inf)))
    return margins + ([] if phase.held else _voltage_margins(phase, part.steps))


def _last_second(phase):
    return min(phase.second, phase.value[0][-1]) if phase.kind == "drive" else phase.second


def _least(margins):
    """The margin that is the smallest at the last sample."""
    return min(margins, key=lambda margin: margin.distance[-1])


def _reached(phase, part):
    """(reason, cell) of the end that a phase has reached, or None."""
    least = _least(_margins(phase, part))
    return (least.reason, int(least.cell[-1])) if least.distance[-1] <= AT_LIMIT else None


def _until(pack, at, phase, elapsed, second):
    """The length of the step that ends where the first limit is met [s]."""
    from scipy.optimize import brentq

    def distance(left):
        part = _step(pack, at, phase, elapsed, left)[1]
        return _least(_margins(phase, part)).distance[-1]

    return brentq(distance, 0.0, second, xtol=1e-7, rtol=1e-12) if distance(0.0) > 0 else 0.0


def _together(parts):
    second, steps, celsius, held = zip(*parts, strict=True)
    joined = Steps(*(np.concatenate(column) for column in zip(*steps, strict=True)))
    columns = (np.concatenate(column) for column in (celsius, held))
    return Part(np.concatenate(second), joined, *columns)


def _end(names, index, begin, whole, reason, cell):
    rows = np.flatnonzero(whole.held != NOT_HELD)
    since, by = (begin + whole.second[rows[0]], whole.held[rows[0]]) if len(rows) else (np.nan, -1)
    return PhaseEnd(
        index,
        float(begin + whole.second[-1]),
        reason,
        names[cell] if cell >= 0 else None,
        float(since),
        names[by] if by >= 0 else None,
    )


def _joined(parts, ends):
    whole = _together([part for _, _, part in parts])
    return PhasesRun(
        np.concatenate([begin + part.second for _, begin, part in parts]),
        np.concatenate([np.full(len(part.second), index) for index, _, part in parts]),
        *(whole.steps.total_ampere, whole.steps.sensed_volt),
        *whole.steps[:3],
        whole.celsius,
        ends,
    )
