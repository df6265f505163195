"""Which description of OCV over SoC and temperature predicts temperatures it has not seen."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.ocv_entropy import fit_entropic
from cellwright.laws.ocv_forms import HIGHEST_DEGREE, fit_form, form_ocv, form_std
from cellwright.laws.ocv_surface import nodes, surface_from
from cellwright.protocols.ocv_functions import FORMS
from cellwright.refusal import Refusal

ISOTHERMAL, LINE, PARABOLA = "isothermal", "surface", "surface_parabola"
COLUMNS = {ISOTHERMAL: 1, LINE: 2, PARABOLA: 3}


class Function(NamedTuple):
    """One description over temperature: parameters and std (p, q) (none for tables), errors [V].

    function : "log", "two_exponentials", "inverse", "polynomial", "surface" (a table that moves
    along lines over temperature), "surface_parabola" or "isothermal" (a table that does not move:
    the control). cross_validation_rmse_volt : at temperatures left out in turn, the same points
    for all; NaN where too few temperatures are left for the function.
    """

    function: str
    parameters: np.ndarray
    std: np.ndarray
    rmse_volt: float
    cross_validation_rmse_volt: float
    chosen: bool


def compare(readings, *, reference_celsius, largest_std_volt, lowest_soc=0.01, highest_soc=0.99):
    """Fit all functions to readings and choose by leaving out temperatures.

    Parameters
    ----------
    readings : `ocv_readings.Readings` over an even grid of SoC.
    reference_celsius : about which coefficients move [degC].
    largest_std_volt : readings less certain take part in neither fit nor score [V].
    lowest_soc, highest_soc : range that is fitted; the functions have poles at 0 and 1 [1].

    Returns
    -------
    functions : list of Function; exactly one is chosen.

    Raises
    ------
    Refusal : no temperature can be left out, since fewer than three remain with readings certain
        enough.
    """
    sure = _certain(readings, largest_std_volt, lowest_soc, highest_soc)
    kept = readings._replace(ocv_volt=np.where(sure, readings.ocv_volt, np.nan))
    levels = _levels(kept)
    present = levels[np.isfinite(kept.ocv_volt).sum(axis=0) > 0]
    names, settings = [*FORMS, *COLUMNS], {"reference_celsius": reference_celsius}
    if len(np.unique(present)) < 4:
        raise Refusal(
            f"readings within ±{1e3 * largest_std_volt:g} mV at {len(np.unique(present))} "
            "temperature(s); to compare functions by leaving one out takes four"
        )
    whole = {name: _fitted(name, kept, **settings) for name in names}
    inside = {name: _errors(name, whole[name], kept, **settings) for name in names}
    left = {name: np.full(kept.ocv_volt.shape, np.nan) for name in names}
    for level in np.unique(present):
        out = levels == level
        rest = kept._replace(ocv_volt=np.where(out, np.nan, kept.ocv_volt))
        for name in names:
            fit = _fitted(name, rest, near=whole[name], **settings)
            left[name][:, out] = _errors(name, fit, kept, **settings)[:, out]
    scores = _scores(left)
    best = min(scores, key=lambda name: np.nan_to_num(scores[name], nan=np.inf))
    return [
        Function(
            name,
            *_described(name, whole[name], kept, **settings),
            _rms(inside[name]),
            scores[name],
            name == best,
        )
        for name in names
    ]


def _described(name, fit, readings, *, reference_celsius):
    """Parameters and their standard deviations; a table has none."""
    if name not in FORMS:
        return np.array([]), np.array([])
    settings = {"reference_celsius": reference_celsius}
    return fit, form_std(name, fit, *_points(readings), **settings)


def _points(readings):
    """SoC, temperature and voltage of all that was read, (n,) each."""
    known = np.isfinite(readings.ocv_volt)
    soc = np.broadcast_to(readings.soc[:, None], known.shape)
    return soc[known], readings.celsius[known], readings.ocv_volt[known]


def _certain(readings, largest, lowest, highest):
    total = np.hypot(readings.std_volt, readings.common_volt)
    middle = (readings.soc >= lowest - 1e-9) & (readings.soc <= highest + 1e-9)
    return np.isfinite(readings.ocv_volt) & (total <= largest) & middle[:, None]


def _levels(readings):
    """The temperature of each column to 1 K, by which it is left out."""
    return np.round(np.nanmean(readings.celsius, axis=0))


def _scores(left):
    """RMSE over the points that every function could predict; NaN for those that could none."""
    able = {name: error for name, error in left.items() if np.isfinite(error).any()}
    common = np.all([np.isfinite(error) for error in able.values()], axis=0)
    return {name: _rms(error[common]) if name in able else np.nan for name, error in left.items()}


def _rms(error):
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(error**2))) if len(error) else np.nan


def _fitted(name, readings, *, reference_celsius, near=None):
    """Parameters of a form; coefficients over SoC of a table."""
    known = np.isfinite(readings.ocv_volt)
    count = len(np.unique(_levels(readings)[known.any(axis=0)]))
    if name in FORMS:
        return fit_form(
            name,
            *_points(readings),
            reference_celsius=reference_celsius,
            degree=min(HIGHEST_DEGREE, count - 2),
            near=near,
        )
    if name == ISOTHERMAL:
        weight = np.where(known, 1.0, 0.0)
        total = np.nansum(np.where(known, readings.ocv_volt, 0.0), axis=1)
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
        settings = {"reference_celsius": reference_celsius}
        return form_ocv(name, fit, inside, readings.celsius, **settings)[0] - readings.ocv_volt
    known = np.isfinite(fit).all(axis=1)
    if not known.any():
        return np.full(readings.ocv_volt.shape, np.nan)
    surface = surface_from(fit, readings, reference_celsius)
    columns = [nodes(surface, celsius)[0] for celsius in np.nanmean(readings.celsius, axis=0)]
    return np.where(known[:, None], np.stack(columns, axis=1), np.nan) - readings.ocv_volt
