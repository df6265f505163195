"""Models that are linear in all but a few rates: the rates by lmfit, the rest in closed form.

Hot loops have searches of their own, told beside them: `exponentials` (one pass of a compiled
kernel over a record), `least_squares` (many parameters with priors), `impedance.fit` (many
starts in a compiled kernel).
"""

import numpy as np


def best_logarithms(residual, starts, *, bounds, scale=1.0):
    """Logarithms of the rates that fit best, from several starts.

    Only what a model is not linear in is searched, for at given rates the other parameters follow
    from linear least squares (variable projection).

    Parameters
    ----------
    residual : function (k,) logarithms → (n,) residual of the best linear parameters there.
    starts : (s, k) logarithms to set out from; with k = 0 there is nothing to search.
    bounds : (lowest, highest) of every logarithm.
    scale : change of a logarithm that matters.

    Returns
    -------
    logarithms : (k,) of the start that led to the least sum of squares.

    Source: G. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; lmfit, method
    "least_squares" (trust region reflective).
    """
    starts = np.asarray(starts, float)
    if not starts.shape[1]:
        return np.empty(0)
    # Its import takes longer than most jobs' own: only who searches pays.
    from lmfit import Minimizer, Parameters

    def of_parameters(parameters):
        return residual(np.array(list(parameters.valuesdict().values())))

    fits = []
    for start in starts:
        parameters = Parameters()
        for k, value in enumerate(start):
            parameters.add(f"rate_{k}", value, min=bounds[0], max=bounds[1])
        search = Minimizer(of_parameters, parameters, nan_policy="propagate", calc_covar=False)
        fits.append(search.minimize(method="least_squares", x_scale=scale))
    best = min(fits, key=lambda fit: fit.chisqr)
    return np.array(list(best.params.valuesdict().values()))
