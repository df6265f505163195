"""What a fit does not tell, in words."""

import numpy as np

# Relative standard deviation from which a parameter is not told: its 95 % interval, 1.96 times
# that wide, reaches down to zero.
NOT_TOLD = 0.51
# What two parameters form together is told where it is known this many times better than each.
BETTER = 5.0


def verdict(names, values, covariance, lower, upper):
    """What the data do not tell of a fit's parameters; empty where they tell all.

    A parameter is not told where its 95 % interval, from the covariance, reaches zero (relative
    standard deviation above 0.51), or where the fit ran to the limit of its search. Of two that
    are not told, their sum (resistances) or ratio (a pair's R/tau, one over its capacitance) is
    named where that is known five times better.

    Parameters
    ----------
    names, values, covariance, lower, upper : of the parameters, as in `fit.CircuitFit`; the limits
        of their search in their units.

    Returns
    -------
    words : sentences, joined by "; ".
    """
    spread = np.sqrt(np.diag(covariance)) / np.abs(values)
    said = []
    for index, name in enumerate(names):
        if lower[index] == upper[index]:
            continue
        limit = _at_limit(names, values, lower, upper, index)
        if limit:
            said.append(limit)
        elif spread[index] > NOT_TOLD and not name.startswith("ocv"):
            said.append(f"{name} cannot be told: it is known within ±{1.96 * spread[index]:.0%}")
        elif np.isnan(spread[index]) and name.startswith("tau"):
            said.append(f"{name} cannot be told: its pair has no voltage")
    return "; ".join([*said, *_together(names, values, covariance, spread)])


def _at_limit(names, values, lower, upper, index):
    name, value = names[index], values[index]
    tau = name.startswith("tau")
    if tau and value >= upper[index] * (1 - 1e-9):
        found = f"the fit runs to the longest that was searched, {value:.3g} s"
        return f"{name} cannot be told, nor r{name[3]}_ohm: {found}"
    if tau and value <= lower[index] * (1 + 1e-9):
        return (
            f"{name} is no longer than {value:.3g} s, the shortest searched: its pair acts at once"
        )
    if value <= lower[index] or value >= upper[index]:
        return f"{name} lies at the bound of its search, {value:.3g}"
    return ""


def _together(names, values, covariance, spread):
    """Sums and ratios that are known much better than what they are made of."""
    lost = [i for i in range(len(names)) if spread[i] > NOT_TOLD and names[i][:3] != "ocv"]
    for i, j in [(i, j) for i in lost for j in lost if i < j]:
        kind, gradient = _combined(names[i], names[j], values[[i, j]])
        part = covariance[np.ix_([i, j], [i, j])]
        known = np.sqrt(max(gradient @ part @ gradient, 0.0))
        if kind and known * BETTER < min(spread[i], spread[j]):
            correlation = part[0, 1] / np.sqrt(part[0, 0] * part[1, 1])
            words = f"{names[i]} and {names[j]} are told only as their {kind}"
            yield f"{words} (±{1.96 * known:.0%}; correlation {correlation:.3f})"


def _combined(first, second, values):
    """Name of what two parameters form, and the gradient of its logarithm."""
    if first[0] == second[0] == "r":
        return "sum", np.ones(2) / values.sum()
    if first[0] == "r" and second == f"tau{first[1]}_second":
        return "ratio", np.array([1.0, -1.0]) / values
    return "", np.zeros(2)
