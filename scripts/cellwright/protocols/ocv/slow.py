"""Open-circuit voltage over SoC from one slow test with a full discharge, a full charge or both.

The protocol, in steps: (1) from full, discharge slowly to the lower cut-off; (2) where the test
was made cold, take the remainder out at room temperature; (3) from empty, charge slowly to the
upper cut-off; (4) fill the remainder. Ampere-hours of all four make the SoC; voltages come from
the slow constant currents of (1) and (3) alone.
"""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from cellwright.protocols.half_cycles import (
    ENDS,
    NAMES,
    RETURN_SHARE,
    Before,
    HalfCycle,
    columns_of,
    start_by_rest,
    start_of_first,
    start_under_load,
)
from cellwright.protocols.ocv.legs import legs_of
from cellwright.records.conditions import SAME_RATE
from cellwright.refusal import Refusal
from cellwright.series.rest_current import offset_at_rest
from cellwright.settings import Ocv

OCV = Ocv()
POINTS = 201
CLOSED = 0.03  # of the charge, by which slow discharge and charge may differ
MOST_OFFSET = 0.3  # of the slow current: the largest reading at rest that is looked for


def joined(soc, discharge_volt, charge_volt, discharge, charge, joined_by):
    """OCV over SoC from the branches [V], and where both needed branches were measured.

    soc : (n,) [1], evenly from 0 to 1 with a point at 0.5.
    discharge_volt, charge_volt : (n,) [V], NaN where a branch does not reach.
    discharge, charge : Leg of each branch, or None.
    joined_by : "single", "mean" or "equilibrium".

    Returns ocv_volt: (n,) [V]. measured : (n,) bool. Raises Refusal: the branches do not overlap
    at 50 % SoC.
    """
    if joined_by == "single":
        only = discharge_volt if charge is None else charge_volt
        measured = np.isfinite(only)
        return np.interp(soc, soc[measured], only[measured]), measured
    if joined_by == "mean":
        return mean_of_branches(soc, discharge_volt, charge_volt)
    return from_equilibrium(soc, discharge_volt, charge_volt, discharge, charge)


def mean_of_branches(soc, discharge_volt, charge_volt):
    """Mean of the branches where both are valid; beyond, one branch moved by half the gap there.

    Below that the charge, above it the discharge, where these reach; where neither does, the OCV
    stays as it is at the edge.

    soc, discharge_volt, charge_volt : as in `joined`.

    Returns ocv_volt: (n,) [V]. both : (n,) bool, where it is the mean. Raises Refusal: the
    branches do not overlap at 50 % SoC.
    """
    # ASSUME: Where one slow branch has ended or drops into its polarisation knee (half gap above
    # three times the usual), the OCV is the other branch moved by half the gap at that edge.
    half, middle = (charge_volt - discharge_volt) / 2, len(soc) // 2
    if np.isnan(half[middle]):
        raise Refusal("slow discharge and slow charge do not overlap at 50 % SoC")
    usual = np.nanmedian(half[(soc > 0.2) & (soc < 0.8)])
    good = half < 3 * usual
    first = np.append(-1, np.flatnonzero(~good[:middle]))[-1] + 1
    last = np.append(np.flatnonzero(~good[middle:]), len(soc) - middle)[0] + middle - 1
    gap = half[np.clip(np.arange(len(soc)), first, last)]
    from_charge, from_discharge = charge_volt - gap, discharge_volt + gap
    low = np.where(np.isnan(from_charge), from_discharge, from_charge)
    high = np.where(np.isnan(from_discharge), from_charge, from_discharge)
    both = (soc >= soc[first]) & (soc <= soc[last])
    ocv = np.where(both, (charge_volt + discharge_volt) / 2, np.where(soc < soc[first], low, high))
    reached = np.isfinite(ocv)
    return np.interp(soc, soc[reached], ocv[reached]), both


