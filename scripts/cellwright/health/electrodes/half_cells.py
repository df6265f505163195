"""Potential of electrode materials over lithiation: published fits by name, and blends."""

from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.health.electrodes.names import named_parts
from cellwright.refusal import Refusal

POINTS = 4001  # of a tabulated fit; 0.25 per mille of lithiation
CHARGE_STD = 0.001  # of the capacity: how well the charge of a slow curve tells lithiation


class HalfCell(NamedTuple):
    """Potential of an electrode material against lithium, falling with lithiation.

    name : of the library, or the user's file. lithiation : (n,) rising [1], 0 empty of lithium.
    potential_volt : (n,), falling [V]. source : paper or file.
    Of a blend, parts : (2, n) lithiation of its materials at `potential_volt` [1]; share : of the
    electrode's capacity that the second holds [1]. `at_share` gives it another share.
    """

    name: str
    lithiation: np.ndarray
    potential_volt: np.ndarray
    source: str
    parts: np.ndarray | None = None
    share: float = 0.0


def _graphite_siox_chen(x):
    return (
        1.9793 * np.exp(-39.3631 * x)
        + 0.2482
        - 0.0909 * np.tanh(29.8538 * (x - 0.1234))
        - 0.04478 * np.tanh(14.9159 * (x - 0.2769))
        - 0.0205 * np.tanh(30.4444 * (x - 0.6103))
    )


def _graphite_mohtat(x):
    steps = ((0.0120, 0.127, 0.016), (0.0118, 0.155, 0.016), (0.0095, 0.190, 0.013))
    steps += ((0.0035, 0.220, 0.020), (0.0145, 0.490, 0.020), (0.0800, 1.030, 0.055))
    return 0.063 + 0.8 * np.exp(-75 * (x + 0.001)) - _tanh_sum(x, steps)


def _graphite_ecker(x):
    return (
        0.716502 * np.exp(-369.028 * x)
        + 0.12193 * np.exp(-35.6478 * (x - 0.0530947))
        - 0.0189193 * np.tanh(21.1967 * (x - 0.196176))
        - 0.0169644 * np.tanh(27.1365 * (x - 0.312832))
        - 0.0199313 * np.tanh(28.5697 * (x - 0.614221))
        - 0.931153 * np.exp(36.328 * (x - 1.10743))
        + 0.140031
    )


def _graphite_safari(x):
    return (
        0.6379
        + 0.5416 * np.exp(-305.5309 * x)
        - 0.044 * np.tanh((x - 0.1958) / 0.1088)
        - 0.1978 * np.tanh((x - 1.0571) / 0.0854)
        - 0.6875 * np.tanh((x + 0.0117) / 0.0529)
        - 0.0175 * np.tanh((x - 0.5692) / 0.0875)
    )


def _graphite_marquis(x):
    steps = ((-0.0351, 0.286, 0.083), (0.0045, 0.849, 0.119), (0.035, 0.9233, 0.05))
    steps += ((0.0147, 0.5, 0.034), (0.102, 0.194, 0.142), (0.022, 0.9, 0.0164))
    steps += ((0.011, 0.124, 0.0226), (-0.0155, 0.105, 0.029))
    return 0.194 + 1.5 * np.exp(-120.0 * x) - _tanh_sum(x, steps)


def _tanh_sum(x, steps):
    """Sum of steps of half height [V], centre [1] and width [1]."""
    return sum(volt * np.tanh((x - centre) / width) for volt, centre, width in steps)


def _silicon_verbrugge(x):
    lithiated = (-96.63, 372.6, -587.6, 489.9, -232.8, 62.99, -9.286, 0.8633)
    delithiated = (-51.02, 161.3, -205.7, 140.2, -58.76, 16.87, -3.792, 0.9937)
    ends = 1e-4 * (1 / x + 1 / (x - 1))
    return (np.polyval(lithiated, x) + ends + np.polyval(delithiated, x)) / 2


def _nmc811_chen(y):
    return (
        -0.8090 * y
        + 4.4875
        - 0.0428 * np.tanh(18.5138 * (y - 0.5542))
        - 17.7326 * np.tanh(15.7890 * (y - 0.3117))
        + 17.5842 * np.tanh(15.9308 * (y - 0.3120))
    )


def _nmc532_mohtat(y):
    smooth = np.polyval((-2.2166, 3.5146, -2.0843, 1.6225, -1.6518, 4.3452), y)
    return smooth - 0.5623e-4 * np.exp(109.451 * y - 100.006)


def _nmc_ecker(y):
    return (
        -2.35211 * y
        - 0.0747061 * np.tanh(31.886 * (y - 0.0219921))
        + 6.34984 * np.tanh(2.66395 * (y - 0.174352))
        - 0.640243 * np.tanh(5.48623 * (y - 0.439245))
        - 3.82383 * np.tanh(4.12167 * (y - 0.176187))
        - 0.0542123 * np.tanh(18.2919 * (y - 0.762272))
        + 4.23285
    )


def _lfp_afshar(y):
    return 3.4077 - 0.020269 * y + 0.5 * np.exp(-150 * y) - 0.9 * np.exp(-30 * (1 - y))


