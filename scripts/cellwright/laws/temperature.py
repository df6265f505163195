"""A quantity over temperature: the thesis' quadratic and two forms of Arrhenius, side by side."""

from itertools import pairwise

import numpy as np

from cellwright.laws.law import NO_LIMIT, Form, choose, fit_law, rows_of
from cellwright.laws.points import (
    capacity_points,
    fast_charge_points,
    grouped,
    impedance_points,
    mean_per_temperature,
    resistance_points,
    rows_of_points,
    with_enough_temperatures,
)
from cellwright.messages import doubt_columns, said_of
from cellwright.numerics.lines import (
    REFERENCE_KELVIN,
    ZERO_CELSIUS_KELVIN,
    fit_line,
    inverse_temperature,
)
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Temperature

# How far beyond the tested temperatures a law is offered and drawn [K]. A model's look-up accepts
# temperatures this far from those it knows, too.
REACH_KELVIN = 5.0


def temperature_laws(capacities=(), resistances=(), spectra=(), settings=None, **changes):
    """Laws of resistance and capacity of one cell over temperature: quadratic and Arrhenius.

    settings : `settings.Temperature`.

    Returns rows, one a parameter; points: what the laws were fitted to. Raises Refusal: no quantity
    is known at three temperatures. Source: thesis ch. 3; docs/temperature.md.
    """
    options = inputs.settings_of(Temperature, settings, changes)
    sizes = capacity_points(inputs.entries(capacities))
    circuits, vague = impedance_points(inputs.entries(spectra))
    pulses, mixed = resistance_points(inputs.entries(resistances), **options._asdict())
    # Two temperatures fit any law of two parameters exactly: only a third can contradict it. Of
    # several tests at one temperature the mean counts, lest the busiest one draw the law.
    points = with_enough_temperatures([*sizes, *circuits, *pulses])
    return fitted_laws(mean_per_temperature(points), (*vague, *mixed))


def fitted_laws(points, notes=()):
    """Result of the laws over temperature that are fitted to points."""

    rows, reasons = law_rows(points)
    return Result({"rows": rows, "points": rows_of_points(points)}, notes=(*notes, *reasons))


def fast_charge_laws(charges):
    """Laws of the fast charge of one cell over temperature.

    charges : rows of `fast_charge` with ambient_temperature_celsius, or (test, result) each.

    Returns rows as of `temperature_laws`; points: all that was measured. Raises Refusal: fewer than
    three temperatures. Source: docs/charge-temperature.md.
    """
    points = fast_charge_points(inputs.entries(charges))
    found = fitted_laws(with_enough_temperatures(points))
    # Quantities known at two temperatures only have no law, but are points all the same.
    return found._replace(tables=found.tables | {"points": rows_of_points(points)})


def falling_range(b1, b2, b3):
    """Range in which b1 T² + b2 T + b3 is positive and falls with temperature.

    Parameters
    ----------
    b1, b2, b3 : [unit/°C²], [unit/°C], [unit].

    Returns
    -------
    limits : (low, high) [°C]: up to the minimum where it opens upward, from the maximum on where
        it opens downward, and no further than its zero. Infinite where there is no limit, NaN
        where it falls nowhere.
    """
    if b1 == 0:
        return NO_LIMIT if b2 <= 0 else (np.nan, np.nan)
    turn, square = -b2 / (2 * b1), b2**2 - 4 * b1 * b3
    # Of the two zeros the one on the falling branch, for either sign of b1.
    zero = turn - np.sqrt(square) / (2 * b1) if square >= 0 else np.inf
    return (float(-np.inf), float(min(turn, zero))) if b1 > 0 else (float(turn), float(zero))


def is_usable(valid_celsius, tested_celsius):
    """Whether a law holds over the tested (low, high) [°C] and `REACH_KELVIN` beyond them."""
    low, high = tested_celsius[0] - REACH_KELVIN, tested_celsius[1] + REACH_KELVIN
    return valid_celsius[0] <= low and high <= valid_celsius[1]


def turn_in_words(values, valid_celsius, tested_celsius):
    """Where a law stops being valid within its range of use, in words; "" where it is valid.

    Parameters
    ----------
    values : parameters of the law; b1, b2, b3 of a quadratic.
    valid_celsius, tested_celsius : (low, high) [°C].
    """
    how, celsius = _turn(values, valid_celsius, tested_celsius)
    return how.format(f"{celsius:.0f} °C")


