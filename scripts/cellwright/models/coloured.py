"""How sure a fit is whose residuals are not white: neighbouring errors agree, and tell less."""

import numpy as np

WHITE = 3.0  # autocorrelation of neighbours, in its standard deviations, still taken as white


def is_white(near, power, samples):
    """True where neighbouring residuals agree no more than chance lets them (3 of its sigma).

    Parameters
    ----------
    near : sum of each residual times the one before it.
    power : sum of the squared residuals, same unit.
    samples : number of residuals.
    """
    return bool(near <= WHITE * power / np.sqrt(samples))


def parameter_covariance(gram, power, samples, *, sensitivity=None, residual=None):
    """Covariance of least-squares parameters, for white or for coloured residuals.

    White: s²·G⁻¹. Coloured: G⁻¹·M·G⁻¹ with M = Σ γ(k)·Σ J(t)·J(t+k), γ the autocovariance of the
    residual up to its first zero crossing. So a parameter told by fast changes of the current is
    widened less by slow errors of the model than one told by slow changes.

    Parameters
    ----------
    gram : (p, p) products G = JᵀJ of the sensitivities at the optimum.
    power : sum of squared residuals.
    samples : number of data.
    sensitivity : (p, n) sensitivities J, for coloured residuals.
    residual : (n,) residuals, for coloured residuals.

    Returns
    -------
    covariance : (p, p); NaN for parameters that the data do not tell.

    Source: L. Hansen, Econometrica 50 (1982) 1029, for a stationary error; the cut of the
    autocovariance after C. Geyer, Statistical Science 7 (1992) 473, simplified.
    """
    inverse, unknown = _inverse(gram)
    freedom = samples - len(gram)
    if freedom < 1:
        return np.full(gram.shape, np.nan)
    if sensitivity is None:
        covariance = inverse * (power / freedom)
    else:
        middle = _middle(sensitivity, residual) * (samples / freedom)
        covariance = inverse @ middle @ inverse
    covariance[unknown] = covariance[:, unknown] = np.nan
    return covariance


def _inverse(gram):
    """Inverse on the directions that the data tell, and which parameters lie in the others."""
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0, scale, 1.0)
    size, directions = np.linalg.eigh(gram / np.outer(scale, scale))
    told = size > 1e-11
    inverse = (directions[:, told] / size[told]) @ directions[:, told].T
    return inverse / np.outer(scale, scale), (np.abs(directions[:, ~told]) > 1e-4).any(axis=1)


def _middle(sensitivity, residual):
    """Σ γ(k)·Σ J(t)·J(t+k) through the spectra, where it is a product."""
    count = len(residual)
    length = 1 << (2 * count - 1).bit_length()
    power = np.abs(np.fft.rfft(residual, length)) ** 2
    auto = np.fft.irfft(power, length)[:count] / count
    crossing = int(np.argmax(auto <= 0)) or count
    kept = np.zeros(length)
    kept[:crossing] = auto[:crossing]
    kept[length - crossing + 1 :] = auto[1:crossing][::-1]
    # Cut off, the autocovariance need not be one of any process: its spectrum may dip below zero.
    spectrum = np.maximum(np.fft.rfft(kept).real, 0.0)
    folded = spectrum * np.where(np.arange(len(spectrum)) % (length // 2) == 0, 1.0, 2.0)
    waves = np.fft.rfft(sensitivity, length, axis=1)
    return ((waves * folded) @ waves.conj().T).real / length
