"""Resistance over SoC and temperature: three forms fitted, tested, the best named, as rows."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.laws.law import (
    NO_LIMIT,
    UNKNOWN,
    Law,
    choose,
    law_row,
    left_out,
    ranges,
    rows_of,
    with_more,
)
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
from cellwright.laws.temperature import falling_range, is_usable, turn_in_words
from cellwright.messages import said_of
from cellwright.numerics.statistics import r_squared, rms, t_interval
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Temperature

TEMPERATURE = Temperature()


def resistance_surface(resistances, *, delay_second=TEMPERATURE.delay_second):
    """Resistance [ohm] of one cell over SoC and temperature in three forms, and which fits best.

    delay_second : delays into the pulse [s].

    Returns rows: the laws; points: measured and fitted. Raises Refusal: too few pulses.
    Source: docs/temperature.md.
    """
    measured = inputs.entries(resistances)
    # Temperatures left out of the fit choose the form: a table meets its own points best.
    fits, reasons = surfaces(measured, delay_second=delay_second)
    tables = {"rows": law_rows(fits), "points": point_rows(fits)}
    return Result(tables, notes=(*reasons, *sentences(fits)))


def law_rows(fits):
    """Rows of the table of laws: parameters and scores of each form, and tests of separability.

    Parameters
    ----------
    fits : list of (Pulses, Fitted of each form, test of `separability` on each scale).

    Returns
    -------
    rows : list of dict with the columns of `law.rows_of`.
    """
    rows = []
    for pulses, fitted, tests in fits:
        rows += [row for fit in fitted for row in rows_of(surface_name(pulses), fit.law)]
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
            **{f"{fit.law.law}_ohm": fit.fitted_ohm[k] for fit in fitted},
            **{f"{fit.law.law}_left_out_ohm": fit.left_out_ohm[k] for fit in fitted},
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


_SPLITS = {
    "R": "A function of SoC plus one of temperature (thesis eq. 3.11)",
    "ln R": "A function of SoC times one of temperature",
}


def _verdict(test):
    """Result of one test of separability in words."""
    verdict = "does not describe" if test["p_value"] < 0.05 else "describes"
    return (
        f"{_SPLITS[test['scale']]} {verdict} the resistance (p = {test['p_value']:.2g}): "
        f"{100 * test['interaction_net']:.1f} % of it depends on both together, where pulses "
        f"scatter by {100 * test['scatter']:.1f} %."
    )


def _best(fitted, pulses):
    """Best form, its error, and forms that are not offered, in words."""
    laws = [fit.law for fit in fitted]
    best = next(law for law in laws if law.chosen)
    untested = [law.law for law in laws if not np.isfinite(law.cross_validation_rmse)]
    share = best.values[best.names.index("left_out_temperature_share")]
    note = f" (too few temperatures to leave one out of the {untested[0]} form)" if untested else ""
    turned = {
        law.law: turn_in_words(law.values, law.valid_celsius, law.tested_celsius) for law in laws
    }
    refused = [f" The {form} form is not offered: it {how}." for form, how in turned.items() if how]
    return (
        f"The {best.law} form predicts temperatures left out best, to "
        f"{1e3 * best.cross_validation_rmse:.2g} mΩ or {100 * share:.0f} %{note}."
    ) + "".join(refused)


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
    """One form fitted to one set of pulses.

    law : `law.Law` with its parameters and, among them, its error at SoC left out [ohm] and both
    errors as shares of the resistance [1]; its cross-validation leaves temperatures out. A table
    has no parameters of its own. fitted_ohm : (n,). left_out_ohm : (n,) prediction of each pulse by
    the fit without its temperature; NaN where the rest determines none.
    """

    law: Law
    fitted_ohm: np.ndarray
    left_out_ohm: np.ndarray


def pulses_of(rows, *, direction, delay_second):
    """Pulses of one rate at all temperatures that have it, resistance known to 5 % or better.

    Parameters
    ----------
    rows : list of dict, rows of stage `resistance` with ambient_temperature_celsius and cycle.
    direction, delay_second : which pulses, and when in the pulse [s].

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
    best = classes[preferred_rate(classes)] if classes else {}
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
    laws = [fit.law for fit in fits]
    offered = [
        np.isfinite(law.cross_validation_rmse) and is_usable(law.valid_celsius, law.tested_celsius)
        for law in laws
    ]
    chosen = choose(laws, offered)
    return tuple(fit._replace(law=law) for fit, law in zip(fits, chosen, strict=True))


def _fit(form, pulses):
    """One form fitted to pulses, with its errors at temperatures and at blocks of SoC left out."""
    soc, celsius, ohm = pulses[1:]
    # A table, too, is a line in 1/T through two temperatures.
    over_temperature = OVER_TEMPERATURE.get(form, 2)

    def predicted_without(out):
        # For a score the grid's rates are near enough.
        rest = fit_form(form, soc[~out], celsius[~out], ohm[~out], polish=False)
        return predict(rest, soc[out], celsius[out])

    surface = fit_form(form, soc, celsius, ohm)
    fitted = predict(surface, soc, celsius)
    # Fifths of the pulses by SoC: what is left out is wider than the steps between pulses.
    fifths = np.searchsorted(np.quantile(soc, np.linspace(0, 1, 6)[1:-1]), soc)
    by_temperature, by_soc = (
        left_out(predicted_without, groups, least=over_temperature, levels=celsius)
        for groups in (celsius, fifths)
    )
    # Parameters of temperature have the scatter of the temperatures, others that of all pulses.
    count = len(surface.values)
    spare = np.full(count, len(soc) - count)
    spare[:over_temperature] = len(np.unique(celsius)) - over_temperature
    limits = [t_interval(*about) for about in zip(surface.values, surface.std, spare, strict=True)]
    lower, upper = np.array(limits, float).reshape(-1, 2).T
    law = Law(
        form,
        *(surface.names, surface.units, surface.values, surface.std, lower, upper),
        r_squared=r_squared(ohm, fitted),
        cross_validation_rmse=rms(by_temperature - ohm),
        tested_celsius=(celsius.min(), celsius.max()),
        valid_celsius=falling_range(*surface.values[:3]) if form == "additive" else NO_LIMIT,
    )
    # Scores stand among the parameters: the table has no columns of their own.
    scores = {
        "left_out_soc_rmse": ("Ohm", rms(by_soc - ohm)),
        "left_out_soc_share": ("1", rms((by_soc - ohm) / ohm)),
        "left_out_temperature_share": ("1", rms((by_temperature - ohm) / ohm)),
    }
    return Fitted(with_more(law, scores), fitted, by_temperature)


def surfaces(rows, *, delay_second=TEMPERATURE.delay_second):
    """Fitted surfaces of all sets of pulses of a cell, with their tests of separability.

    Parameters
    ----------
    rows : as in `pulses_of`.
    delay_second : delays [s], discharge and charge apart.

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
            pulses = pulses_of(rows, direction=direction, delay_second=delay)
        except Refusal as refusal:
            reasons.append(str(refusal))
            continue
        try:
            tests = separability(*pulses[1:])
        except Refusal as refusal:
            reasons.append(said_of(pulses.quantity, refusal))
            tests = []
        fits.append((pulses, fit_surfaces(pulses), tests))
    if not fits:
        raise Refusal("; ".join(reasons) or "no pulses")
    return fits, reasons
