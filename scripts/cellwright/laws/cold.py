"""What limits a cell in the cold: which part of its resistance grows, how much, how sure."""

import numpy as np

from cellwright.laws.law import value_of
from cellwright.laws.points import grouped, mean_per_temperature, point_of
from cellwright.laws.temperature import FORMS, LAWS, span_of
from cellwright.numerics.statistics import NORMAL_95
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result

# What the parts of a resistance are called, the fast one first; from impedance, then from pulses.
PARTS = {
    "impedance": ("ohmic resistance", "charge transfer"),
    "pulses": ("the first sample of a pulse", "the rise after it"),
}


def cold_limit(laws, points=None):
    """A paragraph on the part of the resistance that limits a cell in the cold.

    1. From impedance: ohmic against charge-transfer resistance; where there is none, from
    discharge pulses: the first sample against the rise from there to the last delay. 2. The
    growth of both from the warmest to the coldest temperature that all of a SoC's points share.
    3. The part that adds more ohms at most states of charge limits; the errors of the growth
    factors say how certain that is.

    laws : result of `temperature_laws`, or its rows. points : rows of its points; None: of `laws`.

    Returns content: source, limit (name of the part), levels of SoC; at how many of them it adds
    more ohms (agreeing), at how many its growth factor is the larger beyond 95 % (sure);
    warmest_celsius, coldest_celsius; growth, one dict a SoC and part (log_std: standard deviation
    of ln(cold/warm) from the errors of both, NaN where not known); paragraph. Raises Refusal:
    neither spectra nor pulses show both parts at two temperatures.
    Source: thesis section 3.2 (Rct grows 26-fold to −20 °C, Rs less than twofold);
    docs/temperature.md.
    """
    points = [point_of(row) for row in inputs.rows(laws.points if points is None else points)]
    laws = inputs.rows(laws)
    for source, families in _families(points).items():
        courses = [_of_family(points, family) for family in families]
        pairs = {soc: tuple(course[soc] for course in courses) for soc in _shared_levels(courses)}
        if source == "pulses":
            pairs = _first_and_rise(pairs)
        if pairs:
            limit = _compared(source, pairs)
            return Result({}, limit | {"paragraph": _paragraph(limit, points, laws)})
    raise Refusal("neither spectra nor pulses show two parts of the resistance over temperature")


def _families(points):
    """Source → families of the points that tell its parts; the last delay of a pulse tells all."""
    families = {
        "impedance": ("ohmic resistance, impedance", "charge-transfer resistance, impedance")
    }
    first = "resistance, first sample"
    later = [p.family for p in points if p.family.startswith("resistance, ") and p.family != first]
    return families | ({"pulses": (first, list(dict.fromkeys(later))[-1])} if later else {})


def _first_and_rise(pairs):
    """SoC → (first sample, rise after it) from (first sample, whole) over temperature [ohm]."""
    found = {}
    for soc, (first, whole) in pairs.items():
        rise = {
            c: (whole[c][0] - first[c][0], float(np.hypot(whole[c][1], first[c][1])))
            for c in whole
            if c in first
        }
        # A rise that is not positive is noise: it has no growth factor.
        if min(value for value, _ in rise.values()) > 0:
            found[soc] = first, rise
    return found


def _of_family(points, family):
    """SoC → temperature → (value, std) of a family; repeats are averaged."""
    courses = {}
    for point in mean_per_temperature(point for point in points if point.family == family):
        course = courses.setdefault(point.soc, {})
        course[point.temperature_celsius] = (point.value, point.std)
    return courses


def _shared_levels(courses):
    """States of charge at which both parts are known at two temperatures or more."""
    first, second = courses
    return [soc for soc in first if len(first[soc].keys() & second.get(soc, {}).keys()) >= 2]


def _compared(source, pairs):
    """Growth of both parts between the extremes that most states of charge reach, and the limit."""
    spans = [_span(pair) for pair in pairs.values()]
    # Growth compares only over one span; of two as frequent ones the wider counts.
    warm, cold = max(spans, key=lambda span: (spans.count(span), span[0] - span[1]))
    kept = {soc: pair for soc, pair in pairs.items() if _span(pair) == (warm, cold)}
    growth = []
    for soc, pair in sorted(kept.items()):
        for part, course in zip(PARTS[source], pair, strict=True):
            (warm_ohm, warm_std), (cold_ohm, cold_std) = course[warm], course[cold]
            row = {"source": source, "part": part, "soc": soc}
            row |= {"warm_ohm": warm_ohm, "cold_ohm": cold_ohm}
            growth.append(
                row | {"log_std": float(np.hypot(warm_std / warm_ohm, cold_std / cold_ohm))}
            )
    parts = list(zip(growth[::2], growth[1::2], strict=True))
    slower = [b["cold_ohm"] - b["warm_ohm"] > a["cold_ohm"] - a["warm_ohm"] for a, b in parts]
    limit = PARTS[source][int(np.mean(slower) > 0.5)]
    sign = 1 if limit == PARTS[source][1] else -1
    # A growth factor without a standard deviation compares as not sure.
    sure = [
        sign * (np.log(_factor(b)) - np.log(_factor(a)))
        > NORMAL_95 * np.hypot(a["log_std"], b["log_std"])
        for a, b in parts
    ]
    return {
        "source": source,
        "limit": limit,
        "agreeing": slower.count(sign > 0),
        "sure": sum(sure),
        "levels": len(kept),
        "warmest_celsius": warm,
        "coldest_celsius": cold,
        "growth": growth,
    }


