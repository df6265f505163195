"""Where a course turns for good."""

import numpy as np


def turning_points(values, *, least):
    """Rows where a course turns for good: the start, each extremum after a swing, the end.

    values : (n,), for example the net charge [Ah].
    least : a smaller swing back is no turn, in the unit of `values`.

    Returns rows: ascending; empty without any swing of that size.
    """
    slopes = np.sign(np.diff(values))
    moving = np.flatnonzero(slopes)
    bends = moving[1:][np.diff(slopes[moving]) != 0]
    low = high = heading = 0
    rows = []
    for row in [*bends, len(values) - 1]:
        low = row if values[row] <= values[low] else low
        high = row if values[row] > values[high] else high
        if heading >= 0 and values[high] - values[row] > least:
            rows.append(high)
            heading, low = -1, row
        elif heading <= 0 and values[row] - values[low] > least:
            rows.append(low)
            heading, high = 1, row
    return np.array([*rows, low if heading < 0 else high] if rows else [], int)
