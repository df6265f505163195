"""One engine for laws: a form, its fit, its error where it was not fitted, the choice, the rows."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cellwright.numerics.lines import fit_line, generalised_line
from cellwright.numerics.statistics import r_squared, rms

NO_LIMIT = (-np.inf, np.inf)
UNKNOWN = (np.nan, np.nan)


class Form(NamedTuple):
    """A law as data: what it is linear in, and what its parameters are called.

    name : in tables. columns : axis (n,), such as a temperature [°C] → (n, p) that the parameters
    multiply. names, units : of the parameters; {} stands for the unit of the value. logarithm :
    linear is ln(value/factor), and the first parameter is told as the value whose logarithm was
    fitted. factor : axis → what the value has besides.
    """

    name: str
    columns: Callable
    names: tuple
    units: tuple
    logarithm: bool = False
    factor: Callable = np.ones_like


class Law(NamedTuple):
    """One fitted law; arrays hold one number per parameter.

    law : name of its form. names, units : of the parameters. values, std, lower, upper : estimate,
    standard deviation, confidence limits; NaN where not known. r_squared : on the scale of the
    quantity, for all laws. cross_validation_rmse : error of the prediction at what was left out in
    turn, such as a temperature; NaN where too few remain. tested_celsius : lowest and highest
    temperature; beyond them the law is an extrapolation. valid_celsius : where the law may be read
    at all: a resistance's quadratic only as far as it falls. rises_surely : such a quadratic rises
    within its use, beyond its own error. reason : why something is NaN, or "".
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
    chosen: bool = False
    reason: str = ""
    tested_celsius: tuple = UNKNOWN
    valid_celsius: tuple = NO_LIMIT
    rises_surely: bool = False


def value_of(form, axis, values):
    """Value of a law at (n,) places of its axis; `values` : (p,) parameters."""
    axis = np.asarray(axis, float)
    if not form.logarithm:
        return form.columns(axis) @ np.asarray(values, float)
    logarithm = form.columns(axis) @ np.array([np.log(values[0]), *values[1:]])
    return form.factor(axis) * np.exp(logarithm)


def fit_law(form, axis, value, std=None, *, unit, groups=None):
    """One law fitted to values, with intervals and its error at what was left out.

    Parameters
    ----------
    form : Form. axis, value : (n,) such as temperatures [°C], [any unit].
    std : (n,) standard deviation of each value, weighted beside the scatter that is found
        (`lines.fit_line`); or (n, n) covariance (`lines.generalised_line`); None: not known.
    unit : of the value.
    groups : (n,) rows of one number are left out together; None: each by itself.

    Returns
    -------
    law : Law with 95 % limits; where the logarithm is linear, errors are those of it.
    """
    axis, value = np.asarray(axis, float), np.asarray(value, float)
    groups = np.arange(len(value)) if groups is None else groups

    def predicted_without(out):
        rest = _line_of(form, axis, value, std, ~out).values
        return value_of(form, axis[out], _parameters(form, rest))

    line = _line_of(form, axis, value, std, np.ones(len(value), bool))
    values, deviations = _parameters(form, line.values), np.array(line.std)
    lower, upper = (_parameters(form, limit) for limit in line.interval())
    if form.logarithm:
        deviations[0] *= values[0]
    whole = value_of(form, axis, values)
    others = left_out(predicted_without, groups, least=len(form.names))
    return Law(
        law=form.name,
        names=form.names,
        units=tuple(text.format(unit) for text in form.units),
        values=values,
        std=deviations,
        lower=lower,
        upper=upper,
        r_squared=_weighted_r_squared(line, value, std)
        if np.ndim(std) == 2
        else r_squared(value, whole),
        cross_validation_rmse=rms(others - value),
        reason="as many data as parameters: no scatter to tell"
        if line.degrees_of_freedom < 1
        else "",
    )


