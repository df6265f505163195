"""Where on the SoC scale a record of discharges with rests lies: its full end, its capacity."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal
from cellwright.series.anchor import SPANNED, START_C_RATE, full_row

NEARLY = 0.03  # of the voltage window: how near to the upper cut-off a full cell rests
REACHED = 0.01  # of it: how near to the lower cut-off a discharge ends empty
LIKE = 1.1  # of the usual current of the portions: the last of them may be short
OTHERWISE_VOLT = 1.0  # the window where no upper cut-off is stated


class Scale(NamedTuple):
    """SoC = 1 + (charge − full_ampere_hour) / capacity_ampere_hour.

    full_ampere_hour : net charge of the record at which the cell is full [Ah]. first_volt : voltage
    of its first row where that is at rest, else NaN [V]. source : of the capacity, start : of the
    full end, both in words.
    """

    full_ampere_hour: float
    capacity_ampere_hour: float
    first_volt: float
    source: str
    start: str


class _Anchor(NamedTuple):
    charge_ampere_hour: float
    soc: float
    words: str


def rest_scale(
    current_ampere,
    voltage_volt,
    charge_ampere_hour,
    steps,
    capacities=(),
    *,
    ambient_temperature_celsius=None,
    soc_at_start=None,
    rated_capacity_ampere_hour=None,
    lower_cutoff_volt,
    upper_cutoff_volt=None,
):
    """Full end and capacity of a record that discharges a cell in portions.

    SoC is known, by the first that applies, from: the stated one of the first row; the end of a
    full charge in the record; a first row at rest near the upper cut-off; where no upper cut-off is
    stated, from a record that moves 90 % of the capacity, which then begins full. The capacity is
    what the record takes out where a constant current ends at the lower cut-off, else that of the
    cell's capacity test nearest in temperature (the slowest of them), else the rating; never less
    than the record takes out.

    Parameters
    ----------
    current_ampere, voltage_volt, charge_ampere_hour : (n,) [A] positive on charge, [V], net [Ah].
    steps : series.segments.Steps of the record.
    capacities : list of dict, rows of the capacity stage with test and ambient_temperature_celsius.
    ambient_temperature_celsius : of the record [°C] or None. soc_at_start : stated [1] or None.
    rated_capacity_ampere_hour : [Ah] or None.
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None.

    Returns
    -------
    Scale.

    Raises
    ------
    Refusal : no capacity is known, or nothing tells where the record begins.
    """
    current, voltage, charge = (
        np.asarray(column, float) for column in (current_ampere, voltage_volt, charge_ampere_hour)
    )
    upper, window = upper_cutoff_volt, OTHERWISE_VOLT
    if upper is not None:
        window = upper - lower_cutoff_volt
    known, source = _known(capacities, ambient_temperature_celsius, rated_capacity_ampere_hour)
    empty = _ends_empty(steps, lower_cutoff_volt + REACHED * window)
    rate = current / max(known, float(np.ptp(charge)))
    first = float(voltage[0]) if abs(rate[0]) <= START_C_RATE else np.nan
    share = 1.0 if empty or not known else float(np.ptp(charge)) / known
    if soc_at_start is not None:
        anchor = _Anchor(charge[0], soc_at_start, f"SoC {soc_at_start:g} is stated at its start")
    else:
        anchor = _full(rate, voltage, charge, upper, NEARLY * window, share, first)
    out = float(anchor.charge_ampere_hour - charge.min())
    if empty:
        known, source = out / anchor.soc, "taken out to the lower cut-off, with rests between"
    elif not known:
        raise Refusal("no capacity: the record does not end empty, no capacity test and no rating")
    capacity = max(known, out / anchor.soc)
    full = anchor.charge_ampere_hour + (1 - anchor.soc) * capacity
    return Scale(float(full), capacity, first, source, anchor.words)


def _known(capacities, celsius, rated):
    """Capacity of the test nearest in temperature, else the rating; 0 where there is neither."""
    full = [row for row in capacities if row["direction"] == "discharge"]
    if not full:
        return rated or 0.0, "rating"

    def off(row):
        both = row["ambient_temperature_celsius"], celsius
        return (0.0 if None in both else abs(both[0] - both[1])), row["c_rate"]

    best = min(full, key=off)
    return best["capacity_ampere_hour"], f"discharge of {best['test']} at {best['c_rate']:.2g}C"


def _ends_empty(steps, limit_volt):
    """Whether a discharge ends at the lower cut-off; a larger pulse that does leaves charge."""
    kind, current = np.asarray(steps.kind), steps.current_mean_ampere
    portions = -current[(kind == "CC") & (current < 0)]
    usual = np.median(portions) if len(portions) else 0.0
    down = np.isin(kind, ("CC", "pulse")) & (current < 0) & (-current <= LIKE * usual)
    return bool((down & (steps.voltage_end_volt <= limit_volt)).any())


# ASSUME: A record that begins at rest within 3 % of the voltage window of the upper cut-off begins
# full; where no upper cut-off is stated, one that moves 90 % of the capacity begins full.
def _full(rate, voltage, charge, upper, near_volt, share, first_volt):
    row = full_row(rate, voltage, upper)
    if row is not None:
        return _Anchor(charge[row], 1.0, "full at the end of its full charge")
    if upper is not None and first_volt >= upper - near_volt:
        words = f"full at its start, {1e3 * (upper - first_volt):.0f} mV below the upper cut-off"
        return _Anchor(charge[0], 1.0, words)
    if upper is None and share >= SPANNED:
        words = "full at its start, taken so for it "
        words += f"moves {share:.1%} of the capacity" if share < 1 else "moves all of the capacity"
        return _Anchor(charge[0], 1.0, words)
    at = "under load" if np.isnan(first_volt) else f"at {first_volt:.4g} V"
    wanted = f"rest within {near_volt:.2g} V of {upper:g} V" if upper is not None else ""
    wanted = (
        wanted or f"{SPANNED:.0%} of the capacity moved (found {share:.1%}), for want of limits"
    )
    raise Refusal(f"no SoC at the start: none is stated, it begins {at}; wanted: {wanted}")
