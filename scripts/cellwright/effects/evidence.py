"""The evidence for an effect: what is left without it, over what it would change."""

import numpy as np

BINS = 60


def evidence(step, candidate_columns, sizes, residual, whitening):
    """Residual beside the change that an effect makes, nuisances projected out of both, in bins.

    Parameters
    ----------
    step : State before the effect. candidate_columns : (n, k) [V per unit]. sizes : (k,).
    residual : (n,) [V]. whitening : noise.Whitening.

    Returns
    -------
    found : dict of lists sensitivity_volt, residual_volt, rows, one entry a bin of equal count.
    """
    solution = step.solution
    change = candidate_columns @ sizes
    both = np.stack([change, residual], axis=1)
    white = whitening.apply(both)
    follow = np.linalg.solve(solution.precision, solution.white.T @ white)
    left = both - solution.columns @ follow
    order = np.argsort(left[:, 0])
    parts = np.array_split(order, min(BINS, max(len(order) // 20, 1)))
    return {
        "sensitivity_volt": [float(left[p, 0].mean()) for p in parts],
        "residual_volt": [float(left[p, 1].mean()) for p in parts],
        "rows": [len(p) for p in parts],
    }
