"""How far a cell's resistances and open-circuit voltage are from the reference's, and how sure."""

from typing import NamedTuple

import numpy as np

from cellwright.bias import thesis
from cellwright.bias.courses import KNOTS
from cellwright.numerics import shrunk_regression as regression
from cellwright.numerics.statistics import rms
from cellwright.refusal import Refusal

MOST_CELLS = 60  # that calibrate: more make the regression slower, not better
SCALARS, COURSE = range(2)  # of `features.differences`
PRESENT = 0.8  # of the calibrating cells show a feature that is used
BEYOND = 0.1  # of the range of a feature over the calibrating cells


class Change(NamedTuple):
    """Change of one course from the reference's: (k,) each over `courses.KNOTS`.

    change : logarithm of a ratio of resistances [1], or volts. half_interval : of 95 %, NaN where
    too few cells calibrate. form : what it is predicted by: "scaling", "charge", "terms" or
    "thesis". left_out : (c, k) errors of the calibrating cells, each predicted without itself.
    stretch : (c,) by which such an error is larger in this cell. remoteness : see
    `shrunk_regression.Prediction`.
    """

    change: np.ndarray
    half_interval: np.ndarray
    form: str
    left_out: np.ndarray
    stretch: np.ndarray
    remoteness: float


class Correction(NamedTuple):
    """Corrections of one cell, the cells they are calibrated on, and what lies beyond those.

    changes : three of Change: of fast and of slow resistance, as logarithms of ratios, and of the
    OCV [V]. outside : sentences. ratio_words : where the ratio of all resistances is from.
    model_error_volt : typical error of the calibrating cells' own models on what was left out of
    their fits [V], NaN where none says.
    """

    changes: tuple
    cells: tuple
    outside: tuple
    ratio_words: str
    model_error_volt: float


def correction(cell, base, others):
    """Correction of a cell against the reference, calibrated on the other cells of the type.

    1. What is expected beforehand: all resistances times the ratio at the onset of a discharge; the
    OCV that the cell's charge shows once its polarisation is taken off, else the reference's.
    2. The rest is predicted from the differences that the cells show, by as many terms as the
    calibrating cells carry (`shrunk_regression.shrunk`); too few cells carry none. Resistances
    take those that tell of resistance and size, the OCV those of the charge's course too. 3. The
    thesis' bias functions stand beside it, and count where they clearly err less on cells left
    out.

    Parameters
    ----------
    cell : Compared. base : Courses of the reference. others : list of Compared; those without a
        model that has the reference's chosen member do not count.

    Returns
    -------
    correction : Correction.
    """
    peers = _calibrating(others)
    names, table = _features(cell, peers)
    features = table[:-1], table[-1]
    # ASSUME: The course of a charge tells of the OCV; of resistance only what its onset, its gap to
    # the discharge, its end and its peaks show.
    scalar = [place for place, (_, is_course) in enumerate(names) if not is_course]
    of_resistance = tuple(part[..., scalar] for part in features)
    changes = [
        _resistance_change(which, cell, base, peers, of_resistance) for which in ("fast", "slow")
    ]
    changes.append(_ocv_change(cell, base, peers, features))
    errors = [peer.model_error_volt for peer in peers if peer.model_error_volt is not None]
    return Correction(
        tuple(changes),
        tuple(peer.shown.cell for peer in peers),
        _outside(names, *features, changes),
        cell.ratio_words,
        rms(errors) if errors else np.nan,
    )


def _calibrating(others):
    """Cells with a model to compare, at most `MOST_CELLS`, spread over the capacities."""
    found = [other for other in others if other.fast is not None]
    found.sort(key=lambda other: other.shown.capacity_ampere_hour)
    places = np.linspace(0, len(found) - 1, min(len(found), MOST_CELLS)).round().astype(int)
    return [found[place] for place in places]


def _features(cell, peers):
    """Names with whether each is of the course, and values (c + 1, p), the cell's own last.

    Only what the cell itself and most calibrating cells show; a calibrating cell that lacks one
    gets the mean of the others.
    """
    names, columns = [], []
    own = [(part, name) for part in (SCALARS, COURSE) for name in cell.differences[part]]
    for part, name in own:
        shown = np.array([peer.differences[part].get(name, np.nan) for peer in peers])
        there = np.isfinite(shown)
        if not there.any() or there.mean() < PRESENT:
            continue
        names.append((name, part == COURSE))
        filled = np.where(there, shown, shown[there].mean())
        columns.append(np.append(filled, cell.differences[part][name]))
    table = np.array(columns).T if columns else np.empty((len(peers) + 1, 0))
    return names, table


def _stacked(peers, name):
    return np.array([getattr(peer, name) for peer in peers]).reshape(-1, len(KNOTS))


