"""How cells in parallel share a discharge: what they give, peaks, spread, safe window."""

from typing import NamedTuple

import numpy as np

from cellwright.packs.cells import TABLES
from cellwright.packs.network import network_of
from cellwright.packs.series.capability import first_crossing
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import is_star
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
STEPS = 400
BEYOND = 1.05  # of the pack's charge: so far a discharge is simulated


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
    """Some cells of a PackCells, in the order of `index`, as a PackCells."""
    index = list(index)
    names, members = (tuple(values[k] for k in index) for values in (cells.names, cells.members))
    tables = {name: getattr(cells, name)[:, index] for name in TABLES}
    return cells._replace(
        names=names,
        members=members,
        capacity_ampere_hour=cells.capacity_ampere_hour[index],
        near_end_soc=cells.near_end_soc[index],
        **tables,
    )


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
    """Discharge a pack of any wiring from rest to its cut-off at a constant current.

    A star of parallel cells ends when its own voltage is at the cut-off, as a cycler ends it; any
    other wiring when its first cell is at its cut-off; each at the latest when a cell is at SoC 0.

    Parameters
    ----------
    cells : PackCells in the order of the wiring's leaves, at one temperature or, with `thermal`, at
        several. wiring : Wiring.
    lower_cutoff_volt : scalar or (cells,) [V]. current_ampere : > 0, of the pack [A].
    initial_soc : scalar or (cells,) [1].
    thermal : Thermal, or None: the cells do not warm. ambient_celsius : around them [degC].

    Returns
    -------
    use : PackUse.

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
    """Times (n,) of a discharge that goes beyond what a pack holds [s].

    Parameters
    ----------
    cells, wiring, current_ampere : as of `discharge_pack`.
    """
    whole = cells.capacity_ampere_hour / network_of(wiring, cells.capacity_ampere_hour).share
    return np.linspace(0.0, BEYOND * 3600.0 * whole.max() / current_ampere, STEPS + 1)


def use_of(run, time, cells, wiring, *, lower_cutoff_volt, current_ampere):
    """What a simulated discharge says of a pack: PackUse.

    Parameters
    ----------
    run : PackRun. time : (n,) [s]. cells, wiring, lower_cutoff_volt, current_ampere : as of
        `discharge_pack`.
    """
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

    Parameters
    ----------
    cells : PackCells. celsius : temperature [degC]; None: the middle one of their tables.
    """
    parts = [getattr(cells, name).sum(axis=2) for name in ("r0_ohm", "r_ohm", "kinetic_r_ohm")]
    if cells.two_way_ohm.shape[2]:
        parts.append(cells.two_way_ohm[:, :, -1])
    known = cells.temperature_celsius
    at = known[len(known) // 2] if celsius is None else celsius
    over = np.sum([part.mean(axis=-1) for part in parts], axis=0)
    return np.array([np.interp(at, known, one) for one in over.T])


class Window(NamedTuple):
    """Range of a pack's SoC in which its currents stay within a spread.

    lower_soc, upper_soc : NaN where there is none. charge_share : of the pack's charge [1].
    spread : the largest in it [1]. worst_spread, worst_soc : the largest of all, and where.
    """

    lower_soc: float
    upper_soc: float
    charge_share: float
    spread: float
    worst_spread: float
    worst_soc: float


def safe_window(use, *, current_spread=SETTINGS.current_spread):
    """The widest range of SoC in which no cell strays from its share by more than a limit.

    Parameters
    ----------
    use : PackUse. current_spread : largest |share − 1| of a cell, its current over that by
        capacity [1].

    Returns
    -------
    window : Window.

    Source: thesis 5.2: 125 to 130 % of the ideal current below 15 % SoC, keep out of the last 10 to
    15 %.
    """
    spread = np.abs(use.branch_share - 1.0).max(axis=1)
    soc, worst = use.pack_soc, int(np.argmax(spread))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], spread <= current_spread, [0]])))
    if not len(edges):
        return Window(np.nan, np.nan, 0.0, np.nan, float(spread[worst]), float(soc[worst]))
    begins, ends = edges[::2], edges[1::2] - 1
    widest = int(np.argmax(soc[begins] - soc[ends]))
    begin, end = begins[widest], ends[widest]
    inside = float(spread[begin : end + 1].max())
    width = float(soc[begin] - soc[end])
    limits = (float(soc[end]), float(soc[begin]), width, inside)
    return Window(*limits, float(spread[worst]), float(soc[worst]))
