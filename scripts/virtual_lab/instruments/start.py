"""When every test of the laboratory begins, and dates from there: no clock of the machine."""

from datetime import datetime
from functools import cache

import numpy as np

START = datetime(2024, 3, 4, 8, 0, 0)
UNIX_START_SECOND = 1_709_539_200.0
DAY_SECOND = 86_400


def date_texts(time_second: np.ndarray, *, day: str, clock: str):
    """Date of each row, to the whole second, as a pyarrow array of texts.

    Parameters
    ----------
    time_second : since the start of the test [s].
    day, clock : forms of strftime; an hour in the form %-I has no leading zero, as in Windows.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    start = START - datetime(START.year, START.month, START.day)
    since = np.floor(np.asarray(time_second)).astype(np.int64) + int(start.total_seconds())
    days, which = np.unique(since // DAY_SECOND, return_inverse=True)
    first = np.datetime64(START, "D")
    texts = pc.strftime(pa.array((first + days).astype("datetime64[s]")), format=day)
    clocks = _clock_texts(clock).take(pa.array(since % DAY_SECOND))
    return pc.binary_join_element_wise(texts.take(pa.array(which)), clocks, " ")


@cache
def _clock_texts(form):
    """Every second of a day."""
    import pyarrow as pa
    import pyarrow.compute as pc

    seconds = pa.array(np.arange(DAY_SECOND).astype("datetime64[s]"))
    texts = pc.strftime(seconds, format=form.replace("%-I", "%I"))
    return pc.replace_substring_regex(texts, "^0", "") if "%-I" in form else texts