def from_equilibrium(soc, discharge_volt, charge_volt, discharge, charge):
    """OCV (n,) [V], each half from the branch that began there in equilibrium, and where measured.

    The drop seen as the current starts and stops is taken off each branch, linear in SoC between;
    the gap that remains at half charge is taken to grow linearly from zero at the branch's start.
    """
    # ASSUME: In a four-file OCV test a branch starts in equilibrium and the hysteresis grows
    # linearly from there to half charge, so the low half of the OCV is the charge branch less
    # that part of the gap, the high half the discharge branch plus it.
    # A drop that was not seen, or seen too late, is at most twice that of the other branch.
    twice_in, twice_out = 2 * charge.step_in_volt, 2 * charge.step_out_volt
    from_full = np.fmin(discharge.step_in_volt, twice_out)
    to_empty = np.fmin(discharge.step_out_volt, twice_in)
    from_empty = np.fmin(charge.step_in_volt, 2 * discharge.step_out_volt)
    to_full = np.fmin(charge.step_out_volt, 2 * discharge.step_in_volt)
    drops = np.nan_to_num([from_full, to_empty, from_empty, to_full])
    high = discharge_volt + drops[1] + (drops[0] - drops[1]) * soc
    low = charge_volt - drops[2] - (drops[3] - drops[2]) * soc
    middle = len(soc) // 2
    gap = low[middle] - high[middle]
    ocv = np.where(soc < 0.5, low - gap * soc, high + gap * (1 - soc))
    measured = np.isfinite(ocv)
    if not (np.isfinite(gap) and measured.any()):
        raise Refusal("slow discharge and slow charge do not overlap at 50 % SoC")
    return np.interp(soc, soc[measured], ocv[measured]), measured


class OcvCurve(NamedTuple):
    """Table over SoC and what it was made from; arrays (201,), NaN where a branch is missing.

    soc : 0 to 1. ocv_volt : rises strictly [V]. discharge_volt, charge_volt : as measured under
    the slow current [V]. half_gap_volt : half their distance, hysteresis and current times
    resistance together [V]. capacity_ampere_hour, charge_capacity_ampere_hour : taken out, and
    put back in [Ah]. closed_capacity_ampere_hour : as taken out; where the two differ by 3 % and
    more, that of a charge equal to the discharge, see `_closed` [Ah].
    branches : "both", "discharge" or "charge", or "rests" (`ocv.rests`).
    discharge_current_ampere, charge_current_ampere : signed [A]. joined_by : "mean", "equilibrium"
    or "single".
    step_volt : smallest jump of the voltage, within 10 s, as the slow current starts and stops, a
    drop over resistances in the cell or outside it; NaN where none was seen [V].
    measured_soc : range in which all that `joined_by` needs was measured; beyond it the curve
    is extended. moved_volt : largest change to a sample or to the table to have them rise [V].
    note : what is odd, or "".
    """

    soc: np.ndarray
    ocv_volt: np.ndarray
    discharge_volt: np.ndarray
    charge_volt: np.ndarray
    half_gap_volt: np.ndarray
    capacity_ampere_hour: float
    charge_capacity_ampere_hour: float
    closed_capacity_ampere_hour: float
    branches: str
    discharge_current_ampere: float
    charge_current_ampere: float
    joined_by: str
    step_volt: float
    measured_soc: tuple
    moved_volt: float
    note: str


