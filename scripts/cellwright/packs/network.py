"""The resistive network of a pack at one moment: Thevenin equivalents up the wiring, currents down.

At a moment every cell is a source behind a resistance, V = E + Z·I (current positive on charge).
Series members add E and Z; members on one busbar add conductances. On a ladder the members lie one
after the other along two bars with a resistance from each to the next: the part of the ladder
behind a link is itself a source behind a resistance, so that one walk from the far end to the leads
and one back solve it exactly, without a matrix.
"""

from collections import Counter
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

SERIES, STAR, LADDER, OPPOSITE = range(4)


class Network(NamedTuple):
    """A wiring as arrays. Elements are the cells, in the order of the leaves, then the groups.

    cells : how many. connection : (groups,) SERIES, STAR, LADDER or OPPOSITE (leads at the two
    ends), a group after all groups within it, the whole last. first : (groups + 1,) where a
    group's members begin. member : (m,) element. contact_ohm, link_ohm : (m,) [ohm].
    share : (cells,) of the total current by capacity [1]. names : of the groups.
    """

    cells: int
    connection: np.ndarray
    first: np.ndarray
    member: np.ndarray
    contact_ohm: np.ndarray
    link_ohm: np.ndarray
    share: np.ndarray
    names: tuple


class Reduced(NamedTuple):
    """Every element as a source behind a resistance, and how links divide currents.

    source_volt, resistance_ohm : (elements,), the last the whole pack. onward : (m, 3): what flows
    on through the link before a member: onward[0] + onward[1]·(what reaches the member before) +
    onward[2]·(all that flows through the ladder).
    """

    source_volt: np.ndarray
    resistance_ohm: np.ndarray
    onward: np.ndarray


def network_of(wiring, capacity_ampere_hour):
    """A wiring as arrays.

    Parameters
    ----------
    wiring : Wiring. capacity_ampere_hour : (cells,) in the order of the leaves [Ah].

    Raises
    ------
    Refusal : another number of capacities than of cells, a cell twice, a resistance below zero, or
        another connection than "parallel" and "series".
    """
    parts = {"connection": [], "first": [0], "member": [], "contact": [], "link": []}
    parts |= {"group": [], "cell": []}
    _walk(wiring, len(capacity_ampere_hour), parts)
    names = parts["cell"]
    if len(names) != len(capacity_ampere_hour):
        raise Refusal(
            f"{wiring.name} has {len(names)} cells, but {len(capacity_ampere_hour)} have models"
        )
    if len(set(names)) < len(names):
        twice = sorted(name for name, times in Counter(names).items() if times > 1)
        raise Refusal(f"{wiring.name} names a cell twice: {', '.join(twice)}")
    first, member = (np.array(parts[name], np.int64) for name in ("first", "member"))
    connection = np.array(parts["connection"], np.int64)
    return Network(
        cells=len(names),
        connection=connection,
        first=first,
        member=member,
        contact_ohm=np.array(parts["contact"], float),
        link_ohm=np.array(parts["link"], float),
        share=_shares(len(names), connection, first, member, capacity_ampere_hour),
        names=tuple(parts["group"]),
    )


def _walk(wiring, cells, parts):
    """Number the cells and groups below a group and itself, children first: its element."""
    members = []
    for inner in wiring.members:
        if isinstance(inner, str):
            members.append(len(parts["cell"]))
            parts["cell"].append(inner)
        else:
            members.append(_walk(inner, cells, parts))
    _check(wiring)
    code = SERIES if wiring.connection == "series" else STAR
    if code == STAR and any(wiring.link_ohm):
        code = OPPOSITE if wiring.terminals == "opposite_ends" else LADDER
    parts["connection"].append(code)
    parts["group"].append(wiring.name)
    parts["member"] += members
    parts["first"].append(len(parts["member"]))
    parts["contact"] += wiring.contact_ohm
    parts["link"] += wiring.link_ohm
    return cells + len(parts["connection"]) - 1


def _check(wiring):
    if wiring.connection not in ("parallel", "series"):
        raise Refusal(
            f"{wiring.name} is connected as {wiring.connection!r}; wanted is parallel or series"
        )
    if not len(wiring.members) == len(wiring.contact_ohm) == len(wiring.link_ohm) > 0:
        counts = f"{len(wiring.members)} members, {len(wiring.contact_ohm)} contacts"
        raise Refusal(f"{wiring.name} has {counts} and {len(wiring.link_ohm)} links; one each")
    least = min(*wiring.contact_ohm, *wiring.link_ohm)
    if not least >= 0:
        raise Refusal(f"{wiring.name} has a contact or link of {least} ohm; it must not be below 0")


def _shares(cells, connection, first, member, capacity):
    """Share of each cell in the total current, by capacity at every division (cells,)."""
    elements = np.concatenate([np.asarray(capacity, float), np.zeros(len(connection))])
    for node, code in enumerate(connection):
        # What a group takes until its first member is full.
        inner = elements[member[first[node] : first[node + 1]]]
        elements[cells + node] = inner.min() if code == SERIES else inner.sum()
    share = np.ones(len(elements))
    for node in reversed(range(len(connection))):
        ids = member[first[node] : first[node + 1]]
        # Members in series all carry the whole current.
        whole = 1.0 if connection[node] == SERIES else elements[ids] / elements[ids].sum()
        share[ids] = share[cells + node] * whole
    return share[:cells]


