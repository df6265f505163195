"""Capacity of a cell from a part of its charge: what was counted between two rests, by the OCV.

A rest tells a state of charge as its voltage lies on the open-circuit voltage. Of the charge that
was counted between two of them, over the part of the scale that they are apart, follows the whole.
"""

from typing import NamedTuple

import numpy as np

from cellwright.numerics.relaxing import still_to_go_volt
from cellwright.protocols.balance import ENDS_VOLT, SIGMAS
from cellwright.protocols.half_cycles import reading_at_rest
from cellwright.protocols.ocv.gap import half_gap, slow_gap
from cellwright.protocols.rests import STEADY
from cellwright.records import inputs
from cellwright.records.anchor import RELAXED_SECOND, REST_VOLT
from cellwright.records.basis import at_cycle, curve_at, stated_std_ampere_hour
from cellwright.records.conditions import SAME_CHECKUP_CYCLES, stated_or_reference
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.edges import edge_variance
from cellwright.settings import Instrument

INSTRUMENT = Instrument()
# ASSUME: The open-circuit voltage moves by 0.3 mV/K and less with temperature (one deviation).
ENTROPIC_VOLT_PER_KELVIN = 3e-4
# What a capacity nobody measured leaves open of itself: no surer is no measurement.
UNSURE_SHARE = stated_std_ampere_hour(1.0)
ENDS = 0.05  # of the SoC scale, by which a curve is continued on either side with its end slopes
POINTS = 11_001  # of a curve: a rest at a steep end tells some 1e-4 of the SoC


TEXTS = ("test", "largest_part", "doubt")
NUMBERS = (
    *("cycle", "ambient_temperature_celsius", "capacity_ampere_hour", "capacity_std_ampere_hour"),
    *("charge_ampere_hour", "soc_first", "soc_first_std", "soc_last", "soc_last_std"),
    *("first_second", "last_second", "rests"),
)
NO_ROWS = {name: np.zeros(0, str) for name in TEXTS} | {name: np.zeros(0) for name in NUMBERS}


class Rests(NamedTuple):
    """Rests of a record that may tell a state of charge, arrays (k,).

    second : test time of the end [s]. charge_ampere_hour : counted there [Ah]. volt, std_volt :
    where it relaxes to, and how sure that is [V]. side : 1 after a charge, −1 after a discharge, 0
    where nothing before it is known. ohm : what it took off the voltage of a constant current
    before it, over that current [Ohm]; NaN after another load.
    """

    second: np.ndarray
    charge_ampere_hour: np.ndarray
    volt: np.ndarray
    std_volt: np.ndarray
    side: np.ndarray
    ohm: np.ndarray


class Placed(NamedTuple):
    """Rests on the scale of a curve: SoC (k,) [1] on the curve and on the branch of its load, what
    each is unsure by, and the slope of the curve there [V]."""

    on_curve: np.ndarray
    on_branch: np.ndarray
    std: np.ndarray
    slope_volt: np.ndarray


def capacity_between_rests(tests, basis, settings=None, **changes):
    """Capacity [Ah] of a cell from parts of its charge: between two rests, by the OCV of its basis.

    tests : (test, series, result of `segment`) each; one that the curve itself is from is left out.
    basis : result of `basis`, or its document. settings : `settings.Instrument`.

    Returns rows, one a test: capacity and its standard deviation [Ah], the charge between the rests
    [Ah], SoC of both with their deviations [1], doubt; empty columns where no test tells a capacity
    so. What tells nothing is in the notes, with the reason. Source: docs/capacity.md.
    """
    options = inputs.settings_of(Instrument, settings, changes)
    known, rows, reasons = inputs.basis(basis), [], {}
    for test, series, steps in tests:
        facts = inputs.test_facts(test)
        columns = inputs.columns(series, *inputs.COUNTED)
        try:
            rows.append(_of_test(columns, inputs.steps(steps), facts, known, **options._asdict()))
        except Refusal as refusal:
            reasons.setdefault(str(refusal), []).append(facts.test)
    notes = tuple(f"{', '.join(tests)}: {reason}" for reason, tests in reasons.items())
    return Result({"rows": rows or NO_ROWS}, notes=notes)