def slow_ocv(
    series,
    *,
    lower_cutoff_volt,
    upper_cutoff_volt,
    least_hour=OCV.least_hour,
    soc_at_start=None,
    state_before="",
):
    """OCV of a slow test from its discharge and its charge branch at equal SoC.

    Where files of their own complete both branches, so that each begins in equilibrium, they are
    joined by `from_equilibrium`, else as their mean.

    series : dict of (n,) columns of stage `clean`: test_time_second, current_ampere, voltage_volt,
        charge_ampere_hour, whose net charge carries on across gaps and joined files; file_index,
        which of the joined files a row is from, where there are several.
    lower_cutoff_volt, upper_cutoff_volt : where a full discharge and a full charge end [V].
    least_hour : a branch is slow if it takes longer than this at its current [h].
    soc_at_start : of the first row, as the sheet states it [1], or None. state_before : "full" or
        "empty", as the test before this one in time left the cell; "": not known. A first branch
        that they, the branch after it, or its first rest tell not to begin at its end is left out.

    Returns curve: OcvCurve. Raises Refusal: no leg of the record is slow, full and runs to its
    cut-off, or one is not stated.

    Source: joining of four scripts, "equilibrium": G. L. Plett, Battery Management Systems I
    (2015), ch. 2, function processOCV.
    """
    ends = {"lower": lower_cutoff_volt, "upper": upper_cutoff_volt}
    if unstated := [f"{name} cut-off" for name, volt in ends.items() if volt is None]:
        named = " and the ".join(unstated)
        raise Refusal(f"the {named} is not stated, so no slow curve is known to be complete")
    time, (current, voltage, net_charge) = series["test_time_second"], columns_of(series)
    time, files = np.asarray(time, float), series.get("file_index", np.zeros(len(time)))
    cutoffs = {-1: lower_cutoff_volt, 1: upper_cutoff_volt}
    columns = time, current, voltage, net_charge, np.asarray(files, int)
    known = Before(state_before, soc_at_start)
    discharge, charge, net_charge, note = _legs_chosen(columns, (cutoffs, least_hour), known)
    *closed, without_drift, drift = _closed(discharge, charge, time, current, net_charge)
    soc = np.linspace(0.0, 1.0, POINTS)
    discharge_volt, moved_out = _branch(closed[0], voltage, without_drift, soc)
    charge_volt, moved_back = _branch(closed[1], voltage, without_drift, soc)
    joined_by = "single"
    if discharge and charge:
        conditioned = discharge.conditioned and charge.conditioned
        joined_by = "equilibrium" if conditioned else "mean"
    ocv, measured = joined(soc, discharge_volt, charge_volt, discharge, charge, joined_by)
    table = rising(ocv)
    return OcvCurve(
        soc=soc,
        ocv_volt=table,
        discharge_volt=discharge_volt,
        charge_volt=charge_volt,
        half_gap_volt=(charge_volt - discharge_volt) / 2,
        capacity_ampere_hour=(discharge or charge).capacity_ampere_hour,
        charge_capacity_ampere_hour=charge.capacity_ampere_hour if charge else np.nan,
        closed_capacity_ampere_hour=(closed[0] or closed[1]).capacity_ampere_hour,
        branches="both" if discharge and charge else "discharge" if discharge else "charge",
        discharge_current_ampere=discharge.current_ampere if discharge else np.nan,
        charge_current_ampere=charge.current_ampere if charge else np.nan,
        joined_by=joined_by,
        step_volt=_step_at_once(discharge, charge),
        measured_soc=(float(soc[measured].min()), float(soc[measured].max())),
        moved_volt=float(max(moved_out, moved_back, np.abs(table - ocv).max())),
        note=_balance(discharge, charge, closed[0], drift) or note,
    )


def _step_at_once(*legs):
    """Smallest jump of the voltage as the slow current of a leg starts and stops [V], or NaN."""
    begun, ended = np.array([leg.at_once_volt for leg in legs if leg]).T
    # As a current turns round, a hysteresis may jump too; as it stops, none does.
    return float(np.nanmin([*begun, *ended])) if np.isfinite(ended).any() else np.nan


