"""Open-circuit voltage read at several temperatures, and the entropic coefficient dOCV/dT from it.

Readings come from slow tests at several temperatures, or from rests in a chamber that steps its
temperature; both have the same shape. The coefficient is fitted at every state of charge.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.laws.points import first_check_up
from cellwright.numerics.lines import generalised_line
from cellwright.numerics.statistics import NORMAL_95
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.refusal import Refusal

VOLTAGE_STD_VOLT = 0.001  # of slow tests made weeks apart (typical accuracy of a 5 V cycler)
STEP_STD_VOLT = 0.0001  # of two plateaus of one rest, beside their noise
LEAST_TEMPERATURES = 3
COLUMNS = ("celsius", "ocv_volt", "std_volt", "common_volt")  # of Readings, (m, k) each


class Readings(NamedTuple):
    """Open-circuit voltages of one source at m states of charge and k temperatures [V], NaN: none.

    soc : (m,) [1]. celsius, ocv_volt : (m, k) [degC], [V]. std_volt : (m, k) what scatters on its
    own. common_volt : (m, k) an error that all temperatures of one state of charge share, as long
    as it grows over temperature: known up to one factor, which lies about zero with a standard
    deviation of one [V]. notes : sentences.
    """

    soc: np.ndarray
    celsius: np.ndarray
    ocv_volt: np.ndarray
    std_volt: np.ndarray
    common_volt: np.ndarray
    notes: tuple


def slow_readings(curves):
    """Readings of slow tests at several temperatures, compared at equal charge below full.

    1. Tests that completed both branches at room temperature keep the SoC of their own
    ampere-hours. Of others the remainder is still in the cell: their SoC is counted down from full
    over the capacity of the test nearest 25 °C. 2. What the two directions differ in
    ampere-hours makes the SoC uncertain by half of it, and through the slope the voltage. 3. The
    OCV lies between the branches, so half the gap bounds its error. What of the gap all
    temperatures have in common (hysteresis) falls out of differences; what grows in the cold is the
    overpotential that may pass for entropy: the common error, taken as rectangular. A tenth of it
    (more beyond the thermal voltage) varies from temperature to temperature besides.

    Parameters
    ----------
    curves : list of dict, one a test: test, cycle, ambient_temperature_celsius, soc, ocv_volt,
        half_gap_volt, branches, joined_by, capacity_ampere_hour, charge_capacity_ampere_hour.

    Returns
    -------
    readings : Readings.

    Raises
    ------
    Refusal : fewer than three temperatures with both branches; tests with one are named, for of
        them nobody can tell the overpotential from the entropy.
    """
    ordered = sorted(first_check_up(curves), key=lambda curve: curve["ambient_temperature_celsius"])
    both = [curve for curve in ordered if curve["branches"] == "both"]
    notes = [
        f"{curve['test']}: {curve['branches']} branch only; entropy or overpotential that grows in "
        "the cold: not knowable from one branch, left out"
        for curve in ordered
        if curve["branches"] != "both"
    ]
    count = len({curve["ambient_temperature_celsius"] for curve in both})
    if count < LEAST_TEMPERATURES:
        shortage = (
            f"slow tests with both branches at {count} temperature(s), {LEAST_TEMPERATURES} wanted"
        )
        raise Refusal("; ".join([shortage, *notes]))
    reference = min(both, key=lambda c: abs(c["ambient_temperature_celsius"] - REFERENCE_CELSIUS))
    columns = [_at_reference_soc(curve, reference) for curve in both]
    volt, gap, soc_volt = (np.stack(parts, axis=1) for parts in zip(*columns, strict=True))
    extra = gap - np.nanmin(np.where(np.isfinite(gap), gap, np.inf), axis=1, keepdims=True)
    # What all temperatures have of the gap is hysteresis, which falls out of differences.
    common = extra / np.sqrt(3)
    # ASSUME: The OCV lies at the same share of the gap between the branches at all temperatures,
    # within a tenth of its possible range (where the likelihood of A123's five slow tests is
    # highest). Where the overpotential exceeds the thermal voltage of 25 mV, kinetics are not
    # linear, and the difference grows with it.
    scatter = 0.1 * common * np.maximum(common / 0.025, 1.0)
    celsius = np.array([curve["ambient_temperature_celsius"] for curve in both], float)
    return Readings(
        soc=np.asarray(reference["soc"], float),
        celsius=np.broadcast_to(celsius, volt.shape),
        ocv_volt=volt,
        std_volt=np.sqrt(VOLTAGE_STD_VOLT**2 + soc_volt**2 + scatter**2),
        common_volt=common,
        notes=tuple(
            notes + [words for curve in both for words in _rescaling_notes(curve, reference)]
        ),
    )


def step_readings(rows):
    """Readings of rests in a stepping chamber, one a state of charge.

    Parameters
    ----------
    rows : list of dict, rows of stage `ocv_step`.

    Returns
    -------
    readings : Readings, by ascending SoC; voltages are what the cell showed
        in the end at the first temperature plus the shift.

    Raises
    ------
    Refusal : no state of charge is known.
    """
    rests = {}
    for row in rows:
        if np.isfinite(row["soc"]) and not row["returned"]:
            rests.setdefault((row["soc"], row.get("test", ""), row["rest"]), []).append(row)
    if not rests:
        raise Refusal("the state of charge of no rest is known")
    rests = [rests[key] for key in sorted(rests)]
    widest = max(len(rest) for rest in rests)
    names = ("temperature_celsius", "shift_volt", "noise_std_volt", "relaxation_std_volt")
    table = np.full((len(names), len(rests), widest), np.nan)
    for place, rest in enumerate(rests):
        table[:, place, : len(rest)] = [[row[name] for row in rest] for name in names]
    level = np.array([rest[0]["voltage_volt"] for rest in rests])
    return Readings(
        soc=np.array([rest[0]["soc"] for rest in rests]),
        celsius=table[0],
        ocv_volt=level[:, None] + table[1],
        std_volt=np.hypot(table[2], STEP_STD_VOLT),
        common_volt=table[3],
        notes=(),
    )


def on_curve(readings, curve):
    """Readings of rests interpolated to the SoC of a slow curve, by monotone cubics.

    Parameters
    ----------
    readings : Readings, of `step_readings`.
    curve : dict with soc (n,), ocv_volt (n,) and ambient_temperature_celsius, or None: then only
        the voltages of the rests themselves give the shape.

    Returns
    -------
    readings : Readings over (n,) SoC, NaN beyond the states of charge of the rests.

    Raises
    ------
    Refusal : fewer than three rests in which the chamber went through all temperatures.
    """
    # ASSUME: Between the states of charge that were tested the shift moves as a monotone cubic.
    from scipy.interpolate import PchipInterpolator

    whole = np.isfinite(readings.celsius).all(axis=1)
    if whole.sum() < LEAST_TEMPERATURES:
        raise Refusal(f"{whole.sum()} rest(s) through all temperatures; a map over SoC needs three")
    at = readings.soc[whole]
    grid = np.linspace(0.0, 1.0, 201) if curve is None else np.asarray(curve["soc"], float)
    celsius, volt, std, common = (
        PchipInterpolator(at, getattr(readings, name)[whole], extrapolate=False)(grid)
        for name in COLUMNS
    )
    if curve is not None:
        # Of the rests only the shift with temperature counts: the slow curve gives the shape.
        volt = volt - volt[:, :1]
        steep = np.sum(volt * (celsius - celsius[:, :1]), axis=1)
        steep = steep / np.sum((celsius - celsius[:, :1]) ** 2, axis=1)
        warmer = celsius[:, 0] - curve["ambient_temperature_celsius"]
        volt = volt + (np.asarray(curve["ocv_volt"], float) + steep * warmer)[:, None]
    return readings._replace(
        soc=grid, celsius=celsius, ocv_volt=volt, std_volt=std, common_volt=common
    )


def _at_reference_soc(curve, reference):
    """Voltage, half gap and uncertainty by SoC of a slow test [V] at the SoC of the reference."""
    soc = np.asarray(curve["soc"], float)
    columns = [np.asarray(curve[name], float) for name in ("ocv_volt", "half_gap_volt")]
    inside = np.isfinite(columns[1])
    own_soc = 1 - (1 - np.asarray(reference["soc"], float)) / _capacity_ratio(curve, reference)
    volt, gap = (np.interp(own_soc, soc[inside], column[inside]) for column in columns)
    # Through a steep curve an uncertain SoC is an uncertain voltage; rectangular.
    soc_volt = np.abs(np.gradient(volt, reference["soc"])) * _soc_uncertainty(curve) / np.sqrt(3)
    # Beyond its ends a test says nothing: np.interp would hold its last voltage.
    beyond = (own_soc < soc[inside][0] - 1e-9) | (own_soc > soc[inside][-1] + 1e-9)
    return tuple(np.where(beyond, np.nan, column) for column in (volt, gap, soc_volt))


def _capacity_ratio(curve, reference):
    """Capacity of a test over that of the reference [1]; 1 where completed at room temperature.

    Of a test whose two directions differ the geometric mean counts.
    """
    # ASSUME: Every slow test begins full at one and the same state, however cold it is.
    if curve["joined_by"] == "equilibrium":
        return 1.0
    return _ampere_hours(curve) / _ampere_hours(reference)


def _ampere_hours(curve):
    """Geometric mean of discharge and charge capacity [Ah]."""
    return float(np.sqrt(curve["capacity_ampere_hour"] * curve["charge_capacity_ampere_hour"]))


def _soc_uncertainty(curve):
    """Half the difference of charge and discharge capacity, as a share of the capacity [1]."""
    return abs(curve["charge_capacity_ampere_hour"] / curve["capacity_ampere_hour"] - 1) / 2


def _rescaling_notes(curve, reference):
    """Notes on a test whose SoC was rescaled or is uncertain by more than 1 %."""
    share, loose = _capacity_ratio(curve, reference), _soc_uncertainty(curve)
    if abs(share - 1) > 0.01:
        yield (
            f"{curve['test']}: SoC counted from full over {_ampere_hours(reference):.4g} Ah; "
            f"the test itself moved {_ampere_hours(curve):.4g} Ah"
        )
    if loose > 0.01:
        yield f"{curve['test']}: its two directions leave the SoC uncertain by ±{100 * loose:.1f} %"


class Entropic(NamedTuple):
    """Entropic coefficient at m states of charge about `reference_celsius`; (m,), NaN: not known.

    ocv_volt : at the reference temperature [V]. slope : dOCV/dT [V/K] of a line, its std and
    confidence limits. bend : second coefficient of a parabola [V/K²], its std, and bend_p : how
    often a line would show such a bend by chance [1]. parabola : (m, 3) the parabola itself [V,
    V/K, V/K²]. shared : estimate of the common error's factor [1]. temperatures : how many.
    reach_kelvin : from the reference temperature to the furthest one read [K].
    """

    soc: np.ndarray
    ocv_volt: np.ndarray
    slope: np.ndarray
    slope_std: np.ndarray
    slope_lower: np.ndarray
    slope_upper: np.ndarray
    bend: np.ndarray
    bend_std: np.ndarray
    bend_p: np.ndarray
    parabola: np.ndarray
    shared: np.ndarray
    temperatures: np.ndarray
    reach_kelvin: np.ndarray
    reference_celsius: float


def fit_entropic(readings, *, reference_celsius=REFERENCE_CELSIUS):
    """Entropic coefficient dOCV/dT [V/K] at every state of charge: line and parabola.

    Generalised least squares with C = diag(std²) + c·cᵀ, c the common error: overpotential that
    grows in the cold, or a relaxation, is told from entropy as far as its course over temperature
    allows, and widens the interval where it does not. Where the scatter is larger than the
    standard deviations say, these are made larger by it.

    Parameters
    ----------
    readings : Readings.
    reference_celsius : about which the coefficients hold [degC].

    Returns
    -------
    entropic : Entropic, with intervals of 95 %.

    Source: thesis eq. 3.8 to 3.10: dOCV/dT = −dS/dn over the charge of the electrons.
    """
    from scipy.stats import t as student

    fits = [
        _at_one_soc(*row, reference_celsius)
        for row in zip(*(getattr(readings, name) for name in COLUMNS), strict=True)
    ]
    line, line_std, curve, curve_std, shared, chi_square, count = (
        np.array(column, float) for column in zip(*fits, strict=True)
    )
    # A deviation that was enlarged by what scattered has that scatter's degrees of freedom.
    quantile = student.ppf(0.975, np.maximum(count - 2, 1))
    reach = np.where(chi_square > 1, quantile, NORMAL_95) * line_std[:, 1]
    away = np.where(np.isfinite(readings.ocv_volt), readings.celsius - reference_celsius, 0.0)
    ratio = np.abs(curve[:, 2]) / curve_std[:, 2]
    return Entropic(
        soc=readings.soc,
        ocv_volt=line[:, 0],
        slope=line[:, 1],
        slope_std=line_std[:, 1],
        slope_lower=line[:, 1] - reach,
        slope_upper=line[:, 1] + reach,
        bend=curve[:, 2],
        bend_std=curve_std[:, 2],
        bend_p=2 * student.sf(ratio, np.maximum(count - 3, 1)),
        parabola=curve,
        shared=shared,
        temperatures=count,
        reach_kelvin=np.max(np.abs(away), axis=1),
        reference_celsius=reference_celsius,
    )


def zero_crossings(soc, slope, std, lower, upper):
    """States of charge at which a coefficient certainly changes sign, and the range of each.

    Parameters
    ----------
    soc, slope, std, lower, upper : (m,) SoC ascending [1]; coefficient, its standard deviation and
        limits, NaN: not known.

    Returns
    -------
    crossings : list of dict, one for each pair of neighbouring states of charge at which the
        interval excludes zero on opposite sides: `lower_soc`, `upper_soc` and between them `soc`,
        where signs on both sides agree best with the values [1]; `sign_above`, +1 where the voltage
        rises with temperature above it, else −1.
    """
    finite = np.isfinite(slope) & np.isfinite(std) & np.isfinite(lower) & np.isfinite(upper)
    columns = [np.asarray(column, float)[finite] for column in (soc, slope, std, lower, upper)]
    sign = (columns[3] > 0).astype(int) - (columns[4] < 0)
    sure = np.flatnonzero(sign)
    return [
        _crossing(*(column[first : last + 1] for column in columns[:3]), int(sign[last]))
        for first, last in pairwise(sure)
        if sign[first] != sign[last]
    ]


def _crossing(soc, slope, std, sign):
    """Most likely change of sign between the first and the last of these points."""
    weight = np.cumsum(sign * slope / std)
    low = int(np.argmin(weight[:-1]))
    share = slope[low] / (slope[low] - slope[low + 1])
    at = soc[low] + np.clip(share, 0.0, 1.0) * (soc[low + 1] - soc[low])
    ends = {"lower_soc": float(soc[0]), "upper_soc": float(soc[-1])}
    return {"soc": float(at), **ends, "sign_above": sign}


def shared_covariance(std, common):
    """Covariance (n, n) of readings that scatter, and share an error known up to one factor."""
    return np.diag(std**2) + np.outer(common, common)


def _at_one_soc(celsius, volt, std, common, reference):
    """Line and parabola with deviations, common error's factor, reduced χ², temperatures."""
    finite = np.isfinite(volt) & np.isfinite(std) & np.isfinite(common)
    celsius, volt, std, common = (column[finite] for column in (celsius, volt, std, common))
    # Chambers that were set alike differ by tenths of a kelvin.
    count = len(np.unique(np.round(celsius)))
    nothing = np.full(3, np.nan)
    if count < LEAST_TEMPERATURES:
        return nothing[:2], nothing[:2], nothing, nothing, np.nan, np.nan, count
    columns = np.vander(celsius - reference, 3, increasing=True)
    covariance = shared_covariance(std, common)
    line = generalised_line(columns[:, :2], volt, covariance)
    shared = common @ np.linalg.solve(covariance, volt - columns[:, :2] @ line.values)
    scores = (shared, line.reduced_chi_square, count)
    if count == LEAST_TEMPERATURES:
        return line.values, line.std, nothing, nothing, *scores
    parabola = generalised_line(columns, volt, covariance)
    return line.values, line.std, parabola.values, parabola.std, *scores
