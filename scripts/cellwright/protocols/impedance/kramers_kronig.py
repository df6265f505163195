"""Whether a spectrum can belong to a linear, causal, stable cell at all."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal


class KramersKronig(NamedTuple):
    """Residual of the measurement model: complex, over the modulus (n,); its RMS; pairs used."""

    relative_residual: np.ndarray
    rms_relative_residual: float
    pairs: int
    fill: float


def linear_kramers_kronig(
    frequency_hertz, impedance_ohm, *, fill=0.85, pairs_per_decade=3, most_pairs=50
):
    """Fit a chain of RC pairs, which obeys the Kramers-Kronig relations; what is left does not.

    The time constants lie evenly on a logarithmic axis, so that the fit is linear. Pairs are
    added until their resistances begin to oscillate in sign: the share of negative resistance
    says that noise is being fitted.

    Parameters
    ----------
    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].
    pairs_per_decade : pairs that are begun with [1].
    fill : add pairs while 1 − Σ|negative R|/Σ|positive R| stays above this.
    most_pairs : limit of the number of pairs.

    Returns
    -------
    test : KramersKronig; residuals above about 1 % say drift, nonlinearity or artefacts.

    Raises
    ------
    Refusal : fewer than 8 points.

    Source: M. Schönleber, D. Klotz, E. Ivers-Tiffée, Electrochimica Acta 131 (2014) 20,
    eq. 5 (residuals), 12-13 (time constants), 21 (measure of fill).
    """
    frequency, impedance = np.asarray(frequency_hertz, float), np.asarray(impedance_ohm, complex)
    if len(frequency) < 8:
        raise Refusal(f"spectrum of {len(frequency)} points; a Kramers-Kronig test needs 8")
    rates = 2 * np.pi * frequency
    decades = np.log10(frequency.max() / frequency.min())
    most = min(most_pairs, len(frequency))
    # A chain too coarse for a narrow arc oscillates as well: begin where it cannot be that.
    least = min(max(round(pairs_per_decade * decades), 3), most)
    for pairs in range(least, most + 1):
        resistances, residual = _chain(rates, impedance, pairs)
        negative = -resistances[resistances < 0].sum()
        measure = 1 - negative / max(resistances[resistances > 0].sum(), np.finfo(float).tiny)
        if measure <= fill:
            break
    return KramersKronig(
        residual, float(np.sqrt(np.mean(np.abs(residual) ** 2))), pairs, float(measure)
    )


def _chain(rates, impedance, pairs):
    """Least squares of resistance, inductance, capacitance and RC pairs over the modulus."""
    taus = np.geomspace(1 / rates.max(), 1 / rates.min(), pairs)
    relaxing = 1 / (1 + 1j * rates[:, None] * taus)
    series = np.stack([np.ones(len(rates)), 1j * rates, -1j / rates], axis=1)
    columns = np.concatenate([relaxing, series], axis=1) / np.abs(impedance)[:, None]
    size = np.linalg.norm(columns, axis=0)
    target = impedance / np.abs(impedance)
    stacked = np.concatenate([columns.real, columns.imag]) / size
    solution = np.linalg.lstsq(stacked, np.concatenate([target.real, target.imag]), rcond=None)[0]
    return (solution / size)[:pairs], target - columns @ (solution / size)
