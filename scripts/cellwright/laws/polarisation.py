"""Polarisation over SoC and temperature: which rests compare, their course, laws and words."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.laws.law import Form, choose, fit_law, rows_of, with_more
from cellwright.laws.points import first_check_up, grouped
from cellwright.laws.temperature import fit_laws
from cellwright.messages import said_of
from cellwright.records import inputs
from cellwright.records.conditions import grouped_alike
from cellwright.refusal import Refusal
from cellwright.result import Result


def polarisation_laws(rests):
    """Polarisation of one cell over SoC and temperature: amplitudes [V], time constants [s], laws.

    rests : rows of `relaxation` with ambient_temperature_celsius, or (test, result) each.

    Returns rows: the laws; points: without any where no rests compare, the reason in the notes.
    Source: thesis 3.3; docs/relaxation.md.
    """
    found = comparable_rests(inputs.entries(rests))
    laws, reasons = laws_of(found.points)
    tables = {"rows": law_rows(laws), "points": found.points}
    return Result(tables, notes=(paragraph(found, laws), *reasons))


def temperature_lines(temperature_celsius, value, *, unit):
    """Linear and Arrhenius law over temperature, the one chosen that predicts left-out values.

    Parameters
    ----------
    temperature_celsius, value : (n,) one value a temperature [°C], [unit].
    unit : of the value.

    Returns
    -------
    laws : tuple of `law.Law`, "linear" (slope, value_at_25_celsius, slope_p_value: of the
        hypothesis that there is no slope) and "arrhenius" (as `temperature.fit_laws`).

    Raises
    ------
    Refusal : fewer than three temperatures, a value that is not positive and finite.

    Source: thesis sec. 3.3 (tau1, tau2 about linear in T); Arrhenius: thesis (3.5).
    """
    linear, arrhenius = fit_laws(
        temperature_celsius, value, unit=unit, names=("linear", "arrhenius")
    )
    return with_more(linear, {"slope_p_value": ("1", _p_value(linear, 0, value))}), arrhenius


OVER_SOC = (
    Form(
        "linear over SoC", lambda soc: np.vander(soc, 2), ("slope", "value_at_soc_0"), ("{}",) * 2
    ),
    Form("proportional to SoC", lambda soc: soc[:, None], ("slope",), ("{}",)),
)


def soc_lines(soc, value, *, unit):
    """Line over SoC and line through zero, the one chosen that predicts left-out values.

    Parameters
    ----------
    soc, value : (n,) [1], [unit], at one temperature.
    unit : of the value.

    Returns
    -------
    laws : tuple of `law.Law`, "linear over SoC" (slope, value_at_soc_0, slope_p_value,
        zero_p_value: of the hypothesis that the line goes through zero), "proportional to SoC".

    Raises
    ------
    Refusal : fewer than four values, or all at one SoC.

    Source: thesis sec. 3.3: below 50 % SoC a and b are proportional to SoC in the cold.
    """
    soc, value = np.asarray(soc, float), np.asarray(value, float)
    if len(soc) < 4 or np.ptp(soc) == 0:
        raise Refusal(f"{len(soc)} value(s) over SoC; a line that is tested needs 4")
    free, tied = choose([fit_law(form, soc, value, unit=unit) for form in OVER_SOC])
    p_values = {
        name: ("1", _p_value(free, k, value))
        for k, name in enumerate(("slope_p_value", "zero_p_value"))
    }
    return with_more(free, p_values), tied


def _p_value(law, k, value):
    """Two-sided p-value of parameter `k` of a line through `value`; NaN: its scatter is unknown."""
    from scipy.special import stdtr

    spare = len(value) - 2
    if spare < 1 or not law.std[k] > 0:
        return np.nan
    return float(2 * stdtr(spare, -abs(law.values[k] / law.std[k])))


QUANTITIES = {"a": "V", "b": "V", "tau1": "s", "tau2": "s"}
# How far two rests may lie apart, in ln, and still be of one protocol.
ALIKE = {"current_before_ampere": 0.15, "load_second": 0.2, "rest_second": 0.2, "samples": 0.5}
NO_RESTS = "no rest after a steady load tells two exponentials at a known SoC"


class ComparableRests(NamedTuple):
    """Points of comparable rests, and their protocol in words.

    points : list of dict, one a rest and quantity: quantity, unit, temperature_celsius, soc [1],
    value and std [unit]. Amplitudes are positive where the rest relaxes away from the load.
    exponentials : of the fits that compare. r_squared : (n,) one a rest [1].
    """

    points: list
    protocol: str
    exponentials: int
    r_squared: np.ndarray


# ASSUME: Rests compare over temperature after one direction, current and length of load, with one
# length of rest and one logging: a and b grow with the load, two time constants with the rest.
def comparable_rests(rows):
    """The rests of a cell that can be compared over SoC and temperature.

    1. Rests of the earliest check-up after a steady load are grouped by protocol. 2. The group
    with the most temperatures, then the most rests, is taken. 3. Its fits of three exponentials
    are compared where they are determined in 80 % of its rests and at as many temperatures, for
    then charge transfer is out of a and b; else its fits of two.

    Parameters
    ----------
    rows : list of dict, rows of stage `relaxation` with ambient_temperature_celsius and cycle.

    Returns
    -------
    ComparableRests : without a point, and with the reason as protocol, where no rest after a steady
        load determines two exponentials at a known SoC: a result, not a fault of the tests.
    """
    rests = [
        row for row in first_check_up(rows) if row["exponentials"] >= 2 and np.isfinite(row["soc"])
    ]
    # While a voltage is held the overpotential decays before the rest begins.
    rests = [row for row in rests if row["load"] in ("CC", "pulse")]
    if not rests:
        return ComparableRests([], NO_RESTS, 0, np.zeros(0))
    rests.sort(key=lambda rest: [abs(rest[name]) for name in ALIKE])
    protocols = grouped_alike(rests, _alike)
    best = max(protocols, key=lambda protocol: (len(_celsius(protocol)), len(_rests(protocol))))
    two, three = ([row for row in best if row["exponentials"] == n] for n in (2, 3))
    # A mixture of two and three exponentials would move a and b by itself.
    everywhere = len(_celsius(three)) == len(_celsius(best))
    kept = three if everywhere and len(three) >= 0.8 * len(_rests(best)) else two or three
    points = [point for row in kept for point in _points(row)]
    r_squared = np.array([row["r_squared"] for row in kept])
    return ComparableRests(points, _protocol(kept), kept[0]["exponentials"], r_squared)


def over_temperature(points):
    """Median over SoC 15 to 95 % of each quantity at each temperature.

    The ends are left out: there diffusion rises steeply, and few temperatures have rests.

    Returns
    -------
    courses : dict, quantity → (celsius, value) ascending.
    """
    courses = {}
    for quantity in QUANTITIES:
        middle = [p for p in points if p["quantity"] == quantity and 0.15 <= p["soc"] <= 0.95]
        levels = sorted(grouped(middle, lambda point: point["temperature_celsius"]).items())
        value = [np.median([point["value"] for point in level]) for _, level in levels]
        courses[quantity] = (np.array([celsius for celsius, _ in levels]), np.array(value))
    return courses


def laws_of(points):
    """Laws over temperature of a, b, tau1, tau2, and over SoC of a and b at each temperature.

    Parameters
    ----------
    points : as in `ComparableRests`.

    Returns
    -------
    laws : dict, quantity in words → tuple of `law.Law`.
    reasons : list of sentences for what is not known.
    """
    laws, reasons = {}, []
    temperatures = sorted({point["temperature_celsius"] for point in points})
    count = len(temperatures)
    if 0 < count < 3:
        reasons.append(f"polarisation over temperature: {count} temperature(s), a law needs three")
    for quantity, (celsius, value) in over_temperature(points).items() if count >= 3 else ():
        name = f"polarisation {quantity}, median over SoC"
        _fit_or_reason(laws, reasons, name, temperature_lines, celsius, value, QUANTITIES[quantity])
    for quantity, celsius in product(("a", "b"), temperatures):
        below = sorted(
            (point["soc"], point["value"])
            for point in points
            if (point["quantity"], point["temperature_celsius"]) == (quantity, celsius)
            and point["soc"] <= 0.52  # a rest meant for 50 % SoC lies within 2 % of it
        )
        soc, value = np.array(below).reshape(-1, 2).T
        name = f"polarisation {quantity} below 50 % SoC at {celsius:g} °C"
        _fit_or_reason(laws, reasons, name, soc_lines, soc, value, QUANTITIES[quantity])
    return laws, reasons


def law_rows(laws):
    """The laws as rows of tables/temperature.csv."""
    return [row for name, pair in laws.items() for law in pair for row in rows_of(name, law)]


def _fit_or_reason(laws, reasons, name, fit, axis, value, unit):
    """Add the fitted laws of a quantity, or the reason why there are none."""
    try:
        laws[name] = fit(axis, value, unit=unit)
    except Refusal as refusal:
        reasons.append(said_of(name, refusal))


def _alike(first, other):
    """Whether two rests are of one protocol."""
    if (first["direction"], first["load"]) != (other["direction"], other["load"]):
        return False
    return all(abs(np.log(first[name] / other[name])) <= reach for name, reach in ALIKE.items())


def _celsius(rows):
    return {row["ambient_temperature_celsius"] for row in rows}


def _rests(rows):
    return {(row["test"], row["rest"]) for row in rows}


def _points(row):
    """Points of the four quantities of one rest."""
    for name, unit in QUANTITIES.items():
        sign = np.sign(row["current_before_ampere"]) if unit == "V" else 1.0
        word = {"V": "volt", "s": "second"}[unit]
        yield {
            "quantity": name,
            "unit": unit,
            "temperature_celsius": float(row["ambient_temperature_celsius"]),
            "soc": float(row["soc"]),
            "value": float(row[f"{name}_{word}"] * sign),
            "std": float(row[f"{name}_std_{word}"]),
        }


def _protocol(rows):
    """`discharge of 16 A for 720 s, rests of 2400 s`, from the medians."""
    names = ("current_before_ampere", "load_second", "rest_second")
    current, load, rest = (np.median([abs(row[name]) for row in rows]) for name in names)
    return f"{rows[0]['direction']} of {current:.3g} A for {load:.3g} s, rests of {rest:.4g} s"


SURE = 0.05  # p-value from which on a slope may be chance
MEANS = {
    "a": "The faster polarisation a",
    "b": "The slower polarisation b",
    "tau1": "The time constant tau1",
    "tau2": "The time constant tau2",
}


def paragraph(rests, laws):
    """Paragraph on polarisation over temperature and SoC, for a reader without the plots.

    Parameters
    ----------
    rests : ComparableRests. laws : dict from `laws_of`.
    """
    if not rests.points:
        return f"Polarisation is not known: {rests.protocol}."
    courses = over_temperature(rests.points)
    sentences = [_rests_in_words(rests)]
    sentences += [_course(name, *courses[name]) for name in MEANS if len(courses[name][0]) > 1]
    sentences += [_law(name, laws) for name in MEANS]
    sentences += [_soc(laws, quantity) for quantity in ("a", "b")]
    return " ".join(sentence for sentence in sentences if sentence)


def _rests_in_words(rests):
    """Number, protocol and goodness of fit of the rests in words."""
    count, good = len(rests.r_squared), int(np.sum(rests.r_squared > 0.98))
    numbers = {2: "two exponentials", 3: "three exponentials, the fastest left out of a and b"}
    return (
        f"{count} rests after a {rests.protocol} compare, fitted with "
        f"{numbers[rests.exponentials]}; R² is above 0.98 in {good} of them, "
        f"its median {np.median(rests.r_squared):.4f}."
    )


def _course(name, celsius, value):
    """Change of a quantity from the warmest to the coldest temperature in words."""
    unit, factor = ("mV", 1e3) if name in "ab" else ("s", 1.0)
    ratio = value[0] / value[-1]
    warm, cold = (f"{_digits(factor * value[k])} {unit} at {celsius[k]:g} °C" for k in (-1, 0))
    way = f"{MEANS[name]} goes from {warm} to {cold} (×{ratio:.3g})"
    if ratio >= 1:
        return f"{way}."
    plain = "Polarisation must grow in the cold" if name in "ab" else "A time constant should grow"
    return f"{way}. {plain}: here it does not, and other processes are mixed in, or noise decides."


def _law(name, laws):
    """Whether the thesis' linear law over temperature holds, and which law predicts better."""
    pair = laws.get(f"polarisation {name}, median over SoC")
    if pair is None:
        return ""
    line, arrhenius = pair
    factor, unit = (1e3, "mV") if name in "ab" else (1.0, "s")
    slope, low, high = (factor * x[0] for x in (line.values, line.lower, line.upper))
    p_value = line.values[line.names.index("slope_p_value")]
    sure = "" if p_value < SURE else ", so it may be chance"
    better = "the line" if line.chosen else "Arrhenius"
    errors = [factor * law.cross_validation_rmse for law in (line, arrhenius)]
    energy, reach = arrhenius.values[1] / 1e3, (arrhenius.upper[1] - arrhenius.values[1]) / 1e3
    return (
        f"{name} as a line over temperature: {slope:.3g} {unit}/K ({low:.3g} to {high:.3g}, "
        f"p = {p_value:.2g}{sure}), R² {line.r_squared:.3f}; Arrhenius: {energy:.3g} ± {reach:.2g} "
        f"kJ/mol, R² {arrhenius.r_squared:.3f}. Temperatures left out are predicted better by "
        f"{better} (errors {_digits(errors[0])} and {_digits(errors[1])} {unit})."
    )


def _soc(laws, quantity):
    """Whether a or b is proportional to SoC below 50 %, at the coldest temperature known."""
    start = f"polarisation {quantity} below 50 % SoC at "
    names = [name for name in laws if name.startswith(start)]
    if not names:
        return ""
    coldest = min(names, key=lambda name: float(name.removeprefix(start).split()[0]))
    line = laws[coldest][0]
    slope, zero, slope_p, zero_p = line.values
    where = f"Below 50 % SoC at {coldest.removeprefix(start)} {quantity}"
    if slope_p >= SURE:
        return f"{where} does not change with SoC for sure (p = {slope_p:.2g})."
    way, per = "rises" if slope > 0 else "falls", f"{100 * abs(slope):.2g} mV per 10 %"
    finding = f"{where} {way} with SoC by {per} (p = {slope_p:.2g})"
    if slope > 0 and zero_p >= SURE:
        return f"{finding} and may be proportional to it."
    rest = f"{1e3 * zero:.3g} mV at empty (p = {zero_p:.2g})"
    return f"{finding}; it is not proportional to it: the line has {rest}."


def _digits(value):
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"
