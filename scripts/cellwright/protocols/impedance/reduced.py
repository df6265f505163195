"""A circuit without the elements that a spectrum does not tell: their parameter ends at a limit."""

from cellwright.protocols.impedance.circuits import (
    ELEMENTS,
    FIRST,
    SERIES,
    SYMBOLS,
    parse,
)

SHORT, OPEN, OUT = "short", "open", "out"  # out: of what its neighbours make of it
# What is left of an element at the lower and the upper limit of a parameter (its place in the
# element): nothing that current needs to pass (SHORT), nothing that it passes (OPEN), or another
# element with its value from the parameters. A constant phase of 0.3 is no capacitance, one of 1 a
# plain one; finite diffusion faster than all frequencies is a resistance (or, closed at its end, a
# capacitance), slower than all semi-infinite. The time comes first: it says what the rest means.
AT_LIMIT = {
    "R": {0: (SHORT, OPEN)},
    "C": {0: (OPEN, SHORT)},
    "L": {0: (SHORT, OPEN)},
    "CPE": {1: (OUT, ("C", lambda t, p: t)), 0: (OPEN, SHORT)},
    "W": {0: (OPEN, SHORT)},
    "FLW": {1: (("R", lambda r, tau: r), ("W", lambda r, tau: tau**0.5 / r)), 0: (SHORT, OPEN)},
    "FSW": {
        1: (("C", lambda r, tau: tau / r), ("W", lambda r, tau: tau**0.5 / r)),
        0: (SHORT, OPEN),
    },
    "G": {1: (("R", lambda r, tau: r), ("W", lambda r, tau: tau**0.5 / r)), 0: (SHORT, OPEN)},
}


def reduced(fit, vague=()):
    """The circuit of a fit without what is at a limit, and where its search begins.

    fit : CircuitFit. vague : names of parameters whose elements are taken for none as well, as
    `arcs.vaguest_element` gives them.

    Returns circuit: text, None where nothing would be left; start: dict, name of a parameter →
    value.
    """
    tree = parse(fit.circuit)
    ends = {fit.names.index(name): name in fit.at_upper for name in fit.at_bound}
    places = [fit.names.index(name) for name in vague]
    # An admittance is none where it is large, a time says nothing where it is long.
    ends |= {place: tree.roles[place] in ("warburg", "time") for place in places}
    left = _node(tree, len(tree.kinds) - 1, fit.values, ends)
    if left in (SHORT, OPEN):
        return None, {}
    text, values = _written(left)
    return text, dict(zip(parse(text).names, values, strict=True))


def _node(tree, m, values, ends):
    """What is left of a node: SHORT, OPEN, an element (symbol, values), or (kind, nodes)."""
    kind = tree.kinds[m]
    if kind >= FIRST:
        return _element(tree, m, values, ends)
    # What vanishes in series, and what it takes the whole branch with it; in parallel turned round.
    gone, all_gone = (SHORT, OPEN) if kind == SERIES else (OPEN, SHORT)
    nodes = [_node(tree, child, values, ends) for child in (tree.left[m], tree.right[m])]
    nodes = [gone if node == OUT else node for node in nodes]
    if all_gone in nodes:
        return all_gone
    nodes = [node for node in nodes if node != gone]
    # A chain in a chain is one chain.
    flat = [part for node in nodes for part in (node[1] if node[0] == kind else [node])]
    flat = _joined(flat) if kind == SERIES else flat
    return gone if not flat else flat[0] if len(flat) == 1 else (kind, flat)


def _element(tree, m, values, ends):
    """What is left of an element."""
    element, at = ELEMENTS[tree.kinds[m] - FIRST], tree.at[m]
    own = tuple(float(value) for value in values[at : at + len(element.parameters)])
    for place, limits in AT_LIMIT[element.symbol].items():
        if at + place in ends:
            left = limits[ends[at + place]]
            return left if isinstance(left, str) else (left[0], (left[1](*own),))
    return element.symbol, own


def _joined(chain):
    """A chain with its resistances as one, where the first of them stands."""
    ohm = [part[1][0] for part in chain if part[0] == "R"]
    places = [k for k, part in enumerate(chain) if part[0] == "R"]
    return (
        [
            ("R", (sum(ohm),)) if k == places[0] else part
            for k, part in enumerate(chain)
            if k not in places[1:]
        ]
        if places
        else chain
    )


def _written(node):
    """Text of what is left, and the values in the order of its parameters."""
    kind, content = node
    if kind in SYMBOLS:
        return kind, list(content)
    parts = [_written(part) for part in content]
    # Within a chain a parallel part needs brackets, within a parallel part a chain.
    inner = [
        text if part[0] in SYMBOLS else f"({text})"
        for (text, _), part in zip(parts, content, strict=True)
    ]
    return ("-" if kind == SERIES else "|").join(inner), [v for _, values in parts for v in values]
