"""A fleet of cells put together: strings, parallel groups, strings of groups; and the gain."""

from typing import NamedTuple

import numpy as np

from cellwright.packs.cells import PackCells, pack_cells
from cellwright.packs.decisions.group_use import (
    GROUP_C_RATE,
    GroupUses,
    discharge_groups,
    resistance_of,
)
from cellwright.packs.decisions.matching import (
    even_groups,
    gain_of,
    groups_by_swaps,
    pairs_of_least_cost,
    strings_by_capacity,
)
from cellwright.packs.uncertainty.draws import SEED, draw_cells, drawn_cells, uncertainty_of
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal
from cellwright.settings import PackDecisions

SETTINGS = PackDecisions()
EVERY_PAIR = 200  # cells of which every pair is simulated; of more each with its next ones
NEXT_ONES = 10  # in the order of resistance times capacity
MOST_CELLS = 1000


class Fleet(NamedTuple):
    """Cells of one type: names, tables (PackCells) at 25 °C, lower cut-off [V], what they may be
    (CellDraws)."""

    names: tuple
    tables: PackCells
    lower_cutoff_volt: float
    drawn: object


def fleet_of(models, cells, capacity_std_ampere_hour, settings=SETTINGS):
    """Cells of one type, ready to be put together.

    Parameters
    ----------
    models : model dicts. cells : CellFacts in their order. capacity_std_ampere_hour : (cells,) [Ah]
        or None. settings : PackDecisions.

    Raises
    ------
    Refusal : fewer than 2 cells, more than 1000, or as `cells.pack_cells`.
    """
    if not 2 <= len(models) <= MOST_CELLS:
        found = f"{len(models)} cells of one type with a model"
        raise Refusal(f"{found}; from 2 to {MOST_CELLS} can be matched at once")
    known = uncertainty_of(models, capacity_std_ampere_hour)
    # Where most packs are used, and most cells were tested: which cells go together changes little.
    tables = pack_cells(models, temperature_celsius=REFERENCE_CELSIUS)
    lower = max(cell.lower_cutoff_volt for cell in cells)
    names = tuple(model["cell"] for model in models)
    drawn = draw_cells(known, draws=settings.draws)
    return Fleet(names, tables, float(lower), drawn)


def discharges_of(fleet, c_rate):
    """Discharges of parallel groups of a fleet's cells, each group simulated once.

    Parameters
    ----------
    fleet : Fleet. c_rate : over the capacities of a group's cells [1/h].

    Returns
    -------
    uses : function (groups, draw=None) → GroupUses; `groups` are (groups, size) indices, `draw` one
        of the fleet's draws; None: the cells as their models say. Voltage and SoC at the start,
        which joined cells share, are the same in all draws, so that they are the same for all
        assemblies that are compared.
    """
    known = {}

    def uses(groups, draw=None):
        keys = [(tuple(sorted(map(int, group))), draw) for group in groups]
        new = [key for key in dict.fromkeys(keys) if key not in known]
        if new:
            found = _discharged(fleet, np.array([group for group, _ in new]), c_rate, draw)
            known.update(zip(new, zip(*found, strict=True), strict=True))
        return GroupUses(*np.array([known[key] for key in keys]).T)

    return uses


def _discharged(fleet, groups, c_rate, draw):
    tables = fleet.tables
    current = c_rate * tables.capacity_ampere_hour[groups].sum(axis=1)
    if draw is not None:
        # What joined cells share, their voltage, tells no assembly from another.
        drawn = fleet.drawn._replace(voltage_volt=0.0 * fleet.drawn.voltage_volt, ocv_volt=None)
        tables = drawn_cells(tables, drawn, draw, 1.0)
    # A welded joint: far below a cell's own resistance, yet no branch without any.
    at = {"lower_cutoff_volt": fleet.lower_cutoff_volt, "contact_ohm": 1e-5}
    return discharge_groups(tables, groups, current_ampere=current, **at)


def matched_fleet(fleet, settings=SETTINGS):
    """A fleet put together in three ways, each beside random assemblies of the same cells.

    Parallel groups are matched by the largest branch current over its share: of all pairs exactly
    (matching of least total cost), of larger groups by exchanges from a sorted start. Strings are
    sorted by what each cell alone gives at that current. Strings of groups: blocks of cells by
    capacity, and in each block groups of even capacity.

    Parameters
    ----------
    fleet : Fleet. settings : PackDecisions.

    Returns
    -------
    rows : list of dict: decision, quantity, unit, value, percentiles of random assemblies and of
        the gain. assembly : list of dict: decision, group, string, position, cell.

    Raises
    ------
    Refusal : fewer cells than two parallel groups or one string need.
    """
    cells = len(fleet.names)
    size, length = settings.group_size, settings.string_length
    if cells < 2 * size:
        raise Refusal(f"{cells} cells, wanted at least two groups of {size} to choose between")
    uses = discharges_of(fleet, GROUP_C_RATE)
    random = np.random.default_rng([SEED, 2])
    rows, assembly = _parallel(fleet, uses, random, settings)
    for of_cells in (1, size):
        if cells >= 2 * of_cells * length:
            more = _strings(fleet, uses, random, settings, of_cells)
            rows, assembly = rows + more[0], assembly + more[1]
    return rows, assembly