def slowest_load(series, **limits):
    """As `slow_ocv` of whatever is slowest in a record: a faster full leg is no part of the curve.

    series, limits : arguments of `slow_ocv` without least_hour.

    Returns curve: OcvCurve. Raises Refusal: no leg of the record is full and runs to its cut-off.
    """
    curve = slow_ocv(series, **limits, least_hour=0.0)
    while True:
        sides = abs(curve.discharge_current_ampere), abs(curve.charge_current_ampere)
        slower = SAME_RATE * curve.capacity_ampere_hour / np.nanmax(sides)
        try:
            curve = slow_ocv(series, **limits, least_hour=slower)
        except Refusal:
            return curve


def _at_cutoff(leg, cutoffs):
    """Whether a leg ends at its cut-off, within 3 % of the range of voltage."""
    return leg.sign * (leg.end_volt - cutoffs[leg.sign]) > -_nearly(cutoffs)


def _nearly(cutoffs):
    return 0.03 * (cutoffs[1] - cutoffs[-1])


def _begun(legs, columns, limits, known):
    """Legs of a record, without a first one that does not begin full, or empty; and why not."""
    _, current, voltage, net_charge, _ = columns
    cutoffs, _ = limits
    halves = [
        HalfCycle(
            *(leg.sign, leg.first_row, leg.last_row, leg.capacity_ampere_hour),
            reached=_at_cutoff(leg, cutoffs),
            under_load=abs(current[leg.first_row]) > abs(leg.current_ampere) / 2,
        )
        for leg in legs[:2]
    ]
    if not halves:
        return legs, ""
    about = (current, voltage, net_charge), (cutoffs[-1], cutoffs[1])
    first, after = halves[0], halves[1] if halves[1:] else None
    start = start_of_first(first, after, *about, known)
    if start is None and first.under_load:
        start = start_under_load(first, *about, known.state_before)
    fault = start.fault if start else _fault_of_rest(first, about)
    return (legs[1:], f"its first {NAMES[first.sign]}: {fault}") if fault else (legs, "")


def _fault_of_rest(half, about):
    """Why the rest before a first leg leaves it unfit for a scale of SoC, "" where it does not.

    A scale may err by as much as charge and discharge between the same ends may differ.
    """
    start, moved = start_by_rest(half, None, *about, ()), half.moved_ampere_hour
    if start.fault or start.missing_ampere_hour <= RETURN_SHARE * moved:
        return start.fault
    rest, share = about[0][1][half.first_row], start.missing_ampere_hour / moved
    may = "lack" if half.sign < 0 else "already hold"
    return (
        f"it may not start {ENDS[half.sign]}: by its rest voltage of {rest:.3f} V it may {may} "
        f"{share:.0%} of its charge. State `soc` in tests.tsv if it does start {ENDS[half.sign]}"
    )


def _legs_chosen(columns, limits, known):
    """Branches of a record, its net charge [Ah], and a note: with an offset of the reading.

    An offset of the current counts a discharge and a charge between the same ends unequal. Where
    they differ by 3 % and more, or the lesser is not taken for a full branch, and what the record
    logs at rest makes up for most of it, that is taken off.
    """
    net_charge = columns[3]
    legs, left_out = _begun(legs_of(*columns), columns, limits, known)
    try:
        chosen, refusal = _chosen(legs, *limits), None
    except Refusal as refused:
        chosen, refusal = (None, None), Refusal("; ".join(filter(None, [str(refused), left_out])))
    if left_out and chosen != (None, None):
        return *chosen, net_charge, left_out
    if _closes(chosen):
        return *chosen, net_charge, ""
    if better := _without_offset(columns, limits):
        return better
    if None in chosen and not left_out:
        chosen = _drifted(columns, limits) or chosen
    if refusal is not None and chosen == (None, None):
        raise refusal
    return *chosen, net_charge, ""


