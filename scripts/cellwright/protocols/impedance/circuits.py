"""Equivalent circuits of spectra as data: elements, grammar, constraints, impedance, slopes."""

import re
from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

# Impedance of each element (n,) complex [Ω] at angular frequencies omega (n,) [1/s], and a tuple of
# its derivatives by the logarithms of its parameters. Source: A. Lasia, Electrochemical Impedance
# Spectroscopy and its Applications (2014): CPE eq. 8.9, diffusion ch. 4, Gerischer eq. 9.36.


def _resistance(omega, r):
    """Resistance R [Ω], and its slopes."""
    impedance = np.full(len(omega), r, complex)
    return impedance, (impedance,)


def _capacitance(omega, c):
    """Capacitance 1/(jωC) [Ω], and its slopes."""
    impedance = -1j / (omega * c)
    return impedance, (-impedance,)


def _inductance(omega, henry):
    """Inductance jωL [Ω], and its slopes."""
    impedance = 1j * omega * henry
    return impedance, (impedance,)


def _constant_phase(omega, t, p):
    """Constant-phase element 1/(T (jω)^P) [Ω], and its slopes."""
    angle = p * np.pi / 2
    impedance = np.exp(-p * np.log(omega)) / t * (np.cos(angle) - 1j * np.sin(angle))
    return impedance, (-impedance, -impedance * p * (np.log(omega) + 0.5j * np.pi))


def _warburg(omega, y0):
    """Semi-infinite diffusion 1/(Y0 √(jω)) [Ω], and its slopes."""
    impedance = (1 - 1j) / (y0 * np.sqrt(2 * omega))
    return impedance, (-impedance,)


def _finite_length(omega, r, tau):
    """Finite-length (short) Warburg R tanh(√(jωτ))/√(jωτ) [Ω], and its slopes."""
    x = np.sqrt(omega * tau / 2)
    return _finite(r, x, _tanh(x))


def _finite_space(omega, r, tau):
    """Finite-space (open) Warburg R coth(√(jωτ))/√(jωτ) [Ω], and its slopes."""
    x = np.sqrt(omega * tau / 2)
    return _finite(r, x, 1 / _tanh(x))


def _finite(r, x, wave):
    """Impedance R·wave/u with u = x + jx [Ω], and its slopes; wave is tanh or coth of u."""
    u = x * (1 + 1j)
    impedance = r * wave / u
    return impedance, (impedance, r / 2 * (1 - wave**2 - wave / u))


def _tanh(x):
    """tanh(x + jx), without overflow."""
    # Beyond 20 tanh and coth are 1 to the last digit.
    twice = 2 * np.minimum(x, 20.0)
    below = np.cosh(twice) + np.cos(twice)
    return np.where(x > 20.0, 1.0, (np.sinh(twice) + 1j * np.sin(twice)) / below)


def _gerischer(omega, r, tau):
    """Gerischer R/√(1 + jωτ) [Ω], and its slopes."""
    inside = 1 + 1j * omega * tau
    impedance = r / np.sqrt(inside)
    return impedance, (impedance, -impedance / 2 * (1j * omega * tau) / inside)


class Element(NamedTuple):
    """A kind of circuit element.

    symbol : as in a circuit's text. parameters : suffixes of their names with the unit. roles :
    what each parameter is (keys in `fit.parameter_limits`). formula : its impedance and slopes.
    """

    symbol: str
    parameters: tuple
    roles: tuple
    formula: Callable


# In the order of the numbers by which the kernel knows them: SERIES, PARALLEL, then these.
SERIES, PARALLEL, FIRST = 0, 1, 2
ELEMENTS = (
    Element("R", ("ohm",), ("resistance",), _resistance),
    Element("C", ("farad",), ("capacitance",), _capacitance),
    Element("L", ("henry",), ("inductance",), _inductance),
    Element("CPE", ("t", "p"), ("cpe", "exponent"), _constant_phase),
    Element("W", ("y0",), ("warburg",), _warburg),
    Element("FLW", ("ohm", "second"), ("resistance", "time"), _finite_length),
    Element("FSW", ("ohm", "second"), ("resistance", "time"), _finite_space),
    Element("G", ("ohm", "second"), ("resistance", "time"), _gerischer),
)
SYMBOLS = {element.symbol: FIRST + k for k, element in enumerate(ELEMENTS)}

