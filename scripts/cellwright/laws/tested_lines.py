"""Straight lines tested: over temperature beside Arrhenius, through zero or not over SoC."""

import numpy as np

from cellwright.laws.line import r_squared
from cellwright.laws.temperature import REFERENCE, ZERO_CELSIUS, Law, inverse_temperature
from cellwright.refusal import Refusal
from cellwright.uncertainty import covariance_from_jacobian, standard_deviations, t_interval

FEWEST_TEMPERATURES = 3
FEWEST_SOC = 4


def temperature_lines(temperature_celsius, value, *, unit, level=0.95):
    """A linear law and an Arrhenius law over temperature; the better predicts left-out values.

    Parameters
    ----------
    temperature_celsius, value : (n,) one value a temperature [°C], [unit].
    unit : of the value. level : coverage of the intervals.

    Returns
    -------
    laws : tuple of `temperature.Law`, "linear" (slope, value_at_25_celsius, slope_p_value: of the
        hypothesis that there is no slope) and "arrhenius" (as `temperature.fit_laws`).

    Raises
    ------
    Refusal : fewer than three temperatures, a value that is not positive and finite.

    Source: thesis sec. 3.3 (tau1, tau2 about linear in T); Arrhenius: thesis (3.5).
    """
    celsius, value = np.asarray(temperature_celsius, float), np.asarray(value, float)
    if len(np.unique(celsius)) < FEWEST_TEMPERATURES:
        found = len(np.unique(celsius))
        raise Refusal(f"{found} temperature(s); a law over temperature needs three")
    if not (np.isfinite(value) & (value > 0)).all():
        raise Refusal("a value over temperature is not positive; an Arrhenius law needs that")
    near = celsius + ZERO_CELSIUS - REFERENCE
    inverse = inverse_temperature(celsius)
    columns = np.stack([near, np.ones(len(near))], axis=1)
    linear = _with_p(_line(columns, value, level), len(value) - 2)._replace(law="linear")
    names, units = ("slope", "value_at_25_celsius", "slope_p_value"), (f"{unit}/K", unit, "1")
    linear = linear._replace(names=names, units=units)
    names, units = ("value_at_25_celsius", "activation_energy"), (unit, "J/mol")
    arrhenius = _arrhenius(inverse, value, level)._replace(names=names, units=units)
    tested = (float(celsius.min()), float(celsius.max()))
    return tuple(law._replace(tested_celsius=tested) for law in _chosen(linear, arrhenius))


def soc_lines(soc, value, *, unit, level=0.95):
    """A line over SoC and one through zero; the better predicts values left out in turn.

    Parameters
    ----------
    soc, value : (n,) [1], [unit], at one temperature.
    unit, level : as in `temperature_lines`.

    Returns
    -------
    laws : tuple of `temperature.Law`, "linear over SoC" (slope, value_at_soc_0, slope_p_value,
        zero_p_value: of the hypothesis that the line goes through zero), "proportional to SoC".

    Raises
    ------
    Refusal : fewer than four values, or all at one SoC.

    Source: thesis sec. 3.3: below 50 % SoC a and b are proportional to SoC in the cold.
    """
    soc, value = np.asarray(soc, float), np.asarray(value, float)
    if len(soc) < FEWEST_SOC or np.ptp(soc) == 0:
        raise Refusal(f"{len(soc)} value(s) over SoC; a line that is tested needs {FEWEST_SOC}")
    free = _line(np.stack([soc, np.ones(len(soc))], axis=1), value, level)
    tied = _line(soc[:, None], value, level)
    zero_p = _p_value(free.values[1], free.std[1], len(soc) - 2)
    names = ("slope", "value_at_soc_0", "slope_p_value", "zero_p_value")
    free = _with_p(free, len(soc) - 2, zero_p)._replace(
        law="linear over SoC", names=names, units=(unit, unit, "1", "1")
    )
    tied = tied._replace(law="proportional to SoC", names=("slope",), units=(unit,))
    return _chosen(free, tied)


def _arrhenius(inverse, value, level):
    """Fitted as a line through ln value; errors and R² on the scale of the value."""
    columns = np.stack([np.ones(len(inverse)), inverse], axis=1)
    line = _line(columns, np.log(value), level)
    scale = np.array([np.exp(line.values[0]), 1.0])
    ends = [np.array([np.exp(end[0]), end[1]]) for end in (line.values, line.lower, line.upper)]
    left = [_without(k, columns, np.log(value)) for k in range(len(value))]
    return line._replace(
        law="arrhenius",
        values=ends[0],
        std=line.std * scale,
        lower=ends[1],
        upper=ends[2],
        r_squared=r_squared(value, np.exp(columns @ line.values)),
        cross_validation_rmse=_rms(np.exp(left) - value),
    )


def _line(columns, value, level):
    """Least squares with interval, R² and the error of values left out in turn."""
    values = np.linalg.lstsq(columns, value, rcond=None)[0]
    residual = value - columns @ values
    freedom = len(value) - columns.shape[1]
    std = standard_deviations(covariance_from_jacobian(columns, residual))
    left = [_without(k, columns, value) for k in range(len(value))]
    return Law(
        "",
        (),
        (),
        values,
        std,
        *t_interval(values, std, freedom, level=level),
        r_squared(value, columns @ values),
        _rms(left - value),
        False,
        "",
    )


def _with_p(law, freedom, *more):
    """The law with the p-value of its slope, and others, as further parameters."""
    extra = np.array([_p_value(law.values[0], law.std[0], freedom), *more])
    none = np.full(len(extra), np.nan)
    parts = {name: np.append(getattr(law, name), none) for name in ("std", "lower", "upper")}
    return law._replace(values=np.append(law.values, extra), **parts)


def _p_value(value, std, freedom):
    """Two-sided, of Student's t; NaN where the scatter is not known."""
    from scipy.special import stdtr

    if freedom < 1 or not std > 0:
        return np.nan
    return float(2 * stdtr(freedom, -abs(value / std)))


def _without(place, columns, value):
    """What a line through all values but one says of that one."""
    kept = np.arange(len(value)) != place
    return columns[place] @ np.linalg.lstsq(columns[kept], value[kept], rcond=None)[0]


def _chosen(first, second):
    better = first.cross_validation_rmse <= second.cross_validation_rmse
    return first._replace(chosen=better), second._replace(chosen=not better)


def _rms(error):
    return float(np.sqrt(np.mean(np.square(error))))
