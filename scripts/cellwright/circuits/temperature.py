"""Parameters between and beyond the measured temperatures: weights, OCV tables, the one law."""

from typing import NamedTuple

import numpy as np

from cellwright.circuits.cell import continued
from cellwright.circuits.circuit import KINDS
from cellwright.numerics.lines import GAS_CONSTANT, REFERENCE_KELVIN, ZERO_CELSIUS_KELVIN
from cellwright.refusal import Refusal

SMALLEST = 1e-9  # of any parameter: the logarithm of none would be −∞
LAW_POINTS = 9  # over SoC, of whose logarithms a law follows the mean


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


class EnergyPrior(NamedTuple):
    """What is known of the activation energy of a kind of resistance before a cell tells it.

    mean, std : of the energy [J/mol]. scatter : of ln R at one temperature about the law.
    """

    mean: float
    std: float
    scatter: float


# ASSUME: Activation energies lie about what cells of graphite with layered oxides or iron phosphate
# show: charge transfer is steepest, electrolyte and contacts are flattest, what relaxes later is
# told worst. They may change over temperature ("bend"). The scatter is the most likely one of the
# circuits of four cells.
ENERGIES = {
    "ohmic": EnergyPrior(12e3, 10e3, 0.07),
    "kinetic": EnergyPrior(50e3, 15e3, 0.1),
    "relaxing": EnergyPrior(30e3, 20e3, 0.2),
}
BEND_STD, UNKNOWN = 15e3, 1e6  # J/mol
COLD_KELVIN = 248.15  # −25 °C, at which the bend of an Arrhenius line is stated
BEND_REFERENCE = 1.0 / COLD_KELVIN - 1.0 / REFERENCE_KELVIN  # 1/K
LEAST_SHARE = 0.02  # of all resistance: less is too little to have an activation energy of its own


class Law(NamedTuple):
    """How the logarithm of a resistance goes over 1/T, where it is not identified.

    kinds : names in ENERGIES of the resistances whose sum it is of, the largest first.
    bend_joule_per_mole : how the activation energy changes between the measured temperatures: by
        twice of it from 25 to −25 °C. cold_joule_per_mole, warm_joule_per_mole : activation energy
        below the coldest of them and above the warmest. Each has its standard deviation.
    near_joule_per_mole : activation energy as far as near_kelvin beyond either instead [K].
    """

    kinds: tuple
    bend_joule_per_mole: float
    cold_joule_per_mole: float
    warm_joule_per_mole: float
    bend_std_joule_per_mole: float | None = None
    cold_std_joule_per_mole: float | None = None
    warm_std_joule_per_mole: float | None = None
    near_joule_per_mole: float = 0.0
    near_kelvin: float = 0.0


def fitted_law(kinds, celsius, log_ohm):
    """Law of a resistance by its values and by what is known of cells.

    The bend is of all temperatures, either energy beyond them of the outermost two: what is far
    away says little of how a resistance goes on. One temperature leaves all as it is known.

    Parameters
    ----------
    kinds : names in ENERGIES, the first of which states what is known. celsius : (c,) ascending
        [degC]. log_ohm : (c,) logarithm of the resistance.

    Returns
    -------
    law : Law.
    """
    prior, celsius, log_ohm = ENERGIES[kinds[0]], np.asarray(celsius), np.asarray(log_ohm)
    _, bend = _posterior(prior._replace(std=UNKNOWN), _line_and_bend(celsius), log_ohm)
    cold = _energy_beyond(prior, celsius[:2], log_ohm[:2])
    warm = _energy_beyond(prior, celsius[-2:][::-1], log_ohm[-2:][::-1])
    return Law(tuple(kinds), *(pair[k] for k in (0, 1) for pair in (bend, cold, warm)))


def _energy_beyond(prior, celsius, log_ohm):
    """Energy and its deviation at the first of two temperatures [J/mol]: from their middle to there
    it may change, so that their slope does not tell all of it."""
    outermost = 1.0 / (celsius[0] + ZERO_CELSIUS_KELVIN)
    return _posterior(prior, _line_and_bend(celsius, about=outermost), log_ohm)[0]


def _posterior(prior, design, log_ohm):
    """Energy where its column is 0, and bend, each with its standard deviation [J/mol]."""
    # One temperature, known or not, tells no slope.
    pairs = (design / GAS_CONSTANT, log_ohm)
    design, off = (np.nan_to_num(one - one.mean(axis=0)) for one in pairs)
    about = np.diag([prior.std**-2.0, BEND_STD**-2.0])
    told = design.T @ off / prior.scatter**2 + about[0] * prior.mean
    covariance = np.linalg.inv(design.T @ design / prior.scatter**2 + about)
    pairs = zip(covariance @ told, np.sqrt(np.diag(covariance)), strict=True)
    return [(float(value), float(std)) for value, std in pairs]


def log_factor(law, measured, celsius):
    """Logarithm (n,) of what the law adds to a resistance that is mixed linearly in 1/T.

    Between measured temperatures its bend, which is nothing at each of them; beyond them its
    activation energies, by which no resistance rises with temperature. 0 of what is not known.

    Parameters
    ----------
    law : Law. measured : (c,) temperatures, ascending [degC]. celsius : (n,) [degC].
    """
    if np.isnan(measured).any():
        return np.zeros(len(celsius))
    nearest = np.clip(celsius, measured[0], measured[-1])
    bent = _line_and_bend(nearest)[:, 1] - mixed_by(
        temperature_weights(measured, nearest), _line_and_bend(measured)[:, 1]
    )
    near = np.clip(celsius, measured[0] - law.near_kelvin, measured[-1] + law.near_kelvin)
    courses = [_line_and_bend(course)[:, 0] for course in (nearest, near, celsius)]
    close, beyond = np.diff(courses, axis=0)
    energy = np.where(beyond > 0, law.cold_joule_per_mole, law.warm_joule_per_mole)
    factor = law.bend_joule_per_mole * bent + law.near_joule_per_mole * close
    return np.nan_to_num(factor + np.maximum(energy, 0.0) * beyond) / GAS_CONSTANT


