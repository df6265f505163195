"""Open-circuit voltage over SoC and temperature: a rising table, functions, and their comparison.

A table moves with temperature along the entropic coefficient. In a function each linear
coefficient is a polynomial in d, the temperature above a reference: K = K⁰ + K¹·d + K²·d². Rates
inside exponentials are the same at all temperatures.
"""

from typing import NamedTuple

import numpy as np

from cellwright.laws.law import best_of, left_out
from cellwright.laws.ocv.entropy import fit_entropic
from cellwright.numerics.statistics import rms
from cellwright.protocols.ocv.functions import FORMS, fit_parameters, parameter_stds
from cellwright.refusal import Refusal


class Surface(NamedTuple):
    """Table of OCV over SoC that moves with temperature: ocv_volt + slope·d + bend·d².

    soc : (n,) even from 0 to 1. ocv_volt, slope, bend : (n,) [V], [V/K], [V/K²]; d is the
    temperature above `reference_celsius` [K].
    tested_soc, tested_celsius : lowest and highest that was measured [1], [degC].
    """

    soc: np.ndarray
    ocv_volt: np.ndarray
    slope: np.ndarray
    bend: np.ndarray
    reference_celsius: float
    tested_soc: tuple
    tested_celsius: tuple


def surface_from(coefficients, readings, reference_celsius, curve=None):
    """Surface from fitted coefficients, extended to 0 and 100 % SoC.

    Parameters
    ----------
    coefficients : (n, 1 to 3) over the SoC of the readings, about the reference temperature [V,
        V/K, V/K²]; NaN where not known.
    readings : `entropy.Readings` they are from.
    reference_celsius : [degC].
    curve : (n,) voltage that gives the shape beyond what is known [V], or None: the shape ends.

    Returns
    -------
    surface : Surface.
    """
    # ASSUME: Beyond the SoC at which temperatures were compared the shift is that of the nearest.
    soc = np.asarray(readings.soc, float)
    finite = np.isfinite(coefficients).all(axis=1)
    full = np.zeros((len(soc), 3))
    for place, column in enumerate(np.transpose(coefficients)):
        full[:, place] = np.interp(soc, soc[finite], column[finite])
    if curve is not None:
        apart = np.interp(soc, soc[finite], full[finite, 0] - np.asarray(curve, float)[finite])
        full[:, 0] = np.where(finite, full[:, 0], curve + apart)
    celsius = readings.celsius[np.isfinite(readings.ocv_volt)]
    return Surface(
        soc,
        *full.T,
        reference_celsius=float(reference_celsius),
        tested_soc=(float(soc[finite][0]), float(soc[finite][-1])),
        tested_celsius=(float(celsius.min()), float(celsius.max())),
    )


def table_at(surface, celsius):
    """Rising table of OCV at one temperature [V], its derivative by temperature [V/K]; (n,) each.

    Where the bare table would fall, the nearest rising one is taken (isotonic regression): its
    points move together.
    """
    from scipy.optimize import isotonic_regression

    above = celsius - surface.reference_celsius
    bare = surface.ocv_volt + (surface.slope + surface.bend * above) * above
    moves = surface.slope + 2 * surface.bend * above
    rising = isotonic_regression(bare)
    sizes = np.diff(rising.blocks)
    together = np.repeat(np.add.reduceat(moves, rising.blocks[:-1]) / sizes, sizes)
    # A rise of 1 µV, below any reading, so that plateaus can be inverted.
    return rising.x + 1e-6 * surface.soc, together


def is_tested(surface, soc, celsius):
    """Whether a SoC and temperature lie within what was measured; shaped like both."""
    inside_soc = (soc >= surface.tested_soc[0] - 1e-9) & (soc <= surface.tested_soc[1] + 1e-9)
    cold, warm = surface.tested_celsius
    return inside_soc & (celsius >= cold - 0.5) & (celsius <= warm + 0.5)