def _without_offset(columns, limits):
    """As `_legs_chosen`, what the record logs at rest taken off; None where that is no help."""
    time, current, voltage, net_charge, files = columns
    # A high percentile, not the maximum: a pulse in the record is no slow current.
    largest = float(np.percentile(np.abs(current), 90))
    between = {"least_ampere": 0.005 * largest, "most_ampere": MOST_OFFSET * largest}
    offset = offset_at_rest(time, current, voltage, **between)
    if not offset:
        return None
    corrected = net_charge - offset * (time - time[0]) / 3600.0
    try:
        better = _chosen(legs_of(time, current - offset, voltage, corrected, files), *limits)
    except Refusal:
        return None
    words = f"{1e3 * offset:+.3g} mA, which its rests read, taken off the current"
    note = f"{words}: discharge and charge differed without"
    return (*better, corrected, note) if _closes(better) else None


def _closes(pair):
    """Whether there is a discharge and a charge, and their ampere-hours agree within 3 %."""
    return None not in pair and _unequal(*pair) < CLOSED


def _drifted(columns, limits):
    """Branches of which one is too small for a full one by a drift of the counted charge, or None.

    They end at the cut-offs, and the record at the voltage that it began with: the cell has come
    back to where it was, whatever was counted.
    """
    voltage, legs = columns[2], legs_of(*columns)
    cutoffs, least_hour = limits
    if len(legs) != 2:
        return None
    if abs(voltage[legs[1].last_row] - voltage[legs[0].first_row]) > _nearly(cutoffs):
        return None
    with suppress(Refusal):
        # As unequal as the largest offset makes two legs of one capacity.
        least_share = (1.0 - MOST_OFFSET) / (1.0 + MOST_OFFSET)
        chosen = _chosen(legs, cutoffs, least_hour, least_share=least_share)
        return None if None in chosen else chosen
    return None


def _unequal(discharge, charge):
    """Relative difference of the ampere-hours of both branches."""
    return abs(charge.capacity_ampere_hour / discharge.capacity_ampere_hour - 1.0)


def _chosen(legs, cutoffs, least_hour, *, least_share=0.85):
    """First full slow discharge and the full slow charge after or before it, None if missing."""
    # ASSUME: An OCV record that starts with a discharge starts full, with a charge starts empty,
    # where nothing tells otherwise (`_begun`).
    largest = max((leg.capacity_ampere_hour for leg in legs), default=0.0)
    least = [max(least_share * largest, least_hour * abs(leg.current_ampere)) for leg in legs]
    slow = [
        leg if leg.capacity_ampere_hour > size else None
        for leg, size in zip(legs, least, strict=True)
    ]
    ended = [leg and _at_cutoff(leg, cutoffs) for leg in slow]
    if not any(ended):
        raise Refusal(_why_none(legs, cutoffs, least_hour))
    full = [
        leg if ended[k] or _as_full(leg, slow, ended, k) else None for k, leg in enumerate(slow)
    ]
    neighbours = zip(full, [*full[1:], None], [None, *full[:-1]], strict=True)
    pairs = [(leg, after or before) for leg, after, before in neighbours if leg and leg.sign < 0]
    alone = [(None, leg) for leg in full if leg]
    whole = [pair for pair in pairs if pair[1]]
    return (whole or pairs or alone)[0]


def _as_full(leg, slow, ended, k):
    """Whether leg k, which ends before its cut-off, moves the charge of a full leg next to it.

    A full leg runs from one end to the other by itself; what moves the same charge before or after
    it has been at both ends too, however far its last reading was from the cut-off.
    """
    near = [n for n in (k - 1, k + 1) if leg and 0 <= n < len(slow) and ended[n]]
    return any(_unequal(leg, slow[n]) < CLOSED for n in near)


def _why_none(legs, cutoffs, least_hour):
    """Why no leg of the record is a full slow branch, with the legs that there are."""
    wanted = f"a leg of more than {least_hour:g} h to {cutoffs[-1]:g} V or {cutoffs[1]:g} V"
    legs_found = [
        f"{leg.capacity_ampere_hour:.4g} Ah at {leg.current_ampere:.3g} A to {leg.end_volt:.3f} V"
        for leg in legs
    ]
    return f"no slow full branch: found {'; '.join(legs_found) or 'no current'}; wanted {wanted}"


