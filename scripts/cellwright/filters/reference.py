"""Whether the counted SoC that filters are scored against agrees with a record's own rests."""

import numpy as np

from cellwright.numerics.relaxing import still_to_go_volt
from cellwright.records.anchor import RELAXED_SECOND, REST_VOLT, STATED_SOC, soc_range_of_rest
from cellwright.records.filled import STEP_SHARE


def reference_doubt(record, curve):
    """How far the counted SoC of a record lies beyond what its rests allow.

    A rest is ten minutes and more within 5 % of the largest current: an offset of the reading is
    none of the cell. Its last voltage tells a range of SoC (`anchor.soc_range_of_rest`); as with a
    stated SoC, 5 % beyond it contradict. By as much as it goes on to relax, by its own slope
    (`relaxing.still_to_go_volt`, and twice its deviation), it may be off: ten minutes in the cold
    are no equilibrium.

    Parameters
    ----------
    record : Record. curve : mapping with soc [1], ocv_volt and half_gap_volt [V], (m,) each;
        without a gap rests lie on the OCV.

    Returns
    -------
    off_soc : largest distance from the range [1], 0 where none contradicts; NaN without a rest.
    words : sentence on it, "" where none contradicts.
    """
    time, size = record.test_time_second, np.abs(record.current_ampere)
    idle = size <= STEP_SHARE * size.max(initial=0.0)
    bounds = np.flatnonzero(np.diff(idle.astype(int), prepend=0, append=0))
    pairs = zip(bounds[::2], bounds[1::2] - 1, strict=True)
    rests = [(a, b) for a, b in pairs if time[b] - time[a] >= RELAXED_SECOND]
    off, words = np.nan, ""
    for first, row in rests:
        soc, volt = record.soc[row], record.voltage_volt[row]
        rows = slice(first, row + 1)
        ahead, std = still_to_go_volt(
            time[rows], record.voltage_volt[rows], time[max(first - 1, 0)]
        )
        error = REST_VOLT + abs(ahead) + 2 * std
        low, high = soc_range_of_rest(volt, curve, error_volt=error)
        beyond = max(low - soc, soc - high, 0.0)
        far = beyond if beyond > STATED_SOC else 0.0
        if far and far > np.nan_to_num(off):
            words = (
                f"its reference is in doubt: counted {soc:.2f} at a rest of {volt:.3f} V, which "
                f"tells {low:.2f} to {high:.2f}"
            )
        off = np.fmax(off, far)
    return float(off), words