def _lfp_safari(y):
    empty = 1 - y
    return (
        3.4323
        - 0.8428 * np.exp(-80.2493 * empty**1.3198)
        - 3.2474e-6 * np.exp(20.2645 * empty**3.8003)
        + 3.2482e-6 * np.exp(20.2646 * empty**3.7995)
    )


def _lmo_doyle(y):
    return (
        4.19829
        + 0.0565661 * np.tanh(-14.5546 * y + 8.60942)
        - 0.0275479 * (1 / (0.998432 - y) ** 0.492465 - 1.90111)
        - 0.157123 * np.exp(-0.04738 * y**8)
        + 0.810239 * np.exp(-40 * (y - 0.133875))
    )


def _lmo_fuller(y):
    return (
        4.06279
        + 0.0677504 * np.tanh(-21.8502 * y + 12.8268)
        - 0.105734 * (1 / (1.00167 - y) ** 0.379571 - 1.576)
        - 0.045 * np.exp(-71.69 * y**8)
        + 0.01 * np.exp(-200 * (y - 0.19))
    )


def _lco_marquis(y):
    s = 1.062 * y
    return (
        2.16216
        + 0.07645 * np.tanh(30.834 - 54.4806 * s)
        + 2.1581 * np.tanh(52.294 - 50.294 * s)
        - 0.14169 * np.tanh(11.0923 - 19.8543 * s)
        + 0.2051 * np.tanh(1.4684 - 5.4888 * s)
        + 0.2531 * np.tanh((0.56478 - s) / 0.1316)
        - 0.02167 * np.tanh((s - 0.525) / 0.006)
    )


def _lco_ramadass(y):
    square = (1.13 * y) ** 2
    above = np.polyval((433.434, -462.471, 342.909, -401.119, 88.669, -4.656), square)
    below = np.polyval((95.96, -73.083, 37.311, -79.532, 18.933, -1.0), square)
    return above / below


def _nca_kim(y):
    powers = (1.638, -2.222, 15.056, -23.488, 81.246, -344.566)
    powers += (621.3475, -554.774, 264.427, -66.3691, 11.8058)
    return np.polyval(powers, y) - 0.61386 * np.exp(5.8201 * y**136.4)


CHEN = "Chen et al., J. Electrochem. Soc. 167 (2020) 080534"
MOHTAT = "Mohtat et al., J. Electrochem. Soc. 167 (2020) 110561"
ECKER = "Ecker et al., J. Electrochem. Soc. 162 (2015) A1836"
SAFARI = "Safari and Delacourt, J. Electrochem. Soc. 158 (2011) A562"
MARQUIS = "Marquis et al., J. Electrochem. Soc. 166 (2019) A3693, fit of Newman's Dualfoil"
DOYLE = "Doyle et al., J. Electrochem. Soc. 143 (1996) 1890"
FULLER = "Fuller et al., J. Electrochem. Soc. 141 (1994) 1"
RAMADASS = "Ramadass et al., J. Electrochem. Soc. 151 (2004) A196"
VERBRUGGE = "Verbrugge et al., J. Electrochem. Soc. 163 (2016) A262"
# Function of lithiation [1] → [V], from where to where it holds, the paper.
LIBRARY = {
    "graphite_siox_chen": (_graphite_siox_chen, 0.0, 1.0, CHEN),
    "graphite_mohtat": (_graphite_mohtat, 0.0, 1.0, MOHTAT),
    "graphite_ecker": (_graphite_ecker, 0.0, 1.0, ECKER),
    "graphite_safari": (_graphite_safari, 0.0, 1.0, SAFARI),
    "graphite_marquis": (_graphite_marquis, 0.0, 1.0, MARQUIS),
    "silicon_verbrugge": (_silicon_verbrugge, 0.01, 0.99, VERBRUGGE),
    "nmc811_chen": (_nmc811_chen, 0.15, 1.0, CHEN),
    "nmc532_mohtat": (_nmc532_mohtat, 0.0, 1.0, MOHTAT),
    "nmc_ecker": (_nmc_ecker, 0.0, 1.0, ECKER),
    "lfp_afshar": (_lfp_afshar, 0.0, 1.0, "Afshar et al., SAE Tech. Paper 2017-01-1211"),
    "lfp_safari": (_lfp_safari, 0.0, 1.0, SAFARI),
    "lmo_doyle": (_lmo_doyle, 0.13, 0.998, DOYLE),
    "lmo_fuller": (_lmo_fuller, 0.17, 1.0, FULLER),
    "lco_marquis": (_lco_marquis, 0.36, 1.0, MARQUIS),
    "lco_ramadass": (_lco_ramadass, 0.38, 0.88, RAMADASS),
    "nca_kim": (_nca_kim, 0.3, 1.0, "Kim et al., J. Electrochem. Soc. 158 (2011) A955"),
}

GRAPHITES = tuple(name for name in LIBRARY if name.startswith("graphite"))
WITH_SILICON = (*GRAPHITES, "graphite_mohtat+silicon_verbrugge")


