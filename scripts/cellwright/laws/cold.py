"""What limits a cell in the cold: which part of its resistance grows, how much, how sure."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.points import grouped, mean_per_temperature
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
    """Part of the resistance that limits a cell in the cold, the evidence, and a paragraph.

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
    3. The part that adds more ohms limits; the errors of the growth factors say how certain
    that is.

    Parameters
    ----------
    points : list of `points.Point`. laws : list of dict as `temperature.law_rows` makes them.

    Returns
    -------
    limit : ColdLimit.

    Raises
    ------
    Refusal : neither spectra nor pulses show both parts at two temperatures.

    Source: thesis section 3.2 (Rct grows 26-fold to −20 °C, Rs less than twofold).
    """
    kinds = ("ohmic", "charge-transfer")
    courses = [_of_family(points, f"{kind} resistance, impedance") for kind in kinds]
    spectra = {
        soc: tuple(course[soc] for course in courses) for soc in courses[0] if _shared(courses, soc)
    }
    for source, pairs in (("impedance", spectra), ("pulses", _pulses(points))):
        if pairs:
            return _compared(source, pairs, points, laws)
    raise Refusal("neither spectra nor pulses show two parts of the resistance over temperature")


def _pulses(points):
    """SoC → (first sample, rise after it) over temperature, from discharge pulses [ohm]."""
    families = [p.family for p in points if p.family.startswith("resistance, ")]
    later = [name for name in dict.fromkeys(families) if name != "resistance, first sample"]
    if not later:
        return {}
    courses = [_of_family(points, name) for name in ("resistance, first sample", later[-1])]
    pairs = {}
    for soc in (soc for soc in courses[0] if _shared(courses, soc)):
        first, whole = courses[0][soc], courses[1][soc]
        rise = {
            c: (whole[c][0] - first[c][0], float(np.hypot(whole[c][1], first[c][1])))
            for c in whole
            if c in first
        }
        if min(value for value, _ in rise.values()) > 0:
            pairs[soc] = first, rise
    return pairs


def _of_family(points, family):
    """SoC → temperature → (value, std) of a family; repeats are averaged."""
    courses = {}
    for point in mean_per_temperature(point for point in points if point.family == family):
        course = courses.setdefault(point.soc, {})
        course[point.temperature_celsius] = (point.value, point.std)
    return courses


def _shared(courses, soc):
    """Whether both parts are known at a SoC at two temperatures or more."""
    return (
        all(soc in course for course in courses)
        and len(courses[0][soc].keys() & courses[1][soc].keys()) >= 2
    )


def _compared(source, pairs, points, laws):
    """Growth of both parts between the extremes that most states of charge reach, and the limit."""
    spans = [_span(pair) for pair in pairs.values()]
    warm, cold = max(spans, key=lambda span: (spans.count(span), span[0] - span[1]))
    kept = {soc: pair for soc, pair in pairs.items() if _span(pair) == (warm, cold)}
    growth = []
    for soc, pair in sorted(kept.items()):
        for part, course in zip(PARTS[source], pair, strict=True):
            (warm_ohm, warm_std), (cold_ohm, cold_std) = course[warm], course[cold]
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
    result = ColdLimit(source, limit, agreeing, sum(sure), len(kept), warm, cold, growth, "")
    return result._replace(paragraph=paragraph(result, PARTS[source], points, laws))


def _span(pair):
    """Warmest and coldest temperature that both parts share [°C]."""
    shared = pair[0].keys() & pair[1].keys()
    return max(shared), min(shared)


LOOK_AHEAD_KELVIN = 10.0  # K below the coldest test: how far the words look ahead
COLD_BELOW_CELSIUS = 15.0  # °C: above it, tests have not been to the cold, only towards it


def paragraph(result, parts, points, laws):
    """Paragraph on what limits one cell in the cold, for a reader without the tables.

    Parameters
    ----------
    result : ColdLimit without its paragraph.
    parts : names of the fast and the slow part of the resistance.
    points : list of `points.Point`. laws : rows of the laws, for the look ahead.

    Returns
    -------
    text : str.
    """
    sentences = [
        _limit_sentence(result, parts),
        _certainty_sentence(result),
        *_share_sentence(result),
        *_pulse_sentence(result, points),
        _extrapolation_sentence(result, laws),
    ]
    return " ".join(sentences)


def _limit_sentence(result, parts):
    """Which part limits and by which factor both grow."""
    fast, slow = ([g for g in result.growth if g.part == part] for part in parts)
    names = dict(zip(parts, (_factor(fast), _factor(slow)), strict=True))
    other = next(part for part in parts if part != result.limit)
    where = f"from {result.warmest_celsius:g} to {result.coldest_celsius:g} °C"
    if result.agreeing * 2 == result.levels:
        both = ", ".join(f"{part} grows {names[part]}" for part in parts)
        return f"Neither part stands out {where}: {both}."
    cold = "In" if result.coldest_celsius < COLD_BELOW_CELSIUS else "Towards"
    return (
        f"{cold} the cold this cell is limited by {_LIMITS[result.limit]}: {where} {result.limit} "
        f"grows {names[result.limit]}, {other} {names[other]}."
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
    """Range of the growth factors of a part in words."""
    return f"{span_of([part.cold_ohm / part.warm_ohm for part in growth], '.3g')} times"


def _certainty_sentence(result):
    """At how many states of charge the part limits, and at how many beyond the errors."""
    levels = f"{result.levels} state{'s' if result.levels > 1 else ''} of charge"
    if not np.isfinite([part.log_std for part in result.growth]).any():
        return f"It adds more ohms at {result.agreeing} of {levels}; the points carry no errors."
    return (
        f"It adds more ohms at {result.agreeing} of {levels}, and its growth factor is the larger "
        f"beyond the errors of the points (95 %) at {result.sure}."
    )


def _share_sentence(result):
    """Share of the limiting part in the sum of both, warm and cold, at the SoC nearest 50 %."""
    socs = sorted({part.soc for part in result.growth})
    middle = min(socs, key=lambda soc: abs(soc - 0.5))
    parts = [part for part in result.growth if part.soc == middle]
    limiting = next(part for part in parts if part.part == result.limit)
    warm, cold = (sum(getattr(part, name) for part in parts) for name in ("warm_ohm", "cold_ohm"))
    yield (
        f"At {100 * middle:.0f} % SoC it makes up {100 * limiting.warm_ohm / warm:.0f} % of the "
        f"sum of both at {result.warmest_celsius:g} °C and "
        f"{100 * limiting.cold_ohm / cold:.0f} % at {result.coldest_celsius:g} °C."
    )


def _pulse_sentence(result, points):
    """Growth of the pulse resistance at the SoC nearest 50 %, beside the spectra."""
    pulses = [
        p for p in points if result.source == "impedance" and p.family.startswith("resistance,")
    ]
    factors = []
    for family, family_points in grouped(pulses, lambda point: point.family).items():
        middle = min((point.soc for point in family_points), key=lambda soc: abs(soc - 0.5))
        course = {p.temperature_celsius: p.value for p in family_points if p.soc == middle}
        factor = course[min(course)] / course[max(course)]
        when = family.removeprefix("resistance, ")
        factors.append(f"{factor:.3g} times ({when}, {max(course):g} to {min(course):g} °C)")
    if factors:
        yield f"The pulse resistance grows {' and '.join(factors)}."


def _extrapolation_sentence(result, laws):
    """Growth that the laws predict below the coldest test, marked as an extrapolation."""
    cold = result.coldest_celsius
    rows = [row for row in laws if _IS_OF[result.limit](row["quantity"])]
    rows = [row for row in rows if row["tested_from_celsius"] == cold]
    text = f"Below {cold:g} °C nothing was tested"
    if not rows:
        return f"{text}."
    quantity = min((row["quantity"] for row in rows), key=_from_middle)
    answers = [_step(law, rows, quantity, cold) for law in LAWS]
    answers = [answer for answer in answers if np.isfinite(answer)]
    if not answers:
        return f"{text}."
    return (
        f"{text}: by the laws a further {LOOK_AHEAD_KELVIN:g} K would multiply the {quantity} by "
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
    """Distance of a quantity's SoC from 50 % [%]; infinite where it names none."""
    soc = quantity.partition(" at ")[2].partition(" % SoC")[0]
    return abs(float(soc) - 50) if soc else np.inf


def _step(law, rows, quantity, cold):
    """Growth factor by a law over `LOOK_AHEAD_KELVIN` below the coldest test; NaN: not valid."""
    parameters = [row for row in rows if row["quantity"] == quantity and row["law"] == law]
    if (
        not parameters
        or parameters[0].get("valid_from_celsius", -np.inf) > cold - LOOK_AHEAD_KELVIN
    ):
        return np.nan
    values = [row["value"] for row in parameters]
    return LAWS[law](cold - LOOK_AHEAD_KELVIN, *values) / LAWS[law](cold, *values)
