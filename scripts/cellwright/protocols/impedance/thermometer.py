"""Whether the thermometer of the spectra's files agrees with that of the other records."""

import numpy as np

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
    """Difference of the two thermometers at each chamber temperature at which there are spectra.

    Parameters
    ----------
    spectra, records : sequences of (chamber temperature as stated, temperature read), both [°C];
        None for one that is not stated, NaN where there was nothing to read.

    Returns
    -------
    rows : list of dicts: ambient_temperature_celsius, spectra_celsius, spectra (how many were
        read), records_celsius, records, offset_kelvin, offset_std_kelvin. NaN for what was not
        read, and for the last where neither was read twice.
    notes : tuple of at most one sentence; none where the spectra hold no temperature.
    """
    stated = sorted({ambient for ambient, _ in spectra} - {None})
    rows = [_row(ambient, _read(spectra, ambient), _read(records, ambient)) for ambient in stated]
    return rows, tuple(_notes(rows))


def _read(pairs, ambient):
    found = np.array([celsius for stated, celsius in pairs if stated == ambient], float)
    return found[np.isfinite(found)]


def _row(ambient, spectra, records):
    read = [float(np.median(one)) if len(one) else np.nan for one in (spectra, records)]
    spread = [np.var(one, ddof=1) / len(one) for one in (spectra, records) if len(one) > 1]
    return {
        "ambient_temperature_celsius": ambient,
        "spectra_celsius": read[0],
        "spectra": len(spectra),
        "records_celsius": read[1],
        "records": len(records),
        "offset_kelvin": read[0] - read[1],
        "offset_std_kelvin": float(np.sqrt(sum(spread))) if spread else np.nan,
    }


def _notes(rows):
    known = [row for row in rows if np.isfinite(row["offset_kelvin"])]
    each = ", ".join(
        f"{row['offset_kelvin']:+.1f} K at {row['ambient_temperature_celsius']:g} °C"
        for row in known
    )
    if not known and any(row["spectra"] for row in rows):
        yield (
            "temperatures in the spectra's files cannot be checked: no other record of the same "
            "chamber temperature holds one half an hour after its last current"
        )
    elif known and max(abs(row["offset_kelvin"]) for row in known) < MATERIAL_KELVIN:
        yield f"temperatures in the spectra's files agree with those of the other records: {each}"
    elif known:
        yield (
            "temperatures in the spectra's files differ from those of the other records at rest: "
            f"{each}; curves over temperature must not mix the two (they use the chamber's)"
        )
