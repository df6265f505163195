"""Many steps of a pack at once: by native/pack.c where it can be built, else by `steps`."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.temperature import ZERO_CELSIUS_KELVIN
from cellwright.native import array, count, function, integers, real
from cellwright.packs.cells import TABLES
from cellwright.packs.network import no_resistance
from cellwright.packs.steps import (
    CURRENT,
    LAGS,
    SAME_SOC,
    Step,
    advance,
    is_linear,
    no_power,
    not_solved,
)

STRAIGHT = ("ocv_volt", "ocv_shift_volt")  # quantities that are linear in 1/T
MEMORY = (*LAGS, "hysteresis_volt")
TIMES = tuple(tau for tau, _ in LAGS.values())
NO_RESISTANCE, NOT_SOLVED = 1, 2  # outcomes of native/pack.c


class Keep(NamedTuple):
    """What of a run is kept of each cell: every how many samples (0: none), and the extremes."""

    every: int = 1
    extremes: bool = False


class PackRun(NamedTuple):
    """A simulated pack; currents and voltages positive on charge.

    cell_current_ampere, cell_voltage_volt, soc, temperature_celsius : (kept, cells) [A], [V], [1],
    [degC]. voltage_volt : (n,) between the pack's leads, or at the wiring's sense point [V].
    current_ampere : (n,) through the pack [A]. row : (kept,) samples that were kept of the cells.
    extremes : (n, 8) lowest and highest voltage of a cell and its index each, lowest and highest
    SoC, lowest and highest current; (0, 8) where not kept.
    """

    cell_current_ampere: np.ndarray
    cell_voltage_volt: np.ndarray
    soc: np.ndarray
    temperature_celsius: np.ndarray
    voltage_volt: np.ndarray
    current_ampere: np.ndarray
    row: np.ndarray
    extremes: np.ndarray


def run_steps(plant, state, load, keep):
    """A pack through many steps, at temperatures that do not change.

    Parameters
    ----------
    plant : simulate.Plant. state : PackState. keep : Keep.
    load : (3, n) length of each step [s], what is asked for at its end (steps.CURRENT, VOLTAGE or
        POWER), and how much of it [A], [V], [W].

    Returns
    -------
    run : PackRun. state : PackState at the end.

    Raises
    ------
    Refusal : as `steps.advance`.
    """
    doubles, ints = [array] * 3 + [real], [integers] * 4
    # As pack_steps of native/pack.c is declared.
    types = (count, *doubles, *ints, *[array] * 4, *[integers] * 3, *[array] * 2, real, real)
    kernel = function("pack_steps", *types, *[array] * 9, result=count)
    run = _room(load.shape[1], state, keep)
    if kernel is None:
        return run, _step_by_step(plant, state, load, keep, run)
    return run, _compiled(kernel, plant, state, load, keep, run)


def _room(samples, state, keep):
    """A run to be filled in, at the cells' temperatures of now."""
    kept, cells = (
        np.arange(0, samples, keep.every) if keep.every else np.empty(0, int),
        len(state.soc),
    )
    per_cell = [np.empty((len(kept), cells)) for _ in range(3)]
    celsius = np.broadcast_to(state.temperature_celsius, (len(kept), cells))
    extremes = np.empty((samples if keep.extremes else 0, 8))
    return PackRun(*per_cell, celsius, np.empty(samples), np.empty(samples), kept, extremes)


def joined(runs, keep=None):
    """One run of all samples of several; of its cells what is to be kept (Keep), or all."""
    run = PackRun(*(np.concatenate(column) for column in zip(*runs, strict=True)))
    every = 1 if keep is None else keep.every
    row = np.arange(0, len(run.voltage_volt), every) if every else np.empty(0, int)
    return PackRun(*(column[row] for column in run[:4]), *run[4:6], row, run.extremes)


def _step_by_step(plant, state, load, keep, run):
    """The kernel's result in numpy."""
    network, hold = plant.network, plant.hold
    at_rest, tolerance = np.zeros(network.cells), {"tolerance_volt": plant.tolerance_volt}
    for k, (second, mode, value) in enumerate(load.T):
        left = second
        if hold == "zero_order" and left > 0:
            # The current of before flows until the step's end, and jumps there.
            kept_on = Step(left, at_rest, hold), CURRENT, state.total_ampere
            _, state = advance(plant.cells, network, state, *kept_on, **tolerance)
            left = 0.0
        ramps = hold == "first_order" and mode == CURRENT
        rise = (value - state.total_ampere) * network.share if ramps else at_rest
        step = Step(left, rise, hold)
        solved, state = advance(plant.cells, network, state, step, mode, value, **tolerance)
        _put(run, k, keep, solved, state, plant.sensed)
    return state