def _turn(values, valid, tested):
    """Where a law stops being valid within its range of use: sentence with {}, temperature [°C]."""
    low, high = valid
    if is_usable(valid, tested):
        return "", np.nan
    if low > tested[0] - REACH_KELVIN:
        return "has a maximum at {}", low
    if values[0] > 0 and high == -values[1] / (2 * values[0]):
        return "turns upward at {}", high
    return ("is below zero from {} on" if np.isfinite(high) else "rises throughout"), high


def drawn_pieces(tested_celsius, valid_celsius):
    """Temperature ranges [°C] in which a law is drawn, as (start, stop, sound).

    `tested_celsius`, `valid_celsius` : (low, high) [°C]; sound where the law was tested and may be
    read, else an extrapolation.
    """
    low, high = tested_celsius
    ends = low - REACH_KELVIN, high + REACH_KELVIN
    inner = [limit for limit in valid_celsius if ends[0] < limit < ends[1]]
    start, stop = max(low, valid_celsius[0]), min(high, valid_celsius[1])
    edges = sorted({*ends, low, high, *inner})
    return [(a, b, start <= a and b <= stop) for a, b in pairwise(edges)]


def turn_sentences(families):
    """Sentences on families of resistances whose quadratics rise within their range of use.

    The fitted curve decides, whether or not its turn is certain at 95 %, for an Arrhenius law,
    which never turns, can be used instead. The sentence names how many turns are certain.

    Parameters
    ----------
    families : dict, name → list of `law.Law`, the quadratic of each quantity.
    """
    sentences = []
    for family, laws in families.items():
        turned = [law for law in laws if not is_usable(law.valid_celsius, law.tested_celsius)]
        if not turned:
            continue
        ends = [_turn(law.values, law.valid_celsius, law.tested_celsius) for law in turned]
        where = [
            how.format(f"{span_of([c for _, c in turns], '.0f')} °C")
            for how, turns in grouped(ends, lambda end: end[0]).items()
        ]
        sentences.append(
            f"{family}: {len(turned)} of {len(laws)} quadratic laws are not offered. A resistance "
            f"falls as the cell warms, but the fitted curve {', '.join(where)}, within the tested "
            f"temperatures or less than {REACH_KELVIN:g} K beyond (certain at 95 % for "
            f"{sum(law.rises_surely for law in turned)})"
        )
    return sentences


def span_of(values, digits):
    """Smallest and largest of numbers, in the format `digits`; one number where both read alike."""
    low, high = f"{min(values):{digits}}", f"{max(values):{digits}}"
    return low if low == high else f"{low} to {high}"


def _relative_kelvin(celsius):
    """T/298.15 K, the factor of a value whose T-fold follows an Arrhenius law."""
    return (celsius + ZERO_CELSIUS_KELVIN) / REFERENCE_KELVIN


def _over_inverse_temperature(celsius):
    """Columns of ln(value) over 1/T (thesis 3.7)."""
    return np.stack([np.ones_like(celsius), inverse_temperature(celsius)], axis=-1)


def _above_reference(celsius):
    """Columns of a line: temperature above 25 °C, and what there is at 25 °C."""
    above = celsius + ZERO_CELSIUS_KELVIN - REFERENCE_KELVIN
    return np.stack([above, np.ones_like(celsius)], axis=-1)


ENERGY = ("value_at_25_celsius", "activation_energy"), ("{}", "J/mol")
FORMS = {
    form.name: form
    for form in (
        Form("linear", _above_reference, ("slope", "value_at_25_celsius"), ("{}/K", "{}")),
        # b1 T² + b2 T + b3 with T in °C (thesis eq. 3.13).
        Form(
            "quadratic",
            lambda celsius: np.vander(celsius, 3),
            ("b1", "b2", "b3"),
            ("{}/degC^2", "{}/degC", "{}"),
        ),
        Form("arrhenius", _over_inverse_temperature, *ENERGY, logarithm=True),
        # σT, not σ, follows the law (thesis eq. 3.4, 3.5): its activation energy is higher than
        # that of the plain law by R·T, 2.3 kJ/mol near 5 °C.
        Form(
            "arrhenius_t",
            _over_inverse_temperature,
            *ENERGY,
            logarithm=True,
            factor=_relative_kelvin,
        ),
    )
}
LAWS = ("quadratic", "arrhenius", "arrhenius_t")
# What a cell gives is no rate of a process: a capacity has no activation energy.
LAWS_OF_FAMILY = {"capacity": ("linear", "quadratic")}


