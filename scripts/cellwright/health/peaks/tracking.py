"""Peaks of dQ/dV followed through the life of one cell: which of one charge is which of another.

Charges at one rate and temperature form a sequence in the order of cycles. From charge to charge
all peaks move together, since resistance shifts the whole curve; each moves a little by itself;
heights and areas change slowly. The sequences of other rates and temperatures are joined to the
first.
"""

import re
from typing import NamedTuple

import numpy as np

from cellwright.health.peaks.alignment import align
from cellwright.health.peaks.features import made_alike
from cellwright.health.peaks.names import names_of
from cellwright.health.peaks.sequences import joined_identities
from cellwright.records.conditions import (
    REFERENCE_CELSIUS,
    grouped_alike,
    stated_or_reference,
)
from cellwright.refusal import Refusal
from cellwright.result import Result


class TrackedCharge(NamedTuple):
    """Peaks of one charge: what it was, and columns of (k,) each, from low voltage.

    test : its name. cycle [1], c_rate [1/h], temperature_celsius : of the chamber, NaN where not
    known. peaks : dict of columns of stage `ica`. reason : why it has no peaks, "" where it has.
    """

    test: str
    cycle: float
    c_rate: float
    temperature_celsius: float
    peaks: dict
    reason: str


# What is said of a peak in stage `ica` and again where it was tracked; NaN where it is missing.
OF_PEAK = (
    "voltage_volt",
    "voltage_std_volt",
    "height_ampere_hour_per_volt",
    "height_std_ampere_hour_per_volt",
    "area_ampere_hour",
    "area_std_ampere_hour",
    "width_volt",
)


class _Track(NamedTuple):
    """A peak as last seen: number of its identity, place, height, area, and where it began."""

    identity: int
    voltage: float
    height: float
    area: float
    first_height: float
    drift: float
    seen: bool


def ica_tracks(charges, *, chemistry=""):
    """Peaks of dQ/dV of one cell under names that stay through its life.

    1. Charges of one rate and temperature form a sequence by cycle. 2. Each charge is aligned with
    the peaks known so far: one common shift, the order kept, squared distances over the stated
    tolerances; what fits nothing is new, or missing. A missing peak is remembered, moves with
    the common shift, and may return. 3. The slowest sequence gives the names; another one begins
    with its charge nearest in cycle, aligned with a wider common shift. 4. A peak that is gone
    while the area of its neighbour has grown by its own is merged with it; the reverse is a split.

    charges : `health.peaks.tracking.TrackedCharge` each.
    chemistry : of the cell, for names alone.

    Returns rows, one a peak and charge, by rate, temperature and cycle, from low voltage; one that
    is missing there has NaN as voltage. Raises Refusal: fewer than two charges, or no peak in any.
    Source: docs/ica.md.
    """
    if len(charges) < 2:
        raise Refusal(f"{len(charges)} charge for dQ/dV; two are needed to follow peaks")
    if not any(_count(charge) for charge in charges):
        raise Refusal(f"no peaks in any of {len(charges)} charges: {charges[0].reason}")
    # ASSUME: From charge to charge a peak moves by itself by 12 mV and changes by a factor of 1.8;
    # resistance moves all peaks together by 15 mV, between rates and temperatures by 80 mV.
    # Heights and areas are compared as logarithms.
    motion_volt, shift_volt, rate_shift_volt = 0.012, 0.015, 0.08
    tolerance = (motion_volt, np.log(1.8))
    sequences = _sequences(charges)
    known, rows, begun = [], [], []
    for sequence in sequences:
        start, wide = known, shift_volt
        if begun:  # another sequence sets out from the charge nearest in cycle, with what it shows
            _, tracks = min(begun, key=lambda state: abs(state[0] - sequence[0].cycle))
            start, wide = [track for track in tracks if track.seen], rate_shift_volt
        found, states = _followed(sequence, start, tolerance, (wide, shift_volt), known)
        rows += found
        numbers = {track.identity for track in known}
        known += [track for track in states[-1][1] if track.identity not in numbers]
        begun += states
    rows = joined_identities(rows, motion_volt)
    names = names_of(_first_places(rows), chemistry or "")
    return Result({"rows": [_named(row, names) for row in rows]})


