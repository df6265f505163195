"""Where a quadratic of a resistance may be read: as far as it falls while the cell warms."""

from itertools import pairwise

import numpy as np

NO_LIMIT = (-np.inf, np.inf)
# K beyond the tested temperatures that a law is offered and drawn for. So far from what it was told
# of a model counts as told, too (models.lookup.SAME_KELVIN).
REACH_KELVIN = 5.0


def turning(b1, b2, b3):
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


def falls(valid_celsius, tested_celsius):
    """Whether a law may be read over the tested temperatures and `REACH_KELVIN` beyond them.

    Parameters
    ----------
    valid_celsius, tested_celsius : (low, high) [°C].
    """
    low, high = tested_celsius[0] - REACH_KELVIN, tested_celsius[1] + REACH_KELVIN
    return valid_celsius[0] <= low and high <= valid_celsius[1]


def turn_of(values, valid_celsius, tested_celsius):
    """What ends a law within its use, in words; "" where nothing does.

    Parameters
    ----------
    values : parameters of the law; b1, b2, b3 of a quadratic.
    valid_celsius, tested_celsius : (low, high) [°C].
    """
    how, celsius = _turn(values, valid_celsius, tested_celsius)
    return how.format(f"{celsius:.0f} °C")


def _turn(values, valid, tested):
    """What ends a law within its use, and where [°C]."""
    low, high = valid
    if falls(valid, tested):
        return "", np.nan
    if low > tested[0] - REACH_KELVIN:
        return "has a maximum at {}", low
    if values[0] > 0 and high == -values[1] / (2 * values[0]):
        return "turns upward at {}", high
    return ("is below zero from {} on" if np.isfinite(high) else "rises throughout"), high


def stretches(tested_celsius, valid_celsius):
    """How a law is drawn: the tested temperatures and `REACH_KELVIN` beyond them in pieces.

    Parameters
    ----------
    tested_celsius, valid_celsius : (low, high) [°C].

    Returns
    -------
    pieces : list of (start, stop, sound); sound where the law was tested and may be read.
    """
    low, high = tested_celsius
    ends = low - REACH_KELVIN, high + REACH_KELVIN
    inner = [one for one in valid_celsius if ends[0] < one < ends[1]]
    start, stop = max(low, valid_celsius[0]), min(high, valid_celsius[1])
    edges = sorted({*ends, low, high, *inner})
    return [(one, two, start <= one and two <= stop) for one, two in pairwise(edges)]


def words_of_turns(families):
    """A sentence for each family of resistances whose quadratics turn where they would be used.

    The curve as it would be read decides, not whether its turn is certain: Arrhenius, which never
    turns, is there in its place. How certain it is, is said.

    Parameters
    ----------
    families : dict, name → list of `temperature.Law`, the quadratic of each quantity.

    Returns
    -------
    text : list of str.
    """
    found = []
    for family, laws in families.items():
        turned = [law for law in laws if not falls(law.valid_celsius, law.tested_celsius)]
        if not turned:
            continue
        where = {}
        for law in turned:
            how, celsius = _turn(law.values, law.valid_celsius, law.tested_celsius)
            where.setdefault(how, []).append(celsius)
        count = f"{len(turned)} of {len(laws)}"
        found.append(
            f"{family}: the quadratic of {count} is not offered as a law, for a resistance falls "
            f"as it warms: it {', '.join(how.format(_span(at)) for how, at in where.items())}, "
            f"less than {REACH_KELVIN:g} K beyond the tests or among them (certain at 95 % in "
            f"{sum(law.rises_surely for law in turned)})"
        )
    return found


def _span(celsius):
    low, high = f"{min(celsius):.0f}", f"{max(celsius):.0f}"
    return f"{low} °C" if low == high else f"{low} to {high} °C"
