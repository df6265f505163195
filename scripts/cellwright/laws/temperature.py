"""A quantity over temperature: the thesis' quadratic and two forms of Arrhenius, side by side."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.lines import fit_line, r_squared
from cellwright.refusal import Refusal

NO_LIMIT = (-np.inf, np.inf)
# K beyond the tested temperatures that a law is offered and drawn for. So far from what it was told
# of a model counts as told, too (models.lookup.SAME_KELVIN).
REACH_KELVIN = 5.0


def turning(b1, b2, b3):
    """Range in which b1 T² + b2 T + b3 is positive and falls with temperature.

    Parameters
    ----------
    b1, b2, b3 : [unit/°C²], [unit/°C], [unit].

    Returns
    -------
    limits : (low, high) [°C]: up to the minimum where it opens upward, from the maximum on where
        it opens downward, and no further than its zero. Infinite where there is no limit, NaN
        where it falls nowhere.
    """
    if b1 == 0:
        return NO_LIMIT if b2 <= 0 else (np.nan, np.nan)
    turn, square = -b2 / (2 * b1), b2**2 - 4 * b1 * b3
    # Of the two zeros the one on the falling branch, for either sign of b1.
    zero = turn - np.sqrt(square) / (2 * b1) if square >= 0 else np.inf
    return (float(-np.inf), float(min(turn, zero))) if b1 > 0 else (float(turn), float(zero))


def falls(valid_celsius, tested_celsius):
    """Whether a law may be read over the tested temperatures and `REACH_KELVIN` beyond them.

    Parameters
    ----------
    valid_celsius, tested_celsius : (low, high) [°C].
    """
    low, high = tested_celsius[0] - REACH_KELVIN, tested_celsius[1] + REACH_KELVIN
    return valid_celsius[0] <= low and high <= valid_celsius[1]


def turn_of(values, valid_celsius, tested_celsius):
    """What ends a law within its use, in words; "" where nothing does.

    Parameters
    ----------
    values : parameters of the law; b1, b2, b3 of a quadratic.
    valid_celsius, tested_celsius : (low, high) [°C].
    """
    how, celsius = _turn(values, valid_celsius, tested_celsius)
    return how.format(f"{celsius:.0f} °C")


def _turn(values, valid, tested):
    """What ends a law within its use, and where [°C]."""
    low, high = valid
    if falls(valid, tested):
        return "", np.nan
    if low > tested[0] - REACH_KELVIN:
        return "has a maximum at {}", low
    if values[0] > 0 and high == -values[1] / (2 * values[0]):
        return "turns upward at {}", high
    return ("is below zero from {} on" if np.isfinite(high) else "rises throughout"), high


def stretches(tested_celsius, valid_celsius):
    """How a law is drawn: the tested temperatures and `REACH_KELVIN` beyond them in pieces.

    Parameters
    ----------
    tested_celsius, valid_celsius : (low, high) [°C].

    Returns
    -------
    pieces : list of (start, stop, sound); sound where the law was tested and may be read.
    """
    low, high = tested_celsius
    ends = low - REACH_KELVIN, high + REACH_KELVIN
    inner = [one for one in valid_celsius if ends[0] < one < ends[1]]
    start, stop = max(low, valid_celsius[0]), min(high, valid_celsius[1])
    edges = sorted({*ends, low, high, *inner})
    return [(one, two, start <= one and two <= stop) for one, two in pairwise(edges)]


def words_of_turns(families):
    """A sentence for each family of resistances whose quadratics turn where they would be used.

    The curve as it would be read decides, not whether its turn is certain: Arrhenius, which never
    turns, is there in its place. How certain it is, is said.

    Parameters
    ----------
    families : dict, name → list of `temperature.Law`, the quadratic of each quantity.

    Returns
    -------
    text : list of str.
    """
    found = []
    for family, laws in families.items():
        turned = [law for law in laws if not falls(law.valid_celsius, law.tested_celsius)]
        if not turned:
            continue
        where = {}
        for law in turned:
            how, celsius = _turn(law.values, law.valid_celsius, law.tested_celsius)
            where.setdefault(how, []).append(celsius)
        count = f"{len(turned)} of {len(laws)}"
        found.append(
            f"{family}: the quadratic of {count} is not offered as a law, for a resistance falls "
            f"as it warms: it {', '.join(how.format(_span(at)) for how, at in where.items())}, "
            f"less than {REACH_KELVIN:g} K beyond the tests or among them (certain at 95 % in "
            f"{sum(law.rises_surely for law in turned)})"
        )
    return found


def _span(celsius):
    low, high = f"{min(celsius):.0f}", f"{max(celsius):.0f}"
    return f"{low} °C" if low == high else f"{low} to {high} °C"


GAS_CONSTANT = 8.314462618  # J/(mol K)
ZERO_CELSIUS = 273.15  # K
REFERENCE = 298.15  # K


class Law(NamedTuple):
    """One fitted law; the arrays hold one number per parameter, in the order the law takes them.

    law : a key of `LAWS`. names, units : of the parameters. values, std, lower, upper : estimate,
    standard deviation, confidence limits; NaN where not known. r_squared : on the scale of the
    quantity, for all laws. line_r_squared : on the scale on which the law is a straight fit (ln x
    over 1/T for Arrhenius). cross_validation_rmse : error of the prediction at temperatures left
    out in turn, NaN where too few remain. excess_std : scatter of the points beyond their own
    errors, on the scale of the fit. tested_celsius : lowest and highest temperature; beyond them
    the law is an extrapolation. valid_celsius : where the law may be read at all: a resistance's
    quadratic only as far as it falls. rises_surely : such a quadratic rises within its use, beyond
    its own error. reason : why something is NaN, or "".
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
    line_r_squared: float = np.nan
    excess_std: float = np.nan
    tested_celsius: tuple = (np.nan, np.nan)
    valid_celsius: tuple = NO_LIMIT
    rises_surely: bool = False


