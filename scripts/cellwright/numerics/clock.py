"""The one rule for the clock of a record: it may stand still, at an edge, and never runs back."""

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
