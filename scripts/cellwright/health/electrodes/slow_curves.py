"""Slow curves of a cell, one for each check-up of its life."""

from itertools import pairwise

import numpy as np

from cellwright.health.electrodes.alignment import SlowCurve
from cellwright.protocols.ocv.legs import legs_of
from cellwright.protocols.ocv.slow import slow_ocv
from cellwright.records.conditions import same_rate, same_temperature
from cellwright.refusal import Refusal

LEAST_HOUR = 8.0  # a charge or discharge that takes longer is compared with half cells
GROWN = 0.01  # of the capacity: by less than this a cell may gain from lithium of the overhang
NAMES = ("test_time_second", "current_ampere", "voltage_volt", "charge_ampere_hour")


def slow_curve(
    columns,
    test,
    *,
    cell,
    lower_cutoff_volt,
    upper_cutoff_volt,
    least_hour=LEAST_HOUR,
    mean_hour=1.2,
):
    """Voltage over charge of a slow test: the mean of its branches, or the only one.

    Parameters
    ----------
    columns : mapping of a clean series, (n,) each. test : TestFacts. cell : its name.
    lower_cutoff_volt, upper_cutoff_volt : [V].
    least_hour : a branch is slow if it takes longer than this [h].
    mean_hour : the same where a discharge and a charge of about one rate are averaged, so that
        most of the polarisation drops out [h].

    Returns
    -------
    curve : SlowCurve.

    Raises
    ------
    Refusal : no branch is slow, full and runs to its cut-off.
    """
    limits = {"lower_cutoff_volt": lower_cutoff_volt, "upper_cutoff_volt": upper_cutoff_volt}
    try:
        found = slow_ocv(columns, least_hour=least_hour, **limits)
        branch = {"charge": found.charge_volt, "discharge": found.discharge_volt}
        voltage = branch.get(found.branches, found.ocv_volt)
    except Refusal as refusal:
        # A C/2 pair averages its polarisation out; one branch at that rate does not.
        found, voltage = _mean_of_both(columns, limits, mean_hour, refusal)
    measured = np.isfinite(voltage)
    return SlowCurve(
        *_check_up_of(test, cell),
        current_ampere=float(np.nanmax(_currents(found))),
        soc=found.soc[measured],
        voltage_volt=voltage[measured],
        capacity_ampere_hour=found.capacity_ampere_hour,
        branches=found.branches,
    )


def rest_curve(points, test, *, cell):
    """Open-circuit voltage of a check-up from the rests of its pulse test, one sample a rest.

    For check-ups without a slow charge. Nothing is interpolated between rests: what lies between
    them is not known. Voltages are those at which the rest's exponentials end, where they are told.

    Parameters
    ----------
    points : columns of stage `ocv_rest_points`, (n,) each: soc, charge_ampere_hour, end_volt,
        relaxed_volt, direction, current_ampere.
    test : TestFacts. cell : its name.

    Returns
    -------
    curve : SlowCurve of branches "rests", of the direction with more rests.

    Raises
    ------
    Refusal : fewer than eight rests after loads of one direction, or over less than 60 % of SoC.
    """
    direction = np.asarray(points["direction"]).astype(str)
    counts = {name: int(np.sum(direction == name)) for name in ("discharge", "charge")}
    most = max(counts, key=counts.get)
    soc, charge, end, relaxed, current = (
        np.asarray(points[name], float)
        for name in ("soc", "charge_ampere_hour", "end_volt", "relaxed_volt", "current_ampere")
    )
    voltage = np.where(np.isfinite(relaxed), relaxed, end)
    rows = np.flatnonzero((direction == most) & np.isfinite(voltage))
    rows = rows[np.argsort(soc[rows], kind="stable")]
    # Between a pulse and its counterpart lies no charge worth a second sample.
    rows = rows[np.diff(soc[rows], prepend=-np.inf) > 0.002]
    span = float(np.ptp(soc[rows])) if len(rows) else 0.0
    # Six limits are fitted: a few samples more, over most of the charge, must tell them apart.
    if len(rows) < 8 or span < 0.6:
        raise Refusal(
            f"{len(rows)} rests after {most} over {span:.0%} of SoC; 8 over 60% are needed to "
            "align half cells"
        )
    return SlowCurve(
        *_check_up_of(test, cell),
        current_ampere=float(np.median(np.abs(current[rows]))),
        soc=soc[rows],
        voltage_volt=voltage[rows],
        capacity_ampere_hour=float(np.ptp(charge[rows]) / span),
        branches="rests",
    )


def _check_up_of(test, cell):
    """Cell, test, cycle and temperature of the chamber, the first fields of a SlowCurve."""
    celsius = test.ambient_temperature_celsius
    return cell, test.test, float(test.cycle or 0.0), np.nan if celsius is None else float(celsius)


def _mean_of_both(columns, limits, mean_hour, refusal):
    """A faster discharge and charge, and their mean over SoC; else the refusal of slow ones."""
    try:
        found = slow_ocv(columns, least_hour=mean_hour, **limits)
    except Refusal:
        raise refusal from None
    currents = _currents(found)
    if found.branches != "both" or not same_rate(*currents):
        raise refusal
    return found, _mean_at_equal_charge(found, columns)


