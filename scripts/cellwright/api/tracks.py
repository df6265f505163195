"""How a cell ages: dQ/dV over an ageing record, peaks followed through a life."""

from cellwright.api import inputs, results
from cellwright.settings import Ica

ICA = Ica()


def ica_life(series, steps, cycles, *, prominence=ICA.prominence, most=30):
    """Peaks of dQ/dV of charges spread evenly over one ageing record.

    Parameters
    ----------
    series, steps : clean series, (n,) columns, and its steps.
    cycles : result of `ageing_cycles`, or its columns.
    prominence : least rise of a peak above its valleys, of the highest one [1]. most : charges at
        most.

    Returns
    -------
    life : Result; rows: one a peak, curves: columns cycle, voltage [V], dQ/dV [Ah/V].

    Raises
    ------
    Refusal : No complete charge, or none whose dQ/dV can be taken.

    Source: docs/ica.md.
    """
    from cellwright.protocols.ica.life import peaks_of_life

    names = ("current_ampere", "voltage_volt", "charge_ampere_hour")
    record = inputs.quantities(series, names)
    columns = inputs.columns(cycles, "cycle", "direction", "start_time_second")
    steps = inputs.steps(steps)._asdict()
    found = peaks_of_life(*record, steps, columns, prominence=prominence, most=most)
    tables = {"rows": found.rows, "curves": found.curves}
    return results.Result(tables, notes=tuple(found.notes))


def ica_tracks(charges, *, chemistry=""):
    """Peaks of dQ/dV of one cell under names that stay through its life.

    Parameters
    ----------
    charges : `health.peaks.tracking.TrackedCharge` each.
    chemistry : of the cell, for names alone.

    Returns
    -------
    tracks : Result; rows: one a peak and charge.

    Raises
    ------
    Refusal : Fewer than two charges, or no peak in any.

    Source: docs/ica.md.
    """
    from cellwright.health.peaks.tracking import tracked_peaks

    rows = tracked_peaks(charges, chemistry=chemistry or "")
    return results.Result({"rows": rows})
