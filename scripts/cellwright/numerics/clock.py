"""What the columns of a record have to be: of one length, finite, and their clock never runs back.

It may stand still, at an edge of the current.
"""

import numpy as np

from cellwright.refusal import Refusal


def refuse_backward(test_time_second, *, of=""):
    """Refuse a clock that runs back, with the row after which it does.

    Parameters
    ----------
    test_time_second : (n,) [s]. of : what it is the clock of, for the message.

    Raises
    ------
    Refusal : as said.
    """
    back = np.flatnonzero(np.diff(test_time_second) < 0)
    if len(back):
        raise Refusal(f"{f'{of}: ' if of else ''}the clock runs back after row {back[0]}")


def checked_columns(columns):
    """Columns of a record as arrays of numbers (n,), in their order.

    Parameters
    ----------
    columns : dict of (n,), `time` among them.

    Raises
    ------
    Refusal : no sample, other lengths, values that are not finite, or a time that runs back.
    """
    arrays = [np.ascontiguousarray(column, float) for column in columns.values()]
    shapes = [f"{name} {one.shape}" for name, one in zip(columns, arrays, strict=True)]
    if len({one.shape for one in arrays}) != 1 or arrays[0].ndim != 1:
        raise Refusal(f"shapes are {', '.join(shapes)}; all must be (n,)")
    if not len(arrays[0]):
        raise Refusal("the record holds no sample")
    if not all(np.isfinite(one).all() for one in arrays):
        raise Refusal(f"{' or '.join(columns)} holds values that are not finite")
    refuse_backward(arrays[list(columns).index("time")])
    return arrays
