"""What an identification reads: records, the rows it needs, and the SoC knots they carry."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal

EDGE_PART = 20.0  # a change of this part of a record's largest is a step
DRIVE_SHARE = 0.5  # of steps that stand alone, below which a record is a drive


class Record(NamedTuple):
    """One stretch of measurement that starts from rest; all arrays (n,).

    warmth : factor that the resistances have at the cell's temperature, 1 at the condition's [1].
    """

    test_time_second: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray
    used: np.ndarray
    warmth: np.ndarray


def record_of(test_time_second, current_ampere, voltage_volt, soc, *, used=None, warmth=None):
    """A measured series as a record that an identification can use.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, soc : (n,) [s], [A], [V], [1].
    used : (n,) bool, rows that may be fitted; None takes all. Rows left out still drive the
        states.
    warmth : (n,) factor on the resistances [1]; None: 1 everywhere.

    Returns
    -------
    record : Record.

    Raises
    ------
    Refusal : not finite, one sample only, time running back, SoC outside −0.1…1.1.
    """
    used = np.ones(len(soc), bool) if used is None else used
    warmth = np.ones(len(soc)) if warmth is None else warmth
    columns = (test_time_second, current_ampere, voltage_volt, soc)
    columns = [np.asarray(column, float) for column in columns]
    _check(*columns)
    return Record(*columns, used, np.asarray(warmth, float))


def bridged(record, *, capacity_ampere_hour, gap_second=600.0, c_rate=1.0):
    """The record with its gaps filled by what must have happened in them.

    Some testers store the pulses of an HPPC only, and not the discharges to the next set point.
    The relaxation after such a discharge goes on for hours and is in what follows; so the charge
    that the counter says has passed is let flow at the gap's beginning, and the rest is a rest.

    Parameters
    ----------
    record : Record, whose SoC runs on over its gaps.
    capacity_ampere_hour : what its SoC refers to [Ah].
    gap_second : a longer time between two samples while charge has passed is a gap [s].
    c_rate : current of what is filled in, over the capacity [1/h].

    Returns
    -------
    record : Record, four more rows for each gap, none of which is used in a fit.
    """
    # ASSUME: The charge that passed in a gap of a record flowed at 1C at the gap's beginning.
    time, soc = record.test_time_second, record.soc
    moved = np.diff(soc)
    gaps = np.flatnonzero((np.diff(time) > gap_second) & (np.abs(moved) > 1e-4))
    if not len(gaps):
        return record
    length = np.diff(time)[gaps]
    lasts = np.minimum(np.abs(moved[gaps]) * 3600.0 / c_rate, 0.9 * length)
    ampere = moved[gaps] * capacity_ampere_hour * 3600.0 / lasts
    share = np.array([0.0, 0.5, 1.0, 1.0])
    inside = Record(
        (time[gaps, None] + lasts[:, None] * share).ravel(),
        (ampere[:, None] * np.array([1.0, 1.0, 1.0, 0.0])).ravel(),
        np.repeat(record.voltage_volt[gaps], 4),
        (soc[gaps, None] + moved[gaps, None] * share).ravel(),
        np.zeros(4 * len(gaps), bool),
        np.repeat(record.warmth[gaps], 4),
    )
    where = np.repeat(gaps + 1, 4)
    return Record(*(np.insert(old, where, new) for old, new in zip(record, inside, strict=True)))


def _check(time, current, voltage, soc):
    if len(time) < 2:
        raise Refusal(f"record has {len(time)} sample(s); a model needs a course of time")
    if not all(np.isfinite(column).all() for column in (time, current, voltage, soc)):
        raise Refusal("time, current, voltage or SoC holds values that are not finite")
    if np.any(np.diff(time) < 0):
        raise Refusal("time runs back inside the record")
    if soc.min() < -0.1 or soc.max() > 1.1:
        found = f"{soc.min():.3f} to {soc.max():.3f}"
        raise Refusal(f"SoC of the record runs from {found}, outside −0.1 to 1.1")


def edges(record, *, step_ampere):
    """Rows at which the current has stepped by more than a threshold since the row before."""
    return np.flatnonzero(np.abs(np.diff(record.current_ampere)) > step_ampere) + 1


def thin(record, *, step_ampere, growth=0.1):
    """Drop rows of steady current that say the same as their neighbours.

    A row stays if the current steps before or after it; in a steady stretch the rows stay at
    times since the last step that grow by `growth` each. At rest the relaxations between kept
    rows are exact; every decade of time after a step then weighs the same in the fit, whatever
    the logger's rate was.

    Parameters
    ----------
    record : Record.
    step_ampere : change of current between samples that counts as a step [A].
    growth : growth of the time since the last step from one kept row to the next [1].

    Returns
    -------
    record : Record, fewer rows.
    """
    time, rows = record.test_time_second, np.arange(len(record.soc))
    edge = np.zeros(len(rows), bool)
    edge[edges(record, step_ampere=step_ampere)] = edge[0] = True
    age = time - time[np.maximum.accumulate(np.where(edge, rows, 0))]
    decade = np.floor(np.log1p(age) / growth)
    keep = edge | np.append(edge[1:], True) | (np.diff(decade, prepend=-1.0) != 0)
    return Record(*(column[keep] for column in record))


def without_edges(record, *, step_ampere):
    """The record without the rows at which the current has just stepped between steady stretches.

    Such a row was sampled within the edge: its voltage may belong to the current before. In a
    drive, where the current steps at every row, none is left out.

    Parameters
    ----------
    record : Record.
    step_ampere : change of current between samples that counts as a step [A].
    """
    steps = np.abs(np.diff(record.current_ampere)) > step_ampere
    before, after = np.append(False, steps[:-1]), np.append(steps[1:], False)
    alone = np.append(False, steps & ~before & ~after)
    return record._replace(used=record.used & ~alone)


def driven(current_ampere):
    """Whether the current of a record steps at most rows where it steps at all: a drive.

    Else it steps between steady stretches, and does so at once, however sparse the rows are.

    Parameters
    ----------
    current_ampere : (n,) [A].
    """
    current = np.asarray(current_ampere, float)
    moved = np.abs(np.diff(current, prepend=current[:1]))
    step = moved > moved.max(initial=0.0) / EDGE_PART
    around = np.append(False, step[:-1]) | np.append(step[1:], False)
    return bool((step & ~around).sum() < DRIVE_SHARE * step.sum())
