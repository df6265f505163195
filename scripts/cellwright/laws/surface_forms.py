"""Forms of a resistance over SoC and temperature, and whether the two separate."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from cellwright.numerics.least_squares import best_logarithms
from cellwright.numerics.lines import inverse_temperature, residuals
from cellwright.numerics.statistics import covariance_from_jacobian, standard_deviations
from cellwright.refusal import Refusal

LOW_JOINT, HIGH_JOINT = 0.1, 0.9  # thesis eq. 3.12: linear between, exponentials beyond
RATES = np.geomspace(8.0, 400.0, 9)  # of the exponentials, per unit of SoC, to begin from
OVER_TEMPERATURE = {"additive": 3, "multiplicative": 2}  # parameters of temperature alone


class Surface(NamedTuple):
    """A fitted form; `predict` evaluates it.

    form : "additive", "multiplicative" or "table". names, units, values, std : parameters, arrays
    (p,); std NaN where not known. rates : of the exponentials below 10 % and above 90 % SoC, one
    tuple each; rate 0 is a straight line. nodes : of a table, (temperature, soc, ohm) tuples of
    each temperature; else empty.
    """

    form: str
    names: tuple
    units: tuple
    values: np.ndarray
    std: np.ndarray
    rates: tuple
    nodes: tuple


def predict(surface, soc, temperature_celsius):
    """Resistance [ohm] of a fitted form at (n,) SoC [1] and temperatures [°C], tested or not."""
    soc, celsius = np.broadcast_arrays(np.asarray(soc, float), temperature_celsius)
    if surface.form == "table":
        return _from_nodes(surface.nodes, soc, celsius)
    linear = surface.values[: len(surface.values) - _free(surface.rates)]
    predicted = _columns(surface.form, soc, celsius, surface.rates) @ linear
    return predicted if surface.form == "additive" else np.exp(predicted)


def fit_form(form, soc, temperature_celsius, resistance_ohm, *, polish=True):
    """One form of a resistance over SoC and temperature fitted to pulses.

    additive: R = f(SoC) + b1 T² + b2 T + b3 (thesis eq. 3.11-3.13), T in °C. f is a3·SoC from
    10 to 90 % SoC; beyond, it goes on from its value at the joint by exponentials that are 0 there,
    end·(e^(k·d) − 1)/(e^(0.1·k) − 1) with d the distance from the joint: the printed pieces do not
    join, these do. `end` is the rise from the joint to empty or full. Both ends have their own k.
    multiplicative: the same f for ln R, and Ea/R·(1/T − 1/298.15 K) in place of the quadratic.
    table: ln R between the measured SoC at each temperature, and linear in 1/T between
    temperatures, beyond them along the last two.

    Each end has two exponentials where at least four levels of SoC lie beyond the joint, one where
    two do, a straight line where one does, and nothing where none does.

    Parameters
    ----------
    form : name of the form.
    soc, temperature_celsius, resistance_ohm : (n,) [1], [°C], [ohm].
    polish : refine the rates beyond the grid, with standard deviations.

    Returns
    -------
    surface : Surface.
    """
    soc, celsius, ohm = (np.asarray(a, float) for a in (soc, temperature_celsius, resistance_ohm))
    if form == "table":
        order, empty = np.argsort(soc, kind="stable"), np.empty(0)
        at = [(float(level), order[celsius[order] == level]) for level in np.unique(celsius)]
        nodes = tuple((level, soc[rows], ohm[rows]) for level, rows in at)
        return Surface(form, (), (), empty, empty, ((), ()), nodes)
    # ASSUME: On a resistance surface the additive form errs by the same ohms everywhere, the
    # multiplicative one by the same share.
    target = ohm if form == "additive" else np.log(ohm)

    def residual_at(rates):
        return residuals(_columns(form, soc, celsius, rates), target)

    rates = _search(soc, residual_at)
    rates = _refined(rates, residual_at, np.abs(target).max()) if polish else rates
    columns = _columns(form, soc, celsius, rates)
    linear = np.linalg.lstsq(columns, target, rcond=None)[0]
    design = np.hstack([columns, _rate_slopes(form, soc, celsius, rates, linear)])
    std = _errors(design, target - columns @ linear, celsius, OVER_TEMPERATURE[form])
    values = np.concatenate([linear, [rate for end in rates for rate in end if rate]])
    return Surface(form, *_names(form, rates), values, std, rates, ())


def levels_of(soc):
    """Number of distinct levels of SoC: a pulse and its counterpart lie within 1.5 % of it."""
    ordered = np.sort(soc)
    return int(np.sum(np.diff(ordered) > 0.015)) + 1 if len(ordered) else 0


def _free(rates):
    """Number of rates that are fitted; a rate of 0 is a straight line."""
    return sum(rate > 0 for end in rates for rate in end)


def _columns(form, soc, celsius, rates):
    """Design matrix (n, p): temperature, linear middle range of SoC, both ends."""
    over_temperature = (
        np.stack([celsius**2, celsius, np.ones_like(celsius)], axis=-1)
        if form == "additive"
        else np.stack([np.ones_like(celsius), inverse_temperature(celsius)], axis=-1)
    )
    middle = np.clip(soc, LOW_JOINT, HIGH_JOINT)[..., None]
    beyond = np.maximum(LOW_JOINT - soc, 0), np.maximum(soc - HIGH_JOINT, 0)
    ends = [
        np.expm1(rate * d) / np.expm1(rate * LOW_JOINT) if rate else d / LOW_JOINT
        for d, end_rates in zip(beyond, rates, strict=True)
        for rate in end_rates
    ]
    return np.concatenate([over_temperature, middle, *[end[..., None] for end in ends]], axis=-1)


def _choices(soc):
    """Rates to try at one end, by how many levels of SoC lie beyond its joint."""
    levels = levels_of(soc)
    if levels < 2:
        return [(0.0,) * levels]
    return list(combinations(RATES, 2)) if levels >= 4 else [(rate,) for rate in RATES]


def _search(soc, residual_at):
    """Best rates of the grid, one end after the other; the second sweep knows both ends."""
    choices = _choices(soc[soc < LOW_JOINT]), _choices(soc[soc > HIGH_JOINT])
    best = [options[len(options) // 2] for options in choices]
    for end in (0, 1, 0, 1):
        trials = [[*best[:end], option, *best[end + 1 :]] for option in choices[end]]
        errors = [np.sum(residual_at(trial) ** 2) for trial in trials]
        best = trials[int(np.argmin(errors))]
    return tuple(best)


def _refined(rates, residual_at, scale):
    """Rates refined by a search that starts from the grid's best; residuals are over `scale`."""
    if not _free(rates):
        return rates
    split, from_grid = len(rates[0]), [rate for end in rates for rate in end]

    def whole(logs):
        free = iter(np.exp(logs))
        full = [next(free) if rate else 0.0 for rate in from_grid]
        return tuple(full[:split]), tuple(full[split:])

    start = np.log([rate for rate in from_grid if rate])
    bounds = tuple(np.log([RATES[0] / 4, RATES[-1] * 4]))
    return whole(
        best_logarithms(lambda logs: residual_at(whole(logs)) / scale, [start], bounds=bounds)
    )