def _of_test(
    series,
    steps,
    facts,
    basis,
    *,
    current_accuracy_share=INSTRUMENT.current_accuracy_share,
    clock_error_share=INSTRUMENT.clock_error_share,
):
    """Capacity from the two rests of a test that tell it best, without a full discharge.

    1. Rests of ten minutes and more count; by as much as their own slope goes on to relax
    (`still_to_go_volt`) they are moved half and unsure by the rest. 2. Each lies between the curve
    and the branch of the load before it: where, is unknown, and the same for all of them. 3. Of
    all pairs that with the least deviation is taken; the rests between it must lie on its line,
    else the deviation is widened by what they scatter. 4. The deviation holds the slope of the
    curve at either rest, temperature, counter, what the directions of the curve's test differ by,
    and, of a curve of another age or cell, what may have become of the charge beyond the rests.

    series : dict of (n,) columns of stage `clean`: test_time_second, current_ampere, voltage_volt,
        charge_ampere_hour, and logged_current_ampere where cleaning took its readings out of rests.
    steps : Steps of the record. facts : TestFacts.
    basis : dict, of whose curves that of the test's age and temperature is taken.
    current_accuracy_share, clock_error_share : as of `settings.Instrument`.

    Returns row of stage `capacity_between_rests`: dict with test, cycle,
    ambient_temperature_celsius, capacity_ampere_hour, capacity_std_ampere_hour, charge_ampere_hour
    between the rests, soc_first, soc_first_std, soc_last, soc_last_std [1], first_second,
    last_second [s], rests (how many were used), largest_part and doubt. Raises Refusal: no curve,
    one that is from this test or knows no capacity of its own, fewer than two rests, a charge
    against the sign of what the rests moved, or a capacity no surer than a rating, with the reason.

    Source: docs/capacity.md.
    """
    at_age, celsius = at_cycle(basis, facts.cycle), facts.ambient_temperature_celsius
    curve = curve_at(at_age["ocv"], celsius)
    if curve is None:
        raise Refusal("no open-circuit voltage is known, so no rest tells a state of charge")
    _refuse_circular(curve, facts.test, str(at_age.get("capacity_source") or ""))
    time, current, voltage, charge = (
        np.asarray(column, float) for column in inputs.quantities(series, inputs.COUNTED)
    )
    rests = long_rests(time, voltage, charge, steps)
    apart = stated_or_reference(celsius) - stated_or_reference(
        curve.get("ambient_temperature_celsius")
    )
    std = np.hypot(rests.std_volt, ENTROPIC_VOLT_PER_KELVIN * apart)
    placed, kept = _placed(rests._replace(std_volt=std), curve)
    rests = Rests(*(column[kept] for column in rests))
    if len(rests.second) < 2:
        raise Refusal(_too_few(rests, kept))
    logged = np.asarray(series.get("logged_current_ampere", current), float)
    off_ampere = np.hypot(
        current_accuracy_share * np.abs(current).max(), reading_at_rest(logged, steps)
    )
    variance = np.append(0.0, np.cumsum(edge_variance(time, current, charge)))
    at_rest = np.searchsorted(time, rests.second)
    counter = off_ampere, clock_error_share, variance[at_rest]
    ages = abs((facts.cycle or 0) - (curve.get("cycle") or 0))
    own = basis.get("borrowed_from") is None and ages <= SAME_CHECKUP_CYCLES
    other = None if own else curve["capacity_ampere_hour"], _scale_share(curve)
    row = _row(rests, placed, counter, _best_pair(rests, placed, counter), other)
    about = ("test", "cycle", "ambient_temperature_celsius")
    return {name: getattr(facts, name) for name in about} | row


def _refuse_circular(curve, test, source):
    """Refuse a curve whose scale says already what the test would; source : of the capacity."""
    if curve.get("test") == test:
        raise Refusal("its own rests are the open-circuit voltage, which tells no other capacity")
    # Curves from rests and loads have their capacity from elsewhere, and say from where.
    of_curve = str(curve.get("capacity_source") or "")
    if of_curve.startswith("long load"):
        raise Refusal("voltage over SoC is known under load alone, no open-circuit voltage")
    if of_curve and "rating" in (of_curve[:6], source[:6]):
        raise Refusal("its open-circuit voltage is scaled by the rating, which would come back")


