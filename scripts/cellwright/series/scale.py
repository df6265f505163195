"""Whether what a record moves is off a cell's rating by the factor of a wrong unit."""

import numpy as np

from cellwright.formats.pieces import rows_where
from cellwright.refusal import Refusal
from cellwright.series.doubts import RATING_SHARE
from cellwright.series.rest_current import near_zero_ampere

# What a charge is too small by where the time or the current is read in another unit than its own.
FACTORS = {
    60.0: "minutes read as seconds",
    1000.0: "ampere read as milliampere, seconds as milliseconds, or a rating written in mAh",
    3600.0: "hours read as seconds",
    86400.0: "days read as seconds",
}
NEAR_SHARE = 0.05  # of the window between the cut-offs, within which an end of it was reached
RESTS_SHARE = 0.5  # of the window between rests: a load in the cold reaches both cut-offs, no rest


def refuse_other_unit(columns, rated_capacity_ampere_hour, cutoffs_volt) -> None:
    """Refuse a record that goes from full to empty and moves its rating over the factor of a unit.

    That it does its rests show: a short load in the cold takes the voltage as far, and it comes
    back.

    columns : current_ampere [A], voltage_volt [V], charge_ampere_hour [Ah].
    rated_capacity_ampere_hour : [Ah] or None. cutoffs_volt : lower and upper [V], None where not
        stated.
    """
    lower, upper = cutoffs_volt
    if not rated_capacity_ampere_hour or lower is None or upper is None:
        return
    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    current, voltage, charge = (columns[name] for name in names)
    near = NEAR_SHARE * (upper - lower)
    if not (voltage.max() >= upper - near and voltage.min() <= lower + near):
        return
    zero = near_zero_ampere(current)
    at_rest = voltage[rows_where(lambda i: np.abs(i) <= zero, current)]
    if not len(at_rest) or np.ptp(at_rest) < RESTS_SHARE * (upper - lower):
        return
    moved = float(np.ptp(charge))
    least, most = RATING_SHARE
    for factor, meaning in FACTORS.items():
        if least <= moved * factor / rated_capacity_ampere_hour <= most:
            raise Refusal(
                f"the voltage goes from {voltage.max():.3g} to {voltage.min():.3g} V, and time × "
                f"current moves {moved:.3g} Ah, 1/{factor:g} of about the rating of "
                f"{rated_capacity_ampere_hour:g} Ah: {meaning}? Write the unit of each column into "
                "its label, such as Time (h)"
            )
