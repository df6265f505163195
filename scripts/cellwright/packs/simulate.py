"""A pack under load: how every cell's model moves, and how the wiring divides the current."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.clock import refuse_backward
from cellwright.numerics.lags import HOLDS
from cellwright.packs.kernel import Keep, Load, Steps, prepare, run_steps
from cellwright.packs.network import network_of, sensed_element
from cellwright.packs.steps import CURRENT, start
from cellwright.packs.thermal import heat_of, thermal_modes, warmed
from cellwright.refusal import Refusal

TOLERANCE_VOLT = 1e-9
FLICKER_KELVIN = 0.15  # of a thermometer that reads tenths; it moves resistances by half a percent
ALL = Keep()


class PackRun(NamedTuple):
    """A simulated pack; currents and voltages positive on charge.

    cell_current_ampere, cell_voltage_volt, soc, temperature_celsius : (n, cells) [A], [V], [1],
    [degC]; fewer rows where fewer were kept. voltage_volt : (n,) between the pack's leads, or at
    the wiring's sense point [V].
    row : samples that were kept of the cells. extremes : (n, 8) or None, lowest and highest voltage
    of a cell and its index each, lowest and highest SoC, lowest and highest current.
    """

    cell_current_ampere: np.ndarray
    cell_voltage_volt: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray
    temperature_celsius: np.ndarray
    row: np.ndarray | None = None
    extremes: np.ndarray | None = None


class Plant(NamedTuple):
    """A pack ready to be stepped: PackCells, Network, ThermalModes or None, the element whose
    voltage is measured, hold, tolerance [V], and what the kernel is told of it."""

    cells: object
    network: object
    modes: object
    sensed: int
    hold: str
    tolerance_volt: float
    prepared: object


def simulate_pack(
    test_time_second,
    current_ampere,
    cells,
    wiring,
    *,
    initial_soc,
    ambient_celsius=None,
    thermal=None,
    hold="first_order",
    keep=ALL,
    tolerance_volt=TOLERANCE_VOLT,
):
    """Currents, voltages, SoC and temperatures of all cells of a pack under a total current.

    At every sample the cells' equations at that moment and Kirchhoff's laws hold together. 1. Each
    cell is linearised about its last iterate, V = E + Z·I. 2. The wiring is solved exactly for
    these. 3. Both again, until no cell's voltage is further from its line than `tolerance_volt`
    (Newton; a step that overshoots is shortened). Cells of resistors and RC pairs are linear: one
    pass, about the SoC that the last currents lead to, unless that was off by more than 1e-4.

    A cell's current runs in a step on a straight line that ends at what Kirchhoff's laws give and
    rises by the cell's share (by capacity) of the rise of the total. So a cell alone is what
    `circuits.cell` gives, and currents that flow between unequal cells only decay, however
    long the step.

    Parameters
    ----------
    test_time_second, current_ampere : (n,) never falling [s]; total, positive on charge [A].
    cells : PackCells. wiring : Wiring of as many cells.
    initial_soc : scalar or (cells,) in the order of the wiring's leaves [1].
    ambient_celsius : scalar or (n,); without `thermal` the temperature of all cells [degC]. None
        where the tables know one temperature.
    thermal : Thermal, or None: cells have the ambient's temperature.
    hold : of the total current between samples: "first_order" (a straight line), or "zero_order"
        (it keeps its value until the next sample).
    keep : Keep, how much of the cells is kept: 10,000 cells over an hour are 288 MB a quantity.
    tolerance_volt : of Newton's method [V].

    Returns
    -------
    run : PackRun.

    Raises
    ------
    Refusal : time that runs back, values that are not finite, another number of cells than in the
        wiring, no temperature where one is needed, a parallel member without any resistance, or a
        step whose equations are not solved.

    Source: docs/packs.md; of the parallel group thesis 5.3.
    """
    time, total = _record(test_time_second, current_ampere, hold)
    plant = plant_of(cells, wiring, thermal, hold=hold, tolerance_volt=tolerance_volt)
    ambient = ambient_of(cells, thermal, ambient_celsius, len(time))
    first = {"first_ampere": total[0]}
    state = start(cells, plant.network, initial_soc, ambient[0], thermal, **first)
    load = Load(np.diff(time, prepend=time[0]), np.full(len(time), CURRENT), total)
    if thermal is None and np.ptp(ambient) == 0:
        steps, _ = many_steps(plant, state, load, keep)
        return _run(steps, np.broadcast_to(ambient[0], steps.soc.shape), keep)
    walked = _at_ambient if thermal is None else _with_temperatures
    return _run(*walked(plant, state, load, ambient, keep), keep)


def _run(steps, celsius, keep):
    kept = np.arange(0, len(steps.sensed_volt), keep.every) if keep.every else np.empty(0, int)
    per_cell = (steps.current_ampere, steps.voltage_volt, steps.sensed_volt, steps.soc, celsius)
    return PackRun(*per_cell, kept, steps.extremes if keep.extremes else None)


def _with_temperatures(plant, state, load, ambient, keep):
    """Steps (n, …) one by one, each at the temperatures that the one before has left."""
    heat, parts, temperatures = np.zeros(plant.network.cells), [], []
    for k in range(len(load.second)):
        one = Load(*(column[k : k + 1] for column in load))
        state, heat, part = stepped(plant, state, heat, one, ambient[k], extremes=keep.extremes)
        parts.append(part)
        temperatures.append(state.temperature_celsius)
    return _joined(parts, np.array(temperatures), keep)


def _at_ambient(plant, state, load, ambient, keep):
    """Steps (n, …) of cells that are as warm as the ambient, in stretches of about one temperature.

    Each is at its mean: the reading flickers by its last digit, and no cell follows that.
    """
    parts = []
    for rows in _stretches(ambient):
        part = Load(*(column[rows] for column in load))
        celsius = np.full(plant.network.cells, ambient[rows].mean())
        state = state._replace(temperature_celsius=celsius)
        steps, state = many_steps(plant, state, part, Keep(1, keep.extremes))
        parts.append(steps)
    celsius = np.broadcast_to(ambient[:, None], (len(ambient), plant.network.cells))
    return _joined(parts, celsius, keep)


def _stretches(celsius):
    """Parts of a record, slices, within which a temperature (n,) stays about the same."""
    first, low, high = 0, celsius[0], celsius[0]
    for k, here in enumerate(celsius.tolist()):
        low, high = min(low, here), max(high, here)
        if high - low > FLICKER_KELVIN:
            yield slice(first, k)
            first, low, high = k, here, here
    yield slice(first, len(celsius))


def _joined(parts, celsius, keep):
    """Steps of all parts together and temperatures (n, cells), of the cells those that are kept."""
    joined = Steps(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    rows = slice(0, len(joined.sensed_volt) if keep.every else 0, keep.every or 1)
    return joined._replace(
        current_ampere=joined.current_ampere[rows],
        voltage_volt=joined.voltage_volt[rows],
        soc=joined.soc[rows],
    ), celsius[rows]


def plant_of(cells, wiring, thermal, *, hold, tolerance_volt):
    """A pack ready to be stepped.

    Parameters
    ----------
    cells, wiring, thermal, hold, tolerance_volt : as in `simulate_pack`.

    Returns
    -------
    plant : Plant.
    """
    network = network_of(wiring, cells.capacity_ampere_hour)
    modes = None if thermal is None else thermal_modes(thermal, network.cells)
    sensed, ready = sensed_element(wiring, network), prepare(cells, network)
    return Plant(cells, network, modes, sensed, hold, tolerance_volt, ready)


def many_steps(plant, state, load, keep):
    """A pack through many steps at temperatures that do not change: Steps, PackState.

    Parameters
    ----------
    plant : Plant. state : PackState. load : Load. keep : Keep.
    """
    how = {"hold": plant.hold, "sensed": plant.sensed, "tolerance_volt": plant.tolerance_volt}
    how |= {"keep": keep, "prepared": plant.prepared}
    return run_steps(plant.cells, plant.network, state, load, **how)


def stepped(plant, state, heat_watt, load, ambient_celsius, *, extremes=False):
    """A pack one step later, with the temperatures that its heat leads to.

    Parameters
    ----------
    plant : Plant. state : PackState. heat_watt : (cells,) before the step [W].
    load : Load of one step. ambient_celsius : in the step [degC]. extremes : whether they are kept.

    Returns
    -------
    state : PackState. heat_watt : (cells,) at the end of the step [W]. steps : Steps of one.
    """
    steps, state = many_steps(plant, state, load, Keep(1, extremes))
    now = heat_of(plant.cells, plant.modes, state, steps.voltage_volt[0])
    mean = heat_watt if plant.hold == "zero_order" else 0.5 * (heat_watt + now)
    celsius = warmed(plant.modes, state.temperature_celsius, mean, ambient_celsius, load.second[0])
    return state._replace(temperature_celsius=celsius), now, steps


def ambient_of(cells, thermal, ambient_celsius, samples):
    """Temperature of the ambient at each sample (n,) [degC].

    Parameters
    ----------
    cells, thermal, ambient_celsius : as in `simulate_pack`. samples : how many.

    Raises
    ------
    Refusal : none is given where one is needed.
    """
    if ambient_celsius is not None:
        return np.broadcast_to(np.asarray(ambient_celsius, float), (samples,))
    if thermal is not None or len(cells.temperature_celsius) > 1:
        raise Refusal("parameters follow temperature, but no ambient temperature is given")
    return np.full(samples, cells.temperature_celsius[0])


def _record(test_time_second, current_ampere, hold):
    time = np.asarray(test_time_second, float)
    total = np.asarray(current_ampere, float)
    if time.shape != total.shape or time.ndim != 1 or not len(time):
        raise Refusal(f"time has shape {time.shape}, current {total.shape}; both must be (n,)")
    if not (np.isfinite(time).all() and np.isfinite(total).all()):
        raise Refusal("time or total current holds values that are not finite")
    refuse_backward(time)
    if hold not in HOLDS:
        raise Refusal(f"hold of the current is {hold!r}; allowed are {', '.join(HOLDS)}")
    return time, total
