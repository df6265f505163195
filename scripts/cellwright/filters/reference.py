"""The counted SoC that filters are scored against: where a record's own rests contradict it."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.relaxing import still_to_go_volt
from cellwright.records.anchor import RELAXED_SECOND, REST_VOLT, STATED_SOC, soc_range_of_rest
from cellwright.records.filled import STEP_SHARE

WITHIN = 2.0  # times what a count lies beyond the range of a rest: so far within it the SoC may be


class Reference(NamedTuple):
    """A counted SoC with the interval that the rests of its record leave it.

    soc : (n,) as counted [1]. low, high : (n,) between which the SoC may be; both are `soc` where
        no rest contradicts it [1].
    off_soc : largest distance from what a rest tells, where that is more than `STATED_SOC`, else 0;
        NaN without a rest [1]. words : sentence on it, "" where none contradicts.
    """

    soc: np.ndarray
    low: np.ndarray
    high: np.ndarray
    off_soc: float
    words: str

    def beyond(self, estimated_soc):
        """Error (n,) of an estimate, as far as the reference itself may not be wrong by it [1]."""
        return estimated_soc - np.clip(estimated_soc, self.low, self.high)

    def of_rows(self, rows):
        """The reference of some rows of its record, a slice."""
        return self._replace(soc=self.soc[rows], low=self.low[rows], high=self.high[rows])


def exact(soc):
    """Reference that nothing contradicts: (n,) [1]."""
    return Reference(soc, soc, soc, 0.0, "")


# ASSUME: An error of the count that a rest shows grew evenly since the rest before; before the
# first rest it may have been there from the start, after the last one it stays.
def reference_of(record, curve):
    """The counted SoC of a record with what its rests leave it.

    A rest is ten minutes and more within 5 % of the largest current: an offset of the reading is
    none of the cell. Its last voltage tells a range of SoC (`anchor.soc_range_of_rest`), wider by
    as much as it goes on to relax, by its own slope (`relaxing.still_to_go_volt`, and twice its
    deviation): ten minutes in the cold are no equilibrium. Where the counted SoC lies beyond it,
    the SoC may be anywhere from there to twice as far within the range, at most to its other end.
    As with a stated SoC, 5 % beyond it is told.

    Parameters
    ----------
    record : Record. curve : mapping with soc [1], ocv_volt and half_gap_volt [V], (m,) each;
        without a gap rests lie on the OCV.

    Returns
    -------
    reference : Reference.
    """
    time, off, words = record.test_time_second, np.nan, ""
    rows, below, above = [], [], []
    for first, row in _rests(record):
        soc, volt = record.soc[row], record.voltage_volt[row]
        rest = slice(first, row + 1)
        ahead, std = still_to_go_volt(
            time[rest], record.voltage_volt[rest], time[max(first - 1, 0)]
        )
        error = REST_VOLT + abs(ahead) + 2 * std
        low, high = soc_range_of_rest(volt, curve, error_volt=error)
        beyond = max(low - soc, soc - high, 0.0)
        reach = beyond + min(WITHIN * beyond, max(high - low, 0.0))
        rows.append(row)
        below.append(reach if soc > high else 0.0)
        above.append(reach if soc < low else 0.0)
        far = beyond if beyond > STATED_SOC else 0.0
        if far and far > np.nan_to_num(off):
            words = (
                f"its reference is in doubt: counted {soc:.2f} at a rest of {volt:.3f} V, which "
                f"tells {low:.2f} to {high:.2f}"
            )
        off = np.fmax(off, far)
    if not any(below) and not any(above):
        return exact(record.soc)._replace(off_soc=float(off), words=words)
    spread = [np.interp(time, time[rows], reach) for reach in (below, above)]
    return Reference(record.soc, record.soc - spread[0], record.soc + spread[1], float(off), words)


def _rests(record):
    """First and last row of each rest of ten minutes and more."""
    time, size = record.test_time_second, np.abs(record.current_ampere)
    idle = size <= STEP_SHARE * size.max(initial=0.0)
    bounds = np.flatnonzero(np.diff(idle.astype(int), prepend=0, append=0))
    pairs = zip(bounds[::2], bounds[1::2] - 1, strict=True)
    return [(a, b) for a, b in pairs if time[b] - time[a] >= RELAXED_SECOND]
