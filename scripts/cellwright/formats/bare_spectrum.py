"""A spectrum as three columns of numbers without labels: frequency, real and imaginary part."""

import re

import numpy as np

from cellwright.formats.table import Layout, line_of, read_table

NAME = "bare_spectrum"
NUMBER = rb"\s*[-+]?\d[\d.]*(?:[eE][-+]?\d+)?\s*"
ROW = re.compile(NUMBER + rb"[,;\t]" + NUMBER + rb"[,;\t]" + NUMBER)
COLUMNS = ("frequency_hertz", "impedance_real_ohm", "impedance_imaginary_ohm")
LEAST_ROWS = 5


def recognises(head: bytes) -> bool:
    """Rows of three numbers from the first line on, the first of them above zero and one-way.

    That the third is an imaginary part is seen by `physics.checked_impedance`.
    """
    rows = [row.rstrip(b"\r") for row in head.split(b"\n")[:LEAST_ROWS]]
    if len(rows) < LEAST_ROWS or not all(ROW.fullmatch(row) for row in rows):
        return False
    first = np.array([float(re.split(rb"[,;\t]", row)[0]) for row in rows])
    steps = np.diff(np.log(first)) if np.all(first > 0) else np.zeros(1)
    # ASSUME: Frequencies of a spectrum are spread evenly over decades; a clock's seconds are not.
    return bool(np.all(steps > 0) or np.all(steps < 0)) and np.ptp(steps) < 0.1 * abs(steps[0])


def read(data: bytes) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Frequency [Hz], real and imaginary part [ohm], and notes."""
    delimiter = max(",;\t", key=line_of(data, 1).count)
    return tuple(read_table(data, Layout(COLUMNS, delimiter, 1), COLUMNS))
