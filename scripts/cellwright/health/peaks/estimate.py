"""State of health from peaks of dQ/dV, calibrated on charges of known capacity."""

from typing import NamedTuple

import numpy as np

from cellwright.health.peaks.features import features_of, is_partial
from cellwright.numerics.averaged_models import Rows, averaged, fitted_models
from cellwright.numerics.statistics import robust_std
from cellwright.records.conditions import same_rate, same_temperature
from cellwright.refusal import Refusal

FEWEST_CHARGES = 4
MOST_CHARGES = 100  # that one estimate is calibrated on: few terms need no more
FEWEST_CELLS = 3  # that show how cells of a type differ
FEWEST_TOLD, DISAGREES, ENDS = 8, 5.0, 3  # charges, robust standard deviations, charges
# Of the features in one model; how many it needs is found by left-out charges.
MOST_TERMS = 3
CARRIES = 0.5  # share of the models' weight from which on a peak carries the information
FARTHEST = 0.5  # outside the calibration, in spans of a feature, that is still told
# ASSUME: Before the data speak, a model misses the capacity by 1 %, weighing two charges;
# measured capacities repeat within 0.2 %; channels of a cycler differ by 2 mV.
PRIOR_SHARE, REPEAT_SHARE, CHANNEL_VOLT = 0.01, 0.002, 0.002


class PeakEstimate(NamedTuple):
    """Capacity of one charge from its peaks [Ah]; NaN and a reason where it cannot be told.

    std, lower, upper : of a 95 % interval; NaN, with a reason, where the calibration does not
    show how much cells of the type differ. peaks : share of the models' weight that needs each
    peak, by identity. charges, cells : how many the calibration had at this rate and temperature.
    """

    capacity_ampere_hour: float
    std_ampere_hour: float
    lower_ampere_hour: float
    upper_ampere_hour: float
    peaks: dict
    charges: int
    cells: int
    reason: str

    @property
    def peaks_used(self):
        """Identities that carry the information, in order of voltage; one at least."""
        most = max(self.peaks.values(), default=0.0)
        return [name for name, share in self.peaks.items() if share >= min(CARRIES, most)]


def capacity_from_peaks(charge, calibration, *, most_terms=MOST_TERMS):
    """Capacity of a charge from its peaks, by charges of known capacity of the same type [Ah].

    1. The calibration is narrowed to charges at the rate and temperature of this one,
    and of more than 100 to 100 that are spread evenly over their order by capacity.
    2. Features are positions, heights and areas of peaks, distances and charge between two
    (`features_of`); heights, areas, charges and the capacity as logarithms. 3. Every linear model
    of up to `most_terms` of the features that the charge has is fitted; models are averaged with
    weights by what they predict for charges they were not fitted to. A peak that the charge lacks
    (a partial charge, or one that vanished) thus only removes models. 4. A peak beside
    the edge of a partial charge is placed less surely than those calibrated on: models that need it
    are widened by that, and weigh less.

    Parameters
    ----------
    charge : PeakCharge. calibration : list of PeakCharge; those without capacity do not count.
    most_terms : features in one model [1].

    Returns
    -------
    estimate : PeakEstimate.

    Source: thesis 4.4 (peaks against cycles); averaging: `numerics.averaged_models`.
    """
    alike = [other for other in calibration if _comparable(charge, other)]
    cells = {other.cell for other in alike}
    unknown = _why_not(charge, calibration, alike)
    if unknown:
        return _not_told(unknown, len(alike), len(cells))
    alike = _thinned(alike)
    features = features_of([charge, *alike])
    rows = _rows(features.values[1:], features.names, alike)
    beyond = _further_std(features.std) if is_partial(charge, alike) else None
    models = fitted_models(rows, features.values[0], most_terms=most_terms, asked_std=beyond)
    if not models.terms:
        peaks = ", ".join(charge.peaks)
        words = f"its peaks ({peaks}) are in fewer than {FEWEST_CHARGES} charges calibrated on"
        return _not_told(words, len(alike), len(cells))
    return _estimate(charge, averaged(models), features.names, alike)


