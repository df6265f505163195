"""Does a resistance separate into SoC and temperature? Tested, not assumed."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.surface_forms import levels_of
from cellwright.refusal import Refusal

MOST_KNOTS, FEWEST_KNOTS, FEWEST_DEGREES = 8, 3, 5


class Separability(NamedTuple):
    """A two-way test on one scale: "R" (a sum, thesis eq. 3.11) or "ln R" (a product).

    interaction : RMS of what a course of its own at each temperature adds to the separate courses,
    relative to the mean resistance at that temperature [1]. scatter : of the pulses around the
    courses of their own [1]. interaction_net : what is left of the interaction after the part that
    scatter alone makes.
    """

    scale: str
    f_statistic: float
    p_value: float
    degrees_of_freedom: tuple
    interaction: float
    interaction_net: float
    scatter: float


def separability(soc, temperature_celsius, resistance_ohm):
    """Two-way analysis with interaction, on R and on ln R.

    Separate: one course over SoC for all temperatures and a level at each. Against it: a course of
    its own at each temperature. Courses are straight between knots at quantiles of the SoC, as many
    as the pulses bear. Errors are taken as relative on both scales. F-test of the difference.

    Parameters
    ----------
    soc, temperature_celsius, resistance_ohm : (n,) [1], [°C], [ohm].

    Returns
    -------
    tests : tuple of Separability, on R and on ln R.

    Raises
    ------
    Refusal : too few pulses to leave five degrees of freedom, or fewer than two temperatures.

    Source: two-way analysis of variance with interaction (Scheffé, The Analysis of Variance, 1959,
    chapter 4), in the form of a regression, for the states of charge need not be the same.
    """
    # ASSUME: In the test of separability the scatter of pulses is independent of each other and
    # relative to the resistance.
    soc, celsius, ohm = (np.asarray(a, float) for a in (soc, temperature_celsius, resistance_ohm))
    temperatures = np.unique(celsius)
    if len(temperatures) < 2:
        raise Refusal(f"{len(temperatures)} temperature(s); separability needs two")
    member = celsius[:, None] == temperatures
    size = np.exp(member @ (member.T @ np.log(ohm) / member.sum(axis=0)))
    knots = _knots(soc, celsius, len(temperatures))
    hats = np.stack([np.interp(soc, knots, one) for one in np.eye(len(knots))], axis=1)
    own = (member[:, :, None] * hats[:, None, :]).reshape(len(soc), -1)
    separate = np.hstack([member[:, 1:], hats])
    return (
        _tested("R", ohm / size, separate / size[:, None], own / size[:, None]),
        _tested("ln R", np.log(ohm / size), separate, own),
    )


def _knots(soc, celsius, temperatures):
    """As many knots as leave enough degrees of freedom, at quantiles of the SoC."""
    levels = min(levels_of(soc[celsius == level]) for level in np.unique(celsius))
    most = min(MOST_KNOTS, levels - 1, (len(soc) - FEWEST_DEGREES) // temperatures)
    if most < FEWEST_KNOTS:
        raise Refusal(
            f"{len(soc)} pulses at {temperatures} temperatures, {levels} levels of SoC at one: too "
            "few to test whether SoC and temperature separate"
        )
    return np.quantile(soc, np.linspace(0, 1, most))


def _tested(scale, target, separate, own):
    from scipy.special import fdtrc

    plain, plain_rank = _fitted(separate, target)
    full, full_rank = _fitted(own, target)
    more, left = full_rank - plain_rank, len(target) - full_rank
    gain, rest = np.sum((full - plain) ** 2), np.sum((target - full) ** 2)
    # Below rounding there is no scatter to test against, and nothing to reject.
    floor = (1e-9 * np.abs(target).max()) ** 2 * len(target)
    variance = max(rest, floor) / left
    ratio = gain / more / variance
    net = max(gain - more * variance, 0.0)
    shares = [float(np.sqrt(value / len(target))) for value in (gain, net)]
    p_value = float(fdtrc(more, left, ratio))
    return Separability(
        scale, float(ratio), p_value, (more, left), *shares, float(np.sqrt(variance))
    )


def _fitted(columns, target):
    values, _, rank, _ = np.linalg.lstsq(columns, target, rcond=None)
    return columns @ values, int(rank)
