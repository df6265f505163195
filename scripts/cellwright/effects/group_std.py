"""How sure the size of a group's effect is, with what the model still lacks counted in."""

import numpy as np

from cellwright.effects.group_case import filters_of

BLOCKS = 4  # of each record


def std_of(case, state, name, noises):
    """Standard deviation of a free parameter.

    The larger of two: the posterior's, widened by the scatter of whitened residuals; and that of
    sums over blocks of time, which holds where residuals hang together for longer than the noise
    model knows (an OCV a millivolt off moves branch currents for an hour).

    Parameters
    ----------
    case : group_case.GroupCase. state : group_case.GroupState, its chart made at its values.
    name : of the parameter. noises : tuple of noise.Noise that its solution was found with.

    Returns
    -------
    std : in the parameter's unit.

    Source: K.-Y. Liang, S. Zeger, Biometrika 73 (1986) 13 (sums over clusters); the blocks' number
    b enters as b/(b − 1).
    """
    solution = state.solution
    place = solution.names.index(name)
    influence = np.linalg.solve(solution.chart.precision, np.eye(len(solution.names))[place])
    white = filters_of(case.fit, noises).apply(state.residual)
    scatter = max(float(np.mean(white**2)), 1.0)
    moved = (solution.chart.white @ influence) * white
    number = _blocks(case.fit)
    many = len(moved) // len(number)  # channels
    sums = np.bincount(np.tile(number, many), moved)
    between = float(np.sum((sums - sums.mean()) ** 2)) * len(sums) / (len(sums) - 1)
    return float(np.sqrt(max(influence[place] * scatter, between)))


def _blocks(stack):
    """Number of the block of each row: each record in so many parts of alike length."""
    part = np.zeros(len(stack.file), int)
    for k in range(len(stack.first)):
        rows = np.flatnonzero(stack.file == k)
        part[rows] = BLOCKS * k + BLOCKS * np.arange(len(rows)) // len(rows)
    return part
