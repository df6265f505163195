"""What the polarisation of a cell does over temperature and SoC, in plain words."""

import numpy as np

from cellwright.laws.polarisation import over_temperature

SURE = 0.05  # p-value from which on a slope may be chance
MEANS = {
    "a": "The faster polarisation a",
    "b": "The slower polarisation b",
    "tau1": "The time constant tau1",
    "tau2": "The time constant tau2",
}


def paragraph(found, laws):
    """A few sentences for somebody who has not seen the plots.

    Parameters
    ----------
    found : `polarisation.Compared`. laws : dict from `polarisation.laws_of`.
    """
    courses = over_temperature(found.points)
    said = [_rests(found)]
    said += [_course(name, *courses[name]) for name in MEANS if len(courses[name][0]) > 1]
    said += [_law(name, laws) for name in MEANS]
    said += [_soc(laws, quantity) for quantity in ("a", "b")]
    return " ".join(sentence for sentence in said if sentence)


def _rests(found):
    count, good = len(found.r_squared), int(np.sum(found.r_squared > 0.98))
    numbers = {2: "two exponentials", 3: "three exponentials, the fastest left out of a and b"}
    return (
        f"{count} rests after a {found.protocol} compare, fitted with "
        f"{numbers[found.exponentials]}; R² is above 0.98 in {good} of them, "
        f"its median {np.median(found.r_squared):.4f}."
    )


def _course(name, celsius, value):
    """How a quantity changes from the warmest to the coldest temperature."""
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
    found = f"{where} {way} with SoC by {per} (p = {slope_p:.2g})"
    if slope > 0 and zero_p >= SURE:
        return f"{found} and may be proportional to it."
    rest = f"{1e3 * zero:.3g} mV at empty (p = {zero_p:.2g})"
    return f"{found}; it is not proportional to it: the line has {rest}."


def _digits(value):
    return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"
