"""How cells are wired into a pack: members in parallel or series, nested to any depth.

A group is a set of members in one connection; a member is a cell or another group, so that every
series-parallel wiring nests. In parallel the members lie between two busbars, either on one bar
each (a star) or one after the other along the bars (a ladder, with a resistance of both bars
together from one member to the next).
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

BLANK = {"connection": "parallel", "terminals": "same_end"}  # what a blank in groups.tsv means
NAMED_CELLS = 8  # of more a sentence would be unreadable: the shape is told instead


class Wiring(NamedTuple):
    """A group of members in parallel or in series.

    name : of the group. connection : "parallel" or "series".
    members : tuple, a name of a cell or a Wiring each.
    contact_ohm : tuple, in series with each member: contact and lead [Ω].
    link_ohm : tuple, of both busbars together between a member and the one before it, the first 0
        [Ω]; all 0 is a star.
    terminals : "same_end" or "opposite_ends": where on a ladder the plus and the minus lead sit.
    sense : index of the member at whose terminals the group's voltage is measured; None: at the
        group's own.
    """

    name: str
    connection: str
    members: tuple
    contact_ohm: tuple
    link_ohm: tuple
    terminals: str = "same_end"
    sense: int | None = None


class WiringFault(NamedTuple):
    """What is wrong with a row of groups.tsv.

    row : its index. column : of the sheet. found : its value. wanted : in words.
    also : index of another row that says the same, None where there is none.
    """

    row: int
    column: str
    found: object
    wanted: str
    also: int | None = None


def cells_of(wiring):
    """Names of all cells of a wiring, in the order of the leaves: tuple of str."""
    if isinstance(wiring, str):
        return (wiring,)
    return tuple(cell for member in wiring.members for cell in cells_of(member))


def depth(wiring):
    """How many groups lie one in the other: 0 of a cell, 1 of a group of cells."""
    return 0 if isinstance(wiring, str) else 1 + max(map(depth, wiring.members))


def by_member(wiring, *columns):
    """Members of a group, each with its cells' part of each column: (member, part, …).

    Parameters
    ----------
    wiring : Wiring. columns : (cells,) or (n, cells) arrays in the order of the leaves.
    """
    bounds = np.cumsum([len(cells_of(member)) for member in wiring.members])[:-1]
    return zip(
        wiring.members, *(np.split(column, bounds, axis=-1) for column in columns), strict=True
    )


def member_currents(wiring, cell_ampere):
    """Currents through the members of a group (n, members) from those of its cells [A].

    Parameters
    ----------
    wiring : Wiring. cell_ampere : (n, cells) in the order of the leaves [A].
    """

    def through(member, ampere):
        # What flows through members in series flows through any one of them.
        if isinstance(member, str):
            return ampere[:, 0]
        inner = member_currents(member, ampere)
        return inner.sum(axis=1) if member.connection == "parallel" else inner[:, 0]

    return np.column_stack([through(*part) for part in by_member(wiring, cell_ampere)])


def charge_of(wiring, ampere_hour):
    """Charge that a pack gives or takes of what each of its cells does, full or empty together.

    The sum of members in parallel, the least of members in series. What spread of SoC, resistances
    and currents take off it a simulation says.

    Parameters
    ----------
    wiring : Wiring, or the name of a cell. ampere_hour : (cells,) in the order of the leaves [Ah].
    """
    if isinstance(wiring, str):
        return float(ampere_hour[0])
    members = [charge_of(*part) for part in by_member(wiring, np.asarray(ampere_hour))]
    return sum(members) if wiring.connection == "parallel" else min(members)


def star_of(names, *, wire_resistance_ohm=0.0):
    """Wiring of cells in parallel, each with a lead of `wire_resistance_ohm` to one point [ohm]."""
    wires = np.broadcast_to(np.asarray(wire_resistance_ohm, float), (len(names),))
    return Wiring("the group", "parallel", tuple(names), tuple(wires), (0.0,) * len(names))


def with_contacts(wiring, factor):
    """A wiring with all its contacts times a factor."""
    if isinstance(wiring, str):
        return wiring
    return wiring._replace(
        contact_ohm=tuple(factor * ohm for ohm in wiring.contact_ohm),
        members=tuple(with_contacts(member, factor) for member in wiring.members),
    )


def is_star(wiring):
    """Whether a wiring is cells in parallel, each with its own lead to one point: bool."""
    return wiring.connection == "parallel" and depth(wiring) == 1 and not any(wiring.link_ohm)


def is_string(wiring):
    """Whether a wiring is single cells in series: bool."""
    return wiring.connection == "series" and depth(wiring) == 1


def models_of(wiring, models):
    """Models of the cells of a wiring, in the order of its leaves.

    Parameters
    ----------
    wiring : Wiring. models : list of model dicts in any order, also of other cells.

    Raises
    ------
    Refusal : cells without a model, by name.
    """
    by_cell = {model["cell"]: model for model in models}
    lacking = [cell for cell in cells_of(wiring) if cell not in by_cell]
    if lacking:
        more = len(lacking) - NAMED_CELLS
        named = ", ".join(lacking[:NAMED_CELLS]) + (f" and {more} more" if more > 0 else "")
        wanted = f"wanted one of each of its {len(cells_of(wiring))} cells"
        raise Refusal(f"{wiring.name} is not simulated: found no model of {named}, {wanted}")
    return [by_cell[cell] for cell in cells_of(wiring)]


def described(wiring):
    """A wiring in words, such as "(P01 || P02) + (P03 || P04)" or "series of 3 x parallel of 4"."""
    if isinstance(wiring, str):
        return wiring
    cells = cells_of(wiring)
    if len(cells) > NAMED_CELLS:
        return f"{shape(wiring)} ({cells[0]} to {cells[-1]})"
    sign = " || " if wiring.connection == "parallel" else " + "
    inner = [described(member) for member in wiring.members]
    return sign.join(text if " " not in text else f"({text})" for text in inner)


def shape(wiring):
    """A wiring without its names, such as "series of 3 x parallel of 4 cells"."""
    if isinstance(wiring, str):
        return "cell"
    shapes = [shape(member) for member in wiring.members]
    begin = f"{wiring.connection} of {len(shapes)}"
    if len(set(shapes)) > 1:
        kinds = dict.fromkeys(shapes)
        listed = ", ".join(f"{shapes.count(kind)} x {kind}" for kind in kinds)
        return f"{begin} ({listed})"
    return f"{begin} cells" if shapes[0] == "cell" else f"{begin} x {shapes[0]}"


def wiring_of(group, rows):
    """The wiring of a group from rows of groups.tsv.

    Parameters
    ----------
    group : name of the group.
    rows : list of dict, rows of that group and of all groups that it names, in any order; keys
        position, cell, and where stated group (else they are of this group), connection,
        wire_resistance_ohm, link_resistance_ohm, terminals, sense, initial_soc. Blank resistances
        are 0.

    Raises
    ------
    Refusal : no row of the group, or any of `wiring_faults`.
    """
    rows = [{"group": group, **row} for row in rows]
    faults = wiring_faults(rows)
    if faults:
        raise Refusal("; ".join(_said(fault, rows) for fault in faults))
    by_group = _by_group(rows)
    if group not in by_group:
        raise Refusal(f"no row of group {group}; there are {', '.join(by_group) or 'none'}")
    return _wired(group, {name: [rows[k] for k in places] for name, places in by_group.items()})


def _said(fault, rows):
    also = ""
    if fault.also is not None:
        also = f" (also {rows[fault.also]['group']} position {rows[fault.also]['position']})"
    row = rows[fault.row]
    place = f"{row['group']} position {row['position']}, {fault.column}"
    return f"{place}: found {fault.found!r}, wanted {fault.wanted}{also}"


def rows_below(group, rows):
    """Rows of groups.tsv of a group and of all groups in it, those of the group first."""
    by_group = _by_group(rows)
    members = _members_of(rows, by_group)
    return [rows[k] for name in _groups_below(group, members) for k in by_group[name]]


def _by_group(rows):
    """Indices of the rows of each group in order of position, without rows that were not read."""
    found = {}
    for index, row in enumerate(rows):
        if _was_read(row):
            found.setdefault(row["group"], []).append(index)
    for places in found.values():
        places.sort(key=lambda k: rows[k]["position"])
    return found


def _was_read(row):
    return None not in (row["group"], row["cell"], row["position"])


def _members_of(rows, by_group):
    """Names of the members of each group, in order of position."""
    return {name: [rows[k]["cell"] for k in places] for name, places in by_group.items()}


def _groups_below(group, members):
    """Names of the group and of all groups in it, each once even where they form a circle."""
    # A stack, not recursion: groups that lie in themselves end as well.
    found, waiting = {}, [group]
    while waiting:
        name = waiting.pop()
        if name in members and name not in found:
            found[name] = None
            waiting += reversed(members[name])
    return list(found)


def _wired(group, rows_of):
    rows = rows_of[group]
    members = [row["cell"] for row in rows]
    sensed = [k for k, row in enumerate(rows) if row.get("sense") == "yes"]
    return Wiring(
        name=group,
        connection=_stated(rows[0], "connection"),
        members=tuple(_wired(name, rows_of) if name in rows_of else name for name in members),
        contact_ohm=tuple(float(row.get("wire_resistance_ohm") or 0.0) for row in rows),
        link_ohm=tuple(float(row.get("link_resistance_ohm") or 0.0) for row in rows),
        terminals=_stated(rows[0], "terminals"),
        sense=sensed[0] if sensed else None,
    )


def _stated(row, column):
    """What a row states of its group, or what a blank means."""
    return row.get(column) or BLANK[column]


def wiring_faults(rows, cells=None):
    """All faults of the rows of groups.tsv that no single value shows.

    Parameters
    ----------
    rows : list of dict as in `wiring_of`, of any number of groups; values may be None where the
        sheet could not be read.
    cells : names of all cells, or None: every name that is no group is a cell.

    Returns
    -------
    faults : list of WiringFault in the order of the rows.
    """
    by_group = _by_group(rows)
    partly = {row["group"] for row in rows if not _was_read(row)}
    faults = []
    for name, places in by_group.items():
        faults += _faults_of_group(name, places, rows)
        faults += [] if name in partly else _faults_of_places(name, places, rows)
        if _stated(rows[places[0]], "connection") == "series":
            faults += _faults_of_series(places, rows)
    faults += _faults_of_members(rows, by_group, cells)
    faults += _faults_of_packs(rows, by_group)
    return sorted(faults, key=lambda fault: fault.row)


def _faults_of_group(name, places, rows):
    """Faults of one group: what all its rows share, links, sense points."""
    first = rows[places[0]]
    for column, k in product(BLANK, places):
        value, wanted = _stated(rows[k], column), _stated(first, column)
        if value != wanted:
            wanted = f"the same on all rows of {name}, {wanted} as at its first position"
            yield WiringFault(k, column, value, wanted)
    if first.get("link_resistance_ohm"):
        wanted = "blank or 0 at the first position: a link leads to the member before"
        yield WiringFault(places[0], "link_resistance_ohm", first["link_resistance_ohm"], wanted)
    sensed = [k for k in places if rows[k].get("sense") == "yes"]
    for k in sensed[1:]:
        yield WiringFault(k, "sense", "yes", f"one sense point in {name} at most", sensed[0])


def _faults_of_places(name, places, rows):
    """Faults of a single member, of a position that stands twice, else of the first gap."""
    if len(places) < 2:
        wanted = f"two or more members of {name}; a cell by itself is named where it is wired"
        yield WiringFault(places[0], "group", name, wanted)
    at = {}
    for k in places:
        position = rows[k]["position"]
        if position in at:
            yield WiringFault(k, "position", position, f"each once in {name}", at[position])
        at.setdefault(position, k)
    # A gap beside a position that stands twice is the same slip: told once.
    gap = next((n for n in range(1, len(at) + 1) if n not in at), None)
    if gap and len(at) == len(places):
        k = next(at[position] for position in sorted(at) if position > gap)
        wanted = f"positions of {name} without a gap: 1 to {len(places)}"
        yield WiringFault(k, "position", rows[k]["position"], wanted)


def _faults_of_series(places, rows):
    """Faults of what is nothing in series: busbars with links, and a sense point."""
    nothing = {
        "link_resistance_ohm": "blank in series: links are those of a ladder of parallel members",
        "terminals": "blank in series: there are no busbars",
        "sense": "blank in series, where each cell's voltage is a column of the record",
    }
    for k, column in product(places, nothing):
        value = rows[k].get(column)
        if value and value not in ("same_end", "no"):
            yield WiringFault(k, column, value, nothing[column])


def _faults_of_members(rows, by_group, cells):
    """Faults of names that are no cell and no group, and of a start stated for a whole group."""
    for k, row in enumerate(rows):
        member = row["cell"]
        if None not in (cells, member) and member not in cells and member not in by_group:
            yield WiringFault(k, "cell", member, "a cell of cells.tsv or a group of this sheet")
        if member in by_group and row.get("initial_soc") is not None:
            wanted = f"blank: {member} is a group, whose cells state their own"
            yield WiringFault(k, "initial_soc", row["initial_soc"], wanted)


def _faults_of_packs(rows, by_group):
    """Faults of groups that lie in themselves, and of members that lie twice in one pack."""
    members = _members_of(rows, by_group)
    inner = {name for names in members.values() for name in names if name in members}
    circling = set()
    for name in (name for name in members if name in inner and name not in circling):
        circle = _circle(name, members)
        circling |= set(circle)
        if circle:
            k = next(k for k in by_group[name] if rows[k]["cell"] in circle)
            wanted = f"no group that lies in itself: {' in '.join(reversed(circle))}"
            yield WiringFault(k, "cell", rows[k]["cell"], wanted)
    # Only outermost groups: an inner one's cells would be told again for each that holds it.
    twice = {}
    for pack in (name for name in members if name not in inner or name in circling):
        for fault in _twice(pack, _groups_below(pack, members), rows, by_group):
            twice.setdefault(fault.row, fault)
    yield from twice.values()


def _circle(group, members):
    """Names from a group down to itself again, [] where no way leads back to it."""
    above, waiting = {}, [group]
    while waiting:
        name = waiting.pop()
        for member in (m for m in members[name] if m in members and m not in above):
            above[member] = name
            waiting.append(member)
    if group not in above:
        return []
    way = [group, above[group]]
    while way[-1] != group:
        way.append(above[way[-1]])
    return way[::-1]


def _twice(pack, groups, rows, by_group):
    """A fault of each member that another row of these groups has named before."""
    first = {}
    for k in (k for name in groups for k in by_group[name]):
        member = rows[k]["cell"]
        if member in first:
            yield WiringFault(k, "cell", member, f"each once in {pack}", first[member])
        first.setdefault(member, k)