def _branch(leg, voltage, net_charge, soc):
    """Slow voltage of a leg at the table's SoC, NaN beyond it, and largest correction [V]."""
    # ASSUME: A slow discharge to the lower cut-off ends empty, a slow charge to the upper one
    # full; each branch is scaled to its own ampere-hours, so that losses do not shift the two.
    from scipy.optimize import isotonic_regression

    if leg is None:
        return np.full(len(soc), np.nan), 0.0
    moved = np.abs(net_charge[leg.rows] - net_charge[leg.first_row]) / leg.capacity_ampere_hour
    leg_soc = moved if leg.sign > 0 else 1 - moved
    order = np.argsort(leg_soc, kind="stable")
    measured = voltage[leg.rows][order]
    monotone = isotonic_regression(measured).x
    inside = np.clip(soc, leg_soc.min(), leg_soc.max())
    reached = np.abs(soc - inside) < 0.5 * soc[1]
    means = _cell_means(leg_soc[order], monotone, inside, 0.5 * soc[1])
    return np.where(reached, means, np.nan), np.abs(monotone - measured).max()


def _cell_means(soc, voltage, centre, half_width):
    """Mean voltage over a range of SoC about each centre [V]; ranges shrink towards the ends."""
    area = np.append(0.0, np.cumsum(np.diff(soc) * (voltage[1:] + voltage[:-1]) / 2))
    half = np.minimum(half_width, np.minimum(centre - soc[0], soc[-1] - centre))
    mean = np.diff(np.interp([centre - half, centre + half], soc, area), axis=0)[0]
    wide = half > half_width / 10
    return np.where(wide, mean / np.where(wide, 2 * half, 1.0), np.interp(centre, soc, voltage))


def rising(ocv):
    """Nearest strictly rising table [V]; plateaus rise by a microvolt over the whole range.

    ocv : (n,) over ascending SoC [V].
    """
    from scipy.optimize import isotonic_regression

    # Its inverse is looked up for a rest voltage: a plateau must not have several SoC.
    return isotonic_regression(ocv).x + 1e-6 * np.linspace(0.0, 1.0, len(ocv))


# ASSUME: Where slow discharge and charge differ by more than 3 %, the current sensor has an offset
# or the cell discharges itself: the cell returns what it took, and what is left over grew with
# time. A hold at the end that only feeds a leak then fills nothing.
def _closed(discharge, charge, time, current, net_charge):
    """Branches, net charge [Ah] without the drift that makes them unequal, and that drift [A]."""
    if discharge is None or charge is None or _unequal(discharge, charge) < CLOSED:
        return discharge, charge, net_charge, 0.0
    hours = np.cumsum(np.diff(time, prepend=time[0]) * (current != 0)) / 3600.0
    lasted = sum(hours[leg.last_row] - hours[leg.first_row] for leg in (discharge, charge))
    drift = (charge.capacity_ampere_hour - discharge.capacity_ampere_hour) / lasted
    without = net_charge - drift * hours
    legs = (
        leg._replace(
            capacity_ampere_hour=float(abs(without[leg.last_row] - without[leg.first_row]))
        )
        for leg in (discharge, charge)
    )
    return *legs, without, float(drift)


def _balance(discharge, charge, closed, drift_ampere):
    """Sentence on a difference of charge and discharge above 3 %, and the drift behind it."""
    if not drift_ampere:
        return ""
    leak = ", or as much self-discharge," if drift_ampere > 0 else ""
    return (
        f"slow discharge gave {discharge.capacity_ampere_hour:.4g} Ah, slow charge took "
        f"{charge.capacity_ampere_hour:.4g} Ah; an offset of {1e3 * drift_ampere:+.3g} mA in the "
        f"current reading{leak} would explain it (capacity then "
        f"{closed.capacity_ampere_hour:.4g} Ah)"
    )
