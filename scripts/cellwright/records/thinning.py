"""Fewer rows of a record: means over bins, and steady stretches with rows far apart."""

import itertools

import numpy as np

from cellwright.refusal import Refusal

STEP_PART = 20.0  # a change of this part of a record's largest is a step
DRIVE_SHARE = 0.5  # of steps that stand alone, below which a record is a drive
FINEST_SECOND = 1.0  # width of the first bins, doubled until the rows are few enough
DIGITS = 2.5  # of the current's reading: it flickers by one, with noise of its own size by two
BACK_ROWS, FLICKERS = 3, 10  # by so many rows a flicker is taken back, and so often it is seen
WORTH = 0.8  # of the width of a bin, below which the sampling of a record is worth averaging
# Between wider bins some stretches keep the finest. The first of them is not compared: the quick
# polarisation there is from a current that was averaged.
STRETCH_SECOND, SETTLING_SECOND = 90.0, 30.0


def averaged(record, *, width_second):
    """Means of a record over bins of time, where it is sampled faster than the bins are wide.

    Wide bins show no edge: an ohmic resistance that nothing tells vanishes, or takes up what the
    model lacks. So stretches of `STRETCH_SECOND` keep the finest bins, every third row one of them.

    A mean is of what is linear between rows, such as current and voltage of a circuit, and over
    time: a row counts for half the way to either neighbour, so that three rows of a pulse of 15 ms
    do not outweigh the second around it. Where the median step of the clock is `WORTH` of the
    width or more, a bin would hold 1.25 rows at most, now one and now two: edges of the current
    would be smeared for a fifth fewer rows, and a clock of 1 s that reads 0.999 s would be averaged
    at all. Such a record stays as it is.

    Parameters
    ----------
    record : Record, whose arrays with one entry a row are averaged; `used` is True
        where all rows of a bin are used.
    width_second : of the bins [s].

    Returns
    -------
    record : the same type, fewer rows.
    """
    time = record.test_time_second
    steps = np.diff(time)
    if not len(steps) or np.median(steps) >= WORTH * width_second:
        return record
    width, settling = _bin_widths(time - time[0], width_second)
    # Bins of either width begin at multiples of theirs, and none goes on where the width changes.
    number = np.floor(time / width) + 0.5 * (width < width_second)
    bins = np.cumsum(np.diff(number, prepend=number[0]) != 0)
    count = np.bincount(bins)
    # A row stands for half the way to either neighbour, at most for a bin.
    around = np.concatenate([steps[:1], (steps[1:] + steps[:-1]) / 2, steps[-1:]])
    stands_for = np.clip(around, 1e-6 * width_second, width_second)
    in_bin = np.bincount(bins, stands_for)

    def mean(column):
        if column.ndim == 2:
            return np.stack([mean(column_part) for column_part in column.T], axis=1)
        if column.dtype == bool:
            return np.bincount(bins, column) == count
        return np.bincount(bins, column * stands_for) / in_bin

    columns = {name: np.asarray(getattr(record, name)) for name in row_fields(record)}
    columns["used"] = columns["used"] & ~settling
    return record._replace(**{name: mean(column) for name, column in columns.items()})


def _bin_widths(age_second, width_second):
    """Width of the bin of each row (n,) [s], and whether its stretch of fine ones has begun."""
    if width_second <= FINEST_SECOND:
        return np.full(len(age_second), width_second), np.zeros(len(age_second), bool)
    cycle_second = 2.0 * STRETCH_SECOND * width_second / FINEST_SECOND
    into = (age_second + cycle_second / 2.0) % cycle_second
    fine = into < STRETCH_SECOND
    return np.where(fine, FINEST_SECOND, width_second), fine & (into < SETTLING_SECOND)


def averaged_to(records, *, most_rows=20_000, thinned=()):
    """Records averaged over bins of 1, 2, 4 … s until they have so many rows in all, or fewer.

    Steady stretches are thinned as far as is given before bins are wider: an edge that is averaged
    over 16 s tells no ohmic resistance and no delay, while of a relaxation few rows tell all.

    Parameters
    ----------
    records : sequence of Record.
    most_rows : of all records together.
    thinned : functions (record) → record, mildest first, each in turn applied after averaging and
        before rows are counted; none: nothing is thinned.

    Returns
    -------
    records : list.

    Raises
    ------
    Refusal : fewer rows asked for than there are records.
    """
    if most_rows < len(records):
        raise Refusal(f"{most_rows} rows were asked for of {len(records)} records; wanted more")
    ways = thinned or (lambda record: record,)
    widths = (FINEST_SECOND * 2**doubled for doubled in itertools.count())
    binned = ([averaged(record, width_second=width) for record in records] for width in widths)
    tried = ([fewer(record) for record in means] for means in binned for fewer in ways)
    return next(
        shorter
        for shorter in tried
        if sum(len(record.test_time_second) for record in shorter) <= most_rows
    )


def row_fields(record):
    """Names of the arrays of a record that have one entry per row.

    Parameters
    ----------
    record : any NamedTuple with test_time_second.
    """
    rows = len(record.test_time_second)
    pairs = zip(record._fields, record, strict=True)
    return [n for n, value in pairs if isinstance(value, np.ndarray) and len(value) == rows]


def rows_of(record, rows):
    """The chosen rows of a record.

    Parameters
    ----------
    record : Record. rows : mask, slice or indices.
    """
    return record._replace(**{name: getattr(record, name)[rows] for name in row_fields(record)})