def _span(pair):
    """Warmest and coldest temperature that both parts share [°C]."""
    shared = pair[0].keys() & pair[1].keys()
    return max(shared), min(shared)


def _factor(growth):
    return growth["cold_ohm"] / growth["warm_ohm"]


LOOK_AHEAD_KELVIN = 10.0  # K below the coldest test: how far the words look ahead


def _paragraph(limit, points, laws):
    """What limits one cell in the cold, for a reader without the tables."""
    sentences = [
        _limit_sentence(limit),
        _certainty_sentence(limit),
        _share_sentence(limit),
        *_pulse_sentence(limit, points),
        _extrapolation_sentence(limit, points, laws),
    ]
    return " ".join(sentences)


def _limit_sentence(limit):
    """Which part limits and by which factor both grow."""
    parts, name = PARTS[limit["source"]], limit["limit"]
    grown = {
        part: f"{span_of([_factor(g) for g in limit['growth'] if g['part'] == part], '.3g')} times"
        for part in parts
    }
    other = next(part for part in parts if part != name)
    where = f"from {limit['warmest_celsius']:g} to {limit['coldest_celsius']:g} °C"
    if limit["agreeing"] * 2 == limit["levels"]:
        both = ", ".join(f"{part} grows {grown[part]}" for part in parts)
        return f"Neither part stands out {where}: {both}."
    # Tests that all were above 15 °C have not been to the cold, only towards it.
    cold = "In" if limit["coldest_celsius"] < 15.0 else "Towards"
    return (
        f"{cold} the cold this cell is limited by {_LIMITS[name]}: {where} {name} grows "
        f"{grown[name]}, {other} {grown[other]}."
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


def _certainty_sentence(limit):
    """At how many states of charge the part limits, and at how many beyond the errors."""
    levels = f"{limit['levels']} state{'s' if limit['levels'] > 1 else ''} of charge"
    more = f"It adds more ohms at {limit['agreeing']} of {levels}"
    if not np.isfinite([part["log_std"] for part in limit["growth"]]).any():
        return f"{more}; the points carry no errors."
    return (
        f"{more}, and its growth factor is the larger beyond the errors of the points (95 %) at "
        f"{limit['sure']}."
    )


def _share_sentence(limit):
    """Share of the limiting part in the sum of both, warm and cold, at the SoC nearest 50 %."""
    middle = min((part["soc"] for part in limit["growth"]), key=_from_half)
    parts = [part for part in limit["growth"] if part["soc"] == middle]
    limiting = next(part for part in parts if part["part"] == limit["limit"])
    warm, cold = (
        100 * limiting[name] / sum(part[name] for part in parts)
        for name in ("warm_ohm", "cold_ohm")
    )
    return (
        f"At {100 * middle:.0f} % SoC it makes up {warm:.0f} % of the sum of both at "
        f"{limit['warmest_celsius']:g} °C and {cold:.0f} % at {limit['coldest_celsius']:g} °C."
    )


def _from_half(soc):
    return abs(soc - 0.5)


def _pulse_sentence(limit, points):
    """Growth of the pulse resistance at the SoC nearest 50 %, beside the spectra."""
    beside = limit["source"] == "impedance"
    pulses = [p for p in points if beside and p.family.startswith("resistance,")]
    factors = []
    for family, family_points in grouped(pulses, lambda point: point.family).items():
        middle = min((point.soc for point in family_points), key=_from_half)
        course = {p.temperature_celsius: p.value for p in family_points if p.soc == middle}
        factor = course[min(course)] / course[max(course)]
        when = family.removeprefix("resistance, ")
        factors.append(f"{factor:.3g} times ({when}, {max(course):g} to {min(course):g} °C)")
    if factors:
        yield f"The pulse resistance grows {' and '.join(factors)}."


def _extrapolation_sentence(limit, points, laws):
    """Growth that the laws predict below the coldest test, marked as an extrapolation."""
    cold, source = limit["coldest_celsius"], limit["source"]
    family = _families(points)[source][PARTS[source].index(limit["limit"])]
    socs = {point.quantity: point.soc for point in points if point.family == family}
    rows = [r for r in laws if r["quantity"] in socs and r["tested_from_celsius"] == cold]
    text = f"Below {cold:g} °C nothing was tested"
    quantity = min((row["quantity"] for row in rows), key=lambda q: _from_half(socs[q]), default="")
    answers = [_step(law, rows, quantity, cold) for law in LAWS]
    answers = [answer for answer in answers if np.isfinite(answer)]
    if not answers:
        return f"{text}."
    what = quantity.replace(", ", " by ", 1)
    return (
        f"{text}: extrapolated by the laws, the {what} grows by a factor of "
        f"{span_of(answers, '.3g')} over the next {LOOK_AHEAD_KELVIN:g} K."
    )


def _step(law, rows, quantity, cold):
    """Growth factor by a law over `LOOK_AHEAD_KELVIN` below the coldest test; NaN: not valid."""
    parameters = [row for row in rows if row["quantity"] == quantity and row["law"] == law]
    ahead = cold - LOOK_AHEAD_KELVIN
    if not parameters or parameters[0].get("valid_from_celsius", -np.inf) > ahead:
        return np.nan
    values = [row["value"] for row in parameters]
    colder, coldest = value_of(FORMS[law], [ahead, cold], values)
    return colder / coldest
