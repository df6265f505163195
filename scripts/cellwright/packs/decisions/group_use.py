"""How cells in parallel share a discharge: what they give, peaks, spread, safe window."""

from typing import NamedTuple

import numpy as np

from cellwright.packs.cells import PackCells
from cellwright.packs.network import network_of
from cellwright.packs.series.capability import BEYOND, first_crossing
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.uncertainty.copies import copies_at_once
from cellwright.packs.uncertainty.draws import RESISTANCES
from cellwright.packs.wiring import Wiring, is_star, star_of

CURRENT_SPREAD = 0.2  # deviation of a branch current; thesis 5.2 saw 25 to 30 % below 15 % SoC
GROUP_C_RATE = 1.0  # of a discharge whose branch currents are looked at; thesis 5.2
STEPS = 400  # of a discharge: a quarter percent of SoC each


class PackUse(NamedTuple):
    """A constant-current discharge of a pack to its cut-off.

    capacity_ampere_hour, energy_watt_hour : of the pack. cells_ampere_hour : what it would give if
    every cell gave its capacity: the sum of a parallel group, the smallest group of a string of
    groups. pack_soc : (n,) by its charge over that [1]. branch_share : (n, cells) current of each
    cell over its share of the total by capacity; 1 is ideal. peak_share : the largest.
    first : index of the cell with it. loss_watt : (cells,) mean heat in each cell's resistances.
    """

    capacity_ampere_hour: float
    energy_watt_hour: float
    cells_ampere_hour: float
    pack_soc: np.ndarray
    branch_share: np.ndarray
    peak_share: float
    first: int
    loss_watt: np.ndarray


def cells_at(cells, index):
    """The cells of a PackCells at some indices, in their order, as a PackCells."""
    index = list(index)
    names, members = (tuple(values[k] for k in index) for values in (cells.names, cells.members))
    sizes = cells.capacity_ampere_hour[index], cells.near_end_soc[index]
    tables = {name: table[:, index] for name, table in cells.tables.items()}
    return PackCells(names, members, *sizes, cells.temperature_celsius, tables)


def discharge_pack(
    cells,
    wiring,
    *,
    lower_cutoff_volt,
    current_ampere,
    initial_soc=1.0,
    thermal=None,
    ambient_celsius=None,
):
    """Discharge a pack of any wiring from rest to its cut-off at a constant current: PackUse.

    A star of parallel cells ends when its own voltage is at the cut-off, as a cycler ends it; any
    other wiring when its first cell is at its cut-off; each at the latest when a cell is at SoC 0.

    Parameters
    ----------
    cells : PackCells in the order of the wiring's leaves, at one temperature or, with `thermal`, at
        several. wiring : Wiring.
    lower_cutoff_volt : scalar or (cells,) [V]. current_ampere : > 0, of the pack [A].
    initial_soc : scalar or (cells,) [1].
    thermal : Thermal, or None: the cells do not warm. ambient_celsius : around them [degC].

    Raises
    ------
    Refusal : as `simulate.simulate_pack`.
    """
    time = discharge_seconds(cells, wiring, current_ampere)
    load = np.full(len(time), -float(current_ampere))
    around = {"thermal": thermal, "ambient_celsius": ambient_celsius, "hold": "zero_order"}
    run = simulate_pack(time, load, cells, wiring, initial_soc=initial_soc, **around)
    ends = {"lower_cutoff_volt": lower_cutoff_volt, "current_ampere": current_ampere}
    return use_of(run, time, cells, wiring, **ends)


def discharge_seconds(cells, wiring, current_ampere):
    """Times (n,) of a discharge that goes beyond what a pack holds [s]."""
    whole = cells.capacity_ampere_hour / network_of(wiring, cells.capacity_ampere_hour).share
    return np.linspace(0.0, BEYOND * 3600.0 * whole.max() / current_ampere, STEPS + 1)


