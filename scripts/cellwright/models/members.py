"""Members of the circuit family by name: what a model is asked to hold."""

import re
from typing import NamedTuple

from cellwright.refusal import Refusal

OPTIONS = {"H": "hysteresis", "K": "kinetics", "D": "diffusion in the particles"}


class Member(NamedTuple):
    """What one member of the family has beside OCV and ohmic resistance.

    pairs : number of RC pairs with fitted time constants; None: a resistance on each of a fixed
        series of time constants ("DRT", distribution of relaxation times).
    hysteresis : a one-state hysteresis whose size depends on SoC.
    kinetic : the fast part of the resistance follows the Butler–Volmer equation.
    diffusion : the OCV is taken at the surface of the particles of one electrode.
    """

    name: str
    pairs: int | None
    hysteresis: bool
    kinetic: bool
    diffusion: bool


def member_named(name):
    """Member of a name: "0RC" … "4RC" or "DRT", then any of "+H", "+K", "+D".

    H is hysteresis, K kinetics, D diffusion.

    Raises
    ------
    Refusal : another name.
    """
    base, *options = name.split("+")
    pairs = re.fullmatch(r"([0-4])RC|DRT", base)
    if not pairs or len(set(options)) != len(options) or not set(options) <= set(OPTIONS):
        raise Refusal(f"model {name!r} is unknown; allowed are 0RC … 4RC or DRT, then +H, +K, +D")
    number = None if pairs[1] is None else int(pairs[1])
    return Member(name, number, *(letter in options for letter in OPTIONS))


def size_of(member):
    """How much a member holds, for the choice between equals: courses over SoC and numbers.

    Parameters
    ----------
    member : Member.
    """
    pairs = 10 if member.pairs is None else member.pairs
    return 2 * pairs + 2 * member.hysteresis + 2 * member.kinetic + member.diffusion