def _mean_at_equal_charge(found, columns):
    """Mean of a discharge and a charge over SoC of the discharge [V]; NaN where one is missing.

    Under load the charge ends before the cell is full: the two are laid beside each other by the
    charge counted from where one followed the other. Ends where their gap is more than three times
    the usual are left out.
    """
    files = columns.get("file_index", np.zeros(len(columns["voltage_volt"]), int))
    legs = legs_of(*(np.asarray(columns[name], float) for name in NAMES), np.asarray(files))
    ends = (found.capacity_ampere_hour, found.charge_capacity_ampere_hour)
    rows = [
        min(
            (leg for leg in legs if leg.sign == sign),
            key=lambda leg: abs(leg.capacity_ampere_hour - size),
        ).first_row
        for sign, size in zip((-1, 1), ends, strict=True)
    ]
    share = ends[1] / ends[0]
    charged_soc = found.soc * share + (0.0 if rows[0] < rows[1] else 1 - share)
    known = np.isfinite(found.charge_volt)
    charge = np.interp(
        found.soc, charged_soc[known], found.charge_volt[known], left=np.nan, right=np.nan
    )
    half_gap = (charge - found.discharge_volt) / 2
    usual = np.nanmedian(half_gap[(found.soc > 0.2) & (found.soc < 0.8)])
    return np.where(half_gap < 3 * usual, found.discharge_volt + half_gap, np.nan)


def _currents(found):
    return np.abs([found.discharge_current_ampere, found.charge_current_ampere])


def check_ups(curves):
    """One curve for each check-up, all of one protocol, in order of age, and what was left out.

    What polarisation and hysteresis do to one branch at one current they do to it in the others:
    alike curves are compared. Of several protocols (branches, current, temperature) that counts
    which most check-ups have; of two equal ones a slow curve before rests, the slower, then that
    with both branches.

    Parameters
    ----------
    curves : list of SlowCurve in any order.

    Returns
    -------
    chosen : list of SlowCurve. left_out : list of sentences, on check-ups without that protocol.
    """
    protocols = []
    for curve in sorted(curves, key=lambda one: one.cycle):
        like = [group for group in protocols if alike(group[-1], curve)]
        like[0].append(curve) if like else protocols.append([curve])
    if not protocols:
        return [], []

    def rank(group):
        first = group[0]
        kind = first.branches == "rests", first.current_ampere, first.branches != "both"
        return -len({one.cycle for one in group}), *kind

    best = min(protocols, key=rank)
    chosen = {}
    for curve in best:
        chosen.setdefault(curve.cycle, curve)
    left_out = [
        f"{curve.test}: {_protocol(curve)}, the others {_protocol(best[0])}"
        for curve in curves
        if curve.cycle not in chosen
    ]
    seconds = [curve for curve in best if curve is not chosen[curve.cycle]]
    left_out += [_second(curve, chosen[curve.cycle]) for curve in seconds]
    return list(chosen.values()), [words for words in left_out if words]


def _second(curve, counted):
    """A sentence on a further curve of one cycle whose capacity is not that of the one counted."""
    share = curve.capacity_ampere_hour / counted.capacity_ampere_hour - 1
    if abs(share) <= GROWN:
        return ""
    return (
        f"{curve.test}: a second curve at cycle {curve.cycle:g}, whose capacity is "
        f"{100 * share:+.1f} % off {counted.test}; is its cycle missing in tests.tsv?"
    )


def alike(first, second):
    """Whether two SlowCurves were made by one protocol: branches, rate, temperature.

    The current of a protocol stays as the capacity falls, or falls with it.
    """
    currents = [one.current_ampere for one in (first, second)]
    rates = [one.current_ampere / one.capacity_ampere_hour for one in (first, second)]
    at_one = same_rate(*currents) or same_rate(*rates)
    as_warm = same_temperature(
        first.ambient_temperature_celsius, second.ambient_temperature_celsius
    )
    return first.branches == second.branches and at_one and as_warm


def _protocol(curve):
    words = {"both": "discharge and charge", "rests": "rests between loads"}
    kind = words.get(curve.branches, f"a {curve.branches}")
    celsius = curve.ambient_temperature_celsius
    at = "" if np.isnan(celsius) else f" at {celsius:g} °C"
    return f"{kind} with {curve.current_ampere:.3g} A{at}"


def growth(curves):
    """A sentence for each SlowCurve, by age, whose capacity grew by 1 % since the one before."""
    words = []
    for before, after in pairwise(curves):
        share = after.capacity_ampere_hour / before.capacity_ampere_hour - 1
        if share > GROWN and before.cell == after.cell:
            words.append(
                f"{after.test}: capacity grew by {100 * share:.1f} % since {before.test}; is the "
                "order of the cycles right?"
            )
    return words


def need_two(curves, cell):
    """Raise a Refusal where a cell has fewer than two check-ups, with those that it has."""
    if len(curves) < 2:
        found = ", ".join(f"{curve.test} at cycle {curve.cycle:g}" for curve in curves) or "none"
        raise Refusal(
            f"{cell}: slow curves or rests of one check-up or none ({found}); losses need two, or "
            "a fresh cell of the type marked as reference. Is column `cycle` of tests.tsv filled?"
        )
