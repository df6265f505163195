"""The elements of equivalent circuits: what each is called, its parameters, its impedance."""

from typing import NamedTuple

import numpy as np

# An argument beyond which tanh and coth are 1 to the last digit.
LARGE = 20.0


class Element(NamedTuple):
    """A kind of element.

    symbol : as in a circuit's text. parameters : suffixes of their names with the unit. roles :
    what each parameter is (keys of `starts.LIMITS`). meaning : in words.
    """

    symbol: str
    parameters: tuple
    roles: tuple
    meaning: str


# In the order of the numbers by which the kernel knows them: SERIES, PARALLEL, then these.
SERIES, PARALLEL, FIRST = 0, 1, 2
ELEMENTS = (
    Element("R", ("ohm",), ("resistance",), "resistance R"),
    Element("C", ("farad",), ("capacitance",), "capacitance 1/(jωC)"),
    Element("L", ("henry",), ("inductance",), "inductance jωL"),
    Element("CPE", ("t", "p"), ("cpe", "exponent"), "constant-phase element 1/(T (jω)^P)"),
    Element("W", ("y0",), ("warburg",), "semi-infinite diffusion 1/(Y0 √(jω))"),
    Element(
        "FLW",
        ("ohm", "second"),
        ("resistance", "time"),
        "finite-length (short) Warburg R tanh(√(jωτ))/√(jωτ)",
    ),
    Element(
        "FSW",
        ("ohm", "second"),
        ("resistance", "time"),
        "finite-space (open) Warburg R coth(√(jωτ))/√(jωτ)",
    ),
    Element("G", ("ohm", "second"), ("resistance", "time"), "Gerischer R/√(1 + jωτ)"),
)
SYMBOLS = {element.symbol: FIRST + k for k, element in enumerate(ELEMENTS)}


def element_of(kind):
    """The Element with a kernel's number."""
    return ELEMENTS[kind - FIRST]


def impedance_and_slopes(kind, omega, values):
    """Impedance of one element, and its derivatives by the logarithms of its parameters.

    Parameters
    ----------
    kind : number of the element, see SYMBOLS. omega : (n,) angular frequency [1/s].
    values : its parameters, in the units of their names.

    Returns
    -------
    impedance : (n,) complex [Ω]. slopes : tuple of (n,) complex [Ω], one per parameter.

    Source: A. Lasia, Electrochemical Impedance Spectroscopy and its Applications (2014): CPE
    eq. 8.9, semi-infinite and finite diffusion ch. 4, Gerischer eq. 9.36.
    """
    return FORMULAS[element_of(kind).symbol](np.asarray(omega, float), *values)


def _resistance(omega, r):
    impedance = np.full(len(omega), r, complex)
    return impedance, (impedance,)


def _capacitance(omega, c):
    impedance = -1j / (omega * c)
    return impedance, (-impedance,)


def _inductance(omega, henry):
    impedance = 1j * omega * henry
    return impedance, (impedance,)


def _constant_phase(omega, t, p):
    angle = p * np.pi / 2
    impedance = np.exp(-p * np.log(omega)) / t * (np.cos(angle) - 1j * np.sin(angle))
    return impedance, (-impedance, -impedance * p * (np.log(omega) + 0.5j * np.pi))


def _warburg(omega, y0):
    impedance = (1 - 1j) / (y0 * np.sqrt(2 * omega))
    return impedance, (-impedance,)


def _finite_length(omega, r, tau):
    x = np.sqrt(omega * tau / 2)
    return _finite(r, x, _tanh(x))


def _finite_space(omega, r, tau):
    x = np.sqrt(omega * tau / 2)
    return _finite(r, x, 1 / _tanh(x))


def _finite(r, x, wave):
    """R·wave/u with u = x + jx, and its slopes; wave is tanh or coth of u."""
    u = x * (1 + 1j)
    impedance = r * wave / u
    return impedance, (impedance, r / 2 * (1 - wave**2 - wave / u))


def _tanh(x):
    """tanh(x + jx), without overflow."""
    twice = 2 * np.minimum(x, LARGE)
    below = np.cosh(twice) + np.cos(twice)
    return np.where(x > LARGE, 1.0, (np.sinh(twice) + 1j * np.sin(twice)) / below)


def _gerischer(omega, r, tau):
    inside = 1 + 1j * omega * tau
    impedance = r / np.sqrt(inside)
    return impedance, (impedance, -impedance / 2 * (1j * omega * tau) / inside)


FORMULAS = {
    "R": _resistance,
    "C": _capacitance,
    "L": _inductance,
    "CPE": _constant_phase,
    "W": _warburg,
    "FLW": _finite_length,
    "FSW": _finite_space,
    "G": _gerischer,
}
