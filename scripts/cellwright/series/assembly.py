"""The readings of one test → one series, current positive on charge."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..formats import SIGN_RULE, Reading
from ..refusal import Refusal
from .joining import join
from .sign import charge_positive


class Assembled(NamedTuple):
    """One series and what a person should know of how it came about."""

    columns: dict[str, np.ndarray]
    notes: tuple[str, ...]


def assemble(readings: Sequence[Reading], *, stated_sign: str | None = None) -> Assembled:
    """Join the readings of one test and turn the current positive on charge.

    Parameters
    ----------
    readings : sequence of Reading, in time order
    stated_sign : {None, "charge_positive", "discharge_positive"}
        What the sheet says of the files; blank or None: found from the data.

    Returns
    -------
    Assembled
        Columns: test_time_second [s], current_ampere [A, + charge], voltage_volt [V], file_index
        and what else the files hold.

    Raises
    ------
    Refusal
        A reading is no series, the files are out of order, or the sign cannot be known.
    """
    for number, reading in enumerate(readings, start=1):
        if reading.kind != "series":
            raise Refusal(f"file {number} holds {reading.kind}, a series is wanted")
    joined = join([reading.columns for reading in readings])
    rules = {SIGN_RULE.get(reading.instrument) for reading in readings}
    default = rules.pop() if len(rules) == 1 else None
    signed = charge_positive(joined.columns, stated=stated_sign or None, default=default)
    return Assembled(signed.columns, (*joined.notes, *([signed.note] if signed.note else [])))
