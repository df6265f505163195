"""Open-circuit voltage over SoC from the ends of rests, where a cell has no slow test.

The protocol, in steps: (1) from full, take out a portion; (2) rest, until the voltage hardly moves;
(3) repeat to the lower cut-off. Each rest is a point of the curve: what of it is still to relax is
added where two exponentials tell it.
"""

from typing import NamedTuple

import numpy as np

from cellwright.protocols.ocv.slow import POINTS, OcvCurve, joined, rising
from cellwright.refusal import Refusal

FEWEST = 5  # points of a branch
SPAN = 0.5  # of the SoC that they must span
OFFSET = 0.005  # of the capacity, read in rests: from here on it is said


class RestPoints(NamedTuple):
    """One entry a rest, arrays of shape (rests,).

    charge_ampere_hour : net charge of the record at its end [Ah]. end_volt : mean over its last
    fiftieth [V]. relaxed_volt : where its exponentials end, NaN where they are not told [V].
    doubt_volt : what the extrapolation may be off by, NaN where there is none [V]. direction : of
    the load before. current_ampere : of that load, positive on charge. rest_second : length.
    read_ampere_hour : what the current channel counted within the rest [Ah].
    """

    charge_ampere_hour: np.ndarray
    end_volt: np.ndarray
    relaxed_volt: np.ndarray
    doubt_volt: np.ndarray
    direction: np.ndarray
    current_ampere: np.ndarray
    rest_second: np.ndarray
    read_ampere_hour: np.ndarray


def ocv_of_rests(points, scale, *, lower_cutoff_volt, upper_cutoff_volt=None):
    """OCV curve through the rests of a record.

    Rests after discharge are one branch, those after charge another; a branch takes 5 points that
    span half the SoC. Within each, points are made monotone (isotonic regression) and joined by
    monotone cubics (PCHIP). Where both are there the curve is their mean. Beyond the outermost
    points it runs on straight through the last two of them, not beyond the cut-offs.

    Parameters
    ----------
    points : RestPoints. scale : rest_scale.Scale.
    lower_cutoff_volt, upper_cutoff_volt : [V]; the upper may be None.

    Returns
    -------
    curve : OcvCurve with branches "rests"; joined_by "mean" or "single".

    Raises
    ------
    Refusal : too few rests, or they span too little.

    Source: PCHIP: F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238.
    """
    soc = np.linspace(0.0, 1.0, POINTS)
    own = soc_at(points, scale)
    volt = np.where(np.isnan(points.relaxed_volt), points.end_volt, points.relaxed_volt)
    out, back = (points.direction == name for name in ("discharge", "charge"))
    top = (
        [(1.0, scale.first_volt)]
        if np.isfinite(scale.first_volt) and own.max(initial=0) < 1
        else []
    )
    discharge, moved_out = _branch(own[out], volt[out], top, soc)
    charge, moved_back = _branch(own[back], volt[back], [], soc)
    if discharge is None and charge is None:
        raise Refusal(_too_few(own, out, back))
    sides = [np.full(POINTS, np.nan) if side is None else side for side in (discharge, charge)]
    way = "single" if discharge is None or charge is None else "mean"
    ocv, measured = joined(soc, *sides, discharge, charge, way)
    extended = _extended(soc, ocv, measured, lower_cutoff_volt, upper_cutoff_volt)
    table = rising(extended)
    used = out if charge is None else back if discharge is None else out | back
    return OcvCurve(
        soc=soc,
        ocv_volt=table,
        discharge_volt=sides[0],
        charge_volt=sides[1],
        half_gap_volt=(sides[1] - sides[0]) / 2,
        capacity_ampere_hour=scale.capacity_ampere_hour,
        charge_capacity_ampere_hour=np.nan,
        branches="rests",
        discharge_current_ampere=_usual(points.current_ampere[out]),
        charge_current_ampere=_usual(points.current_ampere[back]),
        joined_by=way,
        measured_soc=(float(soc[measured].min()), float(soc[measured].max())),
        moved_volt=float(max(moved_out, moved_back, np.abs(table - extended).max())),
        note=_note(points, scale, used, way, soc[measured]),
    )