def _resistance_change(which, cell, base, peers, features):
    true = _stacked(peers, which)
    prior = np.log([peer.ratio for peer in peers]).reshape(-1, 1) * np.ones(len(KNOTS))
    course = (features, true, prior, np.full(len(KNOTS), np.log(cell.ratio)))
    expected = _by_terms(*course, form="scaling", degrees=())
    best = _by_terms(*course, form="scaling")
    return _surer(expected, _better(best, _resistance_by_thesis(which, cell, base, peers)))


def _ocv_change(cell, base, peers, features):
    """Change of the OCV: by the cell's charge where all charges tell it, else by terms alone."""
    true = _stacked(peers, "ocv")
    course = (features, true, 0.0 * true, np.zeros(len(KNOTS)))
    expected = _by_terms(*course, form="scaling", degrees=())
    best = _by_terms(*course, form="scaling")
    if cell.opened_volt is not None and all(peer.opened_volt is not None for peer in peers):
        course = (features, true, _stacked(peers, "opened_volt"), cell.opened_volt)
        expected = _by_terms(*course, form="charge", degrees=())
        best = _better(_by_terms(*course, form="charge"), best)
    return _surer(expected, _better(best, _ocv_by_thesis(cell, peers)))


def _by_terms(features, true, prior, own_prior, *, form, degrees=regression.DEGREES):
    """Change of a course: what is expected beforehand, and by terms what that leaves."""
    fit = regression.shrunk(features[0], true - prior, degrees=degrees)
    found = regression.predicted(fit, features[1])
    return Change(
        own_prior + found.change,
        found.half_interval,
        "terms" if fit.degree else form,
        fit.left_out,
        found.stretch,
        found.remoteness,
    )


def _surer(expected, best):
    """What is expected beforehand, where a cell is so far out that the best is less sure of it."""
    return expected if rms(expected.half_interval) < rms(best.half_interval) else best


def _better(first, second):
    """The first of two changes, unless the second clearly errs less on the cells left out.

    The second may be None.
    """
    if second is None or len(first.left_out) < 2:
        return first
    return second if regression.clearly_less(first.left_out, second.left_out) else first


def _resistance_by_thesis(which, cell, base, peers):
    """A resistance by the thesis' bias function, None where peaks do not allow it."""
    shifts = _shifts(cell, peers)
    if shifts is None:
        return None
    mains, means = shifts
    known = base.fast_ohm if which == "fast" else base.slow_ohm
    true = _stacked(peers, which)
    changes = known * np.expm1(true)
    try:
        if which == "fast":
            coefficients, errors = thesis.quadratic_function(mains, KNOTS, changes)
            change = thesis.quadratic_bias(cell.shift_volt[0], KNOTS, coefficients)
        else:
            (per_volt,), errors = thesis.linear_function(means, changes)
            change = np.full(len(KNOTS), per_volt * cell.shift_volt[1])
    except Refusal:
        return None
    left_out = _log_ratio(known, changes + errors) - true
    return _by_function(_log_ratio(known, change), left_out, cell, mains)


def _ocv_by_thesis(cell, peers):
    """The OCV by the thesis' bias function, None where peaks do not allow it."""
    shifts = _shifts(cell, peers)
    if shifts is None:
        return None
    try:
        true = _stacked(peers, "ocv")
        coefficients, errors = thesis.quadratic_function(shifts[0], KNOTS, true)
    except Refusal:
        return None
    change = thesis.quadratic_bias(cell.shift_volt[0], KNOTS, coefficients)
    return _by_function(change, errors, cell, shifts[0])


def _shifts(cell, peers):
    """Main and mean shifts of the peaks of the calibrating cells, None where one has none."""
    shifts = [peer.shift_volt for peer in peers]
    if cell.shift_volt is None or not shifts or None in shifts:
        return None
    return np.array(shifts).T


def _log_ratio(known, change):
    return np.log(np.maximum(1 + change / known, 0.1))


def _by_function(change, left_out, cell, mains):
    """A change by a bias function, sure to its errors on cells left out and to the shift."""
    errors = regression.shrunk(mains[:, None], -left_out, degrees=())
    found = regression.predicted(errors, [cell.shift_volt[0]])
    spread = (found.half_interval, "thesis", left_out, found.stretch, found.remoteness)
    return Change(change, *spread)


def _outside(names, ours, own, changes):
    """What says that a cell is beyond those that calibrate, with how much wider its interval is."""
    words = []
    if not len(ours):
        return ()
    for (name, _), column, value in zip(names, ours.T, own, strict=True):
        low, high = min(column.min(), 0.0), max(column.max(), 0.0)
        if not low - BEYOND * (high - low) <= value <= high + BEYOND * (high - low):
            words.append(f"{name} differs by {value:.3g}, those cells by {low:.3g} to {high:.3g}")
    remote = max(change.remoteness for change in changes)
    if not words or remote <= 1:
        return ()
    return (f"interval {remote:.2g} times the widest of a calibrating cell", *words[:3])