def edges(record, *, step_ampere):
    """Rows at which the current has stepped by more than a threshold since the row before.

    A flicker of the reading's least digit is no step.
    """
    return np.flatnonzero(_stepped(record, step_ampere)) + 1


def edge_ampere(record):
    """Change of a record's current that counts as an edge [A]: a twentieth of its largest.

    Parameters
    ----------
    record : Record, which starts from rest: its first row may be an edge too.
    """
    return float(np.abs(np.diff(record.current_ampere, prepend=0.0)).max()) / STEP_PART


def _stepped(record, step_ampere):
    """Whether the current has stepped since the row before, (n - 1,) bool."""
    return np.abs(np.diff(record.current_ampere)) > max(step_ampere, _flicker_ampere(record))


def _flicker_ampere(record):
    """Change of the current that its reading's least digit makes by itself [A], 0 where none does.

    Levels of a simulated load are multiples of one as well: a digit flickers only where most
    changes are so small, and are taken back at once time and again.
    """
    change = np.diff(record.current_ampere)
    least = min(DIGITS * record.least_digit_ampere, largest_ampere(record) / STEP_PART)
    moved = np.flatnonzero(change)
    small = np.abs(change[moved]) <= least
    back = small[1:] & small[:-1] & (change[moved][1:] * change[moved][:-1] < 0)
    seen = np.sum(back & (np.diff(moved) <= BACK_ROWS)) >= FLICKERS
    return least if seen and small.mean() > 0.5 else 0.0


def largest_ampere(record):
    """Largest current or change of it from row to row [A], against which steps are small.

    Parameters
    ----------
    record : Record.
    """
    current = record.current_ampere
    return max(np.abs(np.diff(current)).max(initial=0.0), np.abs(current).max(initial=0.0))


def thin(record, *, step_ampere, growth=0.1, capacity_ampere_hour=None, portion_soc=0.005):
    """Record without the rows of steady current that add nothing to their neighbours.

    A row stays if the current steps before or after it; in a steady stretch the rows stay at
    times since the last step that grow by `growth` each. At rest the relaxations between kept
    rows are exact; every decade of time after a step then weighs the same in the fit, whatever
    the logger's rate was. Where a capacity is given, a row also stays each time a portion of it
    has passed, so that no long load loses its course over the SoC.

    Parameters
    ----------
    record : Record.
    step_ampere : change of current between samples that counts as a step [A].
    growth : growth of the time since the last step from one kept row to the next [1].
    capacity_ampere_hour : of the cell [Ah], or None: rows are kept by time only.
    portion_soc : charge from one kept row to the next at most, over the capacity [1].

    Returns
    -------
    record : Record, fewer rows; `thinned` marks those before which others were dropped.
    """
    time, current = record.test_time_second, record.current_ampere
    rows = np.arange(len(time))
    edge = np.zeros(len(rows), bool)
    edge[edges(record, step_ampere=step_ampere)] = edge[0] = True
    age = time - time[np.maximum.accumulate(np.where(edge, rows, 0))]
    decade = np.floor(np.log1p(age) / growth)
    keep = edge | np.append(edge[1:], True) | (np.diff(decade, prepend=-1.0) != 0)
    if capacity_ampere_hour is not None:
        passed = np.abs(current) * np.diff(time, prepend=time[0]) / 3600.0 / capacity_ampere_hour
        keep |= np.diff(np.floor(np.cumsum(passed) / portion_soc), prepend=-1.0) != 0
    dropped = np.diff(np.flatnonzero(keep), prepend=-1) > 1
    shorter = rows_of(record, keep)
    return shorter._replace(thinned=shorter.thinned | dropped)


def without_edges(record, *, step_ampere):
    """Record whose rows at a step of the current between steady stretches are not used.

    Such a row was sampled within the edge: its voltage may belong to the current before. In a
    drive, where the current steps at every row, none is left out.

    Parameters
    ----------
    record : Record.
    step_ampere : change of current between samples that counts as a step [A].
    """
    steps = _stepped(record, step_ampere)
    before, after = np.append(False, steps[:-1]), np.append(steps[1:], False)
    alone = np.append(False, steps & ~before & ~after)
    return record._replace(used=record.used & ~alone)


def without_unsettled(record, *, step_ampere, settled_second):
    """Record whose rows within so short a time after a step of the current are not used.

    There the voltage is on its way: the double layer still takes part of the current, and the
    tester sets it. A first row that no other follows as closely stays: it stands for the time until
    the next one.

    Parameters
    ----------
    record : Record. step_ampere : change of current between samples that counts as a step [A].
    settled_second : from a step until its rows are used [s].
    """
    time = record.test_time_second
    steps = np.diff(time)
    stepped = np.append(False, _stepped(record, step_ampere))
    since = time - time[np.maximum.accumulate(np.where(stepped, np.arange(len(time)), 0))]
    near = np.append(np.inf, steps) < settled_second
    near |= np.append(steps, np.inf) < settled_second
    after = np.logical_or.accumulate(stepped)
    unsettled = after & near & (since < settled_second)
    return record._replace(used=record.used & ~unsettled)


def driven(current_ampere):
    """Whether a record is a drive: at least half of its current steps follow one another directly.

    Else it steps between steady stretches, and does so at once, however sparse the rows are.

    Parameters
    ----------
    current_ampere : (n,) [A].
    """
    current = np.asarray(current_ampere, float)
    change = np.abs(np.diff(current, prepend=current[:1]))
    step = change > change.max(initial=0.0) / STEP_PART
    around = np.append(False, step[:-1]) | np.append(step[1:], False)
    return bool((step & ~around).sum() < DRIVE_SHARE * step.sum())
