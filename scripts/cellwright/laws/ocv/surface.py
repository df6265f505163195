"""A table of the open-circuit voltage over SoC that moves with temperature and always rises."""

from typing import NamedTuple

import numpy as np

RISE_VOLT = 1e-6


class Surface(NamedTuple):
    """OCV = ocv_volt + slope·d + bend·d², d the temperature above `reference_celsius`.

    soc : (n,) even from 0 to 1. ocv_volt, slope, bend : (n,) [V], [V/K], [V/K²].
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
    """The surface of fitted coefficients, carried on to 0 and 100 % SoC.

    Parameters
    ----------
    coefficients : (n, 1 to 3) over the SoC of the readings, about the reference temperature [V,
        V/K, V/K²]; NaN where not known.
    readings : `ocv_readings.Readings` they are from.
    reference_celsius : [degC].
    curve : (n,) voltage that gives the shape beyond what is known [V], or None: the shape ends.

    Returns
    -------
    surface : Surface.
    """
    # ASSUME: Beyond the SoC at which temperatures were compared the shift is that of the nearest.
    soc = np.asarray(readings.soc, float)
    known = np.isfinite(coefficients).all(axis=1)
    full = np.zeros((len(soc), 3))
    for place, column in enumerate(np.transpose(coefficients)):
        full[:, place] = np.interp(soc, soc[known], column[known])
    if curve is not None:
        apart = np.interp(soc, soc[known], full[known, 0] - np.asarray(curve, float)[known])
        full[:, 0] = np.where(known, full[:, 0], curve + apart)
    celsius = readings.celsius[np.isfinite(readings.ocv_volt)]
    return Surface(
        soc,
        *full.T,
        reference_celsius=float(reference_celsius),
        tested_soc=(float(soc[known][0]), float(soc[known][-1])),
        tested_celsius=(float(celsius.min()), float(celsius.max())),
    )


def surface_of(columns):
    """The surface back from its artefact.

    Parameters
    ----------
    columns : dict of (n,) columns of stage `ocv_surface`.

    Returns
    -------
    surface : Surface.
    """
    known = np.asarray(columns["soc"], float)[np.asarray(columns["tested"], bool)]
    names = ("soc", "ocv_volt", "slope_volt_per_kelvin", "bend_volt_per_kelvin_squared")
    return Surface(
        *(np.asarray(columns[name], float) for name in names),
        reference_celsius=float(columns["reference_celsius"][0]),
        tested_soc=(float(known[0]), float(known[-1])),
        tested_celsius=tuple(float(columns[f"tested_{end}_celsius"][0]) for end in ("from", "to")),
    )


def nodes(surface, celsius):
    """The rising table at one temperature and how each of its points moves with temperature.

    Parameters
    ----------
    surface : Surface. celsius : [degC].

    Returns
    -------
    ocv_volt, per_kelvin : (n,) over `surface.soc` [V], [V/K]. Where the bare table would fall,
        the nearest rising one is taken (isotonic regression): its points move together.
    """
    from scipy.optimize import isotonic_regression

    above = celsius - surface.reference_celsius
    bare = surface.ocv_volt + (surface.slope + surface.bend * above) * above
    moves = surface.slope + 2 * surface.bend * above
    rising = isotonic_regression(bare)
    sizes = np.diff(rising.blocks)
    together = np.repeat(np.add.reduceat(moves, rising.blocks[:-1]) / sizes, sizes)
    return rising.x + RISE_VOLT * surface.soc, together


def surface_ocv(surface, soc, celsius):
    """Voltage and both its derivatives, continuous over SoC; for filters.

    Parameters
    ----------
    surface : Surface. soc : (m,) [1], held at 0 and 1 beyond. celsius : [degC].

    Returns
    -------
    ocv_volt, per_soc, per_kelvin : (m,) [V], [V], [V/K]; exact derivatives of one another.

    Source: monotone cubics with harmonic slopes, F. N. Fritsch, J. Butland, SIAM J. Sci. Stat.
    Comput. 5 (1984) 300.
    """
    volt, moves = nodes(surface, celsius)
    width = surface.soc[1] - surface.soc[0]
    at = np.clip(np.asarray(soc, float), surface.soc[0], surface.soc[-1])
    left = np.clip(((at - surface.soc[0]) / width).astype(int), 0, len(surface.soc) - 2)
    share = (at - surface.soc[left]) / width
    slopes, slope_moves = _harmonic(np.diff(volt), np.diff(moves))
    value, rise = _cubic(volt, slopes, left, share)
    return value, rise / width, _cubic(moves, slope_moves, left, share)[0]


def tested(surface, soc, celsius):
    """Whether a state of charge and temperature lie within what was measured; shaped like both."""
    inside_soc = (soc >= surface.tested_soc[0] - 1e-9) & (soc <= surface.tested_soc[1] + 1e-9)
    cold, warm = surface.tested_celsius
    return inside_soc & (celsius >= cold - 0.5) & (celsius <= warm + 0.5)


def ocv_tables(surface, celsius):
    """Tables for a model: one a temperature, with the entropic coefficient beside.

    Parameters
    ----------
    surface : Surface. celsius : sequence of [degC].

    Returns
    -------
    tables : list of dict with ambient_temperature_celsius, soc, ocv_volt, entropic_volt_per_kelvin
        and tested, as `models.basis` keeps its curves.
    """
    return [
        {
            "ambient_temperature_celsius": float(one),
            "soc": surface.soc,
            **dict(zip(("ocv_volt", "entropic_volt_per_kelvin"), nodes(surface, one), strict=True)),
            "tested": tested(surface, surface.soc, one),
        }
        for one in celsius
    ]


def _harmonic(rises, moves):
    """Slopes at the points, in units of the spacing, and how they move with temperature."""
    first, second = rises[:-1], rises[1:]
    total = first + second
    inner = 2 * first * second / total
    inner_moves = 2 * (second**2 * moves[:-1] + first**2 * moves[1:]) / total**2
    return (
        np.concatenate([rises[:1], inner, rises[-1:]]),
        np.concatenate([moves[:1], inner_moves, moves[-1:]]),
    )


def _cubic(values, slopes, left, share):
    """Hermite cubic and its derivative by the share of the interval."""
    ends = [values[left], slopes[left], values[left + 1], slopes[left + 1]]
    s = share
    weights = [
        (1 + 2 * s) * (1 - s) ** 2,
        s * (1 - s) ** 2,
        s**2 * (3 - 2 * s),
        s**2 * (s - 1),
    ]
    rates = [6 * s * (s - 1), (1 - s) * (1 - 3 * s), 6 * s * (1 - s), s * (3 * s - 2)]
    return (
        sum(end * weight for end, weight in zip(ends, weights, strict=True)),
        sum(end * rate for end, rate in zip(ends, rates, strict=True)),
    )
