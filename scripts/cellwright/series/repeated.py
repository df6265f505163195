"""Rows that stand in a record twice, or in two files of one test."""

from collections.abc import Mapping

import numpy as np

from cellwright.formats.fields import SERIES

# Odd numbers by which the bits of each column are mixed: of the golden ratio and of two roots.
MIXED = np.array([0x9E3779B97F4A7C15, 0xB504F333F9DE6485, 0xDDB3D742C265539D], np.uint64)
LEAST_REPEAT = 10  # rows of a block, below which equal readings may be chance


def repeated_rows(columns: Mapping, others: Mapping | None = None) -> np.ndarray:
    """Rows (n,) of blocks that stand in others as well, or before in the same record.

    Time, current and voltage are equal to the last digit in ten rows on end and more, with as many
    different voltages: two measurements never are, a resting or simulated constant may be.
    """
    keys = _keys(columns)
    if others is None:
        _, first = np.unique(keys, return_index=True)
        rows = np.ones(len(keys), bool)
        rows[first] = False
    else:
        rows = np.isin(keys, _keys(others))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rows.astype(int), [0]])))
    kept = np.zeros(len(rows), bool)
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        volts = np.unique(columns["voltage_volt"][start:stop])
        kept[start:stop] = len(volts) >= LEAST_REPEAT
    return kept


def _keys(columns):
    """A number of 64 bits for each row, the same only for rows that are equal in all three."""
    keys = np.zeros(len(columns["voltage_volt"]), np.uint64)
    for name, factor in zip(SERIES, MIXED, strict=True):
        # Adding zero makes the two zeros of floating-point numbers one.
        keys ^= (np.ascontiguousarray(columns[name], float) + 0.0).view(np.uint64) * factor
    return keys