def quadratic_law(temperature_celsius, b1, b2, b3):
    """b1 T² + b2 T + b3 with T in °C (thesis eq. 3.13)."""
    return (b1 * temperature_celsius + b2) * temperature_celsius + b3


def arrhenius_law(temperature_celsius, value_at_25_celsius, activation_energy_joule_per_mole):
    """Value at 25 °C times exp(Ea/R (1/T − 1/298.15 K)): falls with temperature for Ea > 0."""
    return value_at_25_celsius * np.exp(
        activation_energy_joule_per_mole * inverse_temperature(temperature_celsius)
    )


def conductivity_law(temperature_celsius, value_at_25_celsius, activation_energy_joule_per_mole):
    """The same with the factor T before it: σT, not σ, follows Arrhenius (thesis eq. 3.4, 3.5).

    Its activation energy is higher than that of the plain law by R·T, 2.3 kJ/mol near 5 °C.
    """
    kelvin = np.asarray(temperature_celsius, float) + ZERO_CELSIUS
    plain = arrhenius_law(
        temperature_celsius, value_at_25_celsius, activation_energy_joule_per_mole
    )
    return plain * kelvin / REFERENCE


def fit_laws(temperature_celsius, value, *, unit, std=None, level=0.95, falling=False):
    """Fit the laws and choose one by cross-validation.

    Parameters
    ----------
    temperature_celsius, value : (n,) one measured value per row [°C], [any unit].
    unit : of the value, for the units of the parameters.
    std : (n,) standard deviation of each value, or None; weights the points beside the scatter
        that is found (`line.fit_line`). Where one is not known, none is used.
    level : coverage of the confidence intervals.
    falling : the quantity is a resistance, which falls as it warms. A quadratic that rises
        somewhere from 5 K below the tested temperatures to 5 K above is then not chosen.

    Returns
    -------
    laws : tuple of Law: quadratic, Arrhenius, Arrhenius with the factor T; exactly one is chosen:
        the one that predicts left-out temperatures best. What cannot be tested so is not chosen.

    Raises
    ------
    Refusal : fewer than three temperatures; a value that is not positive and finite.

    Source: thesis eq. 3.13, 3.7 and 3.5.
    """
    # ASSUME: Over temperature the scatter is relative under the Arrhenius laws and the same in
    # ohm or ampere-hours at each temperature under the quadratic.
    celsius, value = np.asarray(temperature_celsius, float), np.asarray(value, float)
    std = np.full(len(value), np.nan) if std is None else np.asarray(std, float)
    known = np.isfinite(celsius)
    celsius, value, std = celsius[known], value[known], std[known]
    count = len(np.unique(celsius))
    if count < 3:
        raise Refusal(f"{count} temperature(s); a law over temperature needs three")
    if not (np.isfinite(value) & (value > 0)).all():
        raise Refusal("a value over temperature is not positive; an Arrhenius law needs that")
    errors = {name: _left_out(name, celsius, value, std) for name in LAWS}
    found = [_FITS[name](celsius, value, std, unit, level) for name in LAWS]
    if falling:
        found[0] = _limited(found[0], celsius, value, std, level)
    offered = [law.law for law in found if falls(law.valid_celsius, law.tested_celsius)]
    best = min(offered, key=lambda name: np.nan_to_num(errors[name], nan=np.inf))
    return tuple(
        law._replace(cross_validation_rmse=errors[law.law], chosen=law.law == best) for law in found
    )


def _limited(law, celsius, value, std, level):
    """A resistance's quadratic with where it falls, and whether its turn is beyond its error."""
    ends = law.tested_celsius[0] - REACH_KELVIN, law.tested_celsius[1] + REACH_KELVIN
    # With T counted from an end of the range b2 is the slope there, with its own interval.
    slopes = [fit_line(np.vander(celsius - end, 3), value, std, level=level) for end in ends]
    return law._replace(
        valid_celsius=turning(*law.values), rises_surely=any(one.lower[1] > 0 for one in slopes)
    )