def _errors(design, residual, celsius, over_temperature):
    """Standard deviations of parameters, with the error that pulses of one temperature share.

    A chamber that is half a kelvin off, or a law that bends, moves all pulses of a temperature at
    once: their errors are not independent over temperature. The variance of that common part is
    taken from the mean residuals of the temperatures; where there are no more temperatures than
    parameters of temperature it is not known, nor are their errors.
    """
    covariance = covariance_from_jacobian(design, residual)
    member = (celsius[:, None] == np.unique(celsius)).astype(float)
    count, means = member.sum(axis=0), (residual @ member) / member.sum(axis=0)
    spare = len(count) - over_temperature
    if spare < 1:
        covariance[:over_temperature] = covariance[:, :over_temperature] = np.nan
        return standard_deviations(covariance)
    single = residual @ residual / max(len(residual) - design.shape[1], 1)
    common = max(means @ means / spare - single * np.mean(1 / count), 0.0)
    pull = np.linalg.pinv(design) @ member
    return standard_deviations(covariance + common * pull @ pull.T)


def _rate_slopes(form, soc, celsius, rates, linear):
    """Derivative of the prediction by each rate, by central differences."""
    slopes = []
    for end, k in ((e, k) for e in (0, 1) for k, rate in enumerate(rates[e]) if rate):
        step, moved = 1e-4 * rates[end][k], []
        for sign in (1, -1):
            shifted = [list(pair) for pair in rates]
            shifted[end][k] += sign * step
            moved.append(_columns(form, soc, celsius, shifted) @ linear)
        slopes.append((moved[0] - moved[1]) / (2 * step))
    return np.stack(slopes, axis=1) if slopes else np.empty((len(soc), 0))