def use_of(run, time, cells, wiring, *, lower_cutoff_volt, current_ampere):
    """What a simulated discharge (PackRun at times (n,) [s]) says of a pack: PackUse."""
    share = network_of(wiring, cells.capacity_ampere_hour).share
    whole = cells.capacity_ampere_hour / share
    volt = run.voltage_volt[:, None] if is_star(wiring) else run.cell_voltage_volt
    above = volt - (np.max(lower_cutoff_volt) if is_star(wiring) else lower_cutoff_volt)
    # ASSUME: A cell is empty at SoC 0 of its model: beyond it nothing was measured.
    ends = [
        first_crossing(time, falling, 0.0) for falling in (above.min(axis=1), run.soc.min(axis=1))
    ]
    stop = np.nanmin([*ends, time[-1]])
    kept = time < stop
    second = np.append(time[kept], stop)
    hour = second / 3600.0
    energy = current_ampere * np.trapezoid(np.interp(second, time, run.voltage_volt), hour)
    shares = run.cell_current_ampere[kept] / (-current_ampere * share)
    squares = (run.cell_current_ampere[kept] ** 2).mean(axis=0)
    # The pack's SoC at the start by charge; from there by what was drawn.
    soc = np.average(run.soc[0], weights=cells.capacity_ampere_hour)
    return PackUse(
        float(current_ampere * hour[-1]),
        float(energy),
        float(whole.min()),
        soc - current_ampere * hour[:-1] / whole.min(),
        shares,
        float(shares.max()),
        int(np.argmax(shares.max(axis=0))),
        squares * resistance_of(cells, float(run.temperature_celsius[kept].mean())),
    )


