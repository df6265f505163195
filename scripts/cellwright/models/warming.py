"""How a cell's resistance moves with its own temperature, from the tests a model is fitted to."""

from typing import NamedTuple

import numpy as np

from cellwright.models.identify import identify
from cellwright.models.members import member_named
from cellwright.models.settle import cost_of
from cellwright.models.tables import GAS_CONSTANT, ZERO_CELSIUS_KELVIN, warmth
from cellwright.refusal import Refusal

PLAIN = member_named("DRT+D")
SLOWEST_SECOND = 60.0  # of what counts as resistance here: slower parts are poorly known
VARIED_KELVIN = 2.0
TRIED_JOULE_PER_MOLE = (0.0, 10e3, 20e3, 30e3, 40e3, 50e3)


class Activation(NamedTuple):
    """Activation energy of the resistance of each group [J/mol], and what is said of it."""

    joule_per_mole: tuple
    words: str


def activation_of(groups, data_of_group, *, capacity_ampere_hour):
    """Activation energy of the resistances at each temperature.

    With several temperatures the slope of ln R over 1/T to the neighbours, R being what relaxes
    within a minute, at the middle of the common SoC. With one, the value among 0, 10, … 50 kJ/mol
    that fits best, provided the cell warmed by more than 2 K. Else none.

    Parameters
    ----------
    groups : list of groups.Group, ascending in temperature.
    data_of_group : function (group) → design.Data.
    capacity_ampere_hour : [Ah].

    Returns
    -------
    activation : Activation.
    """
    if len(groups) > 1:
        resistance = [_resistance(data_of_group(g), g, capacity_ampere_hour) for g in groups]
        energies = _neighbours([g.celsius for g in groups], resistance)
        listed = ", ".join(
            f"{g.celsius:g} °C {e / 1e3:.0f}" for g, e in zip(groups, energies, strict=True)
        )
        return Activation(
            tuple(energies), f"activation energy of the resistance [kJ/mol]: {listed}"
        )
    varied = max(np.ptp(course) for course in groups[0].courses)
    if varied < VARIED_KELVIN:
        return Activation((0.0,), "")
    try:
        costs = _costs(groups[0], data_of_group, capacity_ampere_hour)
    except Refusal as refusal:
        return Activation((0.0,), f"activation energy not known, taken as 0: {refusal}")
    best = TRIED_JOULE_PER_MOLE[int(np.argmin(costs))]
    words = (
        f"activation energy {best / 1e3:.0f} kJ/mol, from the cell's own warming by {varied:.0f} K"
    )
    return Activation((best,), words)


def warmed(group, joule_per_mole):
    """The group with the warmth of its records at an activation energy.

    Parameters
    ----------
    group : groups.Group.
    joule_per_mole : activation energy [J/mol].
    """
    records = tuple(
        record._replace(warmth=warmth(course, group.celsius, joule_per_mole))
        for record, course in zip(group.records, group.courses, strict=True)
    )
    return group._replace(records=records)


def _resistance(data, group, capacity):
    """Resistance at half charge [ohm], NaN where too little was measured to fit one."""
    try:
        fitted = identify(data, PLAIN, capacity_ampere_hour=capacity, celsius=group.celsius)
    except Refusal:
        return np.nan
    found = fitted.condition
    fast = [
        b.values["r_ohm"]
        for b in found.branches
        if b.kind == "RC" and b.values["tau_second"][0] <= SLOWEST_SECOND
    ]
    total = sum(fast, found.r0_ohm)
    return float(np.interp(0.5, found.soc, total))


def _neighbours(celsius, resistance):
    """Mean slope to the neighbours; a temperature without a resistance takes the nearest ones'."""
    known = np.isfinite(resistance)
    if known.sum() < 2:
        return [0.0] * len(celsius)
    at, ohm = np.asarray(celsius)[known], np.asarray(resistance)[known]
    slope = GAS_CONSTANT * np.diff(np.log(ohm)) / np.diff(1.0 / (at + ZERO_CELSIUS_KELVIN))
    slope = np.clip(slope, 0.0, 100e3)
    means = [np.mean(slope[max(k - 1, 0) : k + 1]) for k in range(len(at))]
    return np.interp(celsius, at, means).tolist()


def _costs(group, data_of_group, capacity):
    costs, factor = [], None
    for energy in TRIED_JOULE_PER_MOLE:
        data = data_of_group(warmed(group, energy))
        found = identify(data, PLAIN, capacity_ampere_hour=capacity, celsius=group.celsius)
        factor = factor or found.solution.factor
        costs.append(cost_of(data, found.held, factor))
    return costs