def _named(row, names):
    """A row with names in place of the numbers of identities."""
    event = re.sub(r"#(\d+)", lambda found: names[int(found[1])], row["event"]).strip()
    return row | {"identity": names[row["identity"]], "event": event}


def _count(charge):
    return len(charge.peaks.get("voltage_volt", ()))


def _sequences(charges):
    """Charges of one rate and temperature by cycle; near 25 °C first, then the slowest."""
    by_rate = sorted(charges, key=lambda c: (c.c_rate, c.cycle))
    sequences = [sorted(s, key=lambda c: c.cycle) for s in grouped_alike(by_rate, made_alike)]
    return sorted((s for s in sequences if any(map(_count, s))), key=_from_reference)


def _from_reference(sequence):
    first = sequence[0]
    away = abs(stated_or_reference(first.temperature_celsius) - REFERENCE_CELSIUS)
    return away > 10, first.c_rate, first.cycle


def _followed(sequence, tracks, tolerance, shifts, known):
    """Rows of one sequence, and (cycle, tracks) after each of its charges."""
    rows, states, numbers = [], [], max([t.identity for t in [*known, *tracks]], default=0)
    wide, usual = shifts
    joined = bool(tracks)
    for charge in sequence:
        new_rows, tracks = _charge_rows(charge, tracks, tolerance, wide, joined, numbers)
        numbers = max([numbers, *(track.identity for track in tracks)])
        rows += new_rows
        states.append((charge.cycle, tracks))
        if _count(charge):
            if joined:
                # The first height is that of this sequence: that of another rate says nothing.
                tracks = [t._replace(first_height=t.height if t.seen else np.nan) for t in tracks]
            wide, joined = usual, False
    return rows, states


def _charge_rows(charge, tracks, tolerance, shift_std, joined, numbers):
    """Rows of one charge, and the tracks after it, from low voltage."""
    names = ("voltage_volt", "height_ampere_hour_per_volt", "area_ampere_hour")
    peaks = list(zip(*(charge.peaks[n] for n in names), strict=True)) if _count(charge) else []
    aligned = align([(t.voltage, t.height, t.area) for t in tracks], peaks, *tolerance, shift_std)
    upset = "" if joined else _upset(aligned, tracks, peaks, np.exp(tolerance[1]))
    aligned = aligned._replace(known=sum(track.seen for track in tracks), upset=upset)
    partner = {peak: track for track, peak in aligned.pairs}
    rows, after = [], []
    for k, (voltage, height, area) in enumerate(peaks):
        old = tracks[partner[k]] if k in partner else None
        if old is None:
            numbers += 1
            track = _Track(numbers, voltage, height, area, height, 0.0, True)
            event = _appearance(aligned, tracks, peaks, k) if tracks and not joined else ""
        else:
            own = voltage - old.voltage - aligned.shift
            track = _Track(
                old.identity, voltage, height, area, old.first_height, old.drift + own, True
            )
            event = _change(old, track, own, tolerance[0], joined)
        after.append(track)
        values = (float(charge.peaks[name][k]) for name in OF_PEAK)
        rows.append(_row(charge, track, values, aligned, event, _doubt(aligned, k)))
    gone = [t for t in range(len(tracks)) if t not in {track for track, _ in aligned.pairs}]
    for number in gone:
        lost = tracks[number]
        place = lost.voltage + aligned.shift
        after.append(lost._replace(voltage=place, seen=False))
        fresh = lost.seen and not joined
        event = _disappearance(aligned, tracks, peaks, number) if fresh else "absent"
        reason = charge.reason or f"no peak near {place:.3f} V, where it would be"
        rows.append(_row(charge, lost, [np.nan] * len(OF_PEAK), aligned, event, reason))
    # Absent peaks keep a place too: the order decides what may cross.
    order = np.argsort([track.voltage for track in after], kind="stable")
    return [rows[k] for k in order], [after[k] for k in order]


