"""What an identification reads: records, the rows it needs, and the SoC knots they carry."""

from typing import NamedTuple

import numpy as np

from cellwright.refusal import Refusal


class Record(NamedTuple):
    """One unbroken stretch of measurement that starts from rest; all arrays (n,)."""

    test_time_second: np.ndarray
    current_ampere: np.ndarray
    voltage_volt: np.ndarray
    soc: np.ndarray
    used: np.ndarray


def records_of(test_time_second, current_ampere, voltage_volt, soc, *, used=None, gap_second=600.0):
    """Cut a measured series at its gaps into records.

    Parameters
    ----------
    test_time_second, current_ampere, voltage_volt, soc : (n,) [s], [A], [V], [1]; the SoC is to
        be continuous over the gaps (from the instrument's counter).
    used : (n,) bool, rows that may be fitted; None takes all. Rows left out still drive the
        states.
    gap_second : a longer time between two samples while current may have flowed is a gap [s].

    Returns
    -------
    records : tuple of Record.

    Raises
    ------
    Refusal : not finite, one sample only, time running back, SoC outside −0.05…1.05.
    """
    # ASSUME: After a gap in a record (the cell moved to its next set point) the cell is at rest.
    used = np.ones(len(soc), bool) if used is None else used
    columns = (test_time_second, current_ampere, voltage_volt, soc)
    columns = [np.asarray(column, float) for column in columns] + [used]
    _check(*columns[:4])
    cuts = np.flatnonzero(np.diff(columns[0]) > gap_second) + 1
    pieces = zip(*(np.split(column, cuts) for column in columns), strict=True)
    return tuple(Record(*piece) for piece in pieces if len(piece[0]) > 1)


def _check(time, current, voltage, soc):
    if len(time) < 2:
        raise Refusal(f"record has {len(time)} sample(s); a model needs a course of time")
    if not all(np.isfinite(column).all() for column in (time, current, voltage, soc)):
        raise Refusal("time, current, voltage or SoC holds values that are not finite")
    if np.any(np.diff(time) < 0):
        raise Refusal("time runs back inside the record")
    if soc.min() < -0.05 or soc.max() > 1.05:
        found = f"{soc.min():.3f} to {soc.max():.3f}"
        raise Refusal(f"SoC of the record runs from {found}, outside −0.05 to 1.05")


def edges(record, *, step_ampere):
    """Rows at which the current has stepped by more than a threshold since the row before."""
    return np.flatnonzero(np.abs(np.diff(record.current_ampere)) > step_ampere) + 1


def thin(record, *, step_ampere, growth=0.05):
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


def knots_of(records, *, step_ampere, cluster_gap=0.02, spacing=0.05, steps=2):
    """SoC knots where the data excite the cell: its set points, or a grid over a drive's range.

    Steps of current that lie close in SoC form a cluster; a narrow cluster (a set point of an
    HPPC) is one knot at its mean, a wide one (a drive) a grid of about `spacing`.

    Parameters
    ----------
    records : sequence of Record.
    step_ampere : change of current that counts as a step [A].
    cluster_gap : SoC without steps that ends a cluster [1].
    spacing : distance of the knots inside a wide cluster, which is one wider than that [1].
    steps : fewest steps of current that make a cluster a knot.

    Returns
    -------
    knots : (k,) ascending SoC [1].

    Raises
    ------
    Refusal : no step of current in any record.
    """
    rows = [edges(record, step_ampere=step_ampere) for record in records]
    found = [r.soc[row[r.used[row]]] for r, row in zip(records, rows, strict=True)]
    soc = np.sort(np.concatenate(found))
    clusters = np.split(soc, np.flatnonzero(np.diff(soc) > cluster_gap) + 1)
    clusters = [cluster for cluster in clusters if len(cluster) >= steps]
    if not clusters:
        raise Refusal(
            f"fewer than {steps} steps of current above {step_ampere:.3g} A at any SoC: "
            "nothing excites the cell"
        )
    counts = [int(np.ptp(cluster) / spacing + 0.2) for cluster in clusters]
    grids = [
        np.linspace(cluster[0], cluster[-1], count + 1) if count else [cluster.mean()]
        for cluster, count in zip(clusters, counts, strict=True)
    ]
    return np.concatenate(grids)


def within(record, knots, *, margin=0.05):
    """The record with rows that lie further than `margin` outside the knots taken from the fit."""
    inside = (record.soc >= knots[0] - margin) & (record.soc <= knots[-1] + margin)
    return record._replace(used=record.used & inside)
