"""The analytic functions of the open-circuit voltage with coefficients that move with temperature.

Each linear coefficient is a polynomial in d, the temperature above a reference: K = K⁰ + K¹·d +
K²·d². Rates inside exponentials are the same at all temperatures.
"""

import numpy as np

from cellwright.protocols.ocv_functions import FORMS
from cellwright.uncertainty import covariance_from_jacobian, standard_deviations

HIGHEST_DEGREE = 2


def fit_form(function, soc, celsius, ocv_volt, *, reference_celsius, degree, near=None):
    """Fit one function to voltages over SoC and temperature at once.

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
    from scipy.optimize import least_squares

    form, places = FORMS[function], np.array(FORMS[function].places)
    powers = np.vander(celsius - reference_celsius, degree + 1, increasing=True)
    # Kelvin by the ten, so that columns of the fit are of one size.
    powers = powers / 10.0 ** np.arange(degree + 1)

    def solved(logs):
        columns = form.columns(soc, np.exp(logs))
        design = (columns[:, :, None] * powers[:, None, :]).reshape(len(soc), -1)
        length = np.linalg.norm(design, axis=0)
        length = np.where(length > 0, length, 1.0)
        found = np.linalg.lstsq(design / length, ocv_volt, rcond=None)[0]
        return found / length, design @ (found / length) - ocv_volt

    starts = form.starts if near is None else (tuple(near[places < 0, 0]),)
    logs = np.array([])
    if form.starts[0]:
        fits = [
            least_squares(lambda x: solved(x)[1], np.log(s), bounds=(-12, 7), x_scale=0.5)
            for s in starts
        ]
        logs = min(fits, key=lambda fit: fit.cost).x
    coefficients = solved(logs)[0].reshape(-1, degree + 1) / 10.0 ** np.arange(degree + 1)
    parameters = np.zeros((len(places), degree + 1))
    parameters[places >= 0] = coefficients[places[places >= 0]]
    parameters[places < 0, 0] = np.exp(logs)
    return parameters


def form_std(function, parameters, soc, celsius, ocv_volt, *, reference_celsius):
    """Standard deviations of the parameters of a fit, shaped like them; NaN where undetermined.

    What the function cannot follow counts as scatter.

    Parameters
    ----------
    function, parameters, reference_celsius : as of the fit.
    soc, celsius, ocv_volt : (n,) what was fitted [1], [degC], [V].
    """
    settings = {"reference_celsius": reference_celsius}
    places = np.array(FORMS[function].places)
    free = np.ones(parameters.shape, bool)
    free[places < 0, 1:] = False
    # Linear in the coefficients and all but so in a step of a rate this small.
    steps = np.where((places < 0)[:, None], 1e-5 * parameters, 1e-3) * free
    columns = []
    for row, column in np.argwhere(free):
        step = np.zeros(parameters.shape)
        step[row, column] = steps[row, column]
        ends = [
            form_ocv(function, parameters + s, soc, celsius, **settings)[0] for s in (step, -step)
        ]
        columns.append((ends[0] - ends[1]) / (2 * step[row, column]))
    residual = form_ocv(function, parameters, soc, celsius, **settings)[0] - ocv_volt
    std = np.full(parameters.shape, np.nan)
    std[free] = standard_deviations(covariance_from_jacobian(np.transpose(columns), residual))
    return std


def form_ocv(function, parameters, soc, celsius, *, reference_celsius):
    """Voltage and both its derivatives by a fitted function, analytic; for filters.

    Parameters
    ----------
    function : key of FORMS. parameters : (p, q) of `fit_form`.
    soc, celsius : (n,) or one number each [1], [degC]; SoC between 0 and 1, both excluded.
    reference_celsius : that of the fit [degC].

    Returns
    -------
    ocv_volt, per_soc, per_kelvin : (n,) [V], [V], [V/K].
    """
    form, places = FORMS[function], np.array(FORMS[function].places)
    parameters = np.asarray(parameters, float)
    soc, above = np.broadcast_arrays(np.asarray(soc, float), celsius - reference_celsius)
    linear, rates = parameters[places >= 0], parameters[places < 0, 0]
    degrees = np.arange(linear.shape[1])
    powers = above[..., None] ** degrees
    moves = degrees * above[..., None] ** np.maximum(degrees - 1, 0)
    columns = form.columns(soc, rates)
    return (
        np.sum(columns * (powers @ linear.T), axis=-1),
        np.sum(form.slopes(soc, rates) * (powers @ linear.T), axis=-1),
        np.sum(columns * (moves @ linear.T), axis=-1),
    )