def fit_form(function, soc, celsius, ocv_volt, *, reference_celsius, degree, near=None):
    """Parameters of one OCV function fitted to voltages over SoC and temperature at once.

    Parameters
    ----------
    function : key of FORMS. soc, celsius, ocv_volt : (n,) [1], [degC], [V].
    reference_celsius : about which the coefficients are polynomials [degC].
    degree : of these, 0 to 2.
    near : parameters of an earlier fit, from whose rates the search then sets out.

    Returns
    -------
    parameters : (p, degree + 1), K0, K1, … in rows; a rate has only its first column.

    Source: thesis tables 3.2 and 3.3 (whose printed numbers are not used: erratum S6).
    """
    # ASSUME: Rates inside exponentials do not move with temperature.
    form = FORMS[function]
    rates = None if near is None else near[np.array(form.places) < 0, 0]
    powers = powers_of(celsius, reference_celsius, degree)
    return fit_parameters(form, soc, ocv_volt, powers=powers, near=rates)


def powers_of(celsius, reference_celsius, degree):
    """Powers (n, degree + 1) of the temperature above the reference [K]."""
    return np.vander(celsius - reference_celsius, degree + 1, increasing=True)


def form_ocv(function, parameters, soc, celsius, *, reference_celsius):
    """Open-circuit voltage [V] by a fitted function.

    Parameters
    ----------
    function : key of FORMS. parameters : (p, q) of `fit_form`.
    soc, celsius : (n,) or one number each [1], [degC]; SoC between 0 and 1, both excluded.
    reference_celsius : that of the fit [degC].

    Returns
    -------
    ocv_volt : (n,) [V].
    """
    form, places = FORMS[function], np.array(FORMS[function].places)
    parameters = np.asarray(parameters, float)
    soc, above = np.broadcast_arrays(np.asarray(soc, float), celsius - reference_celsius)
    linear, rates = parameters[places >= 0], parameters[places < 0, 0]
    powers = above[..., None] ** np.arange(linear.shape[1])
    return np.sum(form.columns(soc, rates) * (powers @ linear.T), axis=-1)


# Tables that do not move (the control), move along lines, and along parabolas over temperature.
TABLES = ISOTHERMAL, LINE, PARABOLA = "isothermal", "surface", "surface_parabola"


# Readings less certain take part in neither fit nor score; where the coldest or warmest bias is so,
# the surface takes that of the nearest SoC [V].
LARGEST_STD_VOLT = 0.02


def compare(readings, *, reference_celsius):
    """OCV functions and tables fitted to readings; the best at left-out temperatures is chosen.

    Parameters
    ----------
    readings : `entropy.Readings` over an even grid of SoC.
    reference_celsius : about which coefficients move [degC].

    Returns
    -------
    functions : list of dict: function (a key of FORMS, or one of TABLES), parameters and std (p, q)
        (none for tables), rmse_volt, cross_validation_rmse_volt (at temperatures left out in turn,
        the same points for all; NaN where too few are left for the function), chosen (exactly one).

    Raises
    ------
    Refusal : no temperature can be left out, since fewer than three remain with readings certain
        enough.
    """
    total = np.hypot(readings.std_volt, readings.common_volt)
    # The functions have poles at 0 and 1.
    middle = np.abs(readings.soc - 0.5) <= 0.49 + 1e-9
    sure = np.isfinite(readings.ocv_volt) & (total <= LARGEST_STD_VOLT) & middle[:, None]
    kept = readings._replace(ocv_volt=np.where(sure, readings.ocv_volt, np.nan))
    levels = _levels(kept)
    present = levels[np.isfinite(kept.ocv_volt).sum(axis=0) > 0]
    names, settings = [*FORMS, *TABLES], {"reference_celsius": reference_celsius}
    if len(np.unique(present)) < 4:
        raise Refusal(
            f"readings within ±{1e3 * LARGEST_STD_VOLT:g} mV at {len(np.unique(present))} "
            "temperature(s); to compare functions by leaving one out takes four"
        )
    fits, inside, outside = {}, {}, {}
    for name in names:
        fits[name] = whole = _fitted(name, kept, **settings)
        inside[name] = _errors(name, whole, kept, **settings)

        def errors_without(out, name=name, whole=whole):
            rest = kept._replace(ocv_volt=np.where(out, np.nan, kept.ocv_volt))
            # Each fit sets out from the whole one: a search from afar might end elsewhere.
            fit = _fitted(name, rest, near=whole, **settings)
            return _errors(name, fit, kept, **settings)[:, out].T

        outside[name] = left_out(errors_without, levels, least=1, shape=middle.shape)
    scores, (soc, celsius, volt) = _scores(outside), _points(kept)
    best, nothing, described = best_of(scores), np.array([]), []
    for name, fit in fits.items():
        about = {"parameters": nothing, "std": nothing}
        if name in FORMS:
            powers = powers_of(celsius, reference_celsius, fit.shape[1] - 1)
            std = parameter_stds(FORMS[name], fit, soc, volt, powers=powers)
            about = {"parameters": fit, "std": std}
        about["rmse_volt"] = rms(inside[name][np.isfinite(inside[name])])
        about["cross_validation_rmse_volt"] = scores[name]
        described.append({"function": name, **about, "chosen": name == best})
    return described


