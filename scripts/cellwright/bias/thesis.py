"""Bias functions of the thesis: resistance and OCV of a cell by the shift of its IC peaks.

Source: thesis 4.5, eq. 4.2–4.6. Its products a2·a3, a2·a4, −a2·a5 (and c2·c4 …) are merged, since
only the products can be identified: f = s·ΔV² + ΔV·(k0 + k1·z + k2·z²).
"""

import numpy as np

from cellwright.refusal import Refusal

LEAST_CELLS = 3


def peak_shift(pairs):
    """Shift of the reference's highest peak that both cells show, and mean shift of all.

    Parameters
    ----------
    pairs : from `features.peak_pairs`.

    Returns
    -------
    main_volt, mean_volt : cell minus reference [V].
    """
    shifts = [theirs["voltage_volt"] - ours["voltage_volt"] for _, ours, theirs in pairs]
    highest = np.argmax([ours["height_ampere_hour_per_volt"] for _, ours, _ in pairs])
    return float(shifts[highest]), float(np.mean(shifts))


def quadratic_bias(shift_volt, soc, coefficients):
    """Bias function of R0 and OCV: s·ΔV² + ΔV·(k0 + k1·z + k2·z²).

    Parameters
    ----------
    shift_volt : scalar [V].
    soc : scalar or (k,) [1].
    coefficients : (4,) s, k0, k1, k2.

    Returns
    -------
    bias : shape of soc, unit of the coefficients times volts.

    Source: thesis (4.3), (4.5). Erratum: the worked example (4.6) needs a2 = 0.17 and the factor
    ΔV in the second term; table 4.5 prints 1.7.
    """
    return _columns(shift_volt, np.asarray(soc, float)) @ np.asarray(coefficients)


def quadratic_function(shift_volt, soc, change):
    """Bias function of the shift of the highest peak, fitted on cells that have both.

    Parameters
    ----------
    shift_volt : (c,) main shift of each cell, from `peak_shift` [V].
    soc : (k,) [1]. change : (c, k) cell minus reference.

    Returns
    -------
    coefficients : (4,) s, k0, k1, k2. left_out : (c, k) error of each cell predicted from the
        others, in the unit of the changes.

    Raises
    ------
    Refusal : fewer than three cells (two would be met exactly, one left out could not be
        predicted), or the shifts, or the SoC, are too much alike.
    """
    # ASSUME: The shift of the IC peaks determines resistance and OCV of a cell, by eq. 4.3 of the
    # thesis.
    stacked = np.array([_columns(shift, np.asarray(soc, float)) for shift in shift_volt])
    _enough(shift_volt)
    if np.linalg.matrix_rank(stacked[1:].reshape(-1, 4), rtol=1e-6) < 4:
        raise Refusal("the peak shifts of the calibrating cells, or their SoC, are too much alike")
    return _fitted(stacked, np.asarray(change, float))


def linear_function(shift_volt, change):
    """Bias function of the mean shift of all peaks: one coefficient over all SoC.

    Parameters
    ----------
    shift_volt : (c,) mean shift of each cell [V]. change : (c, k) cell minus reference.

    Returns
    -------
    coefficients : (1,). left_out : (c, k), as of `quadratic_function`.

    Raises
    ------
    Refusal : fewer than three cells.

    Source: thesis (4.4).
    """
    _enough(shift_volt)
    shift = np.asarray(shift_volt, float)[:, None, None]
    return _fitted(shift * np.ones((1, np.shape(change)[1], 1)), np.asarray(change, float))


def _enough(shifts):
    if len(shifts) < LEAST_CELLS:
        raise Refusal(
            f"{len(shifts)} cell(s) beside the reference have pulses and IC peaks; "
            f"{LEAST_CELLS} needed"
        )


def _columns(shift, soc):
    ones = np.ones_like(soc)
    return np.stack([shift**2 * ones, shift * ones, shift * soc, shift * soc**2], axis=-1)


def _fitted(columns, change):
    """Least squares over all cells, and the error of each cell predicted from the others."""
    width, cells = columns.shape[-1], np.arange(len(change))
    errors = []
    for cell in cells:
        others = cells != cell
        part = np.linalg.lstsq(columns[others].reshape(-1, width), change[others].ravel())[0]
        errors.append(columns[cell] @ part - change[cell])
    fit = np.linalg.lstsq(columns.reshape(-1, width), change.ravel())[0]
    return fit, np.array(errors)
