"""State of health from peaks of dQ/dV, calibrated on charges of known capacity."""

from typing import NamedTuple

import numpy as np

from cellwright.health.peaks.features import features_of, is_partial, made_alike
from cellwright.health.ratings import REPEAT_SHARE
from cellwright.numerics.averaged_models import Rows, averaged, fitted_models
from cellwright.numerics.statistics import robust_std
from cellwright.refusal import Refusal

FEWEST_CHARGES = 4
# Of the features in one model; how many it needs is found by left-out charges.
MOST_TERMS = 3
# ASSUME: Before the data speak, a model misses the capacity by 1 %, weighing two charges.
PRIOR_SHARE = 0.01


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
        """Identities that half of the models' weight needs, in order of voltage; one at least."""
        most = max(self.peaks.values(), default=0.0)
        return [name for name, share in self.peaks.items() if share >= min(0.5, most)]


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
    known = [other for other in calibration if other.capacity_ampere_hour > 0]
    alike = [other for other in known if made_alike(charge, other)]
    unknown = _why_not(charge, known, alike)
    if unknown:
        return _not_known(unknown, alike)
    if len(alike) > 100:  # few terms need no more, if these span all capacities
        by_size = sorted(alike, key=lambda other: other.capacity_ampere_hour)
        places = np.linspace(0, len(by_size) - 1, 100).round().astype(int)
        alike = [by_size[place] for place in places]
    features = features_of([charge, *alike])
    rows = _rows(features.values[1:], features.names, alike)
    beyond = _further_std(features.std) if is_partial(charge, alike) else None
    models = fitted_models(rows, features.values[0], most_terms=most_terms, asked_std=beyond)
    if not models.terms:
        peaks = ", ".join(charge.peaks)
        words = f"its peaks ({peaks}) are in fewer than {FEWEST_CHARGES} charges calibrated on"
        return _not_known(words, alike)
    return _estimate(charge, averaged(models), features.names, alike)


def _rows(values, names, charges):
    """Rows that models are fitted to: logarithms of the capacities over features."""
    target = np.log([charge.capacity_ampere_hour for charge in charges])
    # ASSUME: Channels of a cycler differ by 2 mV.
    offsets = np.array([0.002 if name[0] == "position" else 0.0 for name in names])
    cells = np.array([charge.cell for charge in charges])
    return Rows(values, target, cells, offsets, PRIOR_SHARE, REPEAT_SHARE)


def _further_std(std):
    """Standard deviations of the first row beyond the usual ones of the others.

    The scatter about the models holds those already.
    """
    usual = np.zeros(std.shape[1])
    some = np.isfinite(std[1:]).any(axis=0)
    usual[some] = np.nanmedian(std[1:, some], axis=0)
    return np.sqrt(np.maximum(np.nan_to_num(std[0]) ** 2 - usual**2, 0.0))


def _why_not(charge, known, alike):
    """Why no capacity can be told, before any model is fitted; "" where it may be."""
    if not charge.peaks:
        return "no peaks"
    if len(alike) >= FEWEST_CHARGES:
        return ""
    conditions = sorted({_condition(other) for other in known})
    there_are = f"; there are charges at {', '.join(conditions)}" if conditions else ""
    return (
        f"calibrated on {len(alike)} charge(s) of known capacity at {_condition(charge)}, "
        f"{FEWEST_CHARGES} are needed{there_are}"
    )


def _condition(charge):
    celsius = charge.temperature_celsius
    at = f"{celsius:g} °C" if np.isfinite(celsius) else "a temperature not stated"
    return f"{charge.c_rate:.2g}C and {at}"


def _not_known(reason, alike):
    cells = {other.cell for other in alike}
    return PeakEstimate(*[np.nan] * 4, {}, len(alike), len(cells), reason)


def _estimate(charge, found, names, alike):
    """The average of the models as a capacity, unless the charge lies outside the calibration."""
    cells = {other.cell for other in alike}
    size = np.exp([found.mean, found.lower, found.upper])
    known = [other.capacity_ampere_hour for other in alike]
    if found.beyond > 0.5:
        return _not_known(
            "outside the calibration: its peaks lie beyond those calibrated on by more than half "
            "of what these span, on which capacities are "
            f"{min(known):.4g} to {max(known):.4g} Ah",
            alike,
        )
    peaks = dict.fromkeys(charge.peaks, 0.0)
    for weight, term in zip(found.weights, found.terms, strict=True):
        for identity in {name for number in term for name in names[number][1:]}:
            peaks[identity] += float(weight)
    # The mean is a logarithm: its deviation is a share of the capacity.
    interval = (size[0] * found.std, size[1], size[2])
    reason = ""
    if charge.cell not in cells and len(cells) < 3:
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
    found : list of LeftOut, eight of them known at least; else none is named.

    Returns
    -------
    dict of the relative error by (cell, cycle): those further from the middle of all errors than
    five robust standard deviations, with 1 % added, a tenth of the charges at most. The three
    smallest and largest capacities are not among them: few others are like these, and what is
    carried on to them may fail where nothing is wrong with them.
    """
    known = [one for one in found if np.isfinite(one.without_check_up.capacity_ampere_hour)]
    known = [one for one in known if one.charge.capacity_ampere_hour > 0]
    if len(known) < 8:
        return {}
    sizes = np.array([one.charge.capacity_ampere_hour for one in known])
    low, high = np.sort(sizes)[[2, -3]]
    errors = np.array([one.without_check_up.capacity_ampere_hour for one in known]) / sizes - 1
    # About the middle of all errors: what they share is no disagreement.
    off = np.abs(errors - np.median(errors))
    spread = np.hypot(robust_std(off), PRIOR_SHARE)
    worst = np.argsort(-off)[: max(len(known) // 10, 1)]
    return {
        (known[place].charge.cell, known[place].charge.cycle): float(errors[place])
        for place in worst
        if off[place] > 5.0 * spread and low < sizes[place] < high
    }
