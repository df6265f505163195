"""Formulas over columns of millions of rows, piece by piece.

A piece and all that is made of it stay in the processor's memory; of a whole column each step of a
formula is another column, written to the machine's memory and read again.
"""

import numpy as np

PIECE_ROWS = 1 << 15
SAMPLED, NEAR_MEDIAN = 64, (0.45, 0.55)  # one value in so many; quantiles beside the median


def pieces(rows, *, beside=0) -> list[slice]:
    """Slices of a column of so many rows, each with as many rows of the next one as are `beside`.

    What is made of neighbours, by `beside` shorter than the column, is thereby made once a row.
    """
    return [
        slice(first, min(first + PIECE_ROWS + beside, rows))
        for first in range(0, rows - beside, PIECE_ROWS)
    ]


def _made(formula, columns, beside):
    """First row of each piece, and what the formula makes of it, one after the other."""
    for part in pieces(len(columns[0]), beside=beside):
        yield part.start, formula(*(column[part] for column in columns))


def rows_where(holds, *columns, beside=0) -> np.ndarray:
    """Rows (k,) at which something holds of columns.

    Parameters
    ----------
    holds : function of pieces of the columns → mask, shorter by `beside`, as `np.diff` is by 1.
    columns : (n,) arrays.
    """
    found = [np.flatnonzero(mask) + first for first, mask in _made(holds, columns, beside)]
    return np.concatenate(found) if found else np.empty(0, int)


def any_where(holds, *columns, beside=0) -> bool:
    """Whether something holds of columns at any row; arguments as of `rows_where`."""
    return any(np.any(mask) for _, mask in _made(holds, columns, beside))


def all_where(holds, *columns, beside=0) -> bool:
    """Whether something holds of columns at all rows; arguments as of `rows_where`."""
    return all(np.all(mask) for _, mask in _made(holds, columns, beside))


def count_where(holds, *columns, beside=0) -> int:
    """At how many rows something holds of columns; arguments as of `rows_where`."""
    return sum(int(np.count_nonzero(mask)) for _, mask in _made(holds, columns, beside))


def sum_of(formula, *columns, beside=0) -> float:
    """Sum of what a formula makes of columns; arguments as of `rows_where`."""
    return float(sum(np.sum(values) for _, values in _made(formula, columns, beside)))


def column_of(formula, *columns, beside=0, dtype=float) -> np.ndarray:
    """Column (n - beside,) that a formula makes of columns; arguments as of `rows_where`."""
    made = np.empty(max(len(columns[0]) - beside, 0), dtype)
    for first, values in _made(formula, columns, beside):
        made[first : first + len(values)] = values
    return made


def summed(piece, before=None):
    """Put sums in the place of a piece of steps, on top of the last sum `before`; the last one.

    Of one piece after the other they are as `np.cumsum` makes of all steps, to the last bit.
    """
    if before is not None:
        piece[:1] += before
    np.cumsum(piece, out=piece)
    return piece[-1] if len(piece) else before


def largest(values) -> float:
    """Largest magnitude of values (n,), 0 where there are none; NaN where one is NaN."""
    return float(max(np.max(values), -np.min(values))) if len(values) else 0.0


def step_at(values, rows) -> np.ndarray:
    """`np.diff(values)[rows]`: by how much the values change after rows of any shape."""
    return values[rows + 1] - values[rows]


def median_of(formula, *columns, beside=0) -> float:
    """Median of what a formula makes of columns, to the last bit; NaN where it makes nothing.

    NaN also where one value is. Held are only values near the median of a sample; all are, where
    the median does not lie among them.

    Parameters
    ----------
    formula : function of pieces of the columns → values, of which pieces may give any number.
    columns, beside : as of `rows_where`.
    """
    sample = [values[::SAMPLED] for _, values in _made(formula, columns, beside)]
    sample = np.concatenate(sample) if sample else np.empty(0)
    low, high = np.quantile(sample, NEAR_MEDIAN, method="nearest") if len(sample) else (0.0, 0.0)
    count = below = alike = above = 0
    near = []
    for _, values in _made(formula, columns, beside):
        count += len(values)
        below += np.count_nonzero(values < low)
        alike += np.count_nonzero(values == low)
        above += np.count_nonzero(values > high)
        near.append(values[(values > low) & (values <= high)])
    near = np.concatenate(near) if near else sample
    if below + alike + above + len(near) < count:
        return np.nan
    places = np.array([(count - 1) // 2, count // 2]) - below
    if count and np.all((places >= 0) & (places < alike)):
        return float(low)
    places -= alike
    if np.all((places >= 0) & (places < len(near))):
        return float(np.mean(np.partition(near, places)[places]))
    every = [values for _, values in _made(formula, columns, beside)]
    return float(np.median(np.concatenate(every))) if count else np.nan
