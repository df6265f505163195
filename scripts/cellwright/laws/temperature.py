"""A quantity over temperature: the thesis' quadratic and the Arrhenius law, side by side."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal
from cellwright.uncertainty import covariance_from_jacobian, standard_deviations, t_interval

GAS_CONSTANT = 8.314462618  # J/(mol K)
ZERO_CELSIUS = 273.15  # K
REFERENCE = 298.15  # K


class Law(NamedTuple):
    """One fitted law; the arrays hold one number per parameter, in the order the law takes them.

    law : "quadratic" or "arrhenius". names, units : of the parameters. values, std, lower,
    upper : estimate, standard deviation, confidence limits; NaN where not known. r_squared : on
    the scale of the quantity, for both laws. cross_validation_rmse : error of the prediction at
    temperatures left out in turn, NaN where too few remain. reason : why something is NaN, or "".
    """

    law: str
    names: tuple
    units: tuple
    values: np.ndarray
    std: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    r_squared: float
    cross_validation_rmse: float
    chosen: bool
    reason: str


def quadratic_law(temperature_celsius, b1, b2, b3):
    """b1 T² + b2 T + b3 with T in °C (thesis eq. 3.13)."""
    return (b1 * temperature_celsius + b2) * temperature_celsius + b3


def arrhenius_law(temperature_celsius, value_at_25_celsius, activation_energy_joule_per_mole):
    """Value at 25 °C times exp(Ea/R (1/T − 1/298.15 K)): falls with temperature for Ea > 0."""
    return value_at_25_celsius * np.exp(
        activation_energy_joule_per_mole * _inverse_temperature(temperature_celsius)
    )


def fit_laws(temperature_celsius, value, *, unit, level=0.95):
    """Fit both laws and choose one by cross-validation.

    Parameters
    ----------
    temperature_celsius, value : (n,) one measured value per row [°C], [any unit].
    unit : of the value, for the units of the parameters.
    level : coverage of the confidence intervals.

    Returns
    -------
    laws : tuple of Law, quadratic then Arrhenius; exactly one is chosen: the one that predicts
        left-out temperatures better. Where the quadratic cannot be tested so, it is not chosen.

    Raises
    ------
    Refusal : fewer than three temperatures; a value that is not positive and finite.

    Source: thesis eq. 3.13 and 3.5 (without its prefactor in T).
    """
    # ASSUME: Over temperature the scatter is relative under the Arrhenius law and the same in
    # ohm or ampere-hours at each temperature under the quadratic.
    celsius, value = np.asarray(temperature_celsius, float), np.asarray(value, float)
    known = np.isfinite(celsius)
    celsius, value = celsius[known], value[known]
    count = len(np.unique(celsius))
    if count < 3:
        raise Refusal(f"{count} temperature(s); a law over temperature needs three")
    if not (np.isfinite(value) & (value > 0)).all():
        raise Refusal("a value over temperature is not positive; an Arrhenius law needs that")
    errors = {fit: _left_out(fit, celsius, value) for fit in (_quadratic, _arrhenius)}
    best = min(errors, key=lambda fit: np.nan_to_num(errors[fit], nan=np.inf))
    return tuple(
        fit(celsius, value, unit, level)._replace(
            cross_validation_rmse=errors[fit], chosen=fit is best
        )
        for fit in errors
    )


def law_rows(points):
    """Both laws of every quantity as rows of a table.

    Parameters
    ----------
    points : list of `laws.points.Point`.

    Returns
    -------
    rows : list of dict, one a parameter: quantity, law, parameter, value, std, unit, r_squared,
        cross_validation_rmse, chosen.
    reasons : list of sentences for what is not known.

    Raises
    ------
    Refusal
        No quantity could be fitted; the reasons are named.
    """
    rows, reasons = [], []
    for quantity in dict.fromkeys(point.quantity for point in points):
        mine = [point for point in points if point.quantity == quantity]
        try:
            laws = fit_laws(
                [point.temperature_celsius for point in mine],
                [point.value for point in mine],
                unit=mine[0].unit,
            )
        except Refusal as refusal:
            reasons.append(f"{quantity}: {refusal}")
            continue
        reasons += [f"{quantity}, {law.law} law: {law.reason}" for law in laws if law.reason]
        rows += [row for law in laws for row in _rows(quantity, law)]
    if not rows:
        raise Refusal("; ".join(reasons) or "no quantity is known at three temperatures")
    return rows, reasons


def _rows(quantity, law):
    for name, unit, value, std in zip(law.names, law.units, law.values, law.std, strict=True):
        yield {
            "quantity": quantity,
            "law": law.law,
            "parameter": name,
            "value": float(value),
            "std": float(std),
            "unit": unit,
            "r_squared": law.r_squared,
            "cross_validation_rmse": law.cross_validation_rmse,
            "chosen": law.chosen,
        }


def _inverse_temperature(celsius):
    """(1/T − 1/298.15 K)/R [mol/J], the axis on which ln of an Arrhenius law is a line."""
    kelvin = np.asarray(celsius, float) + ZERO_CELSIUS
    return (1 / kelvin - 1 / REFERENCE) / GAS_CONSTANT


def _quadratic(celsius, value, unit, level):
    columns = np.vander(celsius, 3)
    values, std, lower, upper = _line(columns, value, level)
    return _law(
        "quadratic",
        ("b1", "b2", "b3"),
        (f"{unit}/degC^2", f"{unit}/degC", unit),
        (values, std, lower, upper),
        _r_squared(value, columns @ values),
        len(value) - 3,
    )


def _arrhenius(celsius, value, unit, level):
    columns = np.stack([np.ones(len(celsius)), _inverse_temperature(celsius)], axis=1)
    values, std, lower, upper = _line(columns, np.log(value), level)
    scale = np.array([np.exp(values[0]), 1.0])
    limits = [np.array([np.exp(limit[0]), limit[1]]) for limit in (values, lower, upper)]
    return _law(
        "arrhenius",
        ("value_at_25_celsius", "activation_energy"),
        (unit, "J/mol"),
        (limits[0], std * scale, *limits[1:]),
        _r_squared(value, np.exp(columns @ values)),
        len(value) - 2,
    )


def _law(name, names, units, estimates, r_squared, degrees_of_freedom):
    reason = "" if degrees_of_freedom > 0 else "as many data as parameters: no scatter to tell"
    return Law(name, names, units, *estimates, r_squared, np.nan, False, reason)


def _line(columns, target, level):
    """Linear least squares: values, standard deviations and confidence limits."""
    values = np.linalg.lstsq(columns, target, rcond=None)[0]
    residual = target - columns @ values
    std = standard_deviations(covariance_from_jacobian(columns, residual))
    return values, std, *t_interval(values, std, len(target) - len(values), level=level)


def _r_squared(value, predicted):
    spread = np.sum((value - value.mean()) ** 2)
    return float(1 - np.sum((value - predicted) ** 2) / spread) if spread > 0 else np.nan


def _left_out(fit, celsius, value):
    """RMSE at temperatures left out in turn; NaN where the rest would determine no law."""
    law, needed = {_quadratic: (quadratic_law, 3), _arrhenius: (arrhenius_law, 2)}[fit]
    levels = np.unique(celsius)
    if len(levels) <= needed:
        return np.nan
    errors = [
        law(celsius[out], *fit(celsius[~out], value[~out], "", 0.95).values) - value[out]
        for out in (celsius == level for level in levels)
    ]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
