"""Rows that stand in a record twice, or in two files of one test."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

SERIES = ("test_time_second", "current_ampere", "voltage_volt")
LEAST_REPEAT = 10  # rows of a block, below which equal readings may be chance


def repeated_rows(columns: Mapping, others: Mapping | None = None) -> np.ndarray:
    """Rows (n,) of blocks that stand in others as well, or before in the same record.

    Time, current and voltage are equal to the last digit in ten rows on end and more, with as many
    different voltages: two measurements never are, a resting or simulated constant may be.
    """
    keys = pd.DataFrame({name: columns[name] for name in SERIES})
    if others is None:
        rows = keys.duplicated(keep="first").to_numpy()
    else:
        known = pd.MultiIndex.from_arrays([others[name] for name in SERIES])
        rows = pd.MultiIndex.from_frame(keys).isin(known)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rows.astype(int), [0]])))
    kept = np.zeros(len(rows), bool)
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        volts = np.unique(columns["voltage_volt"][start:stop])
        kept[start:stop] = len(volts) >= LEAST_REPEAT
    return kept
