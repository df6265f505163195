"""How a cell ages: dQ/dV over an ageing record, peaks followed through a life."""

from cellwright.api import inputs, results
from cellwright.settings import Ica


def ica_life(series, steps, cycles, settings=None, *, most=30, **changes):
    """Peaks of dQ/dV of charges spread evenly over one ageing record.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.
    cycles : result of `ageing_cycles`, or its columns.
    settings : `settings.Ica`, or its keys as keywords. most : charges at most.

    Returns
    -------
    life : IcaLife; rows: one a peak, curves: columns cycle, voltage [V], dQ/dV [Ah/V].

    Raises
    ------
    Refusal : No complete charge, or none whose dQ/dV can be taken.

    Source: docs/ica.md.
    """
    from cellwright.protocols.ica.life import peaks_of_life

    chosen = inputs.settings_of(Ica, settings, changes)
    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    record = inputs.quantities(series, names)
    columns = inputs.columns(cycles, "cycle", "direction", "start_time_second")
    steps = inputs.steps(steps)._asdict()
    found = peaks_of_life(*record, steps, columns, settings=chosen, most=most)
    return results.IcaLife(found.rows, found.curves, tuple(found.notes))


def ica_tracks(charges, *, chemistry=""):
    """Peaks of dQ/dV of one cell under names that stay through its life.

    Parameters
    ----------
    charges : `health.tracking.TrackedCharge` each.
    chemistry : of the cell, for names alone.

    Returns
    -------
    tracks : Table; rows: `health.tracking.TrackRow`, one a peak and charge.

    Raises
    ------
    Refusal : Fewer than two charges, or no peak in any.

    Source: docs/ica.md.
    """
    from cellwright.health.peaks.tracking import tracked_peaks

    return results.Table(tracked_peaks(charges, chemistry=chemistry or ""))
