"""What is best done with cells: which to put together, and which to replace."""

from itertools import combinations, product

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csc_array

from cellwright.refusal import Refusal


def strings_by_capacity(capacity_ampere_hour, *, length):
    """Cells put into series strings so that the strings together hold most: sorted, cut in blocks.

    A string holds what its smallest cell holds. Sorting is exact: of all ways, the smallest cell
    of one string is the smallest of all, and with it it costs least to put the next smallest; the
    argument repeats for what is left.

    Parameters
    ----------
    capacity_ampere_hour : (cells,) [Ah]. length : cells in a string. The smallest cells that fill
        no string are left out.

    Returns
    -------
    strings : (strings, length) int, indices of the cells, the largest string first.
    """
    order = np.argsort(-np.asarray(capacity_ampere_hour, float), kind="stable")
    return _blocks(order, length, "string")


def _blocks(order, size, what):
    """Indices in rows of a size, the last that fill none left out; refused where there is none."""
    if len(order) < size:
        raise Refusal(f"{len(order)} cells, wanted at least the {size} of a {what}")
    return order[: len(order) // size * size].reshape(-1, size)


def pairs_of_least_cost(cost):
    """Cells put into pairs of the least total cost: minimum-weight matching, exact.

    Parameters
    ----------
    cost : (cells, cells) symmetric, infinite where two are not to be put together; the diagonal is
        not used. With an odd number of cells one is left out.

    Returns
    -------
    pairs : (cells // 2, 2) int.

    Raises
    ------
    Refusal : fewer than two cells, a cost that is no number, or no solution is found.

    Source: integer programme of perfect matching (Edmonds 1965), solved by HiGHS in scipy.
    """
    cells = len(cost)
    if cells < 2:
        raise Refusal(f"{cells} cell, wanted two or more")
    above = np.triu(np.asarray(cost, float), 1)
    if np.isnan(above).any():
        raise Refusal("the cost of a pair is no number")
    edges = np.argwhere(np.triu(np.isfinite(cost), 1))
    if not len(edges):
        raise Refusal(f"no matching of {cells} cells is found: no two may be put together")
    weight = above[tuple(edges.T)]
    column = np.repeat(np.arange(len(edges)), 2)
    uses = csc_array((np.ones(2 * len(edges)), (edges.ravel(), column)), (cells, len(edges)))
    # Of an odd number one cell stays alone: no cell twice, and as many pairs as there can be.
    count = csc_array(np.ones((1, len(edges))))
    whole = cells // 2
    limits = [LinearConstraint(uses, 0, 1), LinearConstraint(count, whole, whole)]
    binary = {"integrality": np.ones(len(edges)), "bounds": Bounds(0, 1)}
    found = milp(weight, constraints=limits, **binary)
    if found.x is None:
        raise Refusal(f"no matching of {cells} cells is found: {found.message}")
    return edges[found.x > 0.5]


def groups_by_swaps(begin, costs, *, worst=False):
    """Groups improved by exchanging two cells as long as that lowers their cost.

    Parameters
    ----------
    begin : (groups, size) int, indices of cells. costs : function of a list of sorted tuples of
        indices → sequence of float; it is asked once for each tuple, and for many at a time.
    worst : lower the costliest group first and the sum second, else the sum alone.

    Returns
    -------
    groups : (groups, size) int: no exchange of two cells betters it, which need not be the best of
        all; see tests/packs/test_decisions.py for how near it comes.
    """
    groups, known = [tuple(map(int, row)) for row in begin], {}

    def ranks(pairs):
        asked = [tuple(sorted(group)) for pair in pairs for group in pair]
        new = [key for key in dict.fromkeys(asked) if key not in known]
        known.update(zip(new, costs(new) if new else (), strict=True))
        found = [known[key] for key in asked]
        both = zip(found[::2], found[1::2], strict=True)
        return [(max(a, b), a + b) if worst else (a + b,) for a, b in both]

    for _ in range(50):  # sweeps; each lowers the cost, and five to ten have been enough
        before = list(groups)
        for one, other in combinations(range(len(groups)), 2):
            pairs = _exchanges(groups[one], groups[other])
            found = ranks(pairs)
            groups[one], groups[other] = pairs[found.index(min(found))]
        if groups == before:
            break
    return np.array([sorted(group) for group in groups])


def _exchanges(one, other):
    """Two groups as they are, then with every exchange of one cell each."""
    return [(one, other)] + [
        ((*one[:i], other[j], *one[i + 1 :]), (*other[:j], one[i], *other[j + 1 :]))
        for i, j in product(range(len(one)), range(len(other)))
    ]


def even_groups(capacity_ampere_hour, *, size):
    """Cells put into parallel groups of nearly one capacity, for a series string of such groups.

    The string holds what its smallest group holds. Cells are dealt out from the largest, always to
    the emptiest group that has room, and then exchanged in pairs as long as the smallest group
    grows.

    Parameters
    ----------
    capacity_ampere_hour : (cells,) [Ah], groups × size of them. size : cells in a group.

    Returns
    -------
    groups : (groups, size) int, indices of the cells.

    Source: number partitioning with equal counts: greedy (LPT) and pairwise interchange.
    """
    capacity = np.asarray(capacity_ampere_hour, float)
    dealt = _blocks(np.argsort(-capacity, kind="stable"), size, "group")
    groups = [[] for _ in dealt]
    for cell in dealt.ravel():
        open_groups = [group for group in groups if len(group) < size]
        min(open_groups, key=lambda group: capacity[group].sum()).append(int(cell))
    return groups_by_swaps(groups, lambda keys: -capacity[np.array(keys)].sum(axis=1), worst=True)


def gain_of(value, matched, assemblies, draws, *, more_is_better=True):
    """A matched assembly against random ones, with the interval of what it brings.

    Parameters
    ----------
    value : function (assembly, draw) → float; draw None is the cells as their models say.
    matched : assembly. assemblies : random ones. draws : cells as they may be, one draw each; the
        first assembly meets the first draw and so on, round and round.
    more_is_better : of the quantity.

    Returns
    -------
    row : dict: value of the matched one; random_p05, _p50, _p95 of random assemblies of the same
        cells; gain_p05, _p50, _p95 of matched − random over the draws; better_share, of draws in
        which the matched one is better [1].
    """
    nominal = np.array([value(assembly, None) for assembly in assemblies])
    met = [
        value(matched, draw) - value(assemblies[k % len(assemblies)], draw)
        for k, draw in enumerate(draws)
    ]
    better = np.array(met) > 0 if more_is_better else np.array(met) < 0
    row = {"value": float(value(matched, None))}
    for name, values in (("random", nominal), ("gain", met)):
        row |= {f"{name}_p{p:02d}": float(np.percentile(values, p)) for p in (5, 50, 95)}
    return row | {"better_share": float(better.mean())}


def replacements(use, cells, *, capacity_ampere_hour, spare_of=None):
    """Which cell of a pack to replace by the median one, by the energy that brings.

    Parameters
    ----------
    use : function, list of cells → (capacity [Ah], energy [Wh]) of the pack with these cells in
        its places. cells : list, of whatever `use` takes. capacity_ampere_hour : (cells,) of each.
    spare_of : function, the median cell of the list → the one that is put in; None: as it is.

    Returns
    -------
    gains : (cells, 2) capacity [Ah] and energy [Wh] that replacing each cell brings.
    median : index of the median cell.
    in_turn : list of (index, capacity [Ah], energy [Wh]): the best cell replaced, then the best of
        those left, up to three, as long as that brings energy.

    Raises
    ------
    Refusal : fewer than two cells.
    """
    if len(cells) < 2:
        raise Refusal("a pack of one cell has no cell to replace by its median one")
    order = np.argsort(np.asarray(capacity_ampere_hour, float), kind="stable")
    median = int(order[len(cells) // 2])
    spare = spare_of(cells[median]) if spare_of else cells[median]
    now, in_turn = list(cells), []
    before = np.array(use(now))
    first = given = _with_each_replaced(use, now, spare)
    for turn in range(min(3, len(cells))):
        given = _with_each_replaced(use, now, spare) if turn else first
        k = int(np.argmax(given[:, 1]))
        if in_turn and given[k, 1] <= in_turn[-1][2]:
            break
        now[k] = spare
        in_turn.append((k, *map(float, given[k])))
    return first - before, median, in_turn


def _with_each_replaced(use, cells, spare):
    """(capacity, energy) of the pack with each cell in turn replaced, (cells, 2)."""
    return np.array([use([*cells[:k], spare, *cells[k + 1 :]]) for k in range(len(cells))])
