"""Peaks that appear later in two sequences of charges recognised as one."""

import numpy as np


def joined_identities(rows, motion_volt):
    """Rows with one identity for peaks that stand at the same place in different sequences.

    Two identities are one if no sequence (rate, temperature) has both, and at the charges nearest
    in cycle they differ by as much as the identities that both charges share, within three motion
    tolerances.

    Parameters
    ----------
    rows : list of dict of `tracking`, with numbers as identities. motion_volt : own motion of a
        peak [V].

    Returns
    -------
    rows : list of dict.
    """
    charges = {}
    for row in rows:
        if np.isfinite(row["voltage_volt"]):
            charges.setdefault(_charge(row), {})[row["identity"]] = row["voltage_volt"]
    numbers = sorted({identity for peaks in charges.values() for identity in peaks})
    same = {}
    for later in numbers:
        earlier = (n for n in numbers if n < later and n not in same)
        first = next((n for n in earlier if _one(charges, n, later, motion_volt)), None)
        if first is not None:
            same[later] = first
            charges = {c: {same.get(n, n): v for n, v in p.items()} for c, p in charges.items()}
    return [_renamed(row, same) for row in rows]


def _charge(row):
    """Sequence and cycle of a row: rate to two digits, temperature to 5 K, cycle."""
    celsius = row["ambient_temperature_celsius"]
    warmth = round(celsius / 5) if np.isfinite(celsius) else None
    return (float(f"{row['c_rate']:.1g}"), warmth), row["cycle"]


def _one(charges, first, later, motion):
    """Whether two identities are one peak, seen in different sequences."""
    where = [{c for c, peaks in charges.items() if n in peaks} for n in (first, later)]
    sequences = [{sequence for sequence, _ in found} for found in where]
    if sequences[0] & sequences[1]:
        return False
    pairs = [(abs(a[1] - b[1]), a, b) for a in where[0] for b in where[1]]
    _, near, other = min(pairs)
    shared = set(charges[near]) & set(charges[other])
    if not shared:
        return False
    # What shared peaks move together is rate and temperature, not identity.
    offset = np.mean([charges[other][n] - charges[near][n] for n in shared])
    apart = charges[other][later] - charges[near][first] - offset
    return abs(apart) <= 3.0 * motion


def _renamed(row, same):
    """A row with the identity, and the names in its event, that are kept."""
    event = row["event"]
    for later, first in same.items():
        event = event.replace(f"#{later} ", f"#{first} ")
    return row | {"identity": same.get(row["identity"], row["identity"]), "event": event}


def count_before(own, tracked) -> float:
    """Cycles between the own count of a record and that of the tracks, by which most charges meet.

    Some charges have no peak, and so no track, and others no curve.

    Parameters
    ----------
    own : (n,) cycles of the record's charges, by its own count. tracked : set of cycles.
    """
    counts = [0.0, *(cycle - own[0] for cycle in sorted(tracked))]
    return float(max(counts, key=lambda before: len(tracked & {*(own + before)})))
