"""A second column of time beside the one that is read: the two must not contradict each other."""

from collections.abc import Mapping

import numpy as np

from cellwright.formats.physics import SAME_CLOCK
from cellwright.refusal import Refusal

BESIDE = ("time", "total time", "elapsed time", "run time")  # that count from the record's start
STRAIGHT_SHARE = 1e-3  # of its span, within which one clock is a multiple of the other


def refuse_contradicting(label: str, second: np.ndarray, others: Mapping[str, np.ndarray]) -> None:
    """Refuse a file in which another column of time runs by one factor faster, or slower.

    A clock of steps, of cycles or of loads alone is no multiple of that of the test.

    label, second : of the clock that is read, (n,) [s]. others : (n,) [s] by label.
    """
    for other, values in others.items():
        known = np.isfinite(second) & np.isfinite(values)
        span = np.ptp(second[known]) if known.sum() > 2 else 0.0
        if not span > 0 or np.any(np.diff(values[known]) < 0):
            continue
        factor, begin = np.polyfit(second[known], values[known], 1)
        off = np.max(np.abs(values[known] - factor * second[known] - begin))
        if abs(factor - 1) > SAME_CLOCK and off <= STRAIGHT_SHARE * factor * span:
            raise Refusal(
                f"two columns of time contradict each other: {other!r} runs {factor:.4g} times as "
                f"fast as {label!r}. Take the wrong one out of the file, or correct its unit"
            )