def reduced(network, source_volt, resistance_ohm):
    """Every group of the pack as a source behind a resistance.

    Parameters
    ----------
    network : Network. source_volt, resistance_ohm : (cells,) E and Z of each cell [V], [ohm].

    Raises
    ------
    Refusal : a parallel member without any resistance.

    Source: Kirchhoff's laws; Thevenin's theorem, L. Thévenin, C. R. Acad. Sci. 97 (1883) 159.
    """
    groups = len(network.connection)
    source = np.concatenate([source_volt, np.zeros(groups)])
    resistance = np.concatenate([resistance_ohm, np.zeros(groups)])
    onward = np.zeros((len(network.member), 3))
    for node, code in enumerate(network.connection):
        rows = slice(network.first[node], network.first[node + 1])
        ids = network.member[rows]
        e, z = source[ids], resistance[ids] + network.contact_ohm[rows]
        at = network.cells + node
        if code == SERIES or len(ids) == 1:
            # Of a single member its current is all there is, also where it has no resistance.
            source[at], resistance[at] = e.sum(), z.sum()
            continue
        if not z.min() > 0:
            raise no_resistance(network, node, int(np.argmin(z)))
        if code == STAR:
            source[at], resistance[at] = star(e, z)
        else:
            # With leads at opposite ends current flows on one bar towards a lead, on the other
            # away from it; with both at one end the two bars act as one resistance.
            half = 0.5 * network.link_ohm[rows] if code == OPPOSITE else np.zeros(len(ids))
            found = _ladder(e, z, network.link_ohm[rows], half)
            source[at], resistance[at], onward[rows] = found
    return Reduced(source, resistance, onward)


def star(source_volt, resistance_ohm):
    """Members on one busbar as one source behind one resistance: (E, Z) [V], [ohm].

    By differences to the first member: the millivolts that divide currents stay exact.

    Parameters
    ----------
    source_volt, resistance_ohm : (m,) E and Z of each with its contact [V], [ohm].
    """
    conductance, first = 1.0 / resistance_ohm, source_volt[0]
    whole = 1.0 / conductance.sum()
    return first + conductance @ (source_volt - first) * whole, whole


def no_resistance(network, group, member):
    """What to raise where a member of a group (indices) has no resistance: its current is any."""
    return Refusal(
        f"member {member + 1} of {network.names[group]} has no resistance at this moment; its cell "
        "or its contact needs one that acts at once"
    )


def _ladder(e, z, link, half):
    """A ladder as source and resistance, and `Reduced.onward` of its members.

    The part from a member on has v = a + b·J + d·T, with J what flows into that part and T what
    flows through the whole ladder, and lies s0 + s1·J + s2·T below the other lead's end.
    """
    # From the far end to the leads: there, J is the last member's own current.
    a, b, d, s0, s1, s2 = e[-1], z[-1], 0.0, 0.0, 0.0, 0.0
    onward = np.zeros((len(e), 3))
    for k in range(len(e) - 1, 0, -1):
        behind, d = b + link[k], d - half[k]
        s1, s2 = s1 - half[k], s2 + half[k]
        b = 1.0 / (1.0 / z[k - 1] + 1.0 / behind)
        inward = b / behind
        before = a
        a = a + (1.0 - inward) * (e[k - 1] - a)
        onward[k] = (a - before) / behind, inward, (inward - 1.0) * d / behind
        s0, s1, s2 = s0 + s1 * onward[k, 0], s1 * onward[k, 1], s2 + s1 * onward[k, 2]
        d = inward * d
    return a + s0, b + d + s1 + s2, onward


def currents(network, reduced, total_ampere):
    """Current through each element of the pack (elements,) [A], the last the total.

    Parameters
    ----------
    network : Network. reduced : Reduced. total_ampere : positive on charge [A].
    """
    current = np.zeros(len(reduced.source_volt))
    current[-1] = total_ampere
    for node in reversed(range(len(network.connection))):
        rows = slice(network.first[node], network.first[node + 1])
        ids, through = network.member[rows], current[network.cells + node]
        if network.connection[node] == SERIES or len(ids) == 1:
            current[ids] = through
        elif network.connection[node] == STAR:
            e, z = reduced.source_volt[ids], reduced.resistance_ohm[ids] + network.contact_ohm[rows]
            at = network.cells + node
            # The bar's voltage over the first member's source, then each current by Ohm's law.
            rise = reduced.source_volt[at] - e[0] + reduced.resistance_ohm[at] * through
            current[ids] = (rise - (e - e[0])) / z
        else:
            current[ids] = _along(reduced.onward[rows], through)
    return current


def _along(onward, through):
    """Currents of the members of a ladder, by what flows on through each link."""
    reaching = np.zeros(len(onward) + 1)
    reaching[0] = through
    for k in range(1, len(onward)):
        reaching[k] = onward[k] @ (1.0, reaching[k - 1], through)
    return reaching[:-1] - reaching[1:]


def sensed_element(wiring, network):
    """Element of a Wiring's Network at whose terminals the pack's voltage is measured."""
    if wiring.sense is None:
        return network.cells + len(network.connection) - 1
    return int(network.member[network.first[-2] + wiring.sense])
