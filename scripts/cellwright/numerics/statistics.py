"""Statistics of fits: RMS, R², covariance, error propagation, intervals, correlated residuals.

A parameter that the data do not determine has NaN for its variance.
"""

import numpy as np

NORMAL_95 = 1.959964  # standard deviations that hold 95 % of a normal distribution
NORMAL_90 = 1.644854  # and 90 %


def robust_std(deviations):
    """Standard deviation of normal deviations from zero by their median size, in their unit.

    A few outliers change it little; 0 where there are none.

    Parameters
    ----------
    deviations : (n,).

    Source: Rousseeuw & Croux, J. Am. Stat. Assoc. 88 (1993) 1273: 1.4826 median |x|.
    """
    return of_median(np.median(np.abs(deviations))) if np.size(deviations) else 0.0


def of_median(size):
    """Standard deviation of normal deviations whose magnitudes have this median, in its unit."""
    return 1.4826 * float(size)


def white_noise_of(values):
    """Standard deviation of the white noise of a smooth course, by its second differences.

    Parameters
    ----------
    values : (n,) evenly sampled; fewer than three: 0.
    """
    return robust_std(np.diff(values, 2)) / np.sqrt(6.0)


def pooled_rms(errors, weights=None):
    """Weighted root mean square of errors, such as those of several records; None without weight.

    Parameters
    ----------
    errors : (n,). weights : (n,) such as numbers of samples; None: all alike.
    """
    weights = np.ones(len(errors)) if weights is None else np.asarray(weights, float)
    if not weights.sum():
        return None
    return float(np.average(np.square(np.asarray(errors, float)), weights=weights) ** 0.5)


def rms(values):
    """Root mean square of errors, in their unit; NaN where there are none.

    Parameters
    ----------
    values : array of any shape.
    """
    values = np.asarray(values, float)
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else np.nan


def r_squared(value, predicted):
    """Share of the variance that a prediction explains; NaN where nothing varies.

    Parameters
    ----------
    value, predicted : (n,) in one unit.
    """
    spread = np.sum((value - value.mean()) ** 2)
    return float(1 - np.sum((value - predicted) ** 2) / spread) if spread > 0 else np.nan


def covariance_from_jacobian(jacobian, residual):
    """Covariance of the parameters of a least-squares fit, s² (JᵀJ)⁻¹.

    Parameters
    ----------
    jacobian : (n, p) derivative of each residual by each parameter.
    residual : (n,) residuals at the optimum, weighted as they were fitted.

    Returns
    -------
    covariance : (p, p). Rows and columns of a parameter that the data do not determine are NaN;
        all are NaN where there is no residual left over to estimate the scatter from.

    Source: Seber & Wild, Nonlinear Regression (1989), eq. 2.20; by SVD of the scaled Jacobian,
    so that the units of the parameters do not matter.
    """
    jacobian, residual = np.asarray(jacobian, float), np.asarray(residual, float)
    rows, parameters = jacobian.shape
    norm, power = np.sqrt(np.einsum("ij,ij->j", jacobian, jacobian)), residual @ residual
    if rows <= parameters or not np.isfinite(power + norm.sum()):
        return np.full((parameters, parameters), np.nan)
    scale = np.where(norm > 0, norm, 1.0)
    _, singular, directions = np.linalg.svd(jacobian / scale, full_matrices=False)
    kept = singular > rows * np.finfo(float).eps * singular[:1]
    weights = directions[kept] / (singular[kept, None] * scale)
    covariance = power / (rows - parameters) * (weights.T @ weights)
    if not kept.all():
        # A parameter that a null direction of the Jacobian moves is not determined.
        unknown = (np.abs(directions[~kept]) > 1e-6).any(axis=0)
        covariance[unknown] = covariance[:, unknown] = np.nan
    return covariance


def standard_deviations(covariance):
    """Square roots of the diagonal; NaN stays NaN. Shape (p,) from (p, p)."""
    return np.sqrt(np.diagonal(covariance))


