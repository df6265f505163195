"""Which points of a spectrum can be trusted: Kramers-Kronig, drift, leads, the thermometer."""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.statistics import rms
from cellwright.records import inputs
from cellwright.records.conditions import at_rest_in_record
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Impedance

IMPEDANCE = Impedance()
DRIFT_TOLERANCE = 0.01  # RMS over the slowest decade; residuals of valid spectra (Schönleber 2014)


def linear_kramers_kronig(frequency_hertz, impedance_ohm):
    """Kramers–Kronig test of a spectrum: the residual of a fitted chain of RC pairs.

    A chain of RC pairs obeys the Kramers–Kronig relations; what it cannot fit does not.

    The time constants lie evenly on a logarithmic axis, so that the fit is linear. Pairs are
    added until their resistances begin to oscillate in sign: the share of negative resistance
    says that noise is being fitted.

    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].

    Returns residual: (n,) complex, over the modulus; above about 1 % it says drift, nonlinearity
    or artefacts. Raises Refusal: fewer than 8 points.

    Source: M. Schönleber, D. Klotz, E. Ivers-Tiffée, Electrochimica Acta 131 (2014) 20,
    eq. 5 (residuals), 12-13 (time constants), 21 (measure of fill).
    """
    frequency, impedance = np.asarray(frequency_hertz, float), np.asarray(impedance_ohm, complex)
    if len(frequency) < 8:
        raise Refusal(f"spectrum of {len(frequency)} points; a Kramers-Kronig test needs 8")
    rates = 2 * np.pi * frequency
    decades = np.log10(frequency.max() / frequency.min())
    most = min(50, len(frequency))  # as many pairs as points fit any spectrum
    # A chain too coarse for a narrow arc oscillates as well: begin where it cannot be that.
    least = min(max(round(3 * decades), 3), most)
    for pairs in range(least, most + 1):
        resistances, residual = _chain(rates, impedance, pairs)
        negative = -resistances[resistances < 0].sum()
        positive = max(resistances[resistances > 0].sum(), np.finfo(float).tiny)
        if 1 - negative / positive <= 0.85:
            break
    return residual


def _chain(rates, impedance, pairs):
    """Resistances of the RC pairs [Ω] and relative residual (n,) of the weighted linear fit."""
    taus = np.geomspace(1 / rates.max(), 1 / rates.min(), pairs)
    relaxing = 1 / (1 + 1j * rates[:, None] * taus)
    series = np.stack([np.ones(len(rates)), 1j * rates, -1j / rates], axis=1)
    columns = np.concatenate([relaxing, series], axis=1) / np.abs(impedance)[:, None]
    size = np.linalg.norm(columns, axis=0)
    target = impedance / np.abs(impedance)
    stacked = np.concatenate([columns.real, columns.imag]) / size
    solution = np.linalg.lstsq(stacked, np.concatenate([target.real, target.imag]), rcond=None)[0]
    return (solution / size)[:pairs], target - columns @ (solution / size)


class Trusted(NamedTuple):
    """Points of a spectrum that a circuit may be fitted to.

    keep : (n,) mask of them. residual : (n,) complex, relative, of the Kramers–Kronig test of the
    points above the drift; NaN below. rms : of it. notes : what is not used, and why.
    """

    keep: np.ndarray
    residual: np.ndarray
    rms: float
    notes: tuple


def trusted_points(
    frequency_hertz,
    impedance_ohm,
    *,
    drift_tolerance=DRIFT_TOLERANCE,
    inductance=IMPEDANCE.inductance,
):
    """Points without drift at low frequencies and, where asked, without inductive points.

    The slowest point is left out, again and again, while the slowest decade of what is left breaks
    the Kramers–Kronig relations. Where two fifths of the points are not enough, none is left out:
    then not the end is at fault but the spectrum.

    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].
    drift_tolerance : RMS of the relative residual that the slowest decade may have [1].
    inductance : "model" keeps inductive points, "cut" leaves them out.

    Returns trusted: Trusted. Raises Refusal: fewer than 8 points.
    """
    order, residuals = np.argsort(frequency_hertz), []
    for dropped in range(int(0.4 * len(order)) + 1):
        kept = order[dropped:]
        residuals.append(linear_kramers_kronig(frequency_hertz[kept], impedance_ohm[kept]))
        size, decade = np.abs(residuals[-1]), np.log10(frequency_hertz[kept])
        slow, fast = rms(size[decade <= decade[0] + 1]), rms(size[decade >= decade[-1] - 1])
        # A noisy spectrum is as bad at its fast end: only the slow one drifts.
        if slow <= max(drift_tolerance, 2.0 * fast):
            break
    else:
        dropped, residuals = 0, residuals[:1]
    keep = np.ones(len(order), bool)
    keep[order[:dropped]] = False
    # Above the real axis the leads' inductance outweighs the cell.
    inductive = impedance_ohm.imag > 0
    if inductance == "cut":
        keep &= ~inductive
    with_them = rms(np.abs(residuals[0]))
    notes = _notes(frequency_hertz, order, dropped, inductive & ~keep, with_them)
    residual = np.full(len(order), np.nan, complex)
    residual[order[dropped:]] = residuals[-1]
    return Trusted(keep, residual, rms(np.abs(residuals[-1])), tuple(notes))


