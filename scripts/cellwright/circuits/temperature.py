"""Parameters between and beyond the measured temperatures: weights, OCV tables, laws."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import continued
from cellwright.numerics.lines import GAS_CONSTANT, ZERO_CELSIUS_KELVIN
from cellwright.refusal import Refusal

SMALLEST = 1e-9  # of any parameter: the logarithm of none would be −∞


def ocv_at(tables, soc, temperature_celsius):
    """Open-circuit voltage from tables at one or several temperatures, linear between them.

    Parameters
    ----------
    tables : sequence of dicts with `soc`, `ocv_volt`, `ambient_temperature_celsius`.
    soc : (n,) [1]; held flat outside a table.
    temperature_celsius : scalar or (n,) [degC]; held flat outside the measured ones.

    Returns
    -------
    ocv_volt : (n,) [V].
    """
    tables, measured = coldest_first(tables)
    weights = temperature_weights(measured, np.broadcast_to(temperature_celsius, np.shape(soc)))
    curves = [np.interp(soc, table["soc"], table["ocv_volt"]) for table in tables]
    return sum(weight * curve for weight, curve in zip(weights, curves, strict=True))


def continued_ocv_at(tables, soc, temperature_celsius):
    """As `ocv_at`, and beyond 0…1 as `cell.continued` goes on.

    Parameters
    ----------
    tables, soc, temperature_celsius : as in `ocv_at`.
    """
    celsius = np.broadcast_to(temperature_celsius, np.shape(soc))
    return continued(lambda within, of: ocv_at(tables, within, celsius[of]), soc)


def table_soc(soc, missing, stretch):
    """SoC of an OCV table that belongs to a counted SoC.

    Full may not have been quite full, nor the capacity quite right.

    Parameters
    ----------
    soc : (n,) counted [1]. missing : what the full charge left out [1].
    stretch : by how much the capacity is smaller than the SoC takes it for [1].
    """
    return 1.0 - missing - (1.0 - soc) * (1.0 + stretch)


def scaled_soc(conditions, weights, soc):
    """SoC of the OCV tables at counted ones, by the `ocv_scale` of each condition.

    Parameters
    ----------
    conditions : sequence of condition dicts. weights : of each, (n,). soc : (n,) counted [1].
    """
    scales = [c.get("ocv_scale", {"missing": 0.0, "stretch": 0.0}) for c in conditions]
    names = ("missing", "stretch")
    return table_soc(soc, *(mixed_by(weights, [scale[name] for scale in scales]) for name in names))


def resistance_factor(celsius, reference_celsius, activation_joule_per_mole):
    """Factor on resistances at a temperature, 1 at the reference (Arrhenius law).

    Parameters
    ----------
    celsius : scalar or (n,) [degC]. reference_celsius : scalar or (n,) [degC].
    activation_joule_per_mole : activation energy [J/mol].
    """
    inverse = [1.0 / (np.asarray(t) + ZERO_CELSIUS_KELVIN) for t in (celsius, reference_celsius)]
    return np.exp(activation_joule_per_mole / GAS_CONSTANT * (inverse[0] - inverse[1]))


def temperature_weights(measured, temperature):
    """Weight of each measured temperature at each sample, linear in 1/T between two.

    Parameters
    ----------
    measured : (c,) measured temperatures, ascending [degC]. temperature : (n,) [degC].

    Returns
    -------
    weights : list of (n,), one a measured temperature.

    Raises
    ------
    Refusal : nothing measured, or several temperatures of which one is not known.
    """
    if not len(measured):
        raise Refusal("the model holds nothing measured: no temperature to look up")
    if len(measured) == 1:
        return [np.ones(len(temperature))]
    if np.isnan(measured).any() or np.isnan(temperature).any():
        raise Refusal(f"{len(measured)} measured conditions, but a temperature is not known")
    inverse = -1.0 / (measured + ZERO_CELSIUS_KELVIN)
    inverse_here = -1.0 / (temperature + ZERO_CELSIUS_KELVIN)
    return [np.interp(inverse_here, inverse, row) for row in np.eye(len(measured))]


def mixed_by(weights, values):
    """Sum of values, each by its weight.

    Parameters
    ----------
    weights : sequence of (n,), see `temperature_weights`. values : sequence of scalars or (n,).
    """
    return sum(weight * value for weight, value in zip(weights, values, strict=True))


def coldest_first(entries):
    """Conditions or OCV tables by their temperature, and these temperatures (c,) [degC].

    Parameters
    ----------
    entries : sequence of dicts with `ambient_temperature_celsius`.
    """
    celsius = [celsius_of(entry["ambient_temperature_celsius"]) for entry in entries]
    order = np.argsort(celsius, kind="stable") if entries else []
    return [entries[k] for k in order], np.array([celsius[k] for k in order])


def celsius_of(value):
    """A stated temperature [degC], NaN where none is.

    Parameters
    ----------
    value : number or None.
    """
    return np.nan if value is None else float(value)


LAWS = ("between", "arrhenius", "quadratic")  # place: degree of the polynomial in 1/T
LAW_IN_WORDS = dict(zip(LAWS, ("interpolation", "Arrhenius", "quadratic"), strict=True))
LEAST_SHARE = 0.02  # of all resistance: less is too little to have an activation energy of its own


class Laws(NamedTuple):
    """Law of ln R over 1/T inside the measured temperatures and beyond them, each one of LAWS."""

    inside: str = LAWS[0]
    beyond: str = LAWS[0]


def law_weights(measured, temperature, laws):
    """Weight of each measured temperature in a logarithm that follows a law in 1/T.

    A polynomial in 1/T through all measured temperatures by least squares ("arrhenius": a line,
    "quadratic": a parabola), and what it leaves at each of them linear in between: what was
    measured is met. "between" has no polynomial, and is held flat beyond.

    Parameters
    ----------
    measured : (c,) measured temperatures, ascending [degC]. temperature : (n,) [degC].
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
    nearest = np.clip(temperature, measured[0], measured[-1])
    by_inside, by_beyond, at_edge = (
        _by_polynomial(measured, *settings)
        for settings in ((nearest, laws.inside), (temperature, laws.beyond), (nearest, laws.beyond))
    )
    return list((by_inside + by_beyond - at_edge).T)


