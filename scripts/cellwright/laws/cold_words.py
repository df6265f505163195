"""What limits a cell in the cold, in plain words."""

import numpy as np

from cellwright.laws.temperature import LAWS

FURTHER = 10.0  # K below the coldest test: how far the words look ahead
CHILLY = 15.0  # °C: above it, tests have not been to the cold, only towards it


def paragraph(found, parts, points, laws):
    """A paragraph for people about one cell.

    Parameters
    ----------
    found : `cold.ColdLimit` without its words.
    parts : names of the fast and the slow part of the resistance.
    points : list of `points.Point`. laws : rows of the laws, for the look ahead.

    Returns
    -------
    text : str.
    """
    sentences = [
        _what(found, parts),
        _how_sure(found),
        *_share(found),
        *_pulses_too(found, points),
        _beyond(found, laws),
    ]
    return " ".join(sentences)


def _what(found, parts):
    fast, slow = ([g for g in found.growth if g.part == part] for part in parts)
    names = dict(zip(parts, (_factor(fast), _factor(slow)), strict=True))
    other = next(part for part in parts if part != found.limit)
    where = f"from {found.warmest_celsius:g} to {found.coldest_celsius:g} °C"
    if found.agreeing * 2 == found.levels:
        both = ", ".join(f"{part} grows {names[part]}" for part in parts)
        return f"Neither part stands out {where}: {both}."
    cold = "In" if found.coldest_celsius < CHILLY else "Towards"
    return (
        f"{cold} the cold this cell is limited by {_LIMITS[found.limit]}: {where} {found.limit} "
        f"grows {names[found.limit]}, {other} {names[other]}."
    )


_LIMITS = {
    "charge transfer": "charge transfer at its electrodes",
    "ohmic resistance": "its ohmic resistance (electrolyte, electrodes, metal)",
    "the rise after it": (
        "what builds up after the onset of a load (charge transfer and diffusion)"
    ),
    "the first sample of a pulse": (
        "what answers a load at once (ohmic resistance, and whatever part of charge transfer is "
        "faster than the sampling)"
    ),
}


def _factor(growth):
    return f"{_range([one.cold_ohm / one.warm_ohm for one in growth])} times"


def _range(values):
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def _how_sure(found):
    levels = f"{found.levels} state{'s' if found.levels > 1 else ''} of charge"
    if not np.isfinite([one.log_std for one in found.growth]).any():
        return f"It adds more ohms at {found.agreeing} of {levels}; the points carry no errors."
    return (
        f"It adds more ohms at {found.agreeing} of {levels}, and its growth factor is the larger "
        f"beyond the errors of the points (95 %) at {found.sure}."
    )


def _share(found):
    """What it makes up of the whole, at the middle of the states of charge."""
    socs = sorted({one.soc for one in found.growth})
    middle = min(socs, key=lambda soc: abs(soc - 0.5))
    here = [one for one in found.growth if one.soc == middle]
    mine = next(one for one in here if one.part == found.limit)
    warm, cold = (sum(getattr(one, name) for one in here) for name in ("warm_ohm", "cold_ohm"))
    yield (
        f"At {100 * middle:.0f} % SoC it makes up {100 * mine.warm_ohm / warm:.0f} % of the sum of "
        f"both at {found.warmest_celsius:g} °C and {100 * mine.cold_ohm / cold:.0f} % at "
        f"{found.coldest_celsius:g} °C."
    )


def _pulses_too(found, points):
    """Beside spectra: what the pulses say, at the state of charge nearest the middle."""
    mine = [p for p in points if found.source == "impedance" and p.family.startswith("resistance,")]
    told = []
    for family in dict.fromkeys(point.family for point in mine):
        here = [point for point in mine if point.family == family]
        middle = min((point.soc for point in here), key=lambda soc: abs(soc - 0.5))
        course = {p.temperature_celsius: p.value for p in here if p.soc == middle}
        factor = course[min(course)] / course[max(course)]
        when = family.removeprefix("resistance, ")
        told.append(f"{factor:.3g} times ({when}, {max(course):g} to {min(course):g} °C)")
    if told:
        yield f"The pulse resistance grows {' and '.join(told)}."


def _beyond(found, laws):
    """The laws' own answers a step below the coldest test, marked as what they are."""
    cold = found.coldest_celsius
    mine = [row for row in laws if _IS_OF[found.limit](row["quantity"])]
    mine = [row for row in mine if row["tested_from_celsius"] == cold]
    text = f"Below {cold:g} °C nothing was tested"
    if not mine:
        return f"{text}."
    quantity = min((row["quantity"] for row in mine), key=_from_middle)
    answers = [_step(law, mine, quantity, cold) for law in LAWS]
    answers = [answer for answer in answers if np.isfinite(answer)]
    if not answers:
        return f"{text}."
    return (
        f"{text}: by the laws a further {FURTHER:g} K would multiply the {quantity} by "
        f"{_range(answers)}, an extrapolation."
    )


_IS_OF = {
    "charge transfer": lambda quantity: quantity.startswith("charge-transfer resistance"),
    "ohmic resistance": lambda quantity: quantity.startswith("ohmic resistance"),
    "the rise after it": lambda quantity: (
        quantity.startswith("resistance") and quantity.endswith(" s")
    ),
    "the first sample of a pulse": lambda quantity: (
        quantity.startswith("resistance") and quantity.endswith("first sample")
    ),
}


def _from_middle(quantity):
    soc = quantity.partition(" at ")[2].partition(" % SoC")[0]
    return abs(float(soc) - 50) if soc else np.inf


def _step(law, rows, quantity, cold):
    mine = [row for row in rows if row["quantity"] == quantity and row["law"] == law]
    if not mine or mine[0].get("valid_from_celsius", -np.inf) > cold - FURTHER:
        return np.nan
    values = [row["value"] for row in mine]
    return LAWS[law](cold - FURTHER, *values) / LAWS[law](cold, *values)
