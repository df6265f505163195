"""A pack through phases as a cycler runs them, ended or limited by the first cell at its limit."""

from typing import NamedTuple

import numpy as np

from cellwright.packs.kernel import Load
from cellwright.packs.simulate import TOLERANCE_VOLT, Plant, ambient_of, plant_of, stepped
from cellwright.packs.steps import CURRENT, POWER, VOLTAGE, NoPower, start
from cellwright.refusal import Refusal

MODES = {"rest": CURRENT, "current": CURRENT, "drive": CURRENT, "power": POWER, "voltage": VOLTAGE}
AT_LIMIT = 1e-6  # [V], [A], [1]: nearer to its end than this, a phase has reached it
SAME_SECOND = 1e-6


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
    "soc", "current", or "power" where the pack cannot give it any more.
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
    """The pack after a step: its state, the heat of its cells, what was measured, and the cell
    whose limit was held (None: none was; −1: the pack's)."""

    state: object
    heat_watt: np.ndarray
    steps: object
    held: int | None


class Ambient(NamedTuple):
    """A pack and the temperature around it [degC]."""

    plant: Plant
    celsius: float


class Margin(NamedTuple):
    """How far a limit is: reason, cell (−1: none's), distance (below zero: beyond)."""

    reason: str
    cell: int
    distance: float


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
    at = Moment(state, np.zeros(plant.network.cells), None, None)
    rows, ends, begin = [], [], 0.0
    for index, phase in enumerate(phases):
        found, (reason, cell), at = _through(pack, at, phase)
        rows += [(begin + second, index, moment) for second, moment in found]
        begin += found[-1][0]
        ends.append(_end(plant, index, rows, begin, reason, cell))
    return _joined(rows, tuple(ends))


def _check(index, phase):
    number = index + 1
    if phase.kind not in MODES:
        raise Refusal(f"phase {number} is of kind {phase.kind!r}; allowed are {', '.join(MODES)}")
    if phase.kind == "drive":
        time, current = (np.asarray(column, float) for column in phase.value)
        if time.shape != current.shape or time.ndim != 1 or len(time) < 2 or time[0] != 0:
            raise Refusal(f"the drive of phase {number} has no two samples from 0 s on")
        if np.any(np.diff(time) < 0) or not np.isfinite([time, current]).all():
            raise Refusal(f"the drive of phase {number} runs back in time or is not finite")
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
    """One phase: samples as (second since its begin, Moment), (reason, cell) of its end, Moment."""
    elapsed, rows = 0.0, []
    at = at._replace(held=None)
    try:
        at = _step(pack, at, phase, elapsed, 0.0)
        rows.append((elapsed, at))
        while (end := _reached(phase, at, elapsed)) is None:
            left = _next_second(phase, elapsed)
            after = _step(pack, at, phase, elapsed, left)
            least = _least(_margins(phase, after, elapsed + left))
            if least.distance < -AT_LIMIT:
                left = _until(pack, phase, at, elapsed, left)
                after = _step(pack, at, phase, elapsed, left)
            at, elapsed = after, elapsed + left
            rows.append((elapsed, at))
    except NoPower:
        if at.steps is None:
            raise
        return rows or [(elapsed, at)], ("power", -1), at
    return rows, end, at


def _next_second(phase, elapsed):
    """Length of the next step [s]."""
    if phase.kind != "drive":
        return min(phase.step_second, phase.second - elapsed)
    time = np.asarray(phase.value[0], float)
    ahead = time[time > elapsed + SAME_SECOND]
    return min(ahead[0], phase.second) - elapsed


def _asked(phase, elapsed):
    """Current, power or voltage that a phase asks for at a time after its begin."""
    if phase.kind == "rest":
        return 0.0
    return float(np.interp(elapsed, *phase.value)) if phase.kind == "drive" else float(phase.value)


def _step(pack, at, phase, elapsed, left):
    """The pack a step later, at what the phase asks for or at the limit that it holds."""
    asked = _asked(phase, elapsed + left)
    after = _moved(pack, at, left, MODES[phase.kind], asked)
    if not phase.held or phase.kind == "voltage":
        return after
    beyond = _least(_voltage_margins(phase, after))
    if beyond.distance >= 0:
        return after
    return _at_the_limit(pack, at, phase, left, after)


