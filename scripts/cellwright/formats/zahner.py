"""Zahner impedance files (.ism): big-endian numbers, magnitude and phase over frequency.

Layout: a version (6 bytes), the number of the last row (6 bytes), then, of all rows, frequency
[Hz], magnitude [ohm], phase [rad] and time [s] as 8-byte floats; what follows is about the test.
"""

import numpy as np

from cellwright.refusal import Refusal

NAME = "zahner"
MARKS = (b"\x00\x00\xff\xff\xff\xff", b"\x00\x00\xff\xff\xff\xfe")
HEAD = 12
COLUMNS = 4
MOST_ROWS = 1 << 20


def recognises(head: bytes) -> bool:
    """The versions that are known."""
    return head.startswith(MARKS)


def read(data: bytes) -> dict[str, np.ndarray]:
    """Frequency [Hz], real and imaginary part [ohm] of one sweep.

    A sweep that begins in the middle, goes to one end of its range and from there to the other,
    passes its first frequencies twice: only the way from end to end counts.

    Raises
    ------
    Refusal
        The file is cut off.
    """
    rows = int.from_bytes(data[6:HEAD], "big") + 1
    if rows > MOST_ROWS or len(data) < HEAD + 8 * COLUMNS * rows:
        raise Refusal(f"the Zahner file is cut off: {len(data)} bytes are too few for {rows} rows")
    values = np.frombuffer(data, ">f8", COLUMNS * rows, HEAD).reshape(COLUMNS, rows)
    frequency, magnitude, phase, _ = values.astype(float)
    start, stop = sorted((int(np.argmin(frequency)), int(np.argmax(frequency))))
    kept = slice(start, stop + 1)
    impedance = magnitude[kept] * np.exp(1j * phase[kept])
    return {
        "frequency_hertz": frequency[kept],
        "impedance_real_ohm": impedance.real,
        "impedance_imaginary_ohm": impedance.imag,
    }
