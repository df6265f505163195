"""Units that no label says, told by what stands beside: dates, the pace of rows, time × current."""

import numpy as np

from cellwright.formats.fields import NET, SERIES, UNITS
from cellwright.formats.physics import SAME_CLOCK, charge_by_clock_and_counter, date_slopes
from cellwright.formats.workbook import EXCEL_EPOCH_DAY
from cellwright.refusal import Refusal

NOT_SAID = "not said"
# Factors between a clock whose unit is not said and its dates [s].
CLOCK_UNITS = {1.0: "s", 60.0: "min", 3600.0: "h"}
EXCEL_DAYS = (36526.0, 73050.0)  # of the years 2000 to 2099
SAME_CHARGE = 0.1  # by which a counter of another unit is never off


def unit_by_dates(field, values, unix, title):
    """Unit of a clock (n,) that does not say it, by the dates beside it (n,) [s] or None.

    title : of the maker, for the message of the Refusal where no dates tell it.
    """
    moved = np.ptp(values[np.isfinite(values)]) if np.isfinite(values).any() else 0.0
    # Dates are written to the second: a minute of them tells the unit to within 2 %.
    if unix is not None and moved > 0:
        slope = np.nanmedian(date_slopes(values, unix))
        for factor, unit in CLOCK_UNITS.items():
            if abs(slope / factor - 1) <= SAME_CLOCK:
                return unit
    raise Refusal(
        f"column {field.label!r} of a {title} file does not say its unit, and no dates tell "
        "it: export it with a unit, such as seconds"
    )


def told_by_pace(field, values, unix):
    """Field of a clock (n,) with the unit that its rows' intervals show, and a note where not s.

    Dates beside it (n,) [s] know better, see `physics.clock_by_dates`. Excel's numbers of days
    become days since 1970, in place. Raises Refusal where several units fit.
    """
    unit = "s" if unix is not None else unit_by_pace(values)
    if not unit:
        raise Refusal(
            f"column {field.label!r} does not say its unit, and its rows lie "
            f"{np.nanmedian(np.diff(values)):.4g} apart, which is no usual number of seconds: "
            f"export it in seconds, or write the unit, such as {field.label} (h)"
        )
    if unit == "s":
        return field, []
    apart = np.nanmedian(np.diff(values))
    said = (
        f"column {field.label!r} does not say its unit: its rows lie {apart:.4g} apart, "
        f"{apart * UNITS['time'][unit]:.3g} s if it counts {unit}, and so it is read"
    )
    if unit == "d" and EXCEL_DAYS[0] <= np.nanmin(values) and np.nanmax(values) < EXCEL_DAYS[1]:
        values -= EXCEL_EPOCH_DAY  # dates, as Excel numbers days: seconds since 1970 then
    return field._replace(unit=unit), [said]


# Seconds between rows that people set, each by its first digits, and by how much one may be off.
SET_PACES, PACE_SHARE = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 5.0, 6.0), 2e-3
LIKE_USUAL = 0.01  # by which intervals of one pace differ: digits that the time is written with


def unit_by_pace(time: np.ndarray) -> str:
    """Unit of a clock whose label has none, by the interval between most of its rows.

    Rows are logged each second, or ten, or minute. An interval of 1.1574e-5 is a second of a clock
    that counts days, and no number of seconds that anybody sets.

    Returns "s" where the interval is a usual number of seconds, or of none of the units; else the
    one of "min", "h", "d" in which it is; "" where several fit.
    """
    interval = np.diff(time)
    interval = interval[interval > 0]
    if not len(interval):
        return "s"
    usual = np.median(interval)
    alike = interval[np.abs(interval - usual) <= LIKE_USUAL * usual]
    if 2 * len(alike) < len(interval):
        return "s"
    fits = [
        unit for unit in ("s", "min", "h", "d") if _is_set(np.mean(alike) * UNITS["time"][unit])
    ]
    return "s" if "s" in fits or not fits else fits[0] if len(fits) == 1 else ""


def _is_set(second):
    """Whether an interval is one that people set rows to lie apart by."""
    digits = second / 10.0 ** np.floor(np.log10(second) + PACE_SHARE)
    return bool(np.any(np.abs(digits / np.array(SET_PACES) - 1.0) <= PACE_SHARE))


def with_unit_of_counter(columns, fields, notes):
    """Columns whose net counter, of no stated unit, counts Ah or mAh as time and current tell.

    One that counts neither is left out: it is no witness. A note on either is put behind `notes`.
    fields : of the file's counters.
    """
    if NET not in columns:
        return columns
    moved, counted = charge_by_clock_and_counter(*(columns[n] for n in (*SERIES[:2], NET)))
    for unit, factor in (("Ah", 1.0), ("mAh", 1e-3)):
        if abs(moved / (factor * counted) - 1) < SAME_CHARGE:
            notes.append(f"{fields[0].label} in {unit}, as time × current moves")
            return columns | {NET: factor * columns[NET]}
    notes.append(
        f"{fields[0].label} does not say its unit, and counts {counted:.4g} where time × current "
        f"moves {moved:.4g} Ah: left out"
    )
    return {name: values for name, values in columns.items() if name != NET}
