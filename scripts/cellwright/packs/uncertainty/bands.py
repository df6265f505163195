"""How sure the currents and the voltage of a simulated pack are: cells drawn within what is known.

All draws are simulated in one run, as packs in series: in series each has the whole current, and
none changes another.
"""

from typing import NamedTuple

import numpy as np

from cellwright.packs.cells import TABLES
from cellwright.packs.decisions.group_use import with_contacts
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.uncertainty.draws import drawn_cells
from cellwright.packs.wiring import Wiring, cells_of, member_currents

DRAWS = 50  # tell a standard deviation to a tenth
MOST_VALUES = 4_000_000  # of one quantity of a run: 32 MB
WITHIN_90_PERCENT = 1.6449  # standard deviations of a normal error


class Band(NamedTuple):
    """Standard deviations over time: current of each member (n, members) [A], voltage (n,) [V]."""

    member_ampere: np.ndarray
    voltage_volt: np.ndarray


def band_of(
    run,
    cells,
    wiring,
    drawn,
    *,
    time_second,
    total_ampere,
    ambient_celsius,
    starts,
    factors,
    thermal=None,
):
    """How far currents and voltage of a pack may be off, for what is not known of its cells.

    Each draw is the pack with other capacities, resistances, OCVs, SoC at the start and contacts;
    the deviation is the root mean square of what the draws are away from the pack as its models
    say. What differs from cell to cell moves the currents: the OCV of each as far as its own fit
    knows it. What models miss of a voltage that they have not seen may be the same in all cells; it
    then moves no current, shows in the voltage in full, and is the caller's to add.

    Parameters
    ----------
    run : PackRun of the pack as its models say, through the same record. cells : PackCells.
    wiring : Wiring. drawn : CellDraws of the cells.
    time_second, total_ampere : (n,) [s], [A]. ambient_celsius : (n,) or scalar, of all cells.
    starts : (draws, cells) SoC at the start in each draw [1]. factors : (draws,) of the contacts.
    thermal : Thermal of the cells, or None: they have the ambient's temperature.

    Returns
    -------
    band : Band.

    Raises
    ------
    Refusal : as `simulate.simulate_pack`.
    """
    at_once = max(1, MOST_VALUES // (len(time_second) * len(cells.names)))
    squares, squares_volt = 0.0, np.zeros(len(time_second))
    known = member_currents(wiring, run.cell_current_ampere)
    for first in range(0, len(factors), at_once):
        chosen = range(first, min(first + at_once, len(factors)))
        copies = [drawn_cells(cells, drawn, k, run.soc[0]) for k in chosen]
        wirings = [_renamed(with_contacts(wiring, factors[k]), f" #{k}") for k in chosen]
        many = simulate_pack(
            time_second,
            total_ampere,
            _side_by_side(copies),
            Wiring("draws", "series", tuple(wirings), *[(0.0,) * len(wirings)] * 2),
            initial_soc=starts[chosen].ravel(),
            ambient_celsius=ambient_celsius,
            thermal=None if thermal is None else repeated(thermal, len(wirings)),
        )
        for part, one in enumerate(wirings):
            columns = slice(part * len(cells.names), (part + 1) * len(cells.names))
            current = many.cell_current_ampere[:, columns]
            squares = squares + (member_currents(one, current) - known) ** 2
            volt = pack_voltage(one, many.cell_voltage_volt[:, columns], current)
            squares_volt += (volt - run.voltage_volt) ** 2
    draws = len(factors)
    return Band(np.sqrt(squares / draws), np.sqrt(squares_volt / draws))


def pack_voltage(wiring, cell_volt, cell_ampere):
    """Voltage of a pack where it is measured, from those of its cells (n,) [V].

    Parameters
    ----------
    wiring : Wiring, or the name of a cell. cell_volt, cell_ampere : (n, cells) in the order of the
        leaves [V], [A], positive on charge.
    """
    if isinstance(wiring, str):
        return cell_volt[:, 0]
    bounds = np.cumsum([len(cells_of(member)) for member in wiring.members])[:-1]
    pairs = zip(*(np.split(part, bounds, axis=1) for part in (cell_volt, cell_ampere)), strict=True)
    volts = [pack_voltage(m, *pair) for m, pair in zip(wiring.members, pairs, strict=True)]
    if wiring.sense is not None:
        return volts[wiring.sense]
    currents = member_currents(wiring, cell_ampere)
    at_bar = np.column_stack(volts) + currents * wiring.contact_ohm
    if wiring.connection == "series":
        return at_bar.sum(axis=1)
    if wiring.terminals != "opposite_ends":
        return at_bar[:, 0]
    # What has left the bar of one lead before a link flows back through the other bar.
    passed = np.cumsum(currents, axis=1)[:, :-1]
    return at_bar[:, 0] + passed @ (0.5 * np.asarray(wiring.link_ohm[1:]))


def repeated(thermal, copies):
    """Thermal of several packs alike, without a way from one to the other.

    Parameters
    ----------
    thermal : Thermal of one pack whose cells do not exchange heat. copies : how many.
    """
    columns = {
        name: np.concatenate([np.atleast_1d(getattr(thermal, name))] * copies)
        for name in ("heat_capacity_joule_per_kelvin", "resistance_kelvin_per_watt")
        + ("entropic_volt_per_kelvin",)
    }
    return thermal._replace(**columns)


def _renamed(wiring, ending):
    """A wiring whose cells and groups have names of their own."""
    if isinstance(wiring, str):
        return wiring + ending
    members = tuple(_renamed(member, ending) for member in wiring.members)
    return wiring._replace(name=wiring.name + ending, members=members)


def _side_by_side(copies):
    """Cells of several packs as one PackCells."""
    tables = {name: np.concatenate([getattr(c, name) for c in copies], axis=1) for name in TABLES}
    columns = ("capacity_ampere_hour", "near_end_soc")
    tables |= {name: np.concatenate([getattr(c, name) for c in copies]) for name in columns}
    names = tuple(f"{name} #{k}" for k, c in enumerate(copies) for name in c.names)
    members = tuple(member for c in copies for member in c.members)
    return copies[0]._replace(names=names, members=members, **tables)