def long_rests(time, voltage, charge, steps):
    """Rests of ten minutes and more, where each relaxes to, as `Rests`.

    time, voltage, charge : (n,) [s], [V], [Ah]. steps : Steps of the record.
    """
    kind, long = np.asarray(steps.kind), np.asarray(steps.duration_second) >= RELAXED_SECOND
    rows = [_rest(time, voltage, charge, steps, k) for k in np.flatnonzero((kind == "rest") & long)]
    return Rests(*np.array(rows, float).reshape(-1, len(Rests._fields)).T)


def _rest(time, voltage, charge, steps, k):
    """Values of `Rests` of one step."""
    rows = slice(int(steps.first_row[k]), int(steps.last_row[k]) + 1)
    t, v = time[rows], voltage[rows]
    begin = float(time[max(rows.start - 1, 0)]) if k else float(t[0])
    ahead, ahead_std = still_to_go_volt(t, v, begin)
    # What hides in its noise is no motion; how far it may go all the same is in the deviation.
    ahead = ahead if abs(ahead) > SIGMAS * ahead_std else 0.0
    late = t >= t[-1] - 0.02 * (t[-1] - t[0])
    # Of the law's way a few exponentials go none to all.
    std = np.linalg.norm([ENDS_VOLT, ahead / np.sqrt(12.0), ahead_std])
    loads = steps.current_mean_ampere[:k][np.asarray(steps.kind[:k]) != "rest"]
    side = np.sign(loads[-1]) if len(loads) else 0.0
    volt, ohm = np.median(v[late]) + ahead / 2, np.nan
    if k and steps.kind[k - 1] in STEADY:
        ohm = (voltage[rows.start - 1] - volt) / steps.current_mean_ampere[k - 1]
    return t[-1], charge[rows][-1], volt, std, side, ohm


# ASSUME: Before its rest a cell may have had any state of charge alike.
def _placed(rests, curve):
    """`Placed` of those rests (k,) that the curve reaches, and which they are, bool (k,).

    Mean and deviation of all states of charge whose voltage the rest may be: on a plateau many.
    """
    known = rests.ohm[rests.ohm > 0]
    branches = _branches(curve, float(np.median(known)) if len(known) else 0.0)
    ends = list(zip(rests.volt, rests.std_volt, rests.side, strict=True))
    both = [[_soc_of_rest(*one, branches, share) for one in ends] for share in (0.0, 1.0)]
    on_curve, on_branch = (np.array(way).reshape(-1, 2).T for way in both)
    std, middle = np.maximum(on_curve[1], on_branch[1]), (on_curve[0] + on_branch[0]) / 2
    kept = np.isfinite(std)
    soc, ocv, _ = branches
    slope = np.interp(middle, soc, np.gradient(ocv, soc))
    return Placed(*(column[kept] for column in (on_curve[0], on_branch[0], std, slope))), kept


def _soc_of_rest(volt, std_volt, side, branches, share):
    """Mean SoC [1] and deviation of a rest; NaN where no SoC has its voltage.

    share : of the half gap by which it lies towards the branch of its load.
    """
    soc, ocv, gap = branches
    known = np.isfinite(gap)
    size = np.where(known, gap, 0.0)
    # Of an unknown load either branch may hold; of a curve of one direction who knows which.
    open_volt = np.where(known, size * (side == 0), REST_VOLT) / np.sqrt(3.0)
    std = np.hypot(std_volt, open_volt)
    off = (volt - np.maximum.accumulate(ocv + share * side * size)) / std
    if np.abs(off).min() > SIGMAS:
        return np.nan, np.nan
    weight = np.exp(-(off**2 - np.min(off**2)) / 2) / std
    mean = weight @ soc / weight.sum()
    spread = weight @ (soc - mean) ** 2 / weight.sum()
    # Beyond its ends a curve is continued, which tells that there is more but not how much.
    beyond = max(soc[0] + ENDS - mean, mean - soc[-1] + ENDS, 0.0)
    return mean, np.sqrt(spread + (soc[1] - soc[0]) ** 2 / 12.0 + beyond**2 / 3.0)