def _upset(aligned, tracks, peaks, factor):
    """Why a charge is too unlike the one before for names to be carried over, or "".

    The charge of the whole curve and the height of a peak that was found again both changed by more
    than is usual for a peak. A partial charge moves less too, but keeps its heights.
    """
    before = sum(track.area for track in tracks if track.seen)
    whole = before / sum(area for _, _, area in peaks) if peaks and before else 1.0
    heights = [peaks[peak][1] / tracks[track].height for track, peak in aligned.pairs]
    strayed = any(max(height, 1 / height) > factor for height in heights)
    if max(whole, 1 / whole) <= factor or not strayed:
        return ""
    return (
        f"the charge of the curve changed by a factor of {max(whole, 1 / whole):.1f} since the one "
        f"before, heights too; names hold up to {factor:.1f}: check-ups between them are needed"
    )


def _appearance(aligned, tracks, peaks, k):
    """How a peak that was not there before came about."""
    for track, peak in aligned.pairs:
        old, now, new = tracks[track], peaks[peak][2], peaks[k][2]
        near = abs(peak - k) == 1
        if near and _agree(old.area, now + new) and not _agree(old.area, now):
            return f"split from #{old.identity} "
    return "appeared"


def _disappearance(aligned, tracks, peaks, number):
    """How a peak went: into its neighbour, or by itself."""
    for track, peak in aligned.pairs:
        before, lost, now = tracks[track].area, tracks[number].area, peaks[peak][2]
        near = abs(track - number) == 1
        if near and _agree(before + lost, now) and not _agree(before, now):
            return f"merged with #{tracks[track].identity} "
    return "vanished"


def _agree(first, second):
    """Whether two areas from valley to valley agree within 15 %."""
    return abs(first - second) <= 0.15 * max(first, second)


def _change(old, track, own, motion, joined):
    """Events of a peak that was found again."""
    words = [] if old.seen else ["returned"]
    if abs(own) > 2 * motion and not joined:
        words.append(f"moved by {1e3 * own:+.0f} mV beside the others")
    half = 0.5 * old.first_height
    if track.height < half and not old.height < half and not joined:
        words.append(f"shrunk to {track.height / old.first_height:.0%}")
    return "; ".join(words)


def _row(charge, track, values, aligned, event, reason):
    """Row of a peak, or of one that is missing."""
    about = {
        "test": charge.test,
        "cycle": charge.cycle,
        "c_rate": charge.c_rate,
        "ambient_temperature_celsius": charge.temperature_celsius,
        "identity": track.identity,
    }
    shifts = {"common_shift_volt": aligned.shift, "own_shift_volt": track.drift}
    peak = dict(zip(OF_PEAK, values, strict=True))
    return about | peak | shifts | {"event": event, "reason": reason}


def _doubt(aligned, k):
    """Why the name of a peak is in doubt, or ""."""
    # By less than 2 in -2 log likelihood the next best assignment is only 2.7 times less likely.
    if aligned.margins.get(k, np.inf) <= 2.0:
        return "another assignment is nearly as likely"
    if aligned.upset:
        return aligned.upset
    if aligned.known > 1 and len(aligned.pairs) == 1 and k in aligned.margins:
        return f"the only one left of {aligned.known}: what is common cannot be told from its own"
    return ""


def _first_places(rows):
    """Voltage of each identity where it was first seen, in the order of the rows."""
    places = {}
    for row in rows:
        if np.isfinite(row["voltage_volt"]):
            places.setdefault(row["identity"], (row["voltage_volt"], row["c_rate"]))
    return places
