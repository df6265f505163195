"""A cell held against the reference of its type: all that a correction is made from."""

from typing import NamedTuple

import numpy as np

from cellwright.bias import thesis
from cellwright.bias.courses import KNOTS, courses_of
from cellwright.bias.features import (
    charge_pair,
    charge_shift,
    differences,
    peak_pairs,
    resistance_ratio,
    same_cycles,
)
from cellwright.circuits.model_file import member_of
from cellwright.refusal import Refusal


class Compared(NamedTuple):
    """A cell of a type against its reference.

    shown : Shown. differences, ratio, ratio_words : of `features.differences` and
    `features.resistance_ratio`.
    shift_volt : main and mean shift of its IC peaks [V], None without peaks that are the same.
    opened_volt : change of the OCV by its charge, see `opened_volt`; None without a charge.
    fast, slow : logarithms of the ratios of its own model's resistances to the reference's, ocv :
    difference of the OCV [V], (k,) each over `courses.KNOTS`; None without a model that has the
    reference's chosen member. model_error_volt : typical error of that member, left out of its fit,
    or None.
    """

    shown: object
    differences: tuple
    ratio: float
    ratio_words: str
    shift_volt: tuple | None
    opened_volt: np.ndarray | None
    fast: np.ndarray | None = None
    slow: np.ndarray | None = None
    ocv: np.ndarray | None = None
    model_error_volt: float | None = None


def compared(reference, cells):
    """Cells of a type against its reference.

    Parameters
    ----------
    reference : Shown, with model. cells : list of Shown.

    Returns
    -------
    compared : list of Compared.
    """
    member = reference.model["chosen"]
    base = courses_of(reference.model, member)
    return [_compared(reference, base, member, cell) for cell in cells]


def _compared(reference, base, member, cell):
    found = Compared(
        cell,
        differences(reference, cell),
        *resistance_ratio(reference, cell),
        _shift(reference, cell),
        opened_volt(reference, base, cell),
    )
    try:
        own = courses_of(cell.model, member) if cell.model else None
    except Refusal:
        own = None
    if own is None:
        return found
    return found._replace(
        fast=np.log(own.fast_ohm / base.fast_ohm),
        slow=np.log(own.slow_ohm / base.slow_ohm),
        ocv=own.ocv_volt - base.ocv_volt,
        model_error_volt=member_of(cell.model, member).get("left_out_rmse_volt"),
    )


def _shift(reference, cell):
    try:
        return thesis.peak_shift(peak_pairs(reference, cell))
    except Refusal:
        return None


def opened_volt(reference, base, cell):
    """Change of the OCV (k,) that the cell's charge shows once its polarisation is taken off [V].

    The voltage of the charge minus the reference's, at one SoC, minus what the cell's polarisation
    has more than the reference's by the resistance ratio. Beyond the end of the current both go to
    the same voltage, full.

    Parameters
    ----------
    reference, cell : Shown. base : Courses of the reference.

    Returns
    -------
    change_volt : (k,) over `courses.KNOTS`, None without charges at one rate.
    """
    # ASSUME: The polarisation of a slow charge is its current times the resistance after ten
    # minutes; from cell to cell it changes in proportion to the resistance at the onset of a
    # discharge.
    shares, shift = charge_shift(reference, cell)
    if len(shares) < 3:
        return None
    start = _soc_at_start(reference, cell)
    pair = charge_pair(reference, cell)
    amperes = [_current(one, charge) for one, charge in zip((reference, cell), pair, strict=True)]
    more_ampere = amperes[1] * resistance_ratio(reference, cell)[0] - amperes[0]
    total = np.interp(shares + start, KNOTS, base.fast_ohm + base.slow_ohm)
    soc = np.append(shares + start, 1.0)
    return np.interp(KNOTS, soc, np.append(shift - more_ampere * total, 0.0))


def _current(shown, charge):
    """Current of a charge [A]: what one C is, a capacity test of the cell says."""
    for row in shown.capacities:
        return abs(row["mean_current_ampere"]) / row["c_rate"] * charge["c_rate"]
    return charge["c_rate"] * shown.capacity_ampere_hour


def _soc_at_start(reference, cell):
    """SoC that a discharge at the rate of the capacity test leaves; 0 where none was made."""
    pair = same_cycles(reference, cell).get("discharge")
    if pair is None:
        return 0.0
    return max(0.0, 1 - pair[1]["capacity_ampere_hour"] / cell.capacity_ampere_hour)