def _branches(curve, ohm):
    """SoC [1], OCV and half gap [V] of a curve, evenly, and 5 % on with its end slopes.

    Of the gap what comes at once with the current, and what a rest takes off, is none of a rest's.
    ohm : median over the record of what a rest takes off, over the current before it.
    """
    soc, ocv = (np.asarray(curve[name], float) for name in ("soc", "ocv_volt"))
    fine = np.linspace(soc[0] - ENDS, soc[-1] + ENDS, POINTS)
    volt = np.interp(fine, soc, ocv)
    for end, inner in ((0, ENDS / 5), (-1, -ENDS / 5)):
        slope = (np.interp(soc[end] + inner, soc, ocv) - ocv[end]) / inner
        beyond = fine < soc[0] if end == 0 else fine > soc[-1]
        volt = np.where(beyond, ocv[end] + slope * (fine - soc[end]), volt)
    gap_soc, gap = half_gap(curve)
    if not len(gap):
        return fine, volt, np.full(POINTS, np.nan)
    # A curve whose current is not stated keeps its whole gap.
    slow = np.maximum(gap - np.nan_to_num(slow_gap(curve).drop_volt(ohm)), 0.0)
    return fine, volt, np.interp(fine, gap_soc, slow)


def _too_few(rests, kept):
    """Why fewer than two rests tell a state of charge."""
    wanted = f"two of {RELAXED_SECOND / 60:.0f} min and more on the open-circuit voltage"
    beyond = np.count_nonzero(~kept)
    lost = f", {beyond} more that the curve does not reach or tells nothing of" if beyond else ""
    found = f"{len(rests.second)} found{lost}"
    return f"no capacity between two rests: it takes {wanted}, {found}"


def _shares(rests, placed, counter, first, last):
    """Capacity [Ah] of pairs of rests, its parts of relative deviation, and the swing [1].

    first, last : (p,) places of the rests. Parts: at the rests, of the branch, of the counter.
    """
    off_ampere, clock, variance = counter
    swings = [way[last] - way[first] for way in (placed.on_curve, placed.on_branch)]
    swing = np.mean(swings, axis=0)
    moved = rests.charge_ampere_hour[last] - rests.charge_ampere_hour[first]
    hours = (rests.second[last] - rests.second[first]) / 3600.0
    counted = np.linalg.norm([off_ampere * hours, clock * moved], axis=0) / np.sqrt(3.0)
    counted = np.hypot(counted, np.sqrt(variance[last] - variance[first]))
    with np.errstate(divide="ignore", invalid="ignore"):
        at_rests = np.hypot(placed.std[first], placed.std[last]) / np.abs(swing)
        branch = np.abs(swings[1] - swings[0]) / np.sqrt(12.0) / np.abs(swing)
        return moved / swing, (at_rests, branch, counted / np.abs(moved)), swing


def _best_pair(rests, placed, counter):
    """Places of the two rests that tell the capacity with the least relative deviation."""
    count = len(rests.second)
    best = np.inf, 0, count - 1
    for step in range(1, count):
        first = np.arange(count - step)
        size, parts, _ = _shares(rests, placed, counter, first, first + step)
        total = np.where(size > 0, np.linalg.norm(parts, axis=0), np.inf)
        total = np.where(np.isfinite(total), total, np.inf)
        k = int(np.argmin(total))
        best = min(best, (float(total[k]), k, k + step))
    return best[1:]


# ASSUME: If the cell has aged since its OCV curve was measured, the charge beyond the two rests is
# as uncertain as a capacity that was never measured, and may differ by as much again as the charge
# between them has been lost.
def _hidden_share(size, swing, other_ampere_hour):
    """Relative deviation by charge that the rests do not enclose; 0 where the curve is its own."""
    if other_ampere_hour is None:
        return 0.0
    shown = other_ampere_hour / size - 1.0
    return max(1.0 - abs(swing), 0.0) * np.hypot(UNSURE_SHARE, shown)


# ASSUME: Any part of the difference between the two directions of a slow test, from none to all, is
# an error of its ends.
def _scale_share(curve):
    """Relative deviation of a curve's scale from empty to full: 0 of one direction alone."""
    back = curve.get("charge_capacity_ampere_hour")
    if back is None or not np.isfinite(back):
        return 0.0
    return abs(back / curve["capacity_ampere_hour"] - 1.0) / np.sqrt(3.0)