def _notes(frequency, order, dropped, cut, with_them):
    """Sentences on the points that are not used, and why."""
    if dropped:
        count = "1 point" if dropped == 1 else f"{dropped} points"
        yield (
            f"{count} below {frequency[order[dropped]]:.3g} Hz left out of the fit: there "
            f"the spectrum breaks the Kramers-Kronig relations "
            f"({with_them:.1%} RMS with them): the cell drifted"
        )
    if cut.any():
        yield (
            f"{int(cut.sum())} points above {frequency[cut].min():.3g} Hz left out of the fit: "
            "inductance of the leads"
        )


def thermometer(spectra, series):
    """Offset [K] between the temperature in a cell's spectra and that of its other records at rest.

    spectra : (test, result of `impedance`, or its row) each. series : (test, series) each.

    Returns rows, one a chamber temperature: the offset [K], NaN without either reading.
    Source: docs/impedance.md.
    """

    def around(test):
        return inputs.test_facts(test).ambient_temperature_celsius

    read = [
        (around(test), inputs.rows(getattr(entry, "rows", [entry]))[0]["temperature_celsius"])
        for test, entry in spectra
    ]
    # Of spectra the instrument's reading, of series that at rest, when the cell is as warm as the
    # chamber: what differs is the thermometer, and would shift every law over temperature.
    names = ("test_time_second", "current_ampere", "surface_temperature_celsius")
    at_rest = [
        (around(test), rested_temperature(*[inputs.columns(entry).get(name) for name in names]))
        for test, entry in series
    ]
    rows, notes = temperature_offsets(read, at_rest)
    return Result({"rows": rows}, notes=tuple(notes))


def rested_temperature(test_time_second, current_ampere, temperature_celsius):
    """Temperature that a record shows when the cell has long been at rest [°C].

    Median of all samples at least half an hour after the last current, when the cell's own heat is
    gone; NaN where a record holds none.

    test_time_second, current_ampere, temperature_celsius : (n,) [s], [A], [°C]; None for the last
        where it was not recorded.
    """
    # ASSUME: After half an hour without current a cell has the temperature of its chamber.
    if temperature_celsius is None:
        return np.nan
    resting = at_rest_in_record(current_ampere)
    loaded = np.where(resting, test_time_second[0], test_time_second)
    rested = resting & (test_time_second - np.maximum.accumulate(loaded) >= 1800.0)
    rested_celsius = temperature_celsius[rested & np.isfinite(temperature_celsius)]
    return float(np.median(rested_celsius)) if len(rested_celsius) else np.nan


def temperature_offsets(spectra, records):
    """Temperature of spectra minus that of other records at each chamber temperature [K].

    spectra, records : sequences of (chamber temperature as stated, temperature read), both [°C];
        None for one that is not stated, NaN where there was nothing to read.

    Returns rows: list of dicts: ambient_temperature_celsius, spectra_celsius, spectra (how many
    were read), records_celsius, records, offset_kelvin, offset_std_kelvin. NaN for what was not
    read, and for the last where neither was read twice; notes : tuple of at most one sentence; none
    where the spectra hold no temperature.
    """
    stated = sorted({ambient for ambient, _ in spectra} - {None})
    rows = [_row(ambient, _read(spectra, ambient), _read(records, ambient)) for ambient in stated]
    return rows, tuple(_thermometer_notes(rows))


def _read(pairs, ambient):
    """Finite temperatures read at one chamber temperature [°C]."""
    temperatures = np.array([celsius for stated, celsius in pairs if stated == ambient], float)
    return temperatures[np.isfinite(temperatures)]


def _row(ambient, spectra, records):
    """Row of one chamber temperature: medians [°C], their difference and its deviation [K]."""
    read = [float(np.median(t)) if len(t) else np.nan for t in (spectra, records)]
    spread = [np.var(t, ddof=1) / len(t) for t in (spectra, records) if len(t) > 1]
    return {
        "ambient_temperature_celsius": ambient,
        "spectra_celsius": read[0],
        "spectra": len(spectra),
        "records_celsius": read[1],
        "records": len(records),
        "offset_kelvin": read[0] - read[1],
        "offset_std_kelvin": float(np.sqrt(sum(spread))) if spread else np.nan,
    }


def _thermometer_notes(rows):
    """Sentence on how far the temperatures of spectra and other records agree."""
    compared = [row for row in rows if np.isfinite(row["offset_kelvin"])]
    each = ", ".join(
        f"{row['offset_kelvin']:+.1f} K at {row['ambient_temperature_celsius']:g} °C"
        for row in compared
    )
    if not compared and any(row["spectra"] for row in rows):
        yield (
            "temperatures in the spectra's files cannot be checked: no other record of the same "
            "chamber temperature holds one half an hour after its last current"
        )
    elif compared and max(abs(row["offset_kelvin"]) for row in compared) < 0.5:
        yield f"temperatures in the spectra's files agree with those of the other records: {each}"
    elif compared:
        yield (
            "temperatures in the spectra's files differ from those of the other records at rest: "
            f"{each}; curves over temperature must not mix the two (they use the chamber's)"
        )
