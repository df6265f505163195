"""What limits a cell in the cold: which part of its resistance grows, how much, how sure."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.points import grouped, one_a_temperature
from cellwright.laws.temperature import LAWS, span_of
from cellwright.refusal import Refusal

SURE = 1.96  # standard deviations: 95 % of a normal distribution

# What the parts of a resistance are called, the fast one first; from impedance, then from pulses.
PARTS = {
    "impedance": ("ohmic resistance", "charge transfer"),
    "pulses": ("the first sample of a pulse", "the rise after it"),
}


class Growth(NamedTuple):
    """How a part of the resistance grows from the warmest to the coldest temperature at one SoC.

    warm_ohm, cold_ohm : values there. log_std : standard deviation of ln(cold/warm) from the
    errors of both; NaN where not known.
    """

    source: str
    part: str
    soc: float
    warm_ohm: float
    cold_ohm: float
    log_std: float


class ColdLimit(NamedTuple):
    """Which part limits, by what, over which range, and the same in words.

    limit : the part that adds more ohms at most states of charge. agreeing, sure, levels : at how
    many SoC it does, at how many its growth factor is the larger beyond 95 %, of how many.
    """

    source: str
    limit: str
    agreeing: int
    sure: int
    levels: int
    warmest_celsius: float
    coldest_celsius: float
    growth: list
    paragraph: str


def cold_limit(points, laws):
    """The part of a cell's resistance that limits it in the cold.

    1. From impedance: ohmic against charge-transfer resistance; where there is none, from
    discharge pulses: the first sample against the rise from there to the last delay. 2. The
    growth of both from the warmest to the coldest temperature that all of a SoC's points share.
    3. The part that adds more ohms limits; how sure is told by the growth factors' errors.

    Parameters
    ----------
    points : list of `points.Point`. laws : list of dict as `temperature.law_rows` makes them.

    Returns
    -------
    found : ColdLimit.

    Raises
    ------
    Refusal : neither spectra nor pulses show both parts at two temperatures.

    Source: thesis section 3.2 (Rct grows 26-fold to −20 °C, Rs less than twofold).
    """
    kinds = ("ohmic", "charge-transfer")
    both = [_of_family(points, f"{kind} resistance, impedance") for kind in kinds]
    spectra = {soc: tuple(one[soc] for one in both) for soc in both[0] if _shared(both, soc)}
    for source, pairs in (("impedance", spectra), ("pulses", _pulses(points))):
        if pairs:
            return _judged(source, pairs, points, laws)
    raise Refusal("neither spectra nor pulses show two parts of the resistance over temperature")


def _pulses(points):
    families = [p.family for p in points if p.family.startswith("resistance, ")]
    later = [name for name in dict.fromkeys(families) if name != "resistance, first sample"]
    if not later:
        return {}
    both = [_of_family(points, name) for name in ("resistance, first sample", later[-1])]
    pairs = {}
    for soc in (soc for soc in both[0] if _shared(both, soc)):
        first, whole = both[0][soc], both[1][soc]
        rise = {
            c: (whole[c][0] - first[c][0], float(np.hypot(whole[c][1], first[c][1])))
            for c in whole
            if c in first
        }
        if min(value for value, _ in rise.values()) > 0:
            pairs[soc] = first, rise
    return pairs


def _of_family(points, family):
    """SoC → temperature → (value, std); the mean of what was measured more than once."""
    courses = {}
    for point in one_a_temperature(point for point in points if point.family == family):
        course = courses.setdefault(point.soc, {})
        course[point.temperature_celsius] = (point.value, point.std)
    return courses


def _shared(both, soc):
    return all(soc in one for one in both) and len(both[0][soc].keys() & both[1][soc].keys()) >= 2


def _judged(source, pairs, points, laws):
    """Growth between the extremes that most states of charge reach."""
    spans = [_span(pair) for pair in pairs.values()]
    warm, cold = max(spans, key=lambda span: (spans.count(span), span[0] - span[1]))
    kept = {soc: pair for soc, pair in pairs.items() if _span(pair) == (warm, cold)}
    growth = []
    for soc, pair in sorted(kept.items()):
        for part, one in zip(PARTS[source], pair, strict=True):
            (warm_ohm, warm_std), (cold_ohm, cold_std) = one[warm], one[cold]
            log_std = float(np.hypot(warm_std / warm_ohm, cold_std / cold_ohm))
            growth.append(Growth(source, part, soc, warm_ohm, cold_ohm, log_std))
    parts = list(zip(growth[::2], growth[1::2], strict=True))
    slower = [b.cold_ohm - b.warm_ohm > a.cold_ohm - a.warm_ohm for a, b in parts]
    limit = PARTS[source][int(np.mean(slower) > 0.5)]
    sign = 1 if limit == PARTS[source][1] else -1
    # A growth factor without a standard deviation compares as not sure.
    sure = [
        sign * (np.log(b.cold_ohm / b.warm_ohm) - np.log(a.cold_ohm / a.warm_ohm))
        > SURE * np.hypot(a.log_std, b.log_std)
        for a, b in parts
    ]
    agreeing = slower.count(sign > 0)
    found = ColdLimit(source, limit, agreeing, sum(sure), len(kept), warm, cold, growth, "")
    return found._replace(paragraph=paragraph(found, PARTS[source], points, laws))


def _span(pair):
    """Warmest and coldest temperature that both parts share [°C]."""
    shared = pair[0].keys() & pair[1].keys()
    return max(shared), min(shared)


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
    return f"{span_of([one.cold_ohm / one.warm_ohm for one in growth], '.3g')} times"


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
    for family, here in grouped(mine, lambda point: point.family).items():
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
        f"{span_of(answers, '.3g')}, an extrapolation."
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