def fit_laws(temperature_celsius, value, *, unit, std=None, falling=False, names=LAWS):
    """Laws fitted to values over temperature, one chosen by cross-validation.

    Parameters
    ----------
    temperature_celsius, value : (n,) one measured value per row [°C], [any unit].
    unit : of the value, for the units of the parameters.
    std : (n,) standard deviation of each value, or None; weights the points beside the scatter
        that is found (`lines.fit_line`). Where one is not known, none is used.
    falling : the quantity is a resistance, which falls as it warms. A quadratic that rises
        somewhere from 5 K below the tested temperatures to 5 K above is then not chosen.
    names : of the laws, see `FORMS`.

    Returns
    -------
    laws : tuple of Law in the order of `names`; exactly one is chosen: the one that predicts
        left-out temperatures best. What cannot be tested so is not chosen.

    Raises
    ------
    Refusal : fewer than three temperatures; a value that is not positive and finite.

    Source: thesis eq. 3.13, 3.7 and 3.5.
    """
    # ASSUME: Over temperature the scatter is relative under the Arrhenius laws and the same in
    # ohm or ampere-hours at each temperature under the quadratic.
    celsius, value = np.asarray(temperature_celsius, float), np.asarray(value, float)
    std = np.full(len(value), np.nan) if std is None else np.asarray(std, float)
    # What the sheet leaves blank has no place on the axis.
    finite = np.isfinite(celsius)
    celsius, value, std = celsius[finite], value[finite], std[finite]
    count = len(np.unique(celsius))
    if count < 3:
        raise Refusal(f"{count} temperature(s); a law over temperature needs three")
    if not (np.isfinite(value) & (value > 0)).all():
        raise Refusal("a value over temperature is not positive; an Arrhenius law needs that")
    tested = float(celsius.min()), float(celsius.max())
    laws = [
        fit_law(FORMS[name], celsius, value, std, unit=unit, groups=celsius)._replace(
            tested_celsius=tested
        )
        for name in names
    ]
    if falling:
        laws = [_with_falling_range(law, celsius, value, std) for law in laws]
    # Some law is always offered: an Arrhenius law never turns.
    return choose(laws, [is_usable(law.valid_celsius, tested) for law in laws])


def _with_falling_range(law, celsius, value, std):
    """A resistance's quadratic with the range in which it falls, and whether it surely rises."""
    if law.law != "quadratic":
        return law
    ends = law.tested_celsius[0] - REACH_KELVIN, law.tested_celsius[1] + REACH_KELVIN
    # With T counted from an end of the range b2 is the slope there, with its own interval.
    slopes = [fit_line(np.vander(celsius - end, 3), value, std) for end in ends]
    rises = any(line.interval()[0][1] > 0 for line in slopes)
    return law._replace(valid_celsius=falling_range(*law.values), rises_surely=rises)


def law_rows(points):
    """All laws of every quantity as rows of a table.

    Parameters
    ----------
    points : list of `laws.points.Point`.

    Returns
    -------
    rows : list of dict as of stage `temperature`, one a parameter.
    reasons : list of sentences for what is not known.

    Raises
    ------
    Refusal
        No quantity could be fitted; the reasons are named.
    """
    # ASSUME: A resistance falls as the cell warms; capacities and times may have a maximum.
    rows, reasons, quadratics = [], [], {}
    for quantity, quantity_points in grouped(points, lambda point: point.quantity).items():
        try:
            laws = fit_laws(
                [point.temperature_celsius for point in quantity_points],
                [point.value for point in quantity_points],
                unit=quantity_points[0].unit,
                std=[point.std for point in quantity_points],
                falling=quantity_points[0].unit == "Ohm",
                names=LAWS_OF_FAMILY.get(quantity_points[0].family, LAWS),
            )
        except Refusal as refusal:
            reasons.append(said_of(quantity, refusal))
            continue
        reasons += [said_of(f"{quantity}, {law.law} law", law.reason) for law in laws if law.reason]
        best = next(law for law in laws if law.chosen)
        if best.r_squared < 0:
            laws = [law._replace(chosen=False) for law in laws]
            reasons.append(
                f"{quantity}: no law is offered; the best, {best.law}, errs more than the mean of "
                f"the points (R² {best.r_squared:.2g})"
            )
        against = doubt_columns(one for point in quantity_points for one in point.doubts)
        rows += [row | against for law in laws for row in rows_of(quantity, law)]
        # Of a family one sentence says what ends its quadratics, not one a SoC.
        (quadratic,) = (law for law in laws if law.law == "quadratic")
        quadratics.setdefault(quantity_points[0].family or quantity, []).append(quadratic)
    if not rows:
        raise Refusal("; ".join(reasons) or "no quantity is known at three temperatures")
    return rows, reasons + turn_sentences(quadratics)
