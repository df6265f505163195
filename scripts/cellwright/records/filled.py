"""Rows that a record lacks: where the current stepped between two rows, and across gaps."""

import numpy as np

from cellwright.records.thinning import edges, row_fields
from cellwright.series.edges import STEP_SHARE, shares_before
from cellwright.series.steps import silent_before
from cellwright.settings import Clean

PACED = 1.5  # of an interval over the next, up to which both are of one pace
LEAST_SILENT_SOC = 0.01  # standard deviation of what a gap may have moved; less is no doubt


def with_edges(record, *, capacity_ampere_hour, uncounted=None):
    """The record with two rows at each step of the current that its rows do not show.

    A tester that stores a row every five seconds shows a pulse by its last row only; whether the
    current of that row or of the next flowed in between, its counter or the pace of its rows knows:
    the share of the interval before the step is what moves the charge counted. Without either the
    charge is that of the mean of both currents, which says nothing of the edge; such an interval
    stays as it is, as do drives, in which the current moves all the time.

    Parameters
    ----------
    record : Record, whose SoC is counted.
    capacity_ampere_hour : what its SoC refers to [Ah].
    uncounted : share of the interval before a step that the charge does not tell [1], or None.

    Returns
    -------
    record : Record, with more rows, none of which is compared with a model; the same one where none
        is added.
    """
    time, current = record.test_time_second, record.current_ampere
    after, share = _steps_between_rows(record, capacity_ampere_hour)
    if uncounted is not None:
        share = np.where(np.isfinite(share), share, uncounted)
    told = np.isfinite(share)
    if not told.any():
        return record
    after, share = after[told], share[told]
    interval = time[after] - time[after - 1]
    earlier = np.repeat(after - 1, 2)
    filled = {name: getattr(record, name)[earlier] for name in row_fields(record)}
    moved = share * interval * current[after - 1] / 3600.0 / capacity_ampere_hour
    filled |= {
        "test_time_second": np.repeat(time[after - 1] + share * interval, 2),
        "current_ampere": np.column_stack([current[after - 1], current[after]]).ravel(),
        "soc": np.repeat(record.soc[after - 1] + moved, 2),
        "used": np.zeros(2 * len(after), bool),
    }
    return _inserted(record, np.repeat(after, 2), filled)


def _steps_between_rows(record, capacity_ampere_hour):
    """Rows after steps of the current between two rows, the share before each; of no drive."""
    time, current = record.test_time_second, record.current_ampere
    largest = np.abs(current).max(initial=0.0)
    if record.kind == "drive" or not largest > 0:
        return np.empty(0, int), np.empty(0)
    after = edges(record, step_ampere=STEP_SHARE * largest)
    after = after[time[after] > time[after - 1]]
    return after, shares_before(time, current, capacity_ampere_hour * record.soc, after)


def uncounted_are_paced(record, *, capacity_ampere_hour):
    """Whether each interval with a step that the charge does not tell is no longer than the next.

    Longer ones began at the pace of before: they hold their edge anywhere.
    Parameters as of `with_edges`.
    """
    after, share = _steps_between_rows(record, capacity_ampere_hour)
    after, interval = after[np.isnan(share)], np.diff(record.test_time_second)
    after = after[after < len(interval)]
    return bool(np.all(interval[after - 1] <= PACED * interval[after]))


def bridged(record, *, capacity_ampere_hour):
    """The record with each gap filled by a load that moves its charge, then a rest.

    Some testers store the pulses of an HPPC only, and not the discharges to the next set point.
    The relaxation after such a discharge goes on for hours and is in what follows; so the charge
    that the counter says has passed is let flow at the gap's beginning, and the rest is a rest.

    Parameters
    ----------
    record : Record, whose SoC runs on over its gaps.
    capacity_ampere_hour : what its SoC refers to [Ah].

    Returns
    -------
    record : Record, four more rows for each gap, none of which is compared with a model.
    """
    # ASSUME: The charge that passed in a gap (ten minutes) flowed at 1C at its beginning.
    time, soc = record.test_time_second, record.soc
    soc_change = np.diff(soc)
    gaps = np.flatnonzero((np.diff(time) > 600.0) & (np.abs(soc_change) > 1e-4))
    if not len(gaps):
        return record
    length = np.diff(time)[gaps]
    lasts = np.minimum(np.abs(soc_change[gaps]) * 3600.0, 0.9 * length)
    ampere = soc_change[gaps] * capacity_ampere_hour * 3600.0 / lasts
    share = np.array([0.0, 0.5, 1.0, 1.0])
    filled = {name: np.repeat(getattr(record, name)[gaps], 4) for name in row_fields(record)}
    filled |= {
        "test_time_second": (time[gaps, None] + lasts[:, None] * share).ravel(),
        "current_ampere": (ampere[:, None] * np.array([1.0, 1.0, 1.0, 0.0])).ravel(),
        "soc": (soc[gaps, None] + soc_change[gaps, None] * share).ravel(),
        "used": np.zeros(4 * len(gaps), bool),
    }
    return _inserted(record, np.repeat(gaps + 1, 4), filled)


# ASSUME: In a gap between two loads of one direction anything may have flowed between what is
# counted and the larger of the two.
def silent_loads(record, *, capacity_ampere_hour):
    """Gaps of a record between two loads of one direction, in which nobody knows what flowed.

    Parameters
    ----------
    record : Record, whose SoC is counted. capacity_ampere_hour : what it refers to [Ah].

    Returns
    -------
    gaps : list of (row after the gap, SoC counted over it, its standard deviation [1]).
    """
    time, current = record.test_time_second, record.current_ampere
    counted, sides = np.diff(record.soc), (current[:-1], current[1:])
    most = np.maximum(*np.abs(sides)) * np.diff(time) / 3600.0 / capacity_ampere_hour
    std = (most - np.abs(counted)) / np.sqrt(3)
    unknown = silent_before(time, Clean().gap_second)[1:] & (sides[0] * sides[1] > 0)
    gaps = np.flatnonzero(unknown & (std > LEAST_SILENT_SOC))
    return [(int(k) + 1, float(counted[k]), float(std[k])) for k in gaps]


def _inserted(record, before, filled):
    """The record with new rows before the rows of these numbers."""
    columns = {name: np.insert(getattr(record, name), before, new) for name, new in filled.items()}
    return record._replace(**columns)
