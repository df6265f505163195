"""Where a fit starts and how far it may go, from the spectrum's own features."""

from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.protocols.impedance.elements import SERIES, SYMBOLS

LOWEST_EXPONENT, HIGHEST_EXPONENT = 0.3, 1.0
# Roles that set a time constant.
SLOW = ("capacitance", "cpe", "time")
# Roots of x^(d+1) = x + 1 spread points evenly over any number of dimensions.
SPREAD_ROUNDS = 60


class Features(NamedTuple):
    """Size of a spectrum.

    smallest : least real part of the capacitive points [Ω]. span : its range [Ω]. largest :
    largest modulus [Ω]. lowest, highest : angular frequencies of all points [1/s]; fastest : the
    highest of a capacitive one. warburg : Y0 that the lowest frequency alone gives [S·s^½].
    leads : inductance that the highest alone gives [H].
    """

    smallest: float
    span: float
    largest: float
    lowest: float
    highest: float
    fastest: float
    warburg: float
    leads: float


def features(frequency_hertz, impedance_ohm):
    """Features of a spectrum that has a capacitive part: (n,) [Hz], (n,) complex [Ω]."""
    omega = 2 * np.pi * frequency_hertz
    capacitive = impedance_ohm.imag < 0
    real = impedance_ohm.real[capacitive]
    largest = float(np.abs(impedance_ohm).max())
    lowest, highest = float(omega.min()), float(omega.max())
    tail = max(abs(float(impedance_ohm.imag[omega.argmin()])), 1e-6 * largest)
    leads = max(abs(float(impedance_ohm.imag[omega.argmax()])), 1e-6 * largest) / highest
    return Features(
        smallest=float(real.min()),
        span=max(float(real.max() - real.min()), 1e-6 * largest),
        largest=largest,
        lowest=lowest,
        highest=highest,
        fastest=float(omega[capacitive].max()),
        warburg=1 / (np.sqrt(lowest) * tail),
        leads=leads,
    )


def limits(circuit, size):
    """Limits of the parameters (p,) each, in units of the spectrum's own size."""
    ends = {
        "resistance": (1e-4 * min(size.span, size.smallest), 100 * size.largest),
        "series": (size.smallest / 100, size.largest),
        "capacitance": (1e-9 / size.largest, 1e9 / size.largest),
        "inductance": (size.leads * 1e-4, size.leads * 1e2),
        "cpe": (1e-6 / size.largest, 1e9 / size.largest),
        "exponent": (LOWEST_EXPONENT, HIGHEST_EXPONENT),
        "warburg": (size.warburg * 1e-3, size.warburg * 1e4),
        "time": (1e-2 / size.highest, 1e3 / size.lowest),
    }
    return np.array([ends[role] for role in _roles(circuit)]).T


def draws(circuit, size, *, number):
    """Starts (s, p): resistances and time constants spread over what the spectrum shows.

    The first is the middle of all; each later one a point of an even, fixed sequence, so that the
    same spectrum gives the same starts. Arcs take turns along the frequency axis, first come, fast.
    """
    roles = _roles(circuit)
    share = _even(number, len(roles))
    found = np.empty((number, len(roles)))
    slow = [k for k, role in enumerate(roles) if role in SLOW]
    rate = _rates(size, share[:, slow])
    for k, role in enumerate(roles):
        found[:, k] = _drawn(role, size, share[:, k])
        if k in slow:
            rates = rate[:, slow.index(k)]
            middle = size.span * np.power(10.0, share[:, k - 1] - 1)
            power = np.power(rates, 0.75 if role == "cpe" else 1.0)
            found[:, k] = 1 / rates if role == "time" else 1 / (middle * power)
    return found


def _drawn(role, size, share):
    if role == "exponent":
        return 0.6 + 0.3 * share
    if role == "series":
        return size.smallest * (0.6 + 0.4 * share)
    around = {
        "resistance": (size.span, 1.5 * share - 1.2),
        "inductance": (size.leads, 0.5 * share - 0.25),
        "warburg": (size.warburg, 1.5 * share - 0.5),
    }
    middle, decades = around.get(role, (1.0, share))
    return middle * np.power(10.0, decades)


def _rates(size, share):
    """Angular frequencies of the capacitive elements: each in its own stretch of the axis.

    The first named is the fastest in one start, the slowest in the next.
    """
    number = share.shape[1]
    forwards, odd = np.arange(number), np.arange(len(share))[:, None] % 2
    place = (np.where(odd, forwards[::-1], forwards) + share) / max(number, 1)
    return np.exp(np.log(size.fastest) + place * np.log(size.lowest / size.fastest))


@cache
def _even(number, dimensions):
    """Evenly spread points (number, dimensions) in 0…1, the first in the middle."""
    ratio = 1.5
    for _ in range(SPREAD_ROUNDS):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = np.power(1 / ratio, np.arange(1, dimensions + 1))
    return (0.5 + np.arange(number)[:, None] * steps) % 1


@cache
def _roles(circuit):
    """As the circuit's, a resistance in series with all else told apart."""
    own = series_resistance(circuit)
    return tuple("series" if k == own else role for k, role in enumerate(circuit.roles))


def series_resistance(circuit):
    """Place of the first resistance that the whole current passes; None where there is none."""
    through, waiting = [], [len(circuit.kinds) - 1]
    while waiting:
        node = waiting.pop()
        if circuit.kinds[node] == SERIES:
            waiting += [circuit.left[node], circuit.right[node]]
        if circuit.kinds[node] == SYMBOLS["R"]:
            through.append(circuit.at[node])
    return min(through, default=None)
