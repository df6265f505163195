"""Resistance over SoC and temperature: three forms fitted, tested, the best named, as rows."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.laws.points import (
    first_check_up,
    grouped,
    preferred_rate,
    pulses_of_kind,
    rate_classes,
    resistance_name,
)
from cellwright.laws.surface_forms import (
    OVER_TEMPERATURE,
    fit_form,
    levels_of,
    predict,
    separability,
)
from cellwright.laws.temperature import (
    NO_LIMIT,
    falling_range,
    is_usable,
    law_row,
    ranges,
    turn_in_words,
)
from cellwright.numerics.statistics import r_squared, rms, t_interval
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Temperature

TEMPERATURE = Temperature()
UNKNOWN = (np.nan, np.nan)


def resistance_surface(
    resistances, *, delay_second=TEMPERATURE.delay_second, c_rate=TEMPERATURE.c_rate
):
    """Resistance [ohm] of one cell over SoC and temperature in three forms, and which fits best.

    delay_second : delays into the pulse [s]. c_rate : preferred rate of the pulses [1/h].

    Returns rows: the laws; points: measured and fitted. Raises Refusal: too few pulses.
    Source: docs/temperature.md.
    """
    measured = inputs.entries(resistances)
    # Temperatures left out of the fit choose the form: a table meets its own points best.
    fits, reasons = surfaces(measured, delay_second=delay_second, c_rate=c_rate)
    tables = {"rows": law_rows(fits), "points": point_rows(fits)}
    return Result(tables, notes=(*reasons, *sentences(fits)))


def law_rows(fits):
    """Rows of the table of laws: parameters and scores of each form, and tests of separability.

    Parameters
    ----------
    fits : list of (Pulses, Fitted of each form, test of `separability` on each scale).

    Returns
    -------
    rows : list of dict with the columns of `temperature.law_rows`. A form's rows end with its
        error at SoC left out, in ohm, and both errors as shares; a table has no parameters.
    """
    rows = []
    for pulses, fitted, tests in fits:
        rows += [row for fit in fitted for row in _form_rows(pulses, fit)]
        rows += [row for fit in tests for row in _test_rows(pulses, fit)]
    return rows


def point_rows(fits):
    """Rows of all pulses with the resistance [ohm] of each form, and with its temperature left out.

    `fits` : as in `law_rows`.
    """
    return [
        {
            "quantity": pulses.quantity,
            "soc": pulses.soc[k],
            "temperature_celsius": pulses.temperature_celsius[k],
            "resistance_ohm": pulses.resistance_ohm[k],
            **{f"{fit.surface.form}_ohm": fit.fitted_ohm[k] for fit in fitted},
            **{f"{fit.surface.form}_left_out_ohm": fit.left_out_ohm[k] for fit in fitted},
        }
        for pulses, fitted, _ in fits
        for k in range(len(pulses.soc))
    ]


def sentences(fits):
    """Tests of separability and best form, one text a surface; `fits` : as in `law_rows`."""
    return [
        " ".join([_heading(pulses), *[_verdict(test) for test in tests], _best(fitted, pulses)])
        for pulses, fitted, tests in fits
    ]


def _heading(pulses):
    """Number of pulses and range of SoC and temperature of a surface in words."""
    celsius = np.unique(pulses.temperature_celsius)
    return (
        f"{surface_name(pulses)}: {len(pulses.soc)} pulses, {len(celsius)} temperatures from "
        f"{celsius[0]:g} to {celsius[-1]:g} °C, SoC {100 * pulses.soc.min():.0f} to "
        f"{100 * pulses.soc.max():.0f} %."
    )


def surface_name(pulses):
    """The name of a surface in tables and figures."""
    what, when = pulses.quantity.split(", ")
    return f"{what} over SoC and temperature, {when}"


_SPLITS = {"R": "a sum of both (thesis eq. 3.11)", "ln R": "a product of both"}


def _verdict(test):
    """Result of one test of separability in words."""
    verdict = "is rejected" if test["p_value"] < 0.05 else "is not rejected"
    return (
        f"That SoC and temperature separate into {_SPLITS[test['scale']]} {verdict} "
        f"(p = {test['p_value']:.2g}); what each temperature has of its own is "
        f"{100 * test['interaction_net']:.1f} % of the resistance, where pulses scatter by "
        f"{100 * test['scatter']:.1f} %."
    )


def _best(fitted, pulses):
    """Best form, its error, and forms that are not offered, in words."""
    best = next(fit for fit in fitted if fit.chosen)
    untested = [fit.surface.form for fit in fitted if not np.isfinite(fit.temperature_rmse)]
    note = f" (too few temperatures to leave one out of the {untested[0]} form)" if untested else ""
    celsius = pulses.temperature_celsius
    turned = {
        fit.surface.form: turn_in_words(
            fit.surface.values, fit.valid_celsius, (min(celsius), max(celsius))
        )
        for fit in fitted
    }
    refused = [f" The {form} form is not offered: it {how}." for form, how in turned.items() if how]
    return (
        f"The {best.surface.form} form predicts temperatures left out best, to "
        f"{1e3 * best.temperature_rmse:.2g} mΩ or {100 * best.temperature_relative:.0f} %{note}."
    ) + "".join(refused)


def _form_rows(pulses, fitted):
    """Rows of one form: parameters, then errors at SoC and temperatures left out."""
    surface, celsius = fitted.surface, pulses.temperature_celsius
    temperature_parameters = OVER_TEMPERATURE.get(surface.form, 0)
    spare = len(np.unique(celsius)) - temperature_parameters
    rest = len(pulses.soc) - len(surface.values)
    law = {
        "r_squared": fitted.r_squared,
        "cross_validation_rmse": fitted.temperature_rmse,
        "chosen": fitted.chosen,
    }
    columns = zip(surface.names, surface.units, surface.values, surface.std, strict=True)
    entries = [
        (
            name,
            unit,
            value,
            std,
            t_interval(value, std, spare if k < temperature_parameters else rest),
        )
        for k, (name, unit, value, std) in enumerate(columns)
    ]
    scores = (
        ("left_out_soc_rmse", "Ohm", fitted.soc_rmse),
        ("left_out_soc_share", "1", fitted.soc_relative),
        ("left_out_temperature_share", "1", fitted.temperature_relative),
    )
    # Scores stand among the parameters: the table has no columns of their own.
    entries += [(*score, np.nan, UNKNOWN) for score in scores]
    for name, unit, value, std, interval in entries:
        limits = ranges(interval, (celsius.min(), celsius.max()), fitted.valid_celsius)
        head = surface_name(pulses), surface.form, name
        yield law_row(*head, value, std, unit=unit, **law, **limits)


def _test_rows(pulses, test):
    """Rows of one test of separability."""
    celsius = pulses.temperature_celsius
    limits = ranges(UNKNOWN, (celsius.min(), celsius.max()))
    for name in ("f_statistic", "p_value", "interaction", "interaction_net", "scatter"):
        head = surface_name(pulses), f"separability of {test['scale']}", name
        yield law_row(*head, test[name], unit="1", chosen=False, **limits)


FORMS = ("additive", "multiplicative", "table")
LEAST_LEVELS = 4  # of SoC at a temperature: fewer show neither end of the course


class Pulses(NamedTuple):
    """Pulses of one direction, delay and rate; arrays of shape (n,)."""

    quantity: str
    soc: np.ndarray
    temperature_celsius: np.ndarray
    resistance_ohm: np.ndarray


class Fitted(NamedTuple):
    """One form fitted to one set of pulses, with its scores.

    left_out_ohm : (n,) prediction of each pulse by the fit without its temperature; NaN where the
    rest determines none. temperature_rmse, soc_rmse : its error, and that with blocks of SoC left
    out [ohm]; each relative_… the same as a share of the resistance [1]. valid_celsius : where the
    form may be read: the additive one as far as its quadratic falls.
    """

    surface: tuple
    fitted_ohm: np.ndarray
    left_out_ohm: np.ndarray
    r_squared: float
    temperature_rmse: float
    temperature_relative: float
    soc_rmse: float
    soc_relative: float
    chosen: bool
    valid_celsius: tuple = NO_LIMIT


def pulses_of(rows, *, direction, delay_second, c_rate=TEMPERATURE.c_rate):
    """Pulses of one rate at all temperatures that have it, resistance known to 5 % or better.

    Parameters
    ----------
    rows : list of dict, rows of stage `resistance` with ambient_temperature_celsius and cycle.
    direction, delay_second : which pulses, and when in the pulse [s].
    c_rate : rate that is preferred among those that most temperatures have [1/h].

    Returns
    -------
    pulses : Pulses, by temperature and SoC.

    Raises
    ------
    Refusal : fewer than three temperatures, or fewer than four levels of SoC at one, at any rate.
    """
    pulses = pulses_of_kind(first_check_up(rows), direction, delay_second)
    # All pulses weigh alike in a surface, so that a vague one would bend it.
    pulses = [r for r in pulses if not r["resistance_std_ohm"] > 0.05 * r["resistance_ohm"]]
    classes = {rate: _full_courses(same_rate) for rate, same_rate in rate_classes(pulses).items()}
    quantity = ", ".join(resistance_name(direction, delay_second))
    best = classes[preferred_rate(classes, c_rate)] if classes else {}
    count = len(best)
    if count < 3:
        raise Refusal(
            f"{quantity}: pulses of one rate at {LEAST_LEVELS} states of charge at {count} "
            "temperature(s); a surface needs three"
        )
    chosen = [row for celsius in sorted(best) for row in best[celsius]]
    columns = ("soc", "ambient_temperature_celsius", "resistance_ohm")
    return Pulses(quantity, *(np.array([row[c] for row in chosen], float) for c in columns))


def _full_courses(rows):
    """Temperature → rows by SoC, where there are `LEAST_LEVELS` levels of SoC."""
    rows = sorted(rows, key=lambda row: row["soc"])
    return {
        celsius: course
        for celsius, course in grouped(rows, lambda row: row["ambient_temperature_celsius"]).items()
        if levels_of([row["soc"] for row in course]) >= LEAST_LEVELS
    }


def fit_surfaces(pulses):
    """All forms fitted to one set of pulses, the best at temperatures left out chosen.

    The additive form is not, where its quadratic rises within 5 K of the tested temperatures: a
    resistance falls as it warms.

    Parameters
    ----------
    pulses : Pulses.

    Returns
    -------
    fitted : tuple of Fitted in the order of `FORMS`.
    """
    fits = [_fit(form, pulses) for form in FORMS]
    tested = np.min(pulses.temperature_celsius), np.max(pulses.temperature_celsius)
    offered = [
        np.isfinite(fit.temperature_rmse) and is_usable(fit.valid_celsius, tested) for fit in fits
    ]
    errors = np.where(offered, [fit.temperature_rmse for fit in fits], np.inf)
    return tuple(fit._replace(chosen=k == errors.argmin()) for k, fit in enumerate(fits))


def _fit(form, pulses):
    """One form fitted to pulses, with its errors at temperatures and at blocks of SoC left out."""
    soc, celsius, ohm = pulses[1:]
    surface = fit_form(form, soc, celsius, ohm)
    fitted = predict(surface, soc, celsius)
    left_out = _left_out(form, pulses, celsius)
    # Fifths of the pulses by SoC: what is left out is wider than the steps between pulses.
    blocks = np.quantile(soc, np.linspace(0, 1, 6)[1:-1])
    by_soc = _left_out(form, pulses, np.searchsorted(blocks, soc))
    return Fitted(
        surface,
        fitted,
        left_out,
        r_squared(ohm, fitted),
        *(rms(error) for error in (left_out - ohm, (left_out - ohm) / ohm)),
        *(rms(error) for error in (by_soc - ohm, (by_soc - ohm) / ohm)),
        chosen=False,
        valid_celsius=falling_range(*surface.values[:3]) if form == "additive" else NO_LIMIT,
    )


def _left_out(form, pulses, blocks):
    """Prediction [ohm] of each block of pulses by a fit without it; NaN: not determined."""
    soc, celsius, ohm = pulses[1:]
    predicted = np.full(len(ohm), np.nan)
    for out in (blocks == block for block in np.unique(blocks)):
        # A table, too, is a line in 1/T through two temperatures.
        if len(np.unique(celsius[~out])) < OVER_TEMPERATURE.get(form, 2):
            continue
        # For a score the grid's rates are near enough.
        rest = fit_form(form, soc[~out], celsius[~out], ohm[~out], polish=False)
        predicted[out] = predict(rest, soc[out], celsius[out])
    return predicted


def surfaces(rows, *, delay_second=TEMPERATURE.delay_second, c_rate=TEMPERATURE.c_rate):
    """Fitted surfaces of all sets of pulses of a cell, with their tests of separability.

    Parameters
    ----------
    rows : as in `pulses_of`.
    delay_second : delays [s], discharge and charge apart.
    c_rate : preferred rate [1/h].

    Returns
    -------
    fits : list of (Pulses, tuple of Fitted, list of tests).
    reasons : list of sentences for what could not be had.

    Raises
    ------
    Refusal : no surface at all; the reasons are named.
    """
    fits, reasons = [], []
    for direction, delay in product(("discharge", "charge"), delay_second):
        try:
            pulses = pulses_of(rows, direction=direction, delay_second=delay, c_rate=c_rate)
        except Refusal as refusal:
            reasons.append(str(refusal))
            continue
        try:
            tests = separability(*pulses[1:])
        except Refusal as refusal:
            reasons.append(f"{pulses.quantity}: {refusal}")
            tests = []
        fits.append((pulses, fit_surfaces(pulses), tests))
    if not fits:
        raise Refusal("; ".join(reasons) or "no pulses")
    return fits, reasons