# Names of negative and of positive electrodes that a chemistry may have; "a+b" is a blend of two.
# ASSUME: A cell of a stated chemistry has graphite (with or without silicon) as its negative.
CHEMISTRIES = {
    "NMC": (WITH_SILICON, ("nmc811_chen", "nmc532_mohtat", "nmc_ecker")),
    "NCA": (WITH_SILICON, ("nca_kim", "nmc811_chen", "nmc_ecker")),
    "LCO": (GRAPHITES, ("lco_marquis", "lco_ramadass")),
    "LFP": (GRAPHITES, ("lfp_afshar", "lfp_safari")),
    "LMO": (GRAPHITES, ("lmo_doyle", "lmo_fuller", "lmo_doyle+nca_kim")),
}
BLEND_FORM = "wanted a+b, or a+b:0.1 where b holds 10 % of the electrode's lithium"


def half_cell(name, own=None):
    """A half cell by its name; "a+b:0.2" is a blend with 20 % of the electrode's lithium in b.

    Parameters
    ----------
    name : of `LIBRARY` or `own`, or two such names of a blend. own : the user's half cells by name.

    Raises
    ------
    Refusal : no such name, or a blend that is not of this form.
    """
    own = own or {}
    # The user's own half cells go before those of the library.
    names, share = named_parts(name)
    unknown = [one for one in names if one not in LIBRARY and one not in own]
    if unknown:
        words = f"half cell {unknown[0]!r} is not in the library: {', '.join(sorted(LIBRARY))}"
        raise Refusal(words if len(names) == 1 else f"{name}: {words}; {BLEND_FORM}")
    materials = [own[one] if one in own else _of_library(one) for one in names]
    if len(materials) == 1:
        return materials[0]
    if len(materials) > 2:
        raise Refusal(f"{name}: a blend of {len(materials)}, wanted two; {BLEND_FORM}")
    # ASSUME: Silicon beside graphite, or the second part of another blend, holds about 10 % of an
    # electrode's lithium if nothing is stated.
    return blended(*materials, share=0.1 if share is None else _number(share, name))


def _number(share, name):
    """Share of a blend [1] from what follows the colon."""
    try:
        value = float(share)
    except ValueError:
        value = np.nan
    if not 0 <= value <= 1:
        raise Refusal(f"{name}: found the share {share!r}, {BLEND_FORM}")
    return value


@cache
def _of_library(name):
    potential, lowest, highest, source = LIBRARY[name]
    lithiation = np.linspace(lowest, highest, POINTS)
    # A fit may rise by a fraction of a millivolt between its steps, which no equilibrium does.
    return with_ends(
        HalfCell(name, lithiation, np.minimum.accumulate(potential(lithiation)), source)
    )


# ASSUME: No published fit follows graphite until it is empty, where its potential rises to that of
# the other electrode, nor a positive electrode until it is full. How steeply hardly matters.
def with_ends(half_cell):
    """HalfCell that rises by 2 V within 0.4 % of lithiation where empty, and falls so where full.

    Only at ends within 1 % of empty or full; a table that ends elsewhere says nothing beyond.
    """
    lithiation, potential = half_cell.lithiation, half_cell.potential_volt
    if lithiation[0] <= 0.01:
        lithiation = np.append(lithiation[0] - 0.004, lithiation)
        potential = np.append(potential[0] + 2.0, potential)
    if lithiation[-1] >= 0.99:
        lithiation = np.append(lithiation, lithiation[-1] + 0.004)
        potential = np.append(potential, potential[-1] - 2.0)
    return half_cell._replace(lithiation=lithiation, potential_volt=potential)


def may_hold_silicon(half_cell):
    """Whether silicon may be in a negative electrode: not in graphite of the library alone."""
    name = half_cell.name
    return name not in GRAPHITES or "siox" in name


def blended(first, second, *, share):
    """Two materials in one electrode, at one potential; together they hold lithium from 0 to 1.

    Parameters
    ----------
    first, second : HalfCell.
    share : of the electrode's capacity, held by the second [1].

    Returns
    -------
    blend : HalfCell over the range of potential that both have.

    Source: Dubarry et al., J. Power Sources 219 (2012) 204: capacities add at equal potential.
    """
    highest = min(first.potential_volt[0], second.potential_volt[0])
    lowest = max(first.potential_volt[-1], second.potential_volt[-1])
    # Levels of both tables: a plateau of either keeps its resolution.
    levels = np.union1d(first.potential_volt, second.potential_volt)[::-1]
    levels = levels[(levels <= highest) & (levels >= lowest)]
    parts = [np.interp(-levels, -one.potential_volt, one.lithiation) for one in (first, second)]
    sources = f"{first.source}; {second.source}"
    name = f"{first.name}+{second.name}"
    return at_share(HalfCell(name, levels, levels, sources, parts=np.array(parts)), share)


def at_share(blend, share):
    """A blend in which the second material holds another share of the electrode's capacity [1]."""
    lithiation = blend.parts[0] + share * (blend.parts[1] - blend.parts[0])
    return blend._replace(lithiation=lithiation, share=share)