def _row(rests, placed, counter, pair, about):
    """Row of the best pair; refused where it is no surer than a rating.

    about : capacity [Ah] of the curve's own cell or age, None where that is this one, and the
        relative deviation of its scale.
    """
    other_ampere_hour, scale = about
    first, last = pair
    size, parts, swing = _shares(rests, placed, counter, first, last)
    moved = rests.charge_ampere_hour[last] - rests.charge_ampere_hour[first]
    apart = np.hypot(placed.std[first], placed.std[last])
    if not size > 0 and abs(swing) > SIGMAS * apart:
        raise Refusal(
            f"{moved:+.3g} Ah were counted while the rests' SoC moved by {swing:+.3f}: the two "
            "contradict each other"
        )
    scatter, off = _scatter(rests, placed, pair)
    aged = _hidden_share(size, swing, other_ampere_hour)
    parts = dict(zip(PARTS, (parts[0] * scatter, *parts[1:], scale, aged), strict=True))
    share = float(np.linalg.norm(list(parts.values())))
    largest = max(parts, key=parts.get)
    if not size > 0 or not share <= UNSURE_SHARE:
        raise Refusal(_unsure(placed, pair, swing, share, largest))
    soc = (placed.on_curve + placed.on_branch) / 2
    return {
        "capacity_ampere_hour": float(size),
        "capacity_std_ampere_hour": float(size * share),
        "charge_ampere_hour": float(moved),
        "soc_first": float(soc[first]),
        "soc_first_std": float(placed.std[first]),
        "soc_last": float(soc[last]),
        "soc_last_std": float(placed.std[last]),
        "first_second": float(rests.second[first]),
        "last_second": float(rests.second[last]),
        "rests": len(rests.second),
        "largest_part": largest,
        "doubt": off,
    }


PARTS = ("rests", "hysteresis", "counter", "scale of the curve", "ageing of the curve")


def _scatter(rests, placed, pair):
    """Factor (1 and more) by which the rests between a pair scatter about its line, and a doubt."""
    first, last = pair
    soc = (placed.on_curve + placed.on_branch) / 2
    between = np.arange(first + 1, last)
    if not len(between):
        return 1.0, ""
    charge = rests.charge_ampere_hour
    way = (charge[between] - charge[first]) / (charge[last] - charge[first])
    off = soc[between] - soc[first] - way * (soc[last] - soc[first])
    gap = np.abs(placed.on_branch - placed.on_curve) / np.sqrt(12.0)
    std = np.hypot(placed.std, gap)
    line = np.hypot((1 - way) * std[first], way * std[last])
    sigmas = off / np.hypot(std[between], line)
    worst = int(np.argmax(np.abs(sigmas)))
    # Two deviations are to reach the farthest of them.
    factor = max(float(np.sqrt(np.mean(sigmas**2))), float(abs(sigmas[worst])) / SIGMAS, 1.0)
    if abs(sigmas[worst]) <= 3.0:
        return factor, ""
    return factor, (
        f"the rest that ends at {rests.second[between[worst]]:.0f} s lies {off[worst]:+.3f} of the "
        "SoC off the line of the two: the curve is not this cell's of this age, or charge was not "
        "counted"
    )


def _unsure(placed, pair, swing, share, largest):
    """Why a pair of rests tells no capacity, in words."""
    worst = max(pair, key=lambda k: placed.std[k])
    std, slope = placed.std[worst], placed.slope_volt[worst]
    found = f"{share:.0%} of the capacity" if share < 1.0 else "all of the capacity"
    found = f"{found} is left open (a rating leaves {UNSURE_SHARE:.0%})"
    if largest == "ageing of the curve":
        return (
            f"{found}: the curve is another cell's, or of another age, and the rests enclose only "
            f"{abs(swing):.3f} of its SoC"
        )
    if np.hypot(*placed.std[list(pair)]) <= UNSURE_SHARE:
        return f"{found}: the two rests lie only {abs(swing):.3f} of the SoC apart"
    where = (placed.on_curve + placed.on_branch)[worst] / 2
    return (
        f"{found}: the open-circuit voltage is flat at SoC {where:.2f} ({1e3 * slope / 100:.2g} mV "
        f"per %), where a rest tells the SoC within ± {std:.2f}"
    )