def _rows(values, names, charges):
    """Rows that models are fitted to: logarithms of the capacities over features."""
    target = np.log([charge.capacity_ampere_hour for charge in charges])
    offsets = np.array([CHANNEL_VOLT if name[0] == "position" else 0.0 for name in names])
    cells = np.array([charge.cell for charge in charges])
    return Rows(values, target, cells, offsets, PRIOR_SHARE, REPEAT_SHARE)


def _further_std(std):
    """Standard deviations of the first row beyond the usual ones of all others, which the scatter
    about the models holds already.
    """
    usual = np.zeros(std.shape[1])
    some = np.isfinite(std[1:]).any(axis=0)
    usual[some] = np.nanmedian(std[1:, some], axis=0)
    return np.sqrt(np.maximum(np.nan_to_num(std[0]) ** 2 - usual**2, 0.0))


def _comparable(charge, other):
    """Whether a charge of known capacity was made at the same rate and temperature."""
    alike = same_rate(charge.c_rate, other.c_rate)
    as_warm = same_temperature(charge.temperature_celsius, other.temperature_celsius)
    return other.capacity_ampere_hour > 0 and alike and as_warm


def _why_not(charge, calibration, alike):
    """Why no capacity can be told, before any model is fitted; "" where it may be."""
    if not charge.peaks:
        return "no peaks"
    if len(alike) >= FEWEST_CHARGES:
        return ""
    conditions = sorted({_condition(c) for c in calibration if c.capacity_ampere_hour > 0})
    known = f"; there are charges at {', '.join(conditions)}" if conditions else ""
    return (
        f"calibrated on {len(alike)} charge(s) of known capacity at {_condition(charge)}, "
        f"{FEWEST_CHARGES} are needed{known}"
    )


def _thinned(charges):
    """Charges evenly spread over their order by capacity, where there are too many."""
    if len(charges) <= MOST_CHARGES:
        return charges
    by_size = sorted(charges, key=lambda charge: charge.capacity_ampere_hour)
    places = np.linspace(0, len(by_size) - 1, MOST_CHARGES).round().astype(int)
    return [by_size[place] for place in places]


def _condition(charge):
    celsius = charge.temperature_celsius
    at = f"{celsius:g} °C" if np.isfinite(celsius) else "a temperature not stated"
    return f"{charge.c_rate:.2g}C and {at}"


def _not_told(reason, charges, cells):
    return PeakEstimate(*[np.nan] * 4, {}, charges, cells, reason)


def _estimate(charge, found, names, alike):
    """The average of the models as a capacity, unless the charge lies outside the calibration."""
    cells = {other.cell for other in alike}
    size = np.exp([found.mean, found.lower, found.upper])
    known = [other.capacity_ampere_hour for other in alike]
    if found.beyond > FARTHEST:
        return _not_told(
            "outside the calibration: its peaks lie beyond those calibrated on by more than half "
            "of what these span, on which capacities are "
            f"{min(known):.4g} to {max(known):.4g} Ah",
            len(alike),
            len(cells),
        )
    peaks = dict.fromkeys(charge.peaks, 0.0)
    for weight, term in zip(found.weights, found.terms, strict=True):
        for identity in {name for number in term for name in names[number][1:]}:
            peaks[identity] += float(weight)
    interval = (size[0] * found.std, size[1], size[2])
    reason = ""
    if charge.cell not in cells and len(cells) < FEWEST_CELLS:
        interval = (np.nan,) * 3
        reason = (
            f"calibrated on {len(cells)} other cell(s), which does not show how cells of the type "
            "differ: no interval"
        )
    elif not min(known) <= size[0] <= max(known):
        reason = f"beyond the capacities calibrated on, {min(known):.4g} to {max(known):.4g} Ah"
    return PeakEstimate(
        float(size[0]), *(float(x) for x in interval), peaks, len(alike), len(cells), reason
    )


class LeftOut(NamedTuple):
    """A charge, its estimate without its own check-up, and without its whole cell."""

    charge: object
    without_check_up: PeakEstimate
    without_cell: PeakEstimate


