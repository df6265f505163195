"""A pack under load: how every cell's model moves, and how the wiring divides the current."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.clock import checked_columns
from cellwright.numerics.lags import check_hold
from cellwright.packs.kernel import Keep, joined, kernel_sizes, run_steps, table_places
from cellwright.packs.network import network_of, sensed_element
from cellwright.packs.steps import CURRENT, start
from cellwright.packs.thermal import heat_of, thermal_modes, warmed
from cellwright.refusal import Refusal

TOLERANCE_VOLT = 1e-9
FLICKER_KELVIN = 0.15  # of a thermometer that reads tenths; it moves resistances by half a percent
ALL = Keep()


class Plant(NamedTuple):
    """A pack ready to be stepped.

    cells : PackCells. network : Network. modes : ThermalModes, None: the cells do not warm.
    sensed : element whose voltage is measured. hold : of the total current between samples.
    tolerance_volt : of Newton's method [V]. sizes, tables : `kernel.kernel_sizes`, `table_places`.
    """

    cells: object
    network: object
    modes: object
    sensed: int
    hold: str
    tolerance_volt: float
    sizes: np.ndarray
    tables: tuple


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
    run : kernel.PackRun.

    Raises
    ------
    Refusal : time that runs back, values that are not finite, another number of cells than in the
        wiring, no temperature where one is needed, a parallel member without any resistance, or a
        step whose equations are not solved.

    Source: docs/packs.md; of the parallel group thesis 5.3.
    """
    time, total = checked_columns({"time": test_time_second, "current": current_ampere})
    check_hold(hold)
    ambient = ambient_of(cells, thermal, ambient_celsius, len(time))
    plant = plant_of(cells, wiring, thermal, hold=hold, tolerance_volt=tolerance_volt)
    state = start(cells, plant.network, initial_soc, ambient[0], thermal, first_ampere=total[0])
    load = np.array([np.diff(time, prepend=time[0]), np.full(len(time), CURRENT), total])
    if thermal is None and np.ptp(ambient) == 0:
        return run_steps(plant, state, load, keep)[0]
    walked = _at_ambient if thermal is None else _with_temperatures
    return walked(plant, state, load, ambient, keep)


def _with_temperatures(plant, state, load, ambient, keep):
    """The run of steps one by one, each at the temperatures that the one before has left."""
    parts = []
    for k, celsius in enumerate(ambient):
        part, state = stepped(
            plant, state, load[:, k : k + 1], ambient_celsius=celsius, extremes=keep.extremes
        )
        parts.append(part)
    return joined(parts, keep)


def _at_ambient(plant, state, load, ambient, keep):
    """The run of cells that are as warm as the ambient, in stretches of about one temperature.

    Each is at its mean: the reading flickers by its last digit, and no cell follows that.
    """
    parts = []
    for rows in _stretches(ambient):
        celsius = np.full(plant.network.cells, ambient[rows].mean())
        state = state._replace(temperature_celsius=celsius)
        part, state = run_steps(plant, state, load[:, rows], Keep(1, keep.extremes))
        shape = part.soc.shape
        parts.append(part._replace(temperature_celsius=np.broadcast_to(ambient[rows, None], shape)))
    return joined(parts, keep)


def _stretches(celsius):
    """Parts of a record, slices, within which a temperature (n,) stays about the same."""
    first, low, high = 0, celsius[0], celsius[0]
    for k, here in enumerate(celsius.tolist()):
        low, high = min(low, here), max(high, here)
        if high - low > FLICKER_KELVIN:
            yield slice(first, k)
            first, low, high = k, here, here
    yield slice(first, len(celsius))


def plant_of(cells, wiring, thermal, *, hold, tolerance_volt):
    """A pack ready to be stepped: Plant, of arguments as of `simulate_pack`."""
    # The kernel walks through the tables in memory, and numpy lays a choice of cells out otherwise.
    tables = {name: np.ascontiguousarray(one, float) for name, one in cells.tables.items()}
    cells = cells._replace(tables=tables)
    network = network_of(wiring, cells.capacity_ampere_hour)
    modes = None if thermal is None else thermal_modes(thermal, network.cells)
    sensed = sensed_element(wiring, network)
    # Looked up once: callers may take a million single steps.
    sizes = kernel_sizes(cells, network, hold, sensed, ALL)
    return Plant(cells, network, modes, sensed, hold, tolerance_volt, sizes, table_places(cells))


def stepped(plant, state, load, *, ambient_celsius, extremes=False):
    """A pack some steps later; where its cells warm one step, to what its heat leads to.

    Parameters
    ----------
    plant : Plant. state : PackState. load : as of `kernel.run_steps`, one step where cells warm.
    ambient_celsius : in the step [degC]. extremes : whether they are kept.

    Returns
    -------
    run : kernel.PackRun. state : PackState at the end.
    """
    run, after = run_steps(plant, state, load, Keep(1, extremes))
    if plant.modes is None:
        return run, after
    # Between samples the heat runs as the current does: straight, or as it was at the begin.
    heat = heat_of(plant.cells, plant.modes, after, run.cell_voltage_volt[0])
    mean = state.heat_watt if plant.hold == "zero_order" else 0.5 * (state.heat_watt + heat)
    celsius = warmed(plant.modes, state.temperature_celsius, mean, ambient_celsius, load[0, 0])
    after = after._replace(temperature_celsius=celsius, heat_watt=heat)
    return run._replace(temperature_celsius=celsius[None]), after


def ambient_of(cells, thermal, ambient_celsius, samples):
    """Temperature of the ambient at each sample (n,) [degC], of arguments as of `simulate_pack`.

    Raises
    ------
    Refusal : none is given where one is needed.
    """
    if ambient_celsius is not None:
        return np.broadcast_to(np.asarray(ambient_celsius, float), (samples,))
    if thermal is not None or len(cells.temperature_celsius) > 1:
        raise Refusal("parameters follow temperature, but no ambient temperature is given")
    return np.full(samples, cells.temperature_celsius[0])