def _put(run, k, keep, solved, state, sensed):
    lines, current, volt = solved.network, state.current_ampere, solved.voltage_volt
    across = lines.resistance_ohm[sensed] * solved.current_ampere[sensed]
    run.voltage_volt[k] = lines.source_volt[sensed] + across
    run.current_ampere[k] = state.total_ampere
    if keep.extremes:
        low, high = np.argmin(volt), np.argmax(volt)
        ends = [state.soc.min(), state.soc.max(), current.min(), current.max()]
        run.extremes[k] = [volt[low], low, volt[high], high, *ends]
    if keep.every and k % keep.every == 0:
        for column, values in zip(run[:3], (current, volt, state.soc), strict=True):
            column[k // keep.every] = values


def _compiled(kernel, plant, state, load, keep, run):
    """The state at the end; fills in the run."""
    cells, network = plant.cells, plant.network
    measured = cells.temperature_celsius
    celsius = np.minimum(np.maximum(state.temperature_celsius, measured[0]), measured[-1])
    begin, current = _packed(state), state.current_ampere.copy()
    # All sizes but what is kept are the plant's.
    work, sizes, fault = np.zeros(work_room(cells, network)), plant.sizes.copy(), np.zeros(3)
    work[: len(begin)], sizes[-3:-1] = begin, keep
    stopped = kernel(
        load.shape[1],
        *map(np.ascontiguousarray, load),
        state.total_ampere,
        *(sizes, *plant.tables),
        -1.0 / (measured + ZERO_CELSIUS_KELVIN),
        -1.0 / (celsius + ZERO_CELSIUS_KELVIN),
        1.0 / (3600.0 * cells.capacity_ampere_hour),
        *(network.share, network.connection, network.first, network.member),
        *(network.contact_ohm, network.link_ohm, plant.tolerance_volt, SAME_SOC, work, current),
        *(run.cell_current_ampere, run.cell_voltage_volt, run.soc, run.voltage_volt),
        *(run.extremes, run.current_ampere, fault),
    )
    if stopped >= 0:
        raise _refusal(plant, load[:, stopped], fault)
    return _unpacked(work, state)._replace(
        current_ampere=current, total_ampere=float(run.current_ampere[-1])
    )


def _refusal(plant, step, fault):
    outcome, first, second = fault
    if outcome == NO_RESISTANCE:
        return no_resistance(plant.network, int(first), int(second))
    if outcome == NOT_SOLVED:
        return not_solved(plant.cells, int(first), second, step[0])
    return no_power(step[2])


def table_places(cells):
    """Of each quantity: where its table begins, doubles from cell to cell, whether in 1/T.

    The addresses are those of the tables of these very cells, which have to live as long.
    """
    rows = []
    for name in TABLES:
        table = cells.tables[name]
        entries, points = table.shape[2:]
        first, stride = table.ctypes.data, entries * points
        rows += [(first + 8 * points * e, stride, name in STRAIGHT) for e in range(entries)]
    return tuple(np.array(column, np.int64) for column in zip(*rows, strict=True))


def kernel_sizes(cells, network, hold, sensed, keep):
    """Numbers by which native/pack.c knows what it is given: the array `sizes` of its comment.

    Parameters
    ----------
    cells : PackCells. network : Network. hold, sensed : as of `simulate.Plant`. keep : Keep.
    """
    tables = cells.tables
    entries = {name: table.shape[2] for name, table in tables.items()}
    elements = network.cells + len(network.connection)
    # Time constants that stay the same let the kernel reuse the weights of a step.
    moving = len(cells.temperature_celsius) > 1 or any(
        np.any(tables[name] != tables[name][..., :1]) for name in TIMES
    )
    sizes = [network.cells, len(network.connection), tables["ocv_volt"].shape[-1]]
    sizes += [len(cells.temperature_celsius), entries["r_ohm"], entries["kinetic_r_ohm"]]
    sizes += [entries["hysteresis_volt"], entries["soc_per_ampere"], entries["charge_ohm"]]
    sizes += [is_linear(cells), moving, not tables["r0_ohm"].min() > 0]
    return np.array([*sizes, hold == "first_order", *keep, sensed % elements], np.int64)


def work_room(cells, network):
    """How many numbers native/pack.c needs to work with, for PackCells in a Network."""
    entries = {name: table.shape[2] for name, table in cells.tables.items()}
    lags = sum(entries[name] for name in TIMES)
    memory = lags + entries["hysteresis_volt"]
    rows = 8 + 4 * sum(entries.values()) + 2 * lags + 2 * memory + entries["r_ohm"]
    elements = network.cells + len(network.connection)
    return rows * network.cells + 4 * elements + 6 * len(network.member)


def _packed(state):
    """State as rows of (cells,): SoC, memory, quantities."""
    parts = [state.memory[name].T for name in MEMORY]
    parts += [state.parameters[name].T for name in TABLES]
    return np.concatenate([state.soc, *(part.ravel() for part in parts)])


def _unpacked(work, state):
    """The state whose rows `_packed` lays out, as the kernel has left them."""
    at, cells = len(state.soc), len(state.soc)

    def taken(like):
        nonlocal at
        at += like.size
        return work[at - like.size : at].reshape(like.shape[1], cells).T.copy()

    memory = {name: taken(state.memory[name]) for name in MEMORY}
    parameters = {name: taken(state.parameters[name]) for name in TABLES}
    return state._replace(soc=work[:cells].copy(), memory=memory, parameters=parameters)
