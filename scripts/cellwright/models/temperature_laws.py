"""Resistances at temperatures between and beyond those that were measured, by a law in 1/T."""

from typing import NamedTuple

import numpy as np

from cellwright.models.tables import (
    SMALLEST,
    ZERO_CELSIUS_KELVIN,
    mixed_by,
    temperature_weights,
    warmth,
)
from cellwright.refusal import Refusal

LAWS = ("between", "arrhenius", "quadratic")  # place: degree of the polynomial in 1/T
LEAST_SHARE = 0.02  # of all resistance: less is too little to have an activation energy of its own


class Laws(NamedTuple):
    """Law of ln R over 1/T inside the measured temperatures and beyond them, each one of LAWS."""

    inside: str = LAWS[0]
    beyond: str = LAWS[0]


def law_weights(known, temperature, laws):
    """Weight of each measured temperature in a logarithm that follows a law in 1/T.

    A polynomial in 1/T through all measured temperatures by least squares ("arrhenius": a line,
    "quadratic": a parabola), and what it leaves at each of them linear in between: what was
    measured is met. "between" has no polynomial, and is held flat beyond.

    Parameters
    ----------
    known : (c,) measured temperatures, ascending [degC]. temperature : (n,) [degC].
    laws : Laws, inside the measured range and beyond it.

    Returns
    -------
    weights : list of (n,), one a measured temperature; they add up to 1.

    Raises
    ------
    Refusal : as `temperature_weights`; a law of another name.
    """
    unknown = set(laws) - set(LAWS)
    if unknown:
        raise Refusal(
            f"law over temperature {min(unknown)!r} is unknown; allowed are {', '.join(LAWS)}"
        )
    nearest = np.clip(temperature, known[0], known[-1])
    inside, here, edge = (
        _by_polynomial(known, *asked)
        for asked in ((nearest, laws.inside), (temperature, laws.beyond), (nearest, laws.beyond))
    )
    return list((inside + here - edge).T)


def _by_polynomial(known, temperature, law):
    straight = np.array(temperature_weights(known, temperature)).T
    if law == LAWS[0] or len(known) == 1:
        return straight
    degree = min(LAWS.index(law), len(known) - 1)
    measured, here = (_powers(celsius, degree, known) for celsius in (known, temperature))
    fitted = np.linalg.pinv(measured)
    return here @ fitted + straight @ (np.eye(len(known)) - measured @ fitted)


def _powers(celsius, degree, known):
    """Columns of a polynomial in 1/T, scaled to the measured range."""
    inverse = 1.0 / (np.asarray(celsius) + ZERO_CELSIUS_KELVIN)
    ends = 1.0 / (np.asarray(known)[[0, -1]] + ZERO_CELSIUS_KELVIN)
    return np.vander((inverse - ends.mean()) / (ends[0] - ends[1]), degree + 1)


def mixed_resistances(courses, origins, weights, by_law):
    """Resistances (m, n) between temperatures: a sum for each origin by a law, shares straight.

    Ions in the electrolyte, charge transfer and diffusion have activation energies of their own. A
    resistance that is zero at one temperature and not at the next has no logarithm to mix: so it is
    the sums that are mixed, and an origin that hardly counts somewhere joins the others.

    Parameters
    ----------
    courses : (m, c, n) at each of c temperatures [ohm]. origins : m names, one a resistance.
    weights : c of (n,), of the shares.
    by_law : c of (n,), of the logarithm of the sum, see `law_weights`.
    """
    courses, mixed = np.array(courses), np.zeros((len(courses), len(by_law[0])))
    for rows in _by_origin(courses, origins):
        totals = np.maximum(courses[rows].sum(axis=0), SMALLEST)
        total = np.exp(mixed_by(by_law, np.log(totals)))
        mixed[rows] = total * np.array([mixed_by(weights, one / totals) for one in courses[rows]])
    return mixed


def _by_origin(courses, origins):
    """Rows of each origin, the smallest joined to the next until each counts everywhere."""
    whole = np.maximum(courses.sum(axis=0), SMALLEST)

    def least(rows):
        return (courses[rows].sum(axis=0) / whole).min()

    groups = [
        [k for k, other in enumerate(origins) if other == name] for name in dict.fromkeys(origins)
    ]
    groups.sort(key=least)
    while len(groups) > 1 and least(groups[0]) < LEAST_SHARE:
        groups = sorted([groups[0] + groups[1], *groups[2:]], key=least)
    return groups


def warmth_beyond(conditions, known, here):
    """Beyond the measured temperatures resistances follow the activation energy of the nearest.

    Where they follow a law over all temperatures, that law goes on instead: the factor is 1.

    Parameters
    ----------
    conditions : sequence of condition dicts, coldest first. known : (c,) their temperatures [degC].
    here : (n,) [degC].
    """
    energies = [c.get("activation_energy_joule_per_mole") or 0.0 for c in conditions]
    if np.isnan(known).any() or not any(energies) or laws_of(conditions).beyond != LAWS[0]:
        return 1.0
    nearest = np.clip(here, known[0], known[-1])
    energy = np.where(here < known[0], energies[0], energies[-1])
    return np.where(np.isnan(here), 1.0, warmth(here, nearest, energy))


def laws_of(conditions):
    """Laws over temperature of the resistances; the same in all conditions of a member.

    Parameters
    ----------
    conditions : sequence of condition dicts.
    """
    return Laws(**conditions[0].get("resistance_laws", {}))
