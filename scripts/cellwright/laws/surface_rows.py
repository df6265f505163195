"""Resistance surfaces as rows of tables, and what they say in words."""

import numpy as np

from cellwright.laws.falling import NO_LIMIT, turn_of
from cellwright.laws.surface_forms import OVER_TEMPERATURE
from cellwright.uncertainty import t_interval

REJECTED = 0.05


def law_rows(found):
    """Rows of the table of laws: parameters and scores of each form, and the tests.

    Parameters
    ----------
    found : list of (Pulses, Fitted of each form, Separability of each scale).

    Returns
    -------
    rows : list of dict with the columns of `temperature.law_rows`. A form's rows end with its
        error at SoC left out, in ohm, and both errors as shares; a table has no parameters.
    """
    rows = []
    for pulses, fitted, tests in found:
        rows += [row for one in fitted for row in _form_rows(pulses, one)]
        rows += [row for one in tests for row in _test_rows(pulses, one)]
    return rows


def point_rows(found):
    """Every pulse with what each form makes of it, and with its temperature left out.

    Parameters
    ----------
    found : as in `law_rows`.

    Returns
    -------
    rows : list of dict.
    """
    return [
        {
            "quantity": pulses.quantity,
            "soc": pulses.soc[k],
            "temperature_celsius": pulses.temperature_celsius[k],
            "resistance_ohm": pulses.resistance_ohm[k],
            **{f"{one.surface.form}_ohm": one.fitted_ohm[k] for one in fitted},
            **{f"{one.surface.form}_left_out_ohm": one.left_out_ohm[k] for one in fitted},
        }
        for pulses, fitted, _ in found
        for k in range(len(pulses.soc))
    ]


def sentences(found):
    """What the tests and the scores say of each surface.

    Parameters
    ----------
    found : as in `law_rows`.

    Returns
    -------
    text : list of str, one a surface.
    """
    return [
        " ".join([_heading(pulses), *[_verdict(test) for test in tests], _best(fitted, pulses)])
        for pulses, fitted, tests in found
    ]


def _heading(pulses):
    celsius = np.unique(pulses.temperature_celsius)
    return (
        f"{name_of(pulses)}: {len(pulses.soc)} pulses, {len(celsius)} temperatures from "
        f"{celsius[0]:g} to {celsius[-1]:g} °C, SoC {100 * pulses.soc.min():.0f} to "
        f"{100 * pulses.soc.max():.0f} %."
    )


def name_of(pulses):
    """The name of a surface in tables and figures."""
    what, when = pulses.quantity.split(", ")
    return f"{what} over SoC and temperature, {when}"


_SPLITS = {"R": "a sum of both (thesis eq. 3.11)", "ln R": "a product of both"}


def _verdict(test):
    said = "is rejected" if test.p_value < REJECTED else "is not rejected"
    return (
        f"That SoC and temperature separate into {_SPLITS[test.scale]} {said} "
        f"(p = {test.p_value:.2g}); what each temperature has of its own is "
        f"{100 * test.interaction_net:.1f} % of the resistance, where pulses scatter by "
        f"{100 * test.scatter:.1f} %."
    )


def _best(fitted, pulses):
    best = next(one for one in fitted if one.chosen)
    untested = [one.surface.form for one in fitted if not np.isfinite(one.temperature_rmse)]
    note = f" (too few temperatures to leave one out of the {untested[0]} form)" if untested else ""
    celsius = pulses.temperature_celsius
    turned = {
        one.surface.form: turn_of(
            one.surface.values, one.valid_celsius, (min(celsius), max(celsius))
        )
        for one in fitted
    }
    refused = [f" The {form} form is not offered: it {how}." for form, how in turned.items() if how]
    return (
        f"The {best.surface.form} form predicts temperatures left out best, to "
        f"{1e3 * best.temperature_rmse:.2g} mΩ or {100 * best.temperature_relative:.0f} %{note}."
    ) + "".join(refused)


def _form_rows(pulses, fitted):
    surface = fitted.surface
    own = OVER_TEMPERATURE.get(surface.form, 0)
    spare = len(np.unique(pulses.temperature_celsius)) - own
    rest = len(pulses.soc) - len(surface.values)
    numbers = zip(surface.names, surface.units, surface.values, surface.std, strict=True)
    for k, (name, unit, value, std) in enumerate(numbers):
        limits = t_interval(value, std, spare if k < own else rest)
        yield _row(pulses, fitted, name, unit, (value, std, *limits))
    scores = (
        ("left_out_soc_rmse", "Ohm", fitted.soc_rmse),
        ("left_out_soc_share", "1", fitted.soc_relative),
        ("left_out_temperature_share", "1", fitted.temperature_relative),
    )
    for name, unit, value in scores:
        yield _row(pulses, fitted, name, unit, (value, np.nan, np.nan, np.nan))


def _row(pulses, fitted, name, unit, numbers):
    law = {
        "law": fitted.surface.form,
        "r_squared": fitted.r_squared,
        "cross_validation_rmse": fitted.temperature_rmse,
        "chosen": fitted.chosen,
        "valid_from_celsius": fitted.valid_celsius[0],
        "valid_to_celsius": fitted.valid_celsius[1],
    }
    return _whole(pulses, law, name, unit, numbers)


def _test_rows(pulses, test):
    nothing = np.nan, np.nan, np.nan
    law = {
        "law": f"separability of {test.scale}",
        "r_squared": np.nan,
        "cross_validation_rmse": np.nan,
        "chosen": False,
        "valid_from_celsius": NO_LIMIT[0],
        "valid_to_celsius": NO_LIMIT[1],
    }
    for name in ("f_statistic", "p_value", "interaction", "interaction_net", "scatter"):
        yield _whole(pulses, law, name, "1", (getattr(test, name), *nothing))


def _whole(pulses, law, parameter, unit, numbers):
    value, std, lower, upper = map(float, numbers)
    return {
        "quantity": name_of(pulses),
        **law,
        "parameter": parameter,
        "value": value,
        "std": std,
        "lower": lower,
        "upper": upper,
        "unit": unit,
        "tested_from_celsius": float(pulses.temperature_celsius.min()),
        "tested_to_celsius": float(pulses.temperature_celsius.max()),
    }