def law_rows(points):
    """All laws of every quantity as rows of a table.

    Parameters
    ----------
    points : list of `laws.points.Point`.

    Returns
    -------
    rows : list of dict, one a parameter: quantity, law, parameter, value, std, lower, upper, unit,
        r_squared, cross_validation_rmse, chosen, tested_from_celsius, tested_to_celsius,
        valid_from_celsius, valid_to_celsius.
    reasons : list of sentences for what is not known.

    Raises
    ------
    Refusal
        No quantity could be fitted; the reasons are named.
    """
    # ASSUME: What is in ohm falls as it warms; capacities and times may have a maximum.
    rows, reasons, quadratics = [], [], {}
    for quantity in dict.fromkeys(point.quantity for point in points):
        mine = [point for point in points if point.quantity == quantity]
        try:
            laws = fit_laws(
                [point.temperature_celsius for point in mine],
                [point.value for point in mine],
                unit=mine[0].unit,
                std=[point.std for point in mine],
                falling=mine[0].unit == "Ohm",
            )
        except Refusal as refusal:
            reasons.append(f"{quantity}: {refusal}")
            continue
        reasons += [f"{quantity}, {law.law} law: {law.reason}" for law in laws if law.reason]
        rows += [row for law in laws for row in rows_of(quantity, law)]
        quadratics.setdefault(mine[0].family or quantity, []).append(laws[0])
    if not rows:
        raise Refusal("; ".join(reasons) or "no quantity is known at three temperatures")
    return rows, reasons + words_of_turns(quadratics)


def rows_of(quantity, law):
    """Rows of one law; `lower` and `upper` bound 95 %, beyond the tested range it is a guess."""
    numbers = zip(law.values, law.std, law.lower, law.upper, strict=True)
    for name, unit, (value, std, lower, upper) in zip(law.names, law.units, numbers, strict=True):
        yield {
            "quantity": quantity,
            "law": law.law,
            "parameter": name,
            "value": float(value),
            "std": float(std),
            "lower": float(lower),
            "upper": float(upper),
            "unit": unit,
            "r_squared": law.r_squared,
            "cross_validation_rmse": law.cross_validation_rmse,
            "chosen": law.chosen,
            "tested_from_celsius": law.tested_celsius[0],
            "tested_to_celsius": law.tested_celsius[1],
            "valid_from_celsius": law.valid_celsius[0],
            "valid_to_celsius": law.valid_celsius[1],
        }


def inverse_temperature(celsius):
    """(1/T − 1/298.15 K)/R [mol/J], the axis on which ln of an Arrhenius law is a line."""
    kelvin = np.asarray(celsius, float) + ZERO_CELSIUS
    return (1 / kelvin - 1 / REFERENCE) / GAS_CONSTANT


def _quadratic(celsius, value, std, unit, level):
    columns = np.vander(celsius, 3)
    line = fit_line(columns, value, std, level=level)
    units = (f"{unit}/degC^2", f"{unit}/degC", unit)
    return _law("quadratic", ("b1", "b2", "b3"), units, line, celsius, value, value)


def _arrhenius(celsius, value, std, unit, level, *, law="arrhenius", factor=1.0):
    """A line through ln(value/factor); its offset is the logarithm of the value at 25 °C."""
    columns = np.stack([np.ones(len(celsius)), inverse_temperature(celsius)], axis=1)
    target = np.log(value / factor)
    line = fit_line(columns, target, std / value, level=level)
    limits = {
        name: np.array([np.exp(getattr(line, name)[0]), getattr(line, name)[1]])
        for name in ("values", "lower", "upper")
    }
    line = line._replace(std=line.std * np.array([limits["values"][0], 1.0]), **limits)
    names = ("value_at_25_celsius", "activation_energy")
    return _law(law, names, (unit, "J/mol"), line, celsius, value, target)


def _conductivity(celsius, value, std, unit, level):
    factor = (celsius + ZERO_CELSIUS) / REFERENCE
    return _arrhenius(celsius, value, std, unit, level, law="arrhenius_t", factor=factor)


LAWS = {
    "quadratic": quadratic_law,
    "arrhenius": arrhenius_law,
    "arrhenius_t": conductivity_law,
}
_FITS = {"quadratic": _quadratic, "arrhenius": _arrhenius, "arrhenius_t": _conductivity}


def _law(law, names, units, line, celsius, value, target):
    predicted = LAWS[law](celsius, *line.values)
    on_line = target + (predicted - value if law == "quadratic" else np.log(predicted / value))
    unproven = line.degrees_of_freedom < 1
    return Law(
        law=law,
        names=names,
        units=units,
        **{name: getattr(line, name) for name in ("values", "std", "lower", "upper")},
        r_squared=r_squared(value, predicted),
        line_r_squared=r_squared(target, on_line),
        cross_validation_rmse=np.nan,
        excess_std=line.excess_std,
        tested_celsius=(float(celsius.min()), float(celsius.max())),
        chosen=False,
        reason="as many data as parameters: no scatter to tell" if unproven else "",
    )


def _left_out(name, celsius, value, std):
    """RMSE at temperatures left out in turn; NaN where the rest would determine no law."""
    levels = np.unique(celsius)
    if len(levels) <= (3 if name == "quadratic" else 2):
        return np.nan
    errors = [
        LAWS[name](
            celsius[out], *_FITS[name](celsius[~out], value[~out], std[~out], "", 0.95).values
        )
        - value[out]
        for out in (celsius == level for level in levels)
    ]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
