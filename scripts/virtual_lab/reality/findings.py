"""What is found in a record: numbers for the table, curves for the figures."""

from typing import NamedTuple

import numpy as np


class Number(NamedTuple):
    """One number of one step (−1: the whole record); `condition`: what the cell was doing."""

    source: str
    real: bool
    cell: str
    test: str
    step: int
    subject: str  # noise, clock, relaxation, pulse, peaks
    condition: str
    quantity: str
    value: float
    unit: str


class Curve(NamedTuple):
    """One line of a figure; the panel says which."""

    source: str
    cell: str
    test: str
    panel: str
    x: np.ndarray
    y: np.ndarray


def numbers(record, step: int, subject: str, condition: str, found: dict) -> list[Number]:
    """Rows for what was found in one step: {quantity: (value, unit)}; what is NaN is left out."""
    about = (record.source.name, record.source.real, record.cell, record.test, int(step))
    return [
        Number(*about, subject, condition, quantity, float(value), unit)
        for quantity, (value, unit) in found.items()
        if np.isfinite(value)
    ]
