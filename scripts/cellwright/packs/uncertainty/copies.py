"""Several packs in one run: in series each has the whole current, and none changes another."""

import numpy as np

from cellwright.packs.cells import PackCells
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import Wiring, by_member, member_currents

MOST_VALUES = 4_000_000  # of the tables of all copies, and of one quantity over time: 32 MB each


def copies_at_once(cells, samples):
    """How many copies of a pack's cells one run of so many samples simulates, at least 1."""
    tables = sum(table.size for table in cells.tables.values())
    return max(1, MOST_VALUES // max(tables, samples * len(cells.names)))


def simulate_copies(
    test_time_second, current_ampere, cells, wirings, *, initial_soc, thermal=None, **how
):
    """Packs of one shape, each with its own cells and contacts, under the same current.

    Parameters
    ----------
    test_time_second, current_ampere : (n,) [s], [A], of each pack.
    cells : list of PackCells, one a pack, on the same temperatures. wirings : list of Wiring.
    initial_soc : (packs, cells) [1].
    thermal : Thermal of one pack, whose cells exchange no heat, the same in all; or None.
    how : further arguments of `simulate.simulate_pack`.

    Returns
    -------
    runs : list of kernel.PackRun, one a pack.
    """
    # A wiring may name a cell once.
    named = tuple(_renamed(wiring, f" #{k}") for k, wiring in enumerate(wirings))
    none = (0.0,) * len(named)
    if thermal is not None:
        names = ("heat_capacity_joule_per_kelvin", "resistance_kelvin_per_watt")
        names += ("entropic_volt_per_kelvin",)
        alike = [np.concatenate([np.atleast_1d(getattr(thermal, n))] * len(named)) for n in names]
        thermal = thermal._replace(**dict(zip(names, alike, strict=True)))
    string = Wiring("copies", "series", named, none, none)
    start = np.asarray(initial_soc, float).ravel()
    about = {"initial_soc": start, "thermal": thermal, **how}
    run = simulate_pack(test_time_second, current_ampere, _side_by_side(cells), string, **about)
    parts = zip(*(np.split(column, len(named), axis=1) for column in run[:4]), strict=True)
    return [
        run._replace(
            cell_current_ampere=current,
            cell_voltage_volt=volt,
            soc=soc,
            temperature_celsius=celsius,
            voltage_volt=pack_voltage(wiring, volt, current),
        )
        for wiring, (current, volt, soc, celsius) in zip(wirings, parts, strict=True)
    ]


def pack_voltage(wiring, cell_volt, cell_ampere):
    """Voltage of a pack where it is measured, from those of its cells (n,) [V].

    Parameters
    ----------
    wiring : Wiring, or the name of a cell. cell_volt, cell_ampere : (n, cells) in the order of the
        leaves [V], [A], positive on charge.
    """
    if isinstance(wiring, str):
        return cell_volt[:, 0]
    volts = [pack_voltage(*part) for part in by_member(wiring, cell_volt, cell_ampere)]
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


def _renamed(wiring, ending):
    """A wiring whose cells and groups have names of their own."""
    if isinstance(wiring, str):
        return wiring + ending
    members = tuple(_renamed(member, ending) for member in wiring.members)
    return wiring._replace(name=wiring.name + ending, members=members)


def _side_by_side(copies):
    """Cells of several packs as one PackCells."""
    first = copies[0]
    return PackCells(
        tuple(f"{name} #{k}" for k, c in enumerate(copies) for name in c.names),
        tuple(member for c in copies for member in c.members),
        np.concatenate([c.capacity_ampere_hour for c in copies]),
        np.concatenate([c.near_end_soc for c in copies]),
        first.temperature_celsius,
        {n: np.concatenate([c.tables[n] for c in copies], axis=1) for n in first.tables},
    )
