"""Many steps of a pack at once: by native/pack.c where it can be built, else by `steps`."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.temperature import ZERO_CELSIUS_KELVIN
from cellwright.native import array, count, function, integers, real
from cellwright.packs.cells import TABLES
from cellwright.packs.network import no_resistance
from cellwright.packs.steps import (
    CURRENT,
    SAME_SOC,
    PackState,
    Step,
    advance,
    is_linear,
    no_power,
    not_solved,
)

# Quantities of a cell in the order of native/pack.c, and which of them are linear in 1/T.
ORDER = (
    *("ocv_volt", "ocv_shift_volt", "r0_ohm", "two_way_ohm", "r_ohm", "kinetic_r_ohm"),
    *("kinetic_scale_volt", "soc_per_ampere", "hysteresis_volt", "hysteresis_ampere_hour"),
    *("tau_second", "kinetic_tau_second", "soc_tau_second"),
)
STRAIGHT = ("ocv_volt", "ocv_shift_volt")
MEMORY = ("relaxed_volt", "kinetic_volt", "surface_soc", "hysteresis_volt")
TIMES = ("tau_second", "kinetic_tau_second", "soc_tau_second")
NO_RESISTANCE, NOT_SOLVED = 1, 2


class Load(NamedTuple):
    """What is asked of a pack: steps (n,) [s], steps.CURRENT, VOLTAGE or POWER (n,), values (n,)
    at their ends [A], [V], [W]."""

    second: np.ndarray
    mode: np.ndarray
    value: np.ndarray


class Keep(NamedTuple):
    """What of a run is kept of each cell: every how many samples (0: none), and the extremes."""

    every: int = 1
    extremes: bool = False


class Prepared(NamedTuple):
    """What the compiled kernel is told of a pack whatever is asked of it: see native/pack.c."""

    address: np.ndarray
    stride: np.ndarray
    straight: np.ndarray
    sizes: np.ndarray
    inverse: np.ndarray
    per_second: np.ndarray
    room: int


class Steps(NamedTuple):
    """A pack after each of n steps.

    current_ampere, voltage_volt, soc : (kept, cells). sensed_volt, total_ampere : (n,).
    extremes : (n, 8) lowest and highest voltage of a cell and its index each, lowest and highest
    SoC, lowest and highest current; (0, 8) where not kept.
    """

    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray
    sensed_volt: np.ndarray
    total_ampere: np.ndarray
    extremes: np.ndarray


def run_steps(
    cells, network, state, load, *, hold, sensed=-1, keep=None, tolerance_volt=1e-9, prepared=None
):
    """A pack through many steps, at temperatures that do not change.

    Parameters
    ----------
    cells : PackCells. network : Network. state : PackState. load : Load.
    hold : of the total current between samples.
    sensed : element whose voltage is measured; -1: the whole pack. keep : Keep, or None: all.
    tolerance_volt : of Newton's method [V].
    prepared : Prepared of these cells and network, for callers that take few steps at a time.

    Returns
    -------
    steps : Steps. state : PackState at the end.

    Raises
    ------
    Refusal : as `steps.advance`.
    """
    keep = Keep() if keep is None else keep
    doubles, ints = [array] * 3 + [real], [integers] * 4
    types = (count, *doubles, *ints, *[array] * 4, *[integers] * 3, *[array] * 2, real, real)
    kernel = function("pack_steps", *types, *[array] * 9, result=count)
    settings = {"hold": hold, "sensed": sensed, "keep": keep, "tolerance_volt": tolerance_volt}
    if kernel is None:
        return _step_by_step(cells, network, state, load, **settings)
    ready = prepare(cells, network) if prepared is None else prepared
    return _compiled(kernel, ready, cells, network, state, load, **settings)


def prepare(cells, network):
    """What of a pack is the same in all steps.

    Parameters
    ----------
    cells : PackCells. network : Network.
    """
    entries = {name: getattr(cells, name).shape[2] for name in TABLES}
    moving = len(cells.temperature_celsius) > 1 or any(
        np.any(getattr(cells, name) != getattr(cells, name)[..., :1]) for name in TIMES
    )
    sizes = [network.cells, len(network.connection), cells.ocv_volt.shape[-1]]
    sizes += [len(cells.temperature_celsius), entries["r_ohm"], entries["kinetic_r_ohm"]]
    sizes += [entries["hysteresis_volt"], entries["soc_per_ampere"], entries["two_way_ohm"] // 2]
    sizes += [is_linear(cells), moving, not cells.r0_ohm.min() > 0]
    return Prepared(
        *_addresses(cells),
        np.array(sizes, np.int64),
        -1.0 / (cells.temperature_celsius + ZERO_CELSIUS_KELVIN),
        1.0 / (3600.0 * cells.capacity_ampere_hour),
        work_room(cells, network),
    )


def _room(rows, cells, keep):
    kept = len(range(0, rows, keep.every)) if keep.every else 0
    per_cell = [np.empty((kept, cells)) for _ in range(3)]
    extremes = np.empty((rows if keep.extremes else 0, 8))
    return Steps(*per_cell, np.empty(rows), np.empty(rows), extremes)


def _step_by_step(cells, network, state, load, *, hold, sensed, keep, tolerance_volt):
    """The kernel's result in numpy."""
    found = _room(len(load.second), network.cells, keep)
    for k, (second, mode, value) in enumerate(zip(*load, strict=True)):
        left = second
        if hold == "zero_order" and left > 0:
            held, total = Step(left, np.zeros(network.cells), hold), state.total_ampere
            _, state = advance(
                cells, network, state, held, CURRENT, total, tolerance_volt=tolerance_volt
            )
            left = 0.0
        ramps = hold == "first_order" and mode == CURRENT
        rise = (value - state.total_ampere) * network.share if ramps else np.zeros(network.cells)
        step = Step(left, rise, hold)
        solved, state = advance(
            cells, network, state, step, mode, value, tolerance_volt=tolerance_volt
        )
        _put(found, k, keep, solved, state, sensed)
    return found, state


