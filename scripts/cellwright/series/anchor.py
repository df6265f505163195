"""State of charge of a record: where on the scale its counted charge begins."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

REST_C_RATE = 0.004
START_C_RATE = 0.02  # of one row: its noise, or a leak that moves the voltage by a millivolt
SPANNED = 0.9  # of the capacity: a record that moves so much has its place on the scale
CUTOFF_SHARE = 0.005  # of the upper cut-off: how near to it the end of a full charge is


class Anchored(NamedTuple):
    """State of charge (n,) [1], and in words where its zero was taken from."""

    soc: np.ndarray
    anchor: str


# ASSUME: A charge that ends at the upper cut-off voltage with at most C/10 leaves the cell full.
# ASSUME: Where a record is anchored by its rest voltage, the cell had relaxed when it began.
# ASSUME: A record without another anchor that moves 90 % of the capacity leaves equal ends unused.
def soc_series(
    charge_ampere_hour,
    current_ampere,
    voltage_volt,
    *,
    capacity_ampere_hour,
    lower_cutoff_volt,
    upper_cutoff_volt,
    soc_at_start=None,
    ocv_soc=None,
    ocv_volt=None,
    full_c_rate=0.1,
):
    """State of charge over a record: counted charge over capacity, from the best anchor there is.

    The first that applies: 1. the state of charge at the start, as stated; 2. the record itself
    reaches full: a charge that ends at the upper cut-off with a current of at most `full_c_rate`;
    3. the record starts at rest, and its first voltage is looked up in the OCV table;
    4. the record moves at least 90 % of the capacity: what it leaves is shared by the two ends.

    Parameters
    ----------
    charge_ampere_hour : (n,) net charge since the first row, + on charge [Ah].
    current_ampere : (n,) [A], positive on charge.
    voltage_volt : (n,) [V].
    capacity_ampere_hour : what the scale from 0 to 1 refers to [Ah].
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None (not stated).
    soc_at_start : stated state of charge at the first row, 0 to 1 [1], or None.
    ocv_soc, ocv_volt : (m,) table of the open-circuit voltage, SoC ascending [1], [V], or None.
    full_c_rate : largest current over capacity that may end a full charge [1/h].

    Returns
    -------
    Anchored : the array may leave 0 to 1 where counting does; it is never clipped.

    Raises
    ------
    Refusal : no capacity, a stated SoC outside 0 to 1, or nothing to anchor to.
    """
    if not capacity_ampere_hour or not capacity_ampere_hour > 0:
        raise Refusal(f"capacity is {capacity_ampere_hour}; SoC needs a positive one")
    counted = np.asarray(charge_ampere_hour, float) / capacity_ampere_hour
    if soc_at_start is not None:
        return Anchored(_stated(soc_at_start) + counted - counted[0], "stated at the start")
    rate = np.asarray(current_ampere, float) / capacity_ampere_hour
    full = full_row(rate, voltage_volt, upper_cutoff_volt, full_c_rate=full_c_rate)
    if full is not None:
        return Anchored(1.0 + counted - counted[full], "end of the full charge in the record")
    if ocv_soc is not None and abs(rate[0]) <= START_C_RATE:
        start = _look_up(voltage_volt[0], ocv_soc, ocv_volt)
        return Anchored(start + counted - counted[0], "rest voltage at the start, by the OCV table")
    span = float(np.ptp(counted))
    if span >= SPANNED:
        top = min((1 + span) / 2, 1.0)
        words = f"the record moves {span:.1%} of the capacity: its highest SoC is {top:.3f}"
        return Anchored(top + counted - counted.max(), f"{words} ± {max(1 - span, 0) / 2:.3f}")
    raise Refusal(_missing(rate[0], upper_cutoff_volt, ocv_soc))


def full_row(rate, voltage_volt, upper_cutoff_volt, *, full_c_rate=0.1):
    """Last row of the first charge that ends full, or None.

    Parameters: rate (n,) current over capacity [1/h], voltage_volt (n,) [V], cut-off [V] or None.
    """
    if upper_cutoff_volt is None:
        return None
    near = np.asarray(voltage_volt) >= upper_cutoff_volt * (1 - CUTOFF_SHARE)
    charging = near & (rate > REST_C_RATE)
    slow = charging & (rate <= full_c_rate)
    ends = np.flatnonzero(slow & ~np.append(charging[1:], False))
    return int(ends[0]) if len(ends) else None


def _stated(soc):
    if not 0 <= soc <= 1:
        raise Refusal(f"stated SoC at the start is {soc}; allowed is 0 to 1")
    return float(soc)


def _look_up(voltage, ocv_soc, ocv_volt):
    """SoC at a rest voltage [V], 0 or 1 beyond the table; a flat stretch gives its upper end."""
    rising = np.maximum.accumulate(np.asarray(ocv_volt, float))
    return float(np.interp(voltage, rising, np.asarray(ocv_soc, float)))


def _missing(first_rate, upper_cutoff_volt, ocv_soc):
    """What stands in the way of each anchor, in one sentence."""
    full = (
        "the upper cut-off is not stated, so no full charge can be told"
        if upper_cutoff_volt is None
        else f"the record never ends a charge full at {upper_cutoff_volt} V"
    )
    table = (
        "there is no OCV table"
        if ocv_soc is None
        else f"the record starts under a load of {abs(first_rate):.3g} C, not at rest"
    )
    return f"no state of charge: none is stated at the start, {full}, and {table}"
