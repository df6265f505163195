"""Two ordered lists paired so that the order stays, at the least cost."""

from itertools import product

import numpy as np


def ordered_pairs(cost, alone_cost):
    """Pairs of members of two ordered lists that keep the order, of the least total cost.

    Parameters
    ----------
    cost : (n, m) of each pair. alone_cost : of each member without a partner; unit of both.

    Returns
    -------
    total : the least. pairs : list of (place in the first list, in the second), in order.

    Source: dynamic programming, S. B. Needleman, C. D. Wunsch, J. Mol. Biol. 48 (1970) 443.
    """
    rows, columns = cost.shape
    best = np.zeros((rows + 1, columns + 1))
    best[:, 0] = alone_cost * np.arange(rows + 1)
    best[0] = alone_cost * np.arange(columns + 1)
    for i, j in product(range(rows), range(columns)):
        alone = alone_cost + min(best[i, j + 1], best[i + 1, j])
        best[i + 1, j + 1] = min(alone, best[i, j] + cost[i, j])
    # Back along the cheapest way, from the end.
    pairs, (i, j) = [], cost.shape
    while i and j:
        if best[i, j] == best[i - 1, j - 1] + cost[i - 1, j - 1]:
            i, j = i - 1, j - 1
            pairs.append((i, j))
        elif best[i, j] == alone_cost + best[i - 1, j]:
            i -= 1
        else:
            j -= 1
    return best[-1, -1], pairs[::-1]