def _names(form, rates):
    """Names and units of the parameters of a form."""
    additive = form == "additive"
    unit = "Ohm" if additive else "1"
    names = ["b1", "b2", "b3"] if additive else ["ln_value_at_25_celsius", "activation_energy"]
    units = ["Ohm/degC^2", "Ohm/degC", "Ohm"] if additive else ["ln(Ohm)", "J/mol"]
    ends = [
        f"{end}_{k + 1}" for e, end in enumerate(("empty", "full")) for k in range(len(rates[e]))
    ]
    curved = [name for name, rate in zip(ends, [r for e in rates for r in e], strict=True) if rate]
    names += ["a3", *[f"rise_{name}" for name in ends], *[f"rate_{name}" for name in curved]]
    return tuple(names), (*units, unit, *[unit] * len(ends), *["1"] * len(curved))


def _from_nodes(nodes, soc, celsius):
    """Resistance [ohm] of a table: ln R over SoC, then linear in 1/T."""
    axis = inverse_temperature([level for level, _, _ in nodes])
    # Resistance grows by factors, towards empty and in the cold: ln R is the straighter.
    courses = np.stack([np.interp(soc, z, np.log(ohm)) for _, z, ohm in nodes])
    at = inverse_temperature(celsius)
    # Nodes run from cold to warm: the axis falls.
    upper = np.clip(np.searchsorted(-axis, -at), 1, len(nodes) - 1)
    rows = np.arange(len(at)) if np.ndim(at) else ()
    first, second = courses[upper - 1, rows], courses[upper, rows]
    share = (at - axis[upper - 1]) / (axis[upper] - axis[upper - 1])
    return np.exp(first + share * (second - first))


def separability(soc, temperature_celsius, resistance_ohm):
    """Tests of whether resistance separates into SoC and temperature, on R and on ln R.

    Separate: one course over SoC for all temperatures and a level at each. Against it: a course of
    its own at each temperature. Courses are straight between knots at quantiles of the SoC, as many
    as the pulses bear. Errors are taken as relative on both scales. F-test of the difference.

    Parameters
    ----------
    soc, temperature_celsius, resistance_ohm : (n,) [1], [°C], [ohm].

    Returns
    -------
    tests : list of dict, on R (sum, thesis eq. 3.11) and on ln R (product): scale, f_statistic,
        p_value; interaction: RMS of what a course of its own at each temperature adds to the
        separate courses, relative to the mean resistance at that temperature [1]; scatter: of the
        pulses around the courses of their own [1]; interaction_net: what is left of the interaction
        after the part that scatter alone makes [1].

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
    # Over its temperature's geometric mean a pulse's scatter is relative.
    size = np.exp(member @ (member.T @ np.log(ohm) / member.sum(axis=0)))
    knots = _knots(soc, celsius, len(temperatures))
    hats = np.stack([np.interp(soc, knots, row) for row in np.eye(len(knots))], axis=1)
    per_temperature = (member[:, :, None] * hats[:, None, :]).reshape(len(soc), -1)
    separate = np.hstack([member[:, 1:], hats])
    return [
        _tested("R", ohm / size, separate / size[:, None], per_temperature / size[:, None]),
        _tested("ln R", np.log(ohm / size), separate, per_temperature),
    ]


def _knots(soc, celsius, temperatures):
    """Knots of SoC at its quantiles, at most eight, so many as leave five degrees of freedom."""
    levels = min(levels_of(soc[celsius == level]) for level in np.unique(celsius))
    most = min(8, levels - 1, (len(soc) - 5) // temperatures)
    if most < 3:  # two knots are a straight line, which no end of a course is
        raise Refusal(
            f"{len(soc)} pulses at {temperatures} temperatures, {levels} levels of SoC at one: too "
            "few to test whether SoC and temperature separate"
        )
    return np.quantile(soc, np.linspace(0, 1, most))


def _tested(scale, target, separate, per_temperature):
    """F-test of one resistance curve over SoC for all temperatures against one for each."""
    from scipy.special import fdtrc

    plain, plain_rank = _fitted(separate, target)
    full, full_rank = _fitted(per_temperature, target)
    extra, freedom = full_rank - plain_rank, len(target) - full_rank
    gain, rest = np.sum((full - plain) ** 2), np.sum((target - full) ** 2)
    # Below rounding there is no scatter to test against, and nothing to reject.
    floor = (1e-9 * np.abs(target).max()) ** 2 * len(target)
    variance = max(rest, floor) / freedom
    ratio = gain / extra / variance
    net = max(gain - extra * variance, 0.0)
    return {
        "scale": scale,
        "f_statistic": float(ratio),
        "p_value": float(fdtrc(extra, freedom, ratio)),
        "interaction": float(np.sqrt(gain / len(target))),
        "interaction_net": float(np.sqrt(net / len(target))),
        "scatter": float(np.sqrt(variance)),
    }


def _fitted(columns, target):
    """Least-squares prediction (n,) and the rank of the columns."""
    values, _, rank, _ = np.linalg.lstsq(columns, target, rcond=None)
    return columns @ values, int(rank)
