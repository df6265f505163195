"""An instrument's file as columns with standard names and units.

The caller hands the bytes: nothing here opens a file. The sign of the current is the file's own;
series.joining turns it.
"""

from typing import NamedTuple

import numpy as np

from cellwright.formats import arbin, bdf, bitrode, digatron, labview, plett
from cellwright.formats.container import sight, unpacked
from cellwright.formats.physics import checked_impedance, checked_series
from cellwright.refusal import Refusal

READERS = {reader.NAME: reader for reader in (bdf, arbin, bitrode, digatron, labview, plett)}
# What a format itself says of its current; where it says nothing, the data must tell.
SIGN_RULE = {"bdf": "charge_positive"}
HEAD = 1 << 14


class Reading(NamedTuple):
    """What one file holds."""

    columns: dict[str, np.ndarray]
    instrument: str  # the reader that understood it
    kind: str  # "series" or "impedance"


def read(data: bytes, *, name: str, instrument: str | None = None) -> Reading:
    """Read one file of an instrument.

    Parameters
    ----------
    data : bytes
        The file as it lies there; gzip and Zstandard are unpacked.
    name : str
        What messages call the file.
    instrument : str, optional
        Reader to use; blank or None: found from the content.

    Returns
    -------
    Reading
        Series: test_time_second [s], current_ampere [A], voltage_volt [V] and what else there is.
        Impedance: frequency_hertz [Hz], impedance_real_ohm and impedance_imaginary_ohm [ohm].

    Raises
    ------
    Refusal
        The file is empty, cut off, of an instrument without a reader, holds text where a number
        belongs, lacks a column, or holds what no cell can have shown. The message starts with
        `name`.
    """
    try:
        content = unpacked(data)
        reader = _reader(instrument) if instrument else READERS[detect(content)]
        return _checked(reader.read(content), reader.NAME)
    except Refusal as reason:
        raise Refusal(f"{name}: {reason}") from None


def read_simulated(data: bytes, *, name: str) -> dict[str, np.ndarray]:
    """A voltage that was simulated for a test, from a file in the Battery Data Format.

    Parameters
    ----------
    data : bytes
        The file as it lies there, CSV or Parquet; gzip and Zstandard are unpacked.
    name : str
        What messages call the file.

    Returns
    -------
    dict
        test_time_second [s], voltage_volt [V]; nothing of them is checked.

    Raises
    ------
    Refusal
        The file is damaged, or lacks one of the two columns. The message starts with `name`.
    """
    try:
        return bdf.read_simulated(unpacked(data))
    except Refusal as reason:
        raise Refusal(f"{name}: {reason}") from None


def detect(data: bytes) -> str:
    """Name of the reader that recognises the (unpacked) content.

    Raises
    ------
    Refusal
        None does; the message says what the file looks like, where that is known.
    """
    found = [name for name, reader in READERS.items() if reader.recognises(data[:HEAD])]
    if found:
        return found[0]
    if not data.strip():
        raise Refusal("the file is empty (nothing but blanks)")
    what = sight(data)
    looks = f"looks like {what}, which is not read yet" if what else "of no instrument known here"
    raise Refusal(f"{looks}; readers: {', '.join(READERS)}")


def _reader(instrument: str):
    if instrument not in READERS:
        raise Refusal(f"no reader for instrument {instrument!r}; readers: {', '.join(READERS)}")
    return READERS[instrument]


def _checked(columns: dict[str, np.ndarray], instrument: str) -> Reading:
    if "frequency_hertz" in columns:
        return Reading(checked_impedance(columns), instrument, "impedance")
    return Reading(checked_series(columns), instrument, "series")