THESIS = "R-(CPE|(R-W))"
THESIS_NAMES = ("r_ohmic_ohm", "cpe_t", "cpe_p", "r_charge_transfer_ohm", "warburg_y0")
LEADS, BENT_LEADS = "L", "(L|R)"  # eddy currents shunt an inductance: its tail bends over
# The thesis' circuit has the names of the results contract; with the leads' inductance as well.
NAMED = {
    THESIS: THESIS_NAMES,
    f"{LEADS}-{THESIS}": ("inductance_henry", *THESIS_NAMES),
    f"{BENT_LEADS}-{THESIS}": ("inductance_henry", "lead_ohm", *THESIS_NAMES),
}
TOKEN = re.compile(r"[A-Z]+|[-|()]")


class Circuit(NamedTuple):
    """A circuit as a tree whose nodes stand in one row, children before their parent.

    text : as written, without blanks. kinds : (m,) SERIES, PARALLEL or number of the element.
    left, right : (m,) children of a node that joins two, −1 for an element. at : (m,) place of an
    element's first parameter. names : of the parameters. roles : what each is, see `Element`.
    """

    text: str
    kinds: tuple
    left: tuple
    right: tuple
    at: tuple
    names: tuple
    roles: tuple


@cache
def parse(text):
    """Circuit of a text: `-` is in series, `|` in parallel, brackets group.

    text : such as "R-(CPE|(R-W))"; elements R, C, L, CPE, W, FLW (finite-length Warburg), FSW
        (finite-space Warburg), G (Gerischer).

    Returns circuit: Circuit. Parameters are named by element, number and unit (`r1_ohm`,
    `cpe2_p`); those of the thesis' circuit as the results contract names them. Raises Refusal: an
    unknown element, brackets that do not match, `-` and `|` mixed without brackets.
    """
    plain = "".join(text.split())
    tokens = TOKEN.findall(plain)
    if "".join(tokens) != plain or not tokens:
        raise Refusal(f"circuit {text!r} holds what is no element, bracket, '-' or '|'")
    nodes = []
    rest = _parse_terms(tokens, nodes, text)
    if rest:
        raise Refusal(f"circuit {text!r}: {rest[0]!r} where the circuit should end")
    kinds, first_child, second_child = zip(*nodes, strict=True)
    elements = [ELEMENTS[kind - FIRST] if kind >= FIRST else None for kind in kinds]
    counts = [len(element.parameters) if element else 0 for element in elements]
    seen, names = Counter(), []
    for element in filter(None, elements):
        seen[element.symbol] += 1
        stem = f"{element.symbol.lower()}{seen[element.symbol]}"
        names += [f"{stem}_{suffix}" for suffix in element.parameters]
    return Circuit(
        text=plain,
        kinds=kinds,
        left=first_child,
        right=second_child,
        at=tuple(int(n) for n in np.cumsum([0, *counts[:-1]])),
        names=NAMED.get(plain) or tuple(names),
        roles=tuple(role for element in elements if element for role in element.roles),
    )


def _parse_terms(tokens, nodes, text):
    """Remaining tokens after terms joined by one kind of sign, whose nodes are appended."""
    tokens = _parse_term(tokens, nodes, text)
    sign = tokens[0] if tokens and tokens[0] in "-|" else None
    while tokens and tokens[0] in "-|":
        if tokens[0] != sign:
            raise Refusal(f"circuit {text!r} mixes '-' and '|'; brackets must say what comes first")
        first = len(nodes) - 1
        tokens = _parse_term(tokens[1:], nodes, text)
        nodes.append((SERIES if sign == "-" else PARALLEL, first, len(nodes) - 1))
    return tokens


def _parse_term(tokens, nodes, text):
    """Remaining tokens after one element or bracketed circuit, whose nodes are appended."""
    if tokens and tokens[0] == "(":
        rest = _parse_terms(tokens[1:], nodes, text)
        if not rest or rest[0] != ")":
            raise Refusal(f"circuit {text!r}: a bracket is not closed")
        return rest[1:]
    if not tokens or tokens[0] not in SYMBOLS:
        seen = repr(tokens[0]) if tokens else "its end"
        symbols = ", ".join(SYMBOLS)
        raise Refusal(f"circuit {text!r}: found {seen} where an element is wanted ({symbols})")
    nodes.append((SYMBOLS[tokens[0]], -1, -1))
    return tokens[1:]