def _moved(pack, at, left, mode, value):
    load = Load(*(np.array([float(number)]) for number in (left, mode, value)))
    return Moment(*stepped(pack.plant, at.state, at.heat_watt, load, pack.celsius), None)


def _at_the_limit(pack, at, phase, left, after):
    """The step with the largest current at which no voltage limit is passed.

    The distance to the nearest limit falls with the current, as every cell's voltage rises with it.
    """
    from scipy.optimize import brentq

    tried = {}

    def distance(total):
        tried[total] = _moved(pack, at, left, CURRENT, total)
        return _least(_voltage_margins(phase, tried[total])).distance

    if distance(0.0) <= 0.0:
        return tried[0.0]._replace(held=_least(_voltage_margins(phase, tried[0.0])).cell)
    total = brentq(distance, 0.0, after.state.total_ampere, xtol=1e-9, rtol=1e-12)
    found = tried[total] if total in tried else _moved(pack, at, left, CURRENT, total)
    return found._replace(held=_least(_voltage_margins(phase, found)).cell)


def _voltage_margins(phase, at):
    """Distances of the pack's and the cells' voltages to their limits."""
    volt, pack = at.steps.voltage_volt[0], at.steps.sensed_volt[0]
    low, high = volt - phase.lowest_cell_volt, phase.highest_cell_volt - volt
    return [
        Margin("pack voltage", -1, pack - phase.lowest_volt),
        Margin("pack voltage", -1, phase.highest_volt - pack),
        Margin("cell voltage", int(np.argmin(low)), low.min()),
        Margin("cell voltage", int(np.argmin(high)), high.min()),
    ]


def _margins(phase, at, elapsed):
    """Distances to all that ends a phase."""
    soc, total = at.state.soc, abs(at.state.total_ampere)
    low, high = soc - phase.lowest_soc, phase.highest_soc - soc
    margins = [
        Margin("soc", int(np.argmin(low)), low.min()),
        Margin("soc", int(np.argmin(high)), high.min()),
        Margin("time", -1, _last_second(phase) - elapsed),
    ]
    if phase.least_ampere > 0 and (phase.kind == "voltage" or at.held is not None):
        margins += [Margin("current", -1, total - phase.least_ampere)]
    return margins + ([] if phase.held else _voltage_margins(phase, at))


def _last_second(phase):
    return min(phase.second, phase.value[0][-1]) if phase.kind == "drive" else phase.second


def _least(margins):
    return min(margins, key=lambda margin: margin.distance)


def _reached(phase, at, elapsed):
    """(reason, cell) of the end that a phase has reached, or None."""
    margins = _margins(phase, at, elapsed)
    reached = [margin for margin in margins if margin.distance <= AT_LIMIT]
    return (_least(reached).reason, _least(reached).cell) if reached else None


def _until(pack, phase, at, elapsed, left):
    """The length of the step that ends where the first limit is met [s]."""
    from scipy.optimize import brentq

    def distance(second):
        after = _step(pack, at, phase, elapsed, second)
        return _least(_margins(phase, after, elapsed + second)).distance

    return brentq(distance, 0.0, left, xtol=1e-7, rtol=1e-12) if distance(0.0) > 0 else 0.0


def _end(plant, index, rows, second, reason, cell):
    names = plant.cells.names
    held = [(time, at.held) for time, phase, at in rows if phase == index and at.held is not None]
    since, by = held[0] if held else (np.nan, -1)
    return PhaseEnd(
        index,
        second,
        reason,
        names[cell] if cell >= 0 else None,
        since,
        names[by] if by >= 0 else None,
    )


def _joined(rows, ends):
    moments = [moment for _, _, moment in rows]
    return PhasesRun(
        np.array([second for second, _, _ in rows]),
        np.array([phase for _, phase, _ in rows]),
        np.array([at.state.total_ampere for at in moments]),
        np.array([at.steps.sensed_volt[0] for at in moments]),
        *(np.array([at.steps[k][0] for at in moments]) for k in range(3)),
        np.array([at.state.temperature_celsius for at in moments]),
        ends,
    )
