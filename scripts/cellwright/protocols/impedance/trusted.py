"""Which points of a spectrum a circuit may be fitted to: drift and the leads' tail left out."""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.impedance.kramers_kronig import linear_kramers_kronig

# Of all points, what may be left out at the slow end before the whole spectrum is in doubt.
MOST_SHARE = 0.4
# The slow end breaks the relations where it is this many times worse than the fast end.
WORSE = 2.0


class Trusted(NamedTuple):
    """keep : (n,) points that a circuit may be fitted to. residual : (n,) complex, relative, of the
    Kramers–Kronig test of the points above the drift; NaN below. rms : of it. notes : what was left
    out, and why."""

    keep: np.ndarray
    residual: np.ndarray
    rms: float
    notes: tuple


def trusted_points(frequency_hertz, impedance_ohm, *, drift_tolerance, inductance="model"):
    """Points without drift at the slow end, and without the leads' tail where it is to be cut.

    The slowest point is left out, again and again, while the slowest decade of what is left breaks
    the Kramers–Kronig relations. Where two fifths of the points are not enough, none is left out:
    then not the end is at fault but the spectrum.

    Parameters
    ----------
    frequency_hertz : (n,) [Hz]. impedance_ohm : (n,) complex [Ω].
    drift_tolerance : RMS of the relative residual that the slowest decade may have [1].
    inductance : "model" keeps inductive points, "cut" leaves them out.

    Returns
    -------
    trusted : Trusted.

    Raises
    ------
    Refusal : fewer than 8 points.
    """
    order = np.argsort(frequency_hertz)
    most = int(MOST_SHARE * len(order))
    tests = []
    for dropped in range(most + 1):
        kept = order[dropped:]
        test = linear_kramers_kronig(frequency_hertz[kept], impedance_ohm[kept])
        tests.append(test)
        if not _breaks(frequency_hertz[kept], test.relative_residual, drift_tolerance):
            break
    else:
        dropped, test = 0, tests[0]
    keep = np.ones(len(order), bool)
    keep[order[:dropped]] = False
    inductive = impedance_ohm.imag > 0
    if inductance == "cut":
        keep &= ~inductive
    notes = _notes(frequency_hertz, order, dropped, inductive & ~keep, tests[0])
    residual = np.full(len(order), np.nan, complex)
    residual[order[dropped:]] = test.relative_residual
    return Trusted(keep, residual, test.rms_relative_residual, tuple(notes))


def _breaks(frequency, residual, tolerance):
    size, decade = np.abs(residual), np.log10(frequency / frequency.min())
    slow = np.sqrt(np.mean(size[decade <= 1] ** 2))
    fast = np.sqrt(np.mean(size[decade >= decade.max() - 1] ** 2))
    return slow > max(tolerance, WORSE * fast)


def _notes(frequency, order, dropped, cut, whole):
    if dropped:
        count = "1 point" if dropped == 1 else f"{dropped} points"
        yield (
            f"{count} below {frequency[order[dropped]]:.3g} Hz left out of the fit: there "
            f"the spectrum breaks the Kramers-Kronig relations "
            f"({whole.rms_relative_residual:.1%} RMS with them): the cell drifted"
        )
    if cut.any():
        yield (
            f"{int(cut.sum())} points above {frequency[cut].min():.3g} Hz left out of the fit: "
            "inductance of the leads"
        )