def left_out(predict, groups, *, least, levels=None, shape=()):
    """Prediction of each group of rows by a fit to the others; NaN where these determine none.

    Parameters
    ----------
    predict : function, which rows are left out (n,) bool → their prediction by the others.
    groups : (n,) such as temperatures; rows of one are left out together.
    least : how many levels the others must have. levels : (n,); None: the groups themselves.
    shape : of the prediction of one row.

    Returns
    -------
    predicted : (n, *shape).
    """
    levels = groups if levels is None else levels
    predicted = np.full((len(groups), *shape), np.nan)
    for out in (groups == group for group in np.unique(groups)):
        if len(np.unique(levels[~out])) >= least:
            predicted[out] = predict(out)
    return predicted


def best_of(errors):
    """Name with the smallest error, the first of equals; `errors` : dict, name → error or NaN."""
    return min(errors, key=lambda name: np.nan_to_num(errors[name], nan=np.inf))


def choose(laws, offered=None):
    """The laws as a tuple, the one chosen that predicts best what was left out.

    `offered` : bool of each law, whether it may be chosen; None: all.
    """
    offered = [True] * len(laws) if offered is None else offered
    able = {law.law: law for law, may in zip(laws, offered, strict=True) if may}
    best = best_of({name: law.cross_validation_rmse for name, law in able.items()})
    return tuple(law._replace(chosen=law.law == best) for law in laws)


def with_more(law, more):
    """A law with further numbers among its parameters: `more`, name → (unit, value)."""
    units, values = zip(*more.values(), strict=True)
    unknown = np.full(len(more), np.nan)
    parts = {name: np.append(getattr(law, name), unknown) for name in ("std", "lower", "upper")}
    return law._replace(
        names=(*law.names, *more),
        units=(*law.units, *units),
        values=np.append(law.values, values),
        **parts,
    )


def rows_of(quantity, law, *, with_ranges=True):
    """Rows of one law, a parameter each, with its 95 % limits and the tested and valid range."""
    scores = {n: getattr(law, n) for n in ("r_squared", "cross_validation_rmse", "chosen")}
    parameters = (law.names, law.units, law.values, law.std, law.lower, law.upper)
    rows = []
    for name, unit, value, std, *limits in zip(*parameters, strict=True):
        reach = ranges(limits, law.tested_celsius, law.valid_celsius) if with_ranges else {}
        more = scores | reach
        rows.append(law_row(quantity, law.law, name, value, std, unit=unit, **more))
    return rows


def law_row(quantity, law, parameter, value, std=np.nan, *, unit, **more):
    """One row of the table of laws, a parameter of a law; `more` : further columns, by name.

    Scores that are not among them are NaN, and the law counts as chosen.
    """
    head = {"quantity": quantity, "law": law, "parameter": parameter}
    known = {"value": float(value), "std": float(std), "unit": unit}
    scores = {"r_squared": np.nan, "cross_validation_rmse": np.nan, "chosen": True}
    return head | known | scores | more


def ranges(interval, tested_celsius, valid_celsius=NO_LIMIT):
    """Columns of the table of laws: (lower, upper) of a parameter, tested and valid range [°C]."""
    names = ("lower", "upper", "tested_from_celsius", "tested_to_celsius")
    names += ("valid_from_celsius", "valid_to_celsius")
    return dict(zip(names, map(float, (*interval, *tested_celsius, *valid_celsius)), strict=True))


def _line_of(form, axis, value, std, rows):
    """Line of a law through some of the rows."""
    columns, target = form.columns(axis[rows]), value[rows]
    if np.ndim(std) == 2:
        return generalised_line(columns, target, std[np.ix_(rows, rows)])
    own = None if std is None else std[rows]
    if not form.logarithm:
        return fit_line(columns, target, own)
    relative = None if own is None else own / target
    return fit_line(columns, np.log(target / form.factor(axis[rows])), relative)


def _parameters(form, coefficients):
    """Parameters of a law from the coefficients of its line, or limits from theirs."""
    if not form.logarithm:
        return coefficients
    return np.array([np.exp(coefficients[0]), *coefficients[1:]])


def _weighted_r_squared(line, value, covariance):
    """R² of a generalised line [1], residuals weighted by the covariance."""
    flat = generalised_line(np.ones((len(value), 1)), value, covariance)
    whole, rest = (
        each.reduced_chi_square * max(each.degrees_of_freedom, 0) for each in (flat, line)
    )
    return 1 - rest / whole if flat.reduced_chi_square > 0 else np.nan