def _by_polynomial(measured, temperature, law):
    straight = np.array(temperature_weights(measured, temperature)).T
    if law == LAWS[0] or len(measured) == 1:
        return straight
    degree = min(LAWS.index(law), len(measured) - 1)
    at_measured, at_temperature = (
        _powers(celsius, degree, measured) for celsius in (measured, temperature)
    )
    fitted = np.linalg.pinv(at_measured)
    return at_temperature @ fitted + straight @ (np.eye(len(measured)) - at_measured @ fitted)


def _powers(celsius, degree, measured):
    """Columns of a polynomial in 1/T, scaled to the measured range."""
    inverse = 1.0 / (np.asarray(celsius) + ZERO_CELSIUS_KELVIN)
    ends = 1.0 / (np.asarray(measured)[[0, -1]] + ZERO_CELSIUS_KELVIN)
    return np.vander((inverse - ends.mean()) / (ends[0] - ends[1]), degree + 1)


def mixed_resistances(courses, origins, weights, by_law):
    """Resistances (m, n) between temperatures [ohm]: sums per origin by a law.

    The shares of a sum are linear in 1/T.

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
        mixed[rows] = total * np.array(
            [mixed_by(weights, course / totals) for course in courses[rows]]
        )
    return mixed


def _by_origin(courses, origins):
    """Rows of each origin; one below `LEAST_SHARE` somewhere is joined to the next larger one."""
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


def factor_beyond(conditions, measured, celsius):
    """Factor on resistances beyond the measured temperatures, 1 between them.

    There they follow the activation energy of the nearest. Where they follow a law over all
    temperatures, that law goes on instead: the factor is 1.

    Parameters
    ----------
    conditions : sequence of condition dicts, coldest first. measured : (c,) their temperatures
        [degC]. celsius : (n,) [degC].
    """
    energies = [c.get("activation_energy_joule_per_mole") or 0.0 for c in conditions]
    if np.isnan(measured).any() or not any(energies) or laws_of(conditions).beyond != LAWS[0]:
        return 1.0
    nearest = np.clip(celsius, measured[0], measured[-1])
    energy = np.where(celsius < measured[0], energies[0], energies[-1])
    return np.where(np.isnan(celsius), 1.0, resistance_factor(celsius, nearest, energy))


def laws_of(conditions):
    """Laws over temperature of the resistances; the same in all conditions of a member.

    Parameters
    ----------
    conditions : sequence of condition dicts.
    """
    return Laws(**conditions[0].get("resistance_laws", {}))
