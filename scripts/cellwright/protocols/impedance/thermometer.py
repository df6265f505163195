"""Whether the thermometer of the spectra's files agrees with that of the other records."""

import numpy as np

from cellwright.refusal import Refusal

RESTED_SECOND = 1800.0
REST_SHARE = 0.01  # of a record's largest current: what is below is rest
MATERIAL_KELVIN = 0.5


def rested_temperature(test_time_second, current_ampere, temperature_celsius):
    """What the thermometer of a record reads when the cell has long been at rest [°C].

    Median of all samples at least half an hour after the last current, when the cell's own heat is
    gone; NaN where a record holds none.

    Parameters
    ----------
    test_time_second, current_ampere, temperature_celsius : (n,) [s], [A], [°C]; None for the last
        where it was not recorded.
    """
    # ASSUME: After half an hour without current a cell has the temperature of its chamber.
    if temperature_celsius is None:
        return np.nan
    size = np.abs(current_ampere)
    resting = size <= REST_SHARE * size.max()
    loaded = np.where(resting, test_time_second[0], test_time_second)
    rested = resting & (test_time_second - np.maximum.accumulate(loaded) >= RESTED_SECOND)
    known = temperature_celsius[rested & np.isfinite(temperature_celsius)]
    return float(np.median(known)) if len(known) else np.nan


def temperature_offsets(spectra, records):
    """Difference of the two thermometers at each chamber temperature.

    Parameters
    ----------
    spectra, records : sequences of (chamber temperature as stated, temperature read), both [°C];
        NaN where there was nothing to read.

    Returns
    -------
    rows : list of dicts, one a chamber temperature that both have: ambient_temperature_celsius,
        spectra_celsius, spectra, records_celsius, records, offset_kelvin, offset_std_kelvin (NaN
        where neither was read twice).
    notes : tuple of one sentence.

    Raises
    ------
    Refusal : no chamber temperature at which both were read.
    """
    read = [
        [(a, t) for a, t in one if a is not None and np.isfinite(t)] for one in (spectra, records)
    ]
    both = sorted({a for a, _ in read[0]} & {a for a, _ in read[1]})
    if not both:
        raise Refusal(
            f"{len(read[0])} spectra and {len(read[1])} rested records hold a temperature, none of "
            "them at the same chamber temperature: the thermometers cannot be compared"
        )
    rows = [_row(a, *[np.array([t for b, t in one if b == a]) for one in read]) for a in both]
    return rows, (_sentence(rows),)


def _row(ambient, spectra, records):
    spread = [
        np.var(one, ddof=1) / len(one) if len(one) > 1 else np.nan for one in (spectra, records)
    ]
    known = [value for value in spread if np.isfinite(value)]
    return {
        "ambient_temperature_celsius": ambient,
        "spectra_celsius": float(np.median(spectra)),
        "spectra": len(spectra),
        "records_celsius": float(np.median(records)),
        "records": len(records),
        "offset_kelvin": float(np.median(spectra) - np.median(records)),
        "offset_std_kelvin": float(np.sqrt(sum(known))) if known else np.nan,
    }


def _sentence(rows):
    offsets = [row["offset_kelvin"] for row in rows]
    each = ", ".join(
        f"{row['offset_kelvin']:+.1f} K at {row['ambient_temperature_celsius']:g} °C"
        for row in rows
    )
    if max(map(abs, offsets)) < MATERIAL_KELVIN:
        return f"temperatures in the spectra's files agree with those of the other records: {each}"
    return (
        "temperatures in the spectra's files differ from those of the other records at rest: "
        f"{each}; curves over temperature must not mix the two (they use the chamber's)"
    )