def _put(found, k, keep, solved, state, sensed):
    lines, current, volt = solved.network, state.current_ampere, solved.voltage_volt
    across = lines.resistance_ohm[sensed] * solved.current_ampere[sensed]
    found.sensed_volt[k] = lines.source_volt[sensed] + across
    found.total_ampere[k] = state.total_ampere
    if keep.extremes:
        low, high = np.argmin(volt), np.argmax(volt)
        ends = [state.soc.min(), state.soc.max(), current.min(), current.max()]
        found.extremes[k] = [volt[low], low, volt[high], high, *ends]
    if keep.every and k % keep.every == 0:
        row = k // keep.every
        for column, values in zip(found[:3], (current, volt, state.soc), strict=True):
            column[row] = values


def _compiled(kernel, ready, cells, network, state, load, *, hold, sensed, keep, tolerance_volt):
    measured = cells.temperature_celsius
    celsius = np.minimum(np.maximum(state.temperature_celsius, measured[0]), measured[-1])
    begin, current = _packed(state), state.current_ampere.copy()
    work = np.zeros(ready.room)
    work[: len(begin)] = begin
    found, fault = _room(len(load.second), network.cells, keep), np.zeros(3)
    stopped = kernel(
        len(load.second),
        *(np.ascontiguousarray(column, float) for column in load),
        state.total_ampere,
        _all_sizes(ready, network, hold, sensed, keep),
        *(ready.address, ready.stride, ready.straight, ready.inverse),
        -1.0 / (celsius + ZERO_CELSIUS_KELVIN),
        *(ready.per_second, network.share, network.connection, network.first, network.member),
        *(network.contact_ohm, network.link_ohm, tolerance_volt, SAME_SOC, work, current),
        *(found.current_ampere, found.voltage_volt, found.soc, found.sensed_volt),
        *(found.extremes, found.total_ampere, fault),
    )
    if stopped >= 0:
        raise _refusal(cells, network, load, stopped, fault)
    return found, _unpacked(work, current, state, found)


def _refusal(cells, network, load, stopped, fault):
    outcome, first, second = fault
    if outcome == NO_RESISTANCE:
        return no_resistance(network, int(first), int(second))
    if outcome == NOT_SOLVED:
        return not_solved(cells, int(first), second, load.second[stopped])
    return no_power(load.value[stopped])


def _addresses(cells):
    """Of each quantity: where its table begins, doubles from cell to cell, whether in 1/T."""
    rows = []
    for name in ORDER:
        table = getattr(cells, name)
        entries, points = table.shape[2:]
        first = table.ctypes.data
        step = 8 * points
        rows += [(first + e * step, entries * points, name in STRAIGHT) for e in range(entries)]
    return (np.array(column, np.int64) for column in zip(*rows, strict=True))


def kernel_sizes(cells, network, hold, sensed, keep):
    """Numbers by which native/pack.c knows what it is given: the array `sizes` of its comment.

    Parameters
    ----------
    cells : PackCells. network : Network. hold, sensed, keep : as of `run_steps`.
    """
    return _all_sizes(prepare(cells, network), network, hold, sensed, keep)


def _all_sizes(ready, network, hold, sensed, keep):
    elements = network.cells + len(network.connection)
    asked_for = [hold == "first_order", keep.every, keep.extremes, sensed % elements]
    return np.concatenate([ready.sizes, np.array(asked_for, np.int64)])


def work_room(cells, network):
    """How many numbers native/pack.c needs to work with.

    Parameters
    ----------
    cells : PackCells. network : Network.
    """
    quantities = sum(getattr(cells, name).shape[2] for name in ORDER)
    lags = sum(getattr(cells, name).shape[2] for name in TIMES)
    memory = lags + cells.hysteresis_volt.shape[2]
    rows = 8 + 4 * quantities + 2 * lags + 2 * memory + cells.r_ohm.shape[2]
    elements = network.cells + len(network.connection)
    return rows * network.cells + 4 * elements + 6 * len(network.member)


def _packed(state):
    """State as rows of (cells,): SoC, memory, quantities."""
    parts = [getattr(state, name).T for name in MEMORY]
    parts += [state.parameters[name].T for name in ORDER]
    return np.concatenate([state.soc, *(part.ravel() for part in parts)])


def _unpacked(work, current, state, found):
    at, cells = 0, len(state.soc)

    def taken(shape):
        nonlocal at
        at += shape[0] * shape[1]
        return work[at - shape[0] * shape[1] : at].reshape(shape[::-1]).T.copy()

    soc = taken((cells, 1))[:, 0]
    memory = {name: taken(getattr(state, name).shape) for name in MEMORY}
    parameters = {name: taken(state.parameters[name].shape) for name in ORDER}
    total = float(found.total_ampere[-1])
    held = {"soc": soc, "current_ampere": current, "total_ampere": total}
    return PackState(
        **held, **memory, temperature_celsius=state.temperature_celsius, parameters=parameters
    )