def parallel_groups(fleet, uses, size):
    """Parallel groups of a fleet in which the busiest cells have least above their share.

    Parameters
    ----------
    fleet : Fleet. uses : function, from `discharges_of`. size : cells in a group.

    Returns
    -------
    groups : (groups, size) int.
    """
    cells, tables = len(fleet.names), fleet.tables
    # Two cells share a current by capacity where resistance times capacity is the same: far from
    # each other in this order no two are a good pair.
    order = np.argsort(resistance_of(tables) * tables.capacity_ampere_hour, kind="stable")
    if size == 2:
        far = cells if cells <= EVERY_PAIR else NEXT_ONES
        places = [(k, n) for k in range(cells) for n in range(k + 1, min(k + far + 1, cells))]
        pairs = order[np.array(places)].T
        cost = np.full((cells, cells), np.inf)
        cost[tuple(pairs)] = cost[tuple(pairs[::-1])] = uses(pairs.T).peak_share
        return pairs_of_least_cost(cost)
    begin = order[: cells // size * size].reshape(-1, size)
    return groups_by_swaps(begin, lambda groups: uses(groups).peak_share)


def _parallel(fleet, uses, random, settings):
    matched = parallel_groups(fleet, uses, settings.group_size)

    def of(quantity, over):
        return lambda groups, draw: float(over(getattr(uses(groups, draw), quantity)))

    shares = "largest branch current over its share"
    quantities = {
        f"{shares}, worst group": ("1", of("peak_share", np.max), False),
        f"{shares}, mean": ("1", of("peak_share", np.mean), False),
        "heat of the hottest cell": ("W", of("hottest_watt", np.max), False),
        "usable charge of all groups": ("Ah", of("capacity_ampere_hour", np.sum), True),
        "usable charge of the smallest group": ("Ah", of("capacity_ampere_hour", np.min), True),
    }
    decision = f"parallel groups of {settings.group_size}"
    return _compared(fleet, decision, matched, quantities, random, settings)


def _strings(fleet, uses, random, settings, size):
    """Strings of cells (size 1) or of parallel groups, which end with their first member."""
    alone, length = np.arange(len(fleet.names))[:, None], settings.string_length
    charge = uses(alone).capacity_ampere_hour
    matched, decision = strings_by_capacity(charge, length=size * length), f"strings of {length}"
    if size > 1:
        # Within a string all groups should be empty at once.
        groups = [block[even_groups(charge[block], size=size)] for block in matched]
        matched, decision = np.array(groups), f"{decision} groups of {size}"

    def of_all(strings, draw):
        if size > 1:
            given = uses(strings.reshape(-1, size), draw).capacity_ampere_hour
            return float(given.reshape(-1, length).min(axis=1).sum())
        # All cells at once, once a draw: which of them a string takes changes nothing of theirs.
        return float(uses(alone, draw).capacity_ampere_hour[strings].min(axis=1).sum())

    quantities = {"usable charge of all strings": ("Ah", of_all, True)}
    return _compared(fleet, decision, matched, quantities, random, settings)


def _compared(fleet, decision, matched, quantities, random, settings):
    """Rows of each quantity of an assembly beside random ones, and rows of who is where."""
    placed = np.ravel(matched)
    at_random = [random.permutation(placed).reshape(matched.shape) for _ in range(settings.draws)]
    draws = range(min(settings.draws, 60))  # in each of them all groups are simulated
    rows = []
    for quantity, (unit, value, more) in quantities.items():
        gain = gain_of(value, matched, at_random, draws, more_is_better=more)
        rows.append({"decision": decision, "quantity": quantity, "unit": unit} | gain)
    names = fleet.names
    strings = matched if matched.ndim == 3 else matched[None]
    assembly = [
        {"decision": decision, "string": s + 1, "group": g + 1, "position": p + 1}
        | {"cell": names[cell]}
        for s, string in enumerate(strings)
        for g, group in enumerate(string)
        for p, cell in enumerate(group)
    ]
    return rows, assembly