def _line_and_bend(celsius, about=1.0 / REFERENCE_KELVIN):
    """Columns (n, 2) that an activation energy and its bend multiply [1/K], 0 at 1/T `about`."""
    inverse = 1.0 / (np.asarray(celsius, float) + ZERO_CELSIUS_KELVIN) - about
    return np.column_stack([inverse, inverse**2 / BEND_REFERENCE])


def kind_of_resistance(branch_kind):
    """Name in ENERGIES of the resistance of a branch, by the name of its kind."""
    kind = KINDS[branch_kind]
    if kind.of_charge_transfer:
        return "kinetic"
    return "ohmic" if kind.lags is KINDS["R"].lags else "relaxing"


def laws_over_temperature(conditions):
    """Laws of a member's resistances over temperature: one definition for all that simulates it.

    Ions in the electrolyte, charge transfer and diffusion have activation energies of their own. A
    kind that hardly counts somewhere has no logarithm there: it joins the next larger one. Laws are
    of the mean logarithm over the common SoC. Where energies are stated as holding everywhere, all
    kinds follow them beyond: 0 of a table that is given, what a search found. What the warming of a
    cell told holds as far as it warmed, `activation_energy_kelvin`: high currents lower the
    resistance of charge transfer too, which then looks like warmth.

    Parameters
    ----------
    conditions : sequence of condition dicts of a model file, coldest first.

    Returns
    -------
    laws : list of Law; every kind in ENERGIES has one.
    """
    stated = [c.get("activation_energy_joule_per_mole") for c in conditions]
    kelvin, near = [c.get("activation_energy_kelvin") for c in conditions], {}
    if None not in stated and not any(reach is not None for reach in kelvin):
        return [Law(tuple(ENERGIES), 0.0, float(stated[0]), float(stated[-1]))]
    if len(conditions) == 1 and stated[0] is not None:
        near = {"near_joule_per_mole": float(stated[0]), "near_kelvin": float(kelvin[0])}
    ends = np.array([[c["soc"][0], c["soc"][-1]] for c in conditions], float)
    soc = np.linspace(ends[:, 0].max(), ends[:, 1].min(), LAW_POINTS)
    sums = {kind: np.zeros((len(conditions), LAW_POINTS)) for kind in ENERGIES}
    for row, condition in enumerate(conditions):
        sums["ohmic"][row] += np.interp(soc, condition["soc"], condition["r0_ohm"])
        for branch in condition["branches"]:
            if "r_ohm" in branch:
                ohm = np.interp(soc, condition["soc"], branch["r_ohm"])
                sums[kind_of_resistance(branch.get("kind", "RC"))][row] += ohm
    celsius = [celsius_of(c["ambient_temperature_celsius"]) for c in conditions]
    laws = []
    for kinds in _joined(sums):
        log_ohm = np.log(np.maximum(sum(sums[kind] for kind in kinds), SMALLEST))
        laws.append(fitted_law(kinds, celsius, log_ohm.mean(axis=1))._replace(**near))
    return laws


def usual_from_kelvin(conditions):
    """How far from an only temperature resistances begin to follow what cells usually have [K].

    Infinite where they follow what several temperatures tell, or energies that hold everywhere.

    Parameters
    ----------
    conditions : sequence of condition dicts of a model file.
    """
    first, *more = conditions
    if more:
        return np.inf
    if first.get("activation_energy_joule_per_mole") is None:
        return 0.0
    kelvin = first.get("activation_energy_kelvin")
    return np.inf if kelvin is None else float(kelvin)


def _joined(sums):
    """Kinds by their law; one below `LEAST_SHARE` somewhere is joined to the next larger one."""
    whole = np.maximum(sum(sums.values()), SMALLEST)

    def least(kinds):
        return (sum(sums[k] for k in kinds) / whole).min()

    groups = sorted(((kind,) for kind in sums), key=least)
    while len(groups) > 1 and least(groups[0]) < LEAST_SHARE:
        groups = sorted([groups[1] + groups[0], *groups[2:]], key=least)
    return groups


def mixed_resistances(courses, kinds, weights, laws, factors):
    """Resistances (m, n) between temperatures [ohm]: sums of the kinds of a law, by that law.

    The shares of a sum are linear in 1/T: a resistance that is zero at one temperature and not at
    the next has no logarithm to mix.

    Parameters
    ----------
    courses : (m, c, n) at each of c temperatures [ohm]. kinds : m names in ENERGIES.
    weights : c of (n,). laws : list of Law. factors : (n,) of each law, see `log_factor`.
    """
    courses, mixed = np.array(courses), np.zeros((len(courses), len(weights[0])))
    for law, factor in zip(laws, factors, strict=True):
        rows = [k for k, kind in enumerate(kinds) if kind in law.kinds]
        totals = np.maximum(courses[rows].sum(axis=0), SMALLEST)
        total = np.exp(mixed_by(weights, np.log(totals)) + factor)
        for row in rows:
            mixed[row] = total * mixed_by(weights, courses[row] / totals)
    return mixed