def soc_at(points, scale):
    """State of charge (rests,) at the end of each rest.

    Parameters
    ----------
    points : RestPoints. scale : rest_scale.Scale.
    """
    return 1 + (points.charge_ampere_hour - scale.full_ampere_hour) / scale.capacity_ampere_hour


def _branch(own, volt, more, soc):
    """Voltage of one branch at the table's SoC, NaN beyond it, and how far points were moved."""
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import isotonic_regression

    if len(own) < FEWEST or np.ptp(own) < SPAN:
        return None, 0.0
    pairs = sorted([*zip(own, volt, strict=True), *more])
    at, found = np.array(pairs).T
    monotone = isotonic_regression(found).x
    places, first = np.unique(at, return_index=True)
    inside = (soc >= places[0] - 0.5 / POINTS) & (soc <= places[-1] + 0.5 / POINTS)
    course = PchipInterpolator(places, monotone[first])(np.clip(soc, places[0], places[-1]))
    return np.where(inside, course, np.nan), float(np.abs(monotone - found).max())


def _usual(current):
    return float(np.median(current)) if len(current) else np.nan


# ASSUME: Beyond its outermost rests an OCV curve runs on straight, as far as the cut-offs.
def _extended(soc, ocv, measured, lower, upper):
    """The curve continued on the mean slope of its last and first 5 % of SoC."""
    known, step = np.flatnonzero(measured), POINTS // 20
    first, last = known[0], known[-1]
    ends = [(first, first + step), (last - step, last)]
    slopes = [(ocv[b] - ocv[a]) / (soc[b] - soc[a]) for a, b in ends]
    below = np.maximum(ocv[first] + slopes[0] * (soc - soc[first]), min(lower, ocv[first]))
    above = ocv[last] + slopes[1] * (soc - soc[last])
    if upper is not None:
        above = np.minimum(above, max(upper, ocv[last]))
    return np.where(soc < soc[first], below, np.where(soc > soc[last], above, ocv))


def _too_few(own, out, back):
    found = [
        f"{side.sum()} after {name} over {np.ptp(own[side]) if side.any() else 0:.0%} of the SoC"
        for name, side in (("discharge", out), ("charge", back))
    ]
    wanted = f"{FEWEST} that span {SPAN:.0%}"
    return f"too few rests for an OCV curve: {', '.join(found)}; wanted {wanted}"


def _note(points, scale, used, way, measured_soc):
    """What a reader must know: how far relaxed, which branch, what is measured, what is not."""
    ahead = 1e3 * np.abs(points.relaxed_volt - points.end_volt)[used]
    doubt, told = 1e3 * points.doubt_volt[used], np.isfinite(ahead)
    said = [f"OCV from {used.sum()} rests; {scale.start}"]
    if told.any():
        most = f"{np.median(ahead[told]):.1f} mV typically, {ahead[told].max():.1f} mV at most"
        off = f"off by {np.median(doubt[told]):.1f} mV typically, {doubt[told].max():.1f} at most"
        said.append(f"what was still to relax is added ({most}) and may be {off}")
    if not told.all():
        said.append(f"{(~told).sum()} are taken as measured: their exponentials are not told")
    if way == "single":
        side = points.direction[used][0]
        said.append(f"all after {side}: half a hysteresis, if the cell has one, is in the curve")
    if np.isfinite(scale.first_volt):
        said.append("at full the first row: how long the cell had rested is not known")
    low, high = measured_soc.min(), measured_soc.max()
    if low > 0 or high < 1:
        said.append(f"straight on beyond SoC {low:.3f} to {high:.3f}")
    read = points.read_ampere_hour.sum() / scale.capacity_ampere_hour
    if abs(read) > OFFSET:
        said.append(f"the current read in the rests counts {read:+.1%} of the capacity: an offset?")
    return "; ".join(said)