def delta_method(function, parameters, covariance):
    """Value of a function of fitted parameters and its standard deviation, by the delta method.

    Parameters
    ----------
    function : takes (p,) and returns a float or an array (m,).
    parameters : (p,) fitted values.
    covariance : (p, p).

    Returns
    -------
    value, std : float or (m,) each, std = √(g C gᵀ) with the gradient g by central differences.
    """
    parameters = np.asarray(parameters, float)
    value = np.asarray(function(parameters), float)
    # The cube root of the machine's precision balances truncation against rounding.
    size = np.fmax(np.abs(parameters), standard_deviations(covariance))
    steps = np.cbrt(np.finfo(float).eps) * np.where(size > 0, size, 1.0)
    columns = [
        (np.asarray(function(parameters + step)) - function(parameters - step)) / (2 * width)
        for step, width in zip(np.diag(steps), steps, strict=True)
    ]
    gradient = np.stack(columns, axis=-1)
    variance = np.einsum("...i,ij,...j", gradient, covariance, gradient)
    return value, np.sqrt(np.maximum(variance, 0.0))


def t_interval(value, std, degrees_of_freedom, *, level=0.95):
    """Confidence interval by Student's t, for an estimate whose scatter was estimated.

    Parameters
    ----------
    value, std : float or (m,) in any one unit.
    degrees_of_freedom : data minus parameters; below 1 the interval is not known (NaN).
    level : coverage, 0 to 1.

    Returns
    -------
    lower, upper : shaped like `value`.
    """
    from scipy.special import stdtrit

    if degrees_of_freedom < 1:
        unknown = np.full(np.shape(value), np.nan)
        return unknown, unknown
    reach = stdtrit(degrees_of_freedom, (1 + level) / 2) * np.asarray(std)
    return value - reach, value + reach


def is_white(near, power, samples):
    """True where neighbouring residuals correlate no more than chance allows (3 sigma).

    Parameters
    ----------
    near : sum of each residual times the one before it.
    power : sum of the squared residuals, same unit.
    samples : number of residuals.
    """
    return bool(near <= 3.0 * power / np.sqrt(samples))


def correlation_factor(residual):
    """Factor by which correlation of neighbouring residuals raises the variance of a mean [1].

    1 + 2·Σ of the autocorrelation up to its first zero crossing; 1 for white noise. A model's
    errors are never white, and without this factor the error bars would be far too small.

    Source: Geyer, Statistical Science 7 (1992) 473, initial positive sequence, simplified.
    """
    centred = residual - residual.mean()
    length = 1 << (2 * len(centred) - 1).bit_length()  # a power of two: fast whatever the length
    power = np.abs(np.fft.rfft(centred, length)) ** 2
    auto = np.fft.irfft(power, length)[: len(centred)]
    if auto[0] <= 0:
        return 1.0
    crossing = np.argmax(auto <= 0) or len(auto)
    return float(1.0 + 2.0 * auto[1:crossing].sum() / auto[0])


def parameter_covariance(gram, power, samples, *, sensitivity=None, residual=None):
    """Covariance of least-squares parameters, for white or for coloured residuals.

    White: s²·G⁻¹. Coloured: G⁻¹·M·G⁻¹ with M = Σ γ(k)·Σ J(t)·J(t+k), γ the autocovariance of the
    residual up to its first zero crossing. So slow errors of the model widen a parameter
    that fast changes of the current determine less than one that slow changes determine.

    Parameters
    ----------
    gram : (p, p) products G = JᵀJ of the sensitivities at the optimum.
    power : sum of squared residuals.
    samples : number of data.
    sensitivity : (p, n) sensitivities J, for coloured residuals.
    residual : (n,) residuals, for coloured residuals.

    Returns
    -------
    covariance : (p, p); NaN for parameters that the data do not determine.

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
    """Pseudo-inverse of a Gram matrix, and which parameters the data do not determine."""
    scale = np.sqrt(gram.diagonal())
    scale = np.where(scale > 0, scale, 1.0)
    scales = scale[:, None] * scale
    size, directions = np.linalg.eigh(gram / scales)
    determined = size > 1e-11
    known = directions[:, determined]
    inverse = (known / size[determined]) @ known.T
    return inverse / scales, (np.abs(directions[:, ~determined]) > 1e-4).any(axis=1)


def _middle(sensitivity, residual):
    """M = Σ γ(k)·Σ J(t)·J(t+k) of the coloured covariance (p, p), by fast Fourier transforms."""
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