def _points(readings):
    """SoC [1], temperature [°C] and voltage [V] of all readings, (n,) each."""
    finite = np.isfinite(readings.ocv_volt)
    soc = np.broadcast_to(readings.soc[:, None], finite.shape)
    return soc[finite], readings.celsius[finite], readings.ocv_volt[finite]


def _levels(readings):
    """Temperature of each column [°C] to 1 K, by which it is left out."""
    return np.round(np.nanmean(readings.celsius, axis=0))


def _scores(errors):
    """RMSE [V] over the points that every function could predict; NaN: a function predicts none."""
    predicting = {name: error for name, error in errors.items() if np.isfinite(error).any()}
    common = np.all([np.isfinite(error) for error in predicting.values()], axis=0)
    return {
        name: rms(error[common]) if name in predicting else np.nan for name, error in errors.items()
    }


def _fitted(name, readings, *, reference_celsius, near=None):
    """Parameters of a function, or coefficients over SoC of a table."""
    finite = np.isfinite(readings.ocv_volt)
    count = len(np.unique(_levels(readings)[finite.any(axis=0)]))
    if name in FORMS:
        return fit_form(
            name,
            *_points(readings),
            reference_celsius=reference_celsius,
            degree=min(2, count - 2),  # one temperature more than coefficients
            near=near,
        )
    if name == ISOTHERMAL:
        weight = np.where(finite, 1.0, 0.0)
        total = np.nansum(np.where(finite, readings.ocv_volt, 0.0), axis=1)
        with np.errstate(invalid="ignore"):
            return (total / weight.sum(axis=1))[:, None]
    fitted = fit_entropic(readings, reference_celsius=reference_celsius)
    return (
        fitted.parabola if name == PARABOLA else np.stack([fitted.ocv_volt, fitted.slope], axis=1)
    )


def _errors(name, fit, readings, *, reference_celsius):
    """Prediction minus reading, (m, k) [V], NaN where either is missing."""
    if name in FORMS:
        inside = np.clip(readings.soc, 1e-6, 1 - 1e-6)[:, None]
        ocv_volt = form_ocv(
            name, fit, inside, readings.celsius, reference_celsius=reference_celsius
        )
        return ocv_volt - readings.ocv_volt
    finite = np.isfinite(fit).all(axis=1)
    if not finite.any():
        return np.full(readings.ocv_volt.shape, np.nan)
    surface = surface_from(fit, readings, reference_celsius)
    columns = [table_at(surface, celsius)[0] for celsius in np.nanmean(readings.celsius, axis=0)]
    return np.where(finite[:, None], np.stack(columns, axis=1), np.nan) - readings.ocv_volt
