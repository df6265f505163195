"""State of health from peaks of dQ/dV, from the rows of many charges."""

from cellwright.api import inputs, results


def health_from_peaks(
    peaks,
    capacities,
    curves=None,
    *,
    rated_ampere_hour=None,
    tracked=(),
):
    """State of health of cells of one type from peaks of dQ/dV, calibrated on known capacities.

    Parameters
    ----------
    peaks : rows of `ica_peaks` with cell, test, cycle and ambient_temperature_celsius, or of
        `ica_tracks` with cell.
    capacities : rows of `capacity` with cell, cycle and ambient_temperature_celsius; of
        `ageing_cycles` also test, and of_a_life, true.
    curves : mapping of the curve of `ica` (or its columns) by (cell, test, cycle); None: the
        charge between two peaks is not used.
    rated_ampere_hour : rating of the type [Ah], None: not known.
    tracked : cells in which an identity is one peak through the life.

    Returns
    -------
    health : Result; one row a charge.

    Raises
    ------
    Refusal : Fewer than four charges of known capacity at any rate and temperature.

    Source: docs/health-from-peaks.md.
    """
    from cellwright.health.peaks.calibration import peak_calibration, peak_charges

    names = ("voltage_volt", "dq_dv_ampere_hour_per_volt")
    pairs = {key: inputs.quantities(curve, names) for key, curve in (curves or {}).items()}
    charges = peak_charges(inputs.rows(peaks), inputs.rows(capacities), pairs)
    rows, information, notes = peak_calibration(
        charges, rated_ampere_hour=rated_ampere_hour, tracked=tracked
    )
    return results.Result({"rows": rows, "information": information}, notes=tuple(notes))