def resistance_of(cells, celsius=None):
    """Resistance of each cell at small currents in the long run, mean over SoC (cells,) [ohm].

    At a temperature [degC]; None: the middle one of the tables.
    """
    # Of resistances that differ by direction that of the discharge.
    names = ("r0_ohm", "r_ohm", "kinetic_r_ohm", "discharge_ohm")
    parts = [cells.tables[name].sum(axis=2) for name in names]
    known = cells.temperature_celsius
    at = known[len(known) // 2] if celsius is None else celsius
    over = np.sum([part.mean(axis=-1) for part in parts], axis=0)
    return np.array([np.interp(at, known, one) for one in over.T])


class GroupUses(NamedTuple):
    """Constant-current discharges of parallel groups, (groups,) each.

    capacity_ampere_hour : given to the cut-off. peak_share : the largest branch current over its
    share by capacity [1]. hottest_watt : mean heat of the hottest cell.
    """

    capacity_ampere_hour: np.ndarray
    peak_share: np.ndarray
    hottest_watt: np.ndarray


def discharge_groups(cells, groups, *, lower_cutoff_volt, current_ampere, contact_ohm):
    """Parallel groups of cells discharged side by side, each full and to its own cut-off.

    The same as `discharge_pack` of each, in few runs: all stand in one string, which gives every
    group the same current. A group at I amperes is there as one at one ampere whose cells have I
    times the resistance and the I-th part of the capacity: its voltages are the same.

    Parameters
    ----------
    cells : PackCells at one temperature. groups : (groups, size) int, indices of the cells; a cell
        may be in several. lower_cutoff_volt : scalar [V]. current_ampere : (groups,) > 0 [A].
    contact_ohm : scalar, between each cell and its group's lead [ohm].

    Returns
    -------
    uses : GroupUses.
    """
    groups, current = np.asarray(groups), np.asarray(current_ampere, float)
    at_once = copies_at_once(cells_at(cells, groups[0]), STEPS + 1)
    parts = [
        _side_by_side(
            cells, groups[k : k + at_once], current[k : k + at_once], lower_cutoff_volt, contact_ohm
        )
        for k in range(0, len(groups), at_once)
    ]
    return GroupUses(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _side_by_side(cells, groups, current, lower_cutoff_volt, contact_ohm):
    count, size = groups.shape
    part = _at_one_ampere(cells_at(cells, groups.ravel()), np.repeat(current, size))
    names = np.array(part.names).reshape(groups.shape)
    # Scaled as the cells are: the same voltage at 1 A.
    contacts = contact_ohm * current
    stars = tuple(
        star_of(row, wire_resistance_ohm=contact)._replace(name=f"group {k + 1}")
        for k, (row, contact) in enumerate(zip(names, contacts, strict=True))
    )
    whole = part.capacity_ampere_hour.reshape(groups.shape)
    time = np.linspace(0.0, BEYOND * 3600.0 * whole.sum(axis=1).max(), STEPS + 1)
    string = Wiring("groups side by side", "series", stars, (0.0,) * count, (0.0,) * count)
    run = simulate_pack(time, -np.ones(len(time)), part, string, initial_soc=1.0, hold="zero_order")
    columns = (run.cell_current_ampere, run.cell_voltage_volt, run.soc)
    branch, volt, soc = (column.reshape(len(time), *groups.shape) for column in columns)
    falling = volt[:, :, 0] + contacts * branch[:, :, 0] - lower_cutoff_volt
    # ASSUME: A cell is empty at SoC 0 of its model: beyond it nothing was measured.
    ends = [first_crossing(time, course, 0.0) for course in (falling, soc.min(axis=2))]
    stop = np.nanmin([*ends, np.full(count, time[-1])], axis=0)
    kept = (time[:, None] < stop)[:, :, None]
    shares = np.where(kept, -branch, 0.0).max(axis=0) / (whole / whole.sum(axis=1, keepdims=True))
    squares = np.where(kept, branch, 0.0) ** 2
    heat = squares.sum(axis=0) / kept.sum(axis=0) * resistance_of(part).reshape(groups.shape)
    return stop / 3600.0 * current, shares.max(axis=1), current * heat.max(axis=1)


def _at_one_ampere(cells, current_ampere):
    """Cells that have at 1 A the voltages of others at (cells,) amperes, each named anew."""
    more = current_ampere[:, None, None]
    tables = {name: cells.tables[name] * more for name in (*RESISTANCES, "soc_per_ampere")}
    tables["hysteresis_ampere_hour"] = cells.tables["hysteresis_ampere_hour"] / more
    return cells._replace(
        names=tuple(f"{name} #{k}" for k, name in enumerate(cells.names)),
        capacity_ampere_hour=cells.capacity_ampere_hour / current_ampere,
        tables=cells.tables | tables,
    )


def safe_window(use, *, current_spread=CURRENT_SPREAD):
    """The widest range of a pack's SoC in which no cell strays from its share by more than a limit.

    Parameters
    ----------
    use : PackUse. current_spread : largest |share − 1| of a cell, its current over that by
        capacity [1].

    Returns
    -------
    window : dict, quantity in words → value [1], NaN where there is no such range.

    Source: thesis 5.2: 125 to 130 % of the ideal current below 15 % SoC, keep out of the last 10 to
    15 %.
    """
    spread = np.abs(use.branch_share - 1.0).max(axis=1)
    soc, worst = use.pack_soc, int(np.argmax(spread))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], spread <= current_spread, [0]])))
    lowest, highest, width, inside = np.nan, np.nan, 0.0, np.nan
    if len(edges):
        begins, ends = edges[::2], edges[1::2] - 1
        widest = int(np.argmax(soc[begins] - soc[ends]))
        begin, end = begins[widest], ends[widest]
        lowest, highest, width = soc[end], soc[begin], soc[begin] - soc[end]
        inside = spread[begin : end + 1].max()
    window = {
        "lowest SoC": lowest,
        "highest SoC": highest,
        "share of the charge": width,
        "largest spread within": inside,
        "largest spread of all": spread[worst],
        "SoC of the largest spread": soc[worst],
    }
    return {quantity: float(value) for quantity, value in window.items()}