def left_out_estimates(charges, *, most_terms=MOST_TERMS, cells=True, distrusted=()):
    """Estimate of each charge by all others of its type: twice, without its check-up, its cell.

    Everything is done anew without what is left out, the choice of models included. A check-up
    is all charges of one cell at one cycle.

    Parameters
    ----------
    charges : list of PeakCharge of one type. most_terms : as for `capacity_from_peaks`.
    cells : whether cells are left out too; else both estimates are that without the check-up.
    distrusted : (cell, cycle) of check-ups that are estimated but not calibrated on.

    Returns
    -------
    list of LeftOut, one a charge.

    Raises
    ------
    Refusal : fewer than four charges of known capacity.
    """
    known = [
        charge
        for charge in charges
        if charge.capacity_ampere_hour > 0 and (charge.cell, charge.cycle) not in distrusted
    ]
    if len(known) < FEWEST_CHARGES:
        raise Refusal(
            f"{len(known)} charge(s) of known capacity among {len(charges)}; {FEWEST_CHARGES} are "
            "needed to calibrate peaks"
        )
    found = []
    for charge in charges:
        others = [one for one in known if (one.cell, one.cycle) != (charge.cell, charge.cycle)]
        by_check_up = capacity_from_peaks(charge, others, most_terms=most_terms)
        rest = [one for one in others if one.cell != charge.cell]
        # A cell of one check-up, and one that nobody calibrated on, are left out alike.
        by_cell = (
            by_check_up
            if not cells or len(rest) == len(others)
            else capacity_from_peaks(charge, rest, most_terms=most_terms)
        )
        found.append(LeftOut(charge, by_check_up, by_cell))
    return found


def disagreeing(found):
    """Check-ups whose measured capacity and peaks say so different things that one is wrong.

    Parameters
    ----------
    found : list of LeftOut, eight told at least; else none is named.

    Returns
    -------
    dict of the relative error by (cell, cycle): those further from the middle of all errors than
    five robust standard deviations, with 1 % added, a tenth of the charges at most. The three
    smallest and largest capacities are not among them: few others are like these, and what is
    carried on to them may fail where nothing is wrong with them.
    """
    told = [one for one in found if np.isfinite(one.without_check_up.capacity_ampere_hour)]
    told = [one for one in told if one.charge.capacity_ampere_hour > 0]
    if len(told) < FEWEST_TOLD:
        return {}
    sizes = np.array([one.charge.capacity_ampere_hour for one in told])
    low, high = np.sort(sizes)[[ENDS - 1, -ENDS]]
    errors = np.array(
        [
            one.without_check_up.capacity_ampere_hour / one.charge.capacity_ampere_hour - 1
            for one in told
        ]
    )
    off = np.abs(errors - np.median(errors))
    spread = np.hypot(robust_std(off), PRIOR_SHARE)
    worst = np.argsort(-off)[: max(len(told) // 10, 1)]
    return {
        (told[place].charge.cell, told[place].charge.cycle): float(errors[place])
        for place in worst
        if off[place] > DISAGREES * spread and low < sizes[place] < high
    }


class Errors(NamedTuple):
    """Errors of left-out estimates as shares of the capacity when new [1]: rms, largest, count.

    covered : share of the charges whose interval holds the measured capacity, of those that
    have one. not_told : how many could not be estimated.
    """

    rms: float
    largest: float
    count: int
    covered: float
    not_told: int


def errors_of(estimates, charges, *, fresh_ampere_hour):
    """Errors of estimates of charges whose capacity is known.

    Parameters
    ----------
    estimates : list of PeakEstimate. charges : list of PeakCharge, one each.
    fresh_ampere_hour : dict of the capacity by cell that errors are shares of [Ah].

    Returns
    -------
    errors : Errors; NaN where there is none.
    """
    pairs = [
        (one, of) for one, of in zip(estimates, charges, strict=True) if of.capacity_ampere_hour > 0
    ]
    told = [(one, of) for one, of in pairs if np.isfinite(one.capacity_ampere_hour)]
    shares = np.array(
        [
            (one.capacity_ampere_hour - of.capacity_ampere_hour) / fresh_ampere_hour[of.cell]
            for one, of in told
        ]
    )
    held = [
        one.lower_ampere_hour <= of.capacity_ampere_hour <= one.upper_ampere_hour
        for one, of in told
        if np.isfinite(one.std_ampere_hour)
    ]
    return Errors(
        float(np.sqrt(np.mean(shares**2))) if told else np.nan,
        float(np.abs(shares).max()) if told else np.nan,
        len(told),
        float(np.mean(held)) if held else np.nan,
        len(pairs) - len(told),
    )
