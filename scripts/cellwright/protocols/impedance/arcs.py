"""Arcs of a fitted circuit, which of them is charge transfer, and the columns that come of it."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.impedance.circuits import (
    PARALLEL,
    SERIES,
    SYMBOLS,
    circuit_impedance,
    parse,
    series_resistance,
)
from cellwright.protocols.impedance.drt import RIPPLE

CAPACITIVE = {SYMBOLS["CPE"], SYMBOLS["C"]}
DIFFUSION = {SYMBOLS["W"], SYMBOLS["FLW"], SYMBOLS["FSW"], SYMBOLS["G"]}

# Parameter, by its place in the element, that says how much there is of it; finite diffusion whose
# time is not known is not seen to be finite.
SIZE = {SYMBOLS[symbol]: 0 for symbol in "RLW"} | {SYMBOLS[s]: 1 for s in ("FLW", "FSW", "G")}
VAGUE = 0.5  # of its value: what has a larger deviation is not known


class Arc(NamedTuple):
    """A capacitance parallel to a branch with a resistance, as places among the parameters.

    t, p : of the capacitance (p is None for a plain one). r : resistances of the other branch.
    """

    t: int
    p: int | None
    r: tuple


def arcs(circuit):
    """Arcs of a circuit (its text or tree), in the order of their parameters: list of Arc."""
    tree = parse(circuit) if isinstance(circuit, str) else circuit
    candidates = [
        _arc(tree, *sides)
        for kind, first, second in zip(tree.kinds, tree.left, tree.right, strict=True)
        if kind == PARALLEL
        for sides in ((first, second), (second, first))
    ]
    return sorted((arc for arc in candidates if arc is not None), key=lambda arc: arc.t)


def _arc(tree, capacitive, branch):
    """Arc of two parallel branches; None unless the first is a capacitance, the other has an R."""
    resistances = _in_series(tree, branch, {SYMBOLS["R"]})
    if tree.kinds[capacitive] not in CAPACITIVE or not resistances:
        return None
    first_parameter = tree.at[capacitive]
    exponent = first_parameter + 1 if tree.kinds[capacitive] == SYMBOLS["CPE"] else None
    return Arc(first_parameter, exponent, tuple(tree.at[k] for k in resistances))


def characteristic_frequency(arc, values):
    """Frequency at the top of an arc, (1/(R·T))^(1/P)/2π [Hz], at parameters `values` (p,)."""
    r = sum(values[k] for k in arc.r)
    power = 1.0 if arc.p is None else values[arc.p]
    return float((1 / (r * values[arc.t])) ** (1 / power) / (2 * np.pi))


def tops(fit):
    """Arcs of a fitted circuit with their characteristic frequency [Hz], slowest first: list."""
    pairs = [(characteristic_frequency(arc, fit.values), arc) for arc in arcs(fit.circuit)]
    return sorted(pairs, key=lambda pair: pair[0])


def tail_hertz(fit, frequency_hertz):
    """Frequency [Hz] below which a fitted spectrum is a tail, 0 where it ends in an arc.

    Between the arcs and the tail of diffusion the imaginary part has its valley: what acts below is
    diffusion, though a circuit may write it as an arc.

    frequency_hertz : (n,) that were fitted.
    """
    frequency = np.sort(frequency_hertz)
    height = -circuit_impedance(fit.circuit, frequency, fit.values).imag
    # From the slow end: down the tail to its valley, and up the next arc. Above the top of all
    # there is none, but the leads' inductance.
    capacitive = np.flatnonzero(height > 0)[-1:]
    rising = np.flatnonzero(np.diff(height[: capacitive.sum() + 1]) > 0)
    return float(frequency[rising[0]]) if len(rising) and rising[0] else 0.0


def charge_transfer(fit, near_hertz):
    """Arc of charge transfer, the one whose top is nearest; None without arcs.

    near_hertz : where it is, see `slowest_arc_hertz`; NaN where it is not known: the slowest.
    """
    return _nearest(fit, near_hertz)[1]


def charge_transfer_hertz(fit, near_hertz):
    """Top of that arc [Hz]; NaN without arcs."""
    return _nearest(fit, near_hertz)[0]


def _nearest(fit, near_hertz):
    """Top [Hz] and arc; NaN and None without arcs."""
    pairs = tops(fit) or [(np.nan, None)]
    if not near_hertz > 0:
        return pairs[0]
    return min(pairs, key=lambda pair: abs(np.log(pair[0] / near_hertz)))


def slowest_arc_hertz(fit, frequency_hertz):
    """Top of the slowest arc that is known and not in the tail of diffusion [Hz]; NaN without arcs.

    frequency_hertz : (n,) that were fitted.
    """
    tail = tail_hertz(fit, frequency_hertz)
    above = [(top, arc) for top, arc in tops(fit) if top > tail] or tops(fit)
    whole = sum(fit.values[arc.r[0]] for _, arc in above)
    known = [top for top, arc in above if _is_known(fit, arc.r[0], RIPPLE * whole)]
    return min(known or [top for top, _ in above], default=np.nan)


def _is_known(fit, place, least):
    """Whether a parameter is more than noise may make, and known to better than half."""
    value = fit.values[place]
    return value > least and fit.std[place] <= VAGUE * value


def vaguest_element(fit):
    """Name of the parameter that says how much there is of the least known element; None where all
    are known. The resistance in series is none of them."""
    tree, share = parse(fit.circuit), fit.std / fit.values
    series = series_resistance(tree)
    unknown = [
        (share[at + SIZE[kind]], fit.names[at + SIZE[kind]])
        for at, kind in zip(tree.at, tree.kinds, strict=True)
        if kind in SIZE and at != series and share[at + SIZE[kind]] > VAGUE
    ]
    return max(unknown, default=(0.0, None))[1]


def contract(fit, near_hertz=np.nan):
    """Columns of the results contract from any circuit: dict of each value and its `_std`.

    r_ohmic_ohm is the resistance that all current passes; r_charge_transfer_ohm, cpe_t and cpe_p
    are those of the arc of charge transfer (a plain capacitance has the exponent 1); warburg_y0
    that of the first semi-infinite diffusion; r_before_diffusion_ohm that of r_ohmic_ohm, charge
    transfer and all faster arcs. NaN for what the circuit does not have.

    near_hertz : as of `charge_transfer`.
    """
    tree, arc = parse(fit.circuit), charge_transfer(fit, near_hertz)
    diffusion = _parameters_of(tree, {SYMBOLS["W"]})
    places = {
        "r_ohmic_ohm": series_resistance(tree),
        "r_charge_transfer_ohm": arc.r[0] if arc else None,
        "cpe_t": arc.t if arc else None,
        "cpe_p": arc.p if arc else None,
        "warburg_y0": diffusion[0] if diffusion else None,
        "inductance_henry": tree.roles.index("inductance") if "inductance" in tree.roles else None,
    }
    row = {}
    for name, index in places.items():
        row[name] = np.nan if index is None else float(fit.values[index])
        row[f"{name}_std"] = np.nan if index is None else float(fit.std[index])
    ohm, std = _before_diffusion(fit, near_hertz)
    row |= {"r_before_diffusion_ohm": ohm, "r_before_diffusion_ohm_std": std}
    return row | ({"cpe_p": 1.0} if arc and arc.p is None else {})


def _before_diffusion(fit, near_hertz):
    """Resistance in series and of all arcs down to charge transfer, and its deviation [Ω].

    Their sum is known better than each: what one arc has less the next has more.
    """
    hertz = charge_transfer_hertz(fit, near_hertz)
    places = [arc.r[0] for top, arc in tops(fit) if top >= hertz]
    series = series_resistance(parse(fit.circuit))
    if not places or series is None:
        return np.nan, np.nan
    places = [series, *places]
    spread = fit.correlation[np.ix_(places, places)] * np.outer(fit.std[places], fit.std[places])
    return float(fit.values[places].sum()), float(np.sqrt(spread.sum()))


def why_inseparable(fit, near_hertz=np.nan):
    """Why charge transfer and diffusion cannot be told apart; empty where they can, or where the
    circuit lacks one of the two.

    near_hertz : as of `charge_transfer`.
    """
    tree, arc = parse(fit.circuit), charge_transfer(fit, near_hertz)
    diffusion = _parameters_of(tree, DIFFUSION)
    if arc is None or not diffusion:
        return ""
    r = arc.r[0]
    share = fit.std[r] / fit.values[r]
    if share > VAGUE:
        return f"{fit.names[r]} is known to {share:.0%} only"
    for k in (r, *diffusion):
        if not fit.std[k] > 0:  # at a limit, or not determined
            return f"{fit.names[k]} is not told"
    correlations = [abs(fit.correlation[r, k]) for k in diffusion]
    # Two parameters that move together like this are one number in the data, not two.
    if not max(correlations) > 0.9:
        return ""
    closest = fit.names[diffusion[int(np.argmax(correlations))]]
    return f"{fit.names[r]} and {closest} are correlated by {max(correlations):.2f}"


def _parameters_of(tree, kinds):
    """Places of the first parameter of each element of these kinds."""
    return [index for index, kind in zip(tree.at, tree.kinds, strict=True) if kind in kinds]


def _in_series(tree, node, kinds):
    """Elements of these kinds that all current of a branch passes."""
    if tree.kinds[node] == SERIES:
        sides = (tree.left[node], tree.right[node])
        return [element for side in sides for element in _in_series(tree, side, kinds)]
    return [node] if tree.kinds[node] in kinds else []
