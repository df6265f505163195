"""What a fitted circuit says of the cell: its arcs, and which of its numbers are to be believed."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.impedance.circuits import parse
from cellwright.protocols.impedance.elements import PARALLEL, SERIES, SYMBOLS
from cellwright.protocols.impedance.starts import series_resistance

CAPACITIVE = {SYMBOLS["CPE"], SYMBOLS["C"]}
DIFFUSION = {SYMBOLS["W"], SYMBOLS["FLW"], SYMBOLS["FSW"], SYMBOLS["G"]}
# Two parameters that move together like this are one number in the data, not two.
INSEPARABLE = 0.9
UNCERTAIN = 0.5


class Arc(NamedTuple):
    """A capacitance parallel to a branch with a resistance, by places among the parameters.

    t, p : of the capacitance (p is None for a plain one). r : resistances of the other branch.
    """

    t: int
    p: int | None
    r: tuple


def arcs(circuit):
    """Arcs of a circuit (its text or tree), in the order of their parameters: list of Arc."""
    tree = parse(circuit) if isinstance(circuit, str) else circuit
    found = [
        _arc(tree, *sides)
        for kind, left, right in zip(tree.kinds, tree.left, tree.right, strict=True)
        if kind == PARALLEL
        for sides in ((left, right), (right, left))
    ]
    return sorted((arc for arc in found if arc is not None), key=lambda arc: arc.t)


def _arc(tree, capacitive, other):
    """Arc of two parallel branches; None where the one is no capacitance or the other lacks R."""
    resistances = _in_series(tree, other, {SYMBOLS["R"]})
    if tree.kinds[capacitive] not in CAPACITIVE or not resistances:
        return None
    at = tree.at[capacitive]
    exponent = at + 1 if tree.kinds[capacitive] == SYMBOLS["CPE"] else None
    return Arc(at, exponent, tuple(tree.at[k] for k in resistances))


def characteristic_frequency(arc, values):
    """Frequency at the top of an arc, (1/(R·T))^(1/P)/2π [Hz], at parameters `values` (p,)."""
    r = sum(values[k] for k in arc.r)
    power = 1.0 if arc.p is None else values[arc.p]
    return float((1 / (r * values[arc.t])) ** (1 / power) / (2 * np.pi))


def charge_transfer(fit):
    """The arc that stands for charge transfer: the slowest; None in a circuit without arcs."""
    return min(
        arcs(fit.circuit), key=lambda arc: characteristic_frequency(arc, fit.values), default=None
    )


def contract(fit):
    """Columns of the results contract from any circuit: dict of value and `_std` of each.

    r_ohmic_ohm is the resistance that all current passes; r_charge_transfer_ohm, cpe_t and cpe_p
    are those of the slowest arc; warburg_y0 that of the first semi-infinite diffusion. NaN for what
    the circuit does not have.
    """
    tree, arc = parse(fit.circuit), charge_transfer(fit)
    diffusion = [at for at, kind in zip(tree.at, tree.kinds, strict=True) if kind == SYMBOLS["W"]]
    places = {
        "r_ohmic_ohm": series_resistance(tree),
        "r_charge_transfer_ohm": arc.r[0] if arc else None,
        "cpe_t": arc.t if arc else None,
        "cpe_p": arc.p if arc else None,
        "warburg_y0": diffusion[0] if diffusion else None,
        "inductance_henry": tree.roles.index("inductance") if "inductance" in tree.roles else None,
    }
    row = {}
    for name, at in places.items():
        row[name] = np.nan if at is None else float(fit.values[at])
        row[f"{name}_std"] = np.nan if at is None else float(fit.std[at])
    return row


def confused(fit):
    """Why charge transfer and diffusion cannot be told apart; empty where they can, or where the
    circuit lacks one of the two."""
    tree, arc = parse(fit.circuit), charge_transfer(fit)
    diffusion = [at for at, kind in zip(tree.at, tree.kinds, strict=True) if kind in DIFFUSION]
    if arc is None or not diffusion:
        return ""
    r = arc.r[0]
    for k in (r, *diffusion):
        share = fit.std[k] / fit.values[k]
        if not share <= UNCERTAIN:
            return f"{fit.names[k]} is {f'known to {share:.0%} only' if share > 0 else 'not told'}"
    told = [abs(fit.correlation[r, k]) for k in diffusion]
    other = fit.names[diffusion[int(np.argmax(told))]]
    beyond = max(told) > INSEPARABLE
    return f"{fit.names[r]} and {other} are correlated by {max(told):.2f}" if beyond else ""


def _in_series(tree, node, kinds):
    """Elements of these kinds that all current of a branch passes."""
    if tree.kinds[node] == SERIES:
        sides = (tree.left[node], tree.right[node])
        return [found for side in sides for found in _in_series(tree, side, kinds)]
    return [node] if tree.kinds[node] in kinds else []
