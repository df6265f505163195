"""What limits a cell in the cold: which part of its resistance grows, how much, and how sure."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.cold_words import paragraph
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
    for source, pairs in (("impedance", _spectra(points)), ("pulses", _pulses(points))):
        if pairs:
            return _judged(source, pairs, points, laws)
    raise Refusal("neither spectra nor pulses show two parts of the resistance over temperature")


def _spectra(points):
    both = [_of_family(points, f"{kind} resistance, impedance") for kind in ("ohmic", KIND)]
    return {soc: (both[0][soc], both[1][soc]) for soc in both[0] if _shared(both, soc)}


KIND = "charge-transfer"


def _pulses(points):
    families = [p.family for p in points if p.family.startswith("resistance, ")]
    later = [name for name in dict.fromkeys(families) if name != "resistance, first sample"]
    if not later:
        return {}
    both = [_of_family(points, name) for name in ("resistance, first sample", later[-1])]
    pairs = {}
    for soc in (soc for soc in both[0] if _shared(both, soc)):
        first, whole = both[0][soc], both[1][soc]
        rise = {c: _minus(whole[c], first[c]) for c in whole if c in first}
        if min(value for value, _ in rise.values()) > 0:
            pairs[soc] = first, rise
    return pairs


def _minus(whole, part):
    return whole[0] - part[0], float(np.hypot(whole[1], part[1]))


def _of_family(points, family):
    """SoC → temperature → (value, std); the mean of what was measured more than once."""
    found = {}
    for point in (point for point in points if point.family == family):
        course = found.setdefault(point.soc, {})
        course.setdefault(point.temperature_celsius, []).append((point.value, point.std))
    return {
        soc: {celsius: _mean(values) for celsius, values in course.items()}
        for soc, course in found.items()
    }


def _mean(values):
    value, std = np.transpose(values)
    return float(value.mean()), float(np.sqrt(np.sum(std**2)) / len(std))


def _shared(both, soc):
    return all(soc in one for one in both) and len(both[0][soc].keys() & both[1][soc].keys()) >= 2


def _judged(source, pairs, points, laws):
    """Growth between the extremes that most states of charge reach."""
    spans = [_span(pair) for pair in pairs.values()]
    warm, cold = max(spans, key=lambda span: (spans.count(span), span[0] - span[1]))
    kept = {soc: pair for soc, pair in pairs.items() if _span(pair) == (warm, cold)}
    growth = [
        Growth(source, part, soc, one[warm][0], one[cold][0], _log_std(one[warm], one[cold]))
        for soc, pair in sorted(kept.items())
        for part, one in zip(PARTS[source], pair, strict=True)
    ]
    fast, slow = growth[::2], growth[1::2]
    slower = [
        b.cold_ohm - b.warm_ohm > a.cold_ohm - a.warm_ohm for a, b in zip(fast, slow, strict=True)
    ]
    limit = PARTS[source][int(np.mean(slower) > 0.5)]
    sign = 1 if limit == PARTS[source][1] else -1
    sure = [sign * _distance(a, b) > SURE for a, b in zip(fast, slow, strict=True)]
    agreeing = slower.count(sign > 0)
    found = ColdLimit(source, limit, agreeing, sum(sure), len(kept), warm, cold, growth, "")
    return found._replace(paragraph=paragraph(found, PARTS[source], points, laws))


def _span(pair):
    shared = pair[0].keys() & pair[1].keys()
    return max(shared), min(shared)


def _log_std(warm, cold):
    return float(np.hypot(warm[1] / warm[0], cold[1] / cold[0]))


def _distance(fast, slow):
    """By how many standard deviations the second part grows more; NaN compares as not sure."""
    more = np.log(slow.cold_ohm / slow.warm_ohm) - np.log(fast.cold_ohm / fast.warm_ohm)
    return more / np.hypot(fast.log_std, slow.log_std)