NUMBER = r"\d+\.?\d*(?:[eE][+-]?\d+)?"
CONSTRAINT = re.compile(rf"(\w+)\s*=\s*(?:({NUMBER})\s*\*\s*)?({NUMBER}|[A-Za-z]\w*)")


def parse_constraints(texts):
    """Fixed and tied parameters of texts, as `fit.fit_circuit` takes them.

    texts : "name = value" fixes a parameter, in its own unit; "name = other" and
        "name = ratio * other" tie it to another.

    Returns fixed: dict, name → value. tied : dict, name → (other name, ratio). Raises Refusal: a
    text of another form.
    """
    fixed, tied = {}, {}
    for text in texts:
        match = CONSTRAINT.fullmatch(text.strip())
        if not match or (match[2] and match[3][0].isdigit()):
            raise Refusal(
                f"constraint {text!r}; wanted is 'name = value' or 'name = ratio * other'"
            )
        name, ratio, right_side = match.groups()
        if right_side[0].isdigit():
            fixed[name] = float(right_side)
        else:
            tied[name] = (right_side, float(ratio or 1))
    return fixed, tied


def series_resistance(circuit):
    """Place of the first resistance that the whole current passes, or None."""
    through, waiting = [], [len(circuit.kinds) - 1]
    while waiting:
        node = waiting.pop()
        if circuit.kinds[node] == SERIES:
            waiting += [circuit.left[node], circuit.right[node]]
        if circuit.kinds[node] == SYMBOLS["R"]:
            through.append(circuit.at[node])
    return min(through, default=None)


def circuit_impedance(circuit, frequency_hertz, values):
    """Impedance of a circuit (n,) [Ω].

    circuit : Circuit, or its text. frequency_hertz : (n,) [Hz].
    values : (p,) in the order and units of the circuit's names.

    Returns impedance: (n,) complex [Ω]; a capacitive arc has a negative imaginary part. ω = 2πf.
    """
    return circuit_slopes(circuit, frequency_hertz, values)[0]


def circuit_slopes(circuit, frequency_hertz, values):
    """Impedance of a circuit and its derivatives by the logarithms of all parameters.

    Upwards through the tree each node's impedance, downwards what a change of it does to the whole:
    nothing but 1 in series, (Z/Zi)² in parallel.

    circuit, frequency_hertz, values : as in `circuit_impedance`.

    Returns impedance: (n,) complex [Ω]. slopes : (p, n) complex [Ω].
    """
    circuit = parse(circuit) if isinstance(circuit, str) else circuit
    omega = 2 * np.pi * np.asarray(frequency_hertz, float)
    nodes, element_slopes = [], {}
    for m, kind in enumerate(circuit.kinds):
        pair = [nodes[child] for child in (circuit.left[m], circuit.right[m]) if child >= 0]
        if kind >= FIRST:
            element, first = ELEMENTS[kind - FIRST], circuit.at[m]
            parameters = values[first : first + len(element.parameters)]
            impedance, element_slopes[m] = element.formula(omega, *parameters)
            nodes.append(impedance)
        else:
            nodes.append(sum(pair) if kind == SERIES else pair[0] * pair[1] / sum(pair))
    return nodes[-1], _downwards(circuit, nodes, element_slopes)


def _downwards(circuit, nodes, element_slopes):
    """Slopes of the whole impedance (p, n) from those of the elements."""
    reach = [1.0] * len(nodes)
    slopes = np.empty((len(circuit.names), len(nodes[-1])), complex)
    for m in range(len(nodes) - 1, -1, -1):
        for child in {circuit.left[m], circuit.right[m]} - {-1}:
            share = (nodes[m] / nodes[child]) ** 2 if circuit.kinds[m] == PARALLEL else 1.0
            reach[child] = reach[m] * share
        for k, slope in enumerate(element_slopes.get(m, ())):
            slopes[circuit.at[m] + k] = reach[m] * slope
    return slopes
