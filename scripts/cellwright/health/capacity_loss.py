"""Capacity lost to temperature and rate, split into true and false."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.law import law_row
from cellwright.laws.points import first_check_up
from cellwright.messages import said_of
from cellwright.numerics.statistics import NORMAL_95
from cellwright.records import inputs
from cellwright.records.anchor import tells_repeats
from cellwright.records.conditions import (
    REFERENCE_CELSIUS,
    SAME_CELSIUS,
    grouped_alike,
    same_rate,
    same_temperature,
)
from cellwright.refusal import Refusal
from cellwright.result import Result

MISMATCH_KELVIN = 5.0  # of a cell on average beside its chamber; beyond, it was not tested there
ASSUMED_SHARE = 0.003  # repeats of a capacity test on good cyclers
SLOW_C_RATE = 0.06  # what a test does not reach up to here is truly lost (thesis 4.2: C/30)


class ReachedCapacity(NamedTuple):
    """Mean charge that one direction reaches at one temperature and rate [Ah].

    std : of that mean [Ah]. tests : their names. held_ampere_hour : what a held voltage adds to it,
    or in a slow OCV test what was moved later at another temperature.
    """

    direction: str
    temperature_celsius: float
    c_rate: float
    capacity_ampere_hour: float
    std_ampere_hour: float
    tests: tuple
    held_ampere_hour: float


# ASSUME: What is reached at a temperature is what its constant current moves to the cut-off; what
# a held voltage adds is reached slowly.
def capacity_loss(capacities):
    """Capacity of one cell lost to temperature and rate [%], split into true and false.

    Returns rows: the laws; points: one row a loss [%]. Raises Refusal: no slow test, or fewer than
    two comparable capacities. Source: thesis 4.2; docs/charge-temperature.md.
    """
    losses, notes = capacity_losses(inputs.entries(capacities))
    return Result({"rows": law_rows(losses), "points": losses}, notes=tuple(notes))


def comparable_capacities(rows):
    """Comparable capacities of one cell [Ah], repeats averaged, and what was left out.

    1. Only the earliest check-up: age must not pass for temperature. 2. A row whose cell was
    colder or warmer on average than the chamber is said to be by more than 5 K was not made at that
    temperature, and is left out: a cell of a fast test that warms itself gives more than one of a
    slow test in the cold. 3. Temperatures and rates are one as `conditions` has it; rows of one
    record under two kinds count once.

    Parameters
    ----------
    rows : list of dict, of stage `capacity` with test, cycle and ambient_temperature_celsius.

    Returns
    -------
    points : list of ReachedCapacity, std still that of repeats (NaN for a single test).
    left_out : list of sentences.
    """
    kept, left_out, seen = [], [], set()
    for row in sorted(first_check_up(rows), key=lambda r: r["ambient_temperature_celsius"]):
        stated, measured = row["ambient_temperature_celsius"], row["temperature_mean_celsius"]
        if abs(measured - stated) > MISMATCH_KELVIN:
            where = f"stated {stated:g} °C, the cell was at {measured:.1f} °C"
            left_out.append(f"{row['test']}, {row['direction']}: {where}")
            continue
        # One record under two kinds of tests has the same numbers twice.
        same = (row["direction"], round(row["capacity_ampere_hour"], 9), row["c_rate"])
        if same not in seen:
            seen.add(same)
            kept.append(row)
    return [_joined(repeats) for repeats in grouped_alike(kept, _repeated)], left_out


def _repeated(first, row):
    """Whether a capacity was measured again: direction, temperature and rate."""
    celsius = (one["ambient_temperature_celsius"] for one in (first, row))
    same_direction = first["direction"] == row["direction"]
    return (
        same_direction and same_temperature(*celsius) and same_rate(first["c_rate"], row["c_rate"])
    )


def _joined(rows):
    """Mean capacity of repeated tests and its standard deviation [Ah]."""
    size = np.array([row["constant_current_ampere_hour"] for row in rows])
    held = np.array([row["capacity_ampere_hour"] for row in rows]) - size
    within = rows[0]["capacity_std_ampere_hour"] if tells_repeats(rows[0]) else np.nan
    spread = size.std(ddof=1) if len(rows) > 1 else within
    repeats = len(rows) if len(rows) > 1 else rows[0]["repeats"]
    return ReachedCapacity(
        direction=rows[0]["direction"],
        temperature_celsius=float(np.mean([r["ambient_temperature_celsius"] for r in rows])),
        c_rate=float(np.mean([row["c_rate"] for row in rows])),
        capacity_ampere_hour=float(size.mean()),
        std_ampere_hour=float(spread / np.sqrt(repeats)),
        tests=tuple(row["test"] for row in rows),
        held_ampere_hour=float(held.mean()),
    )


def slowest(points, direction, celsius):
    """Points of a direction at a temperature, slowest first."""
    as_warm = [
        point
        for point in points
        if point.direction == direction and same_temperature(point.temperature_celsius, celsius)
    ]
    return sorted(as_warm, key=lambda point: point.c_rate)


def repeatability(points, reference, *, assumed_share):
    """Standard deviation of one capacity from test to test, as a share of it, in one direction.

    From repeats, and from what physics forbids: a cell that is warmer than the reference and
    moves less slowly than it did there has aged or did not start alike, so the deficit measures
    how well capacities of this cell compare. The larger of that and `assumed_share`.

    Parameters
    ----------
    points : list of ReachedCapacity of one direction. reference : ReachedCapacity.
    assumed_share : [1].

    Returns
    -------
    share : float [1]. reason : where warmer tests gave less, a sentence, else "".
    """
    squares, warm = [], []
    for point in points:
        count = len(point.tests)
        if count > 1:
            relative_std = point.std_ampere_hour / point.capacity_ampere_hour
            squares.append((relative_std**2 * count, count - 1))
        deficit = 1 - point.capacity_ampere_hour / reference.capacity_ampere_hour
        warmer = point.temperature_celsius > reference.temperature_celsius + SAME_CELSIUS
        if not warmer or point.c_rate > SLOW_C_RATE:
            continue
        squares.append((max(deficit, 0.0) ** 2 / 2, 1))
        if deficit > assumed_share:
            warm.append(
                f"{point.direction} at {point.temperature_celsius:g} °C gives "
                f"{100 * deficit:.1f} % less than at the reference, which temperature cannot do: "
                "age or an unequal start, counted as scatter"
            )
    freedom = sum(count for _, count in squares)
    share = np.sqrt(sum(s * count for s, count in squares) / freedom) if freedom else 0.0
    return max(float(share), assumed_share), "; ".join(warm)


def law_rows(losses):
    """Rows of the table of laws over temperature: the true loss of each temperature.

    Parameters
    ----------
    losses : as of `capacity_losses`.

    Raises
    ------
    Refusal : no slow test at any temperature.
    """
    slow = [loss for loss in losses if loss["known"] and loss["c_rate"] == loss["slow_c_rate"]]
    if not slow:
        raise Refusal("no slow test at any temperature, so no true loss is known")
    rates = {}
    for loss in slow:
        name = loss["direction"]
        rates[name] = max(rates.get(name, 0.0), loss["slow_c_rate"])
    return [
        law_row(
            f"true capacity loss, {loss['direction']} at up to {rates[loss['direction']]:.2g}C",
            "split",
            f"at {loss['temperature_celsius']:g} degC",
            loss["true_percent"],
            loss["true_std_percent"],
            unit="%",
        )
        for loss in slow
    ]


def _with_residual_charge(losses):
    """Losses, each charge with the share that the discharge before it left in the cell [%].

    That is what the discharge, and what was drawn after it, lack of the slowest discharge at the
    reference temperature; over the charge's reference.
    """
    discharges = {
        loss["tests"]: loss for loss in losses if loss["direction"] == "discharge" and loss["known"]
    }
    reference = next((one for one in discharges.values() if one["total_percent"] == 0), None)
    if reference is None:
        return losses
    available = reference["reference_ampere_hour"] + reference["held_ampere_hour"]
    for loss in losses:
        discharge = discharges.get(loss["tests"]) if loss["direction"] == "charge" else None
        if discharge:
            left_in = available - discharge["capacity_ampere_hour"] - discharge["held_ampere_hour"]
            loss["left_in_percent"] = 100 * left_in / loss["reference_ampere_hour"]
    return losses


def capacity_losses(rows, *, assumed_share=ASSUMED_SHARE):
    """Loss of capacity at each temperature and rate [%], split into true and false.

    The reference is the slowest capacity at the temperature nearest 25 °C that has a slow test.
    What the slowest test of a temperature, of at most `SLOW_C_RATE`, lacks of it is
    truly lost there, an upper bound as far as even that rate polarises; what a faster test lacks
    beyond it is false. Where a temperature has no slow test the two cannot be told apart: true is
    between what a warmer temperature has truly lost and what a colder one has (a cell does not
    lose less by growing colder), at most all, and without what a held voltage brought back.

    Parameters
    ----------
    rows : list of dict, of stage `capacity` with test, cycle and ambient_temperature_celsius.
    assumed_share : least standard deviation of a capacity from test to test, as a share of it;
        repeats that scatter more raise it [1].

    Returns
    -------
    losses : list of dict as of stage `capacity_loss`, by direction, temperature and rate. True is
        what is not reached even slowly at a temperature, false the rest, polarisation, which comes
        back when slow; each with the limits it lies in: a 95 % interval where the split is known,
        else everything that the tests allow (std NaN). slow_c_rate: of the test that determines
        the true part, NaN where none does. left_in_percent: of a charge, how much of its loss the
        discharge before it in the same test had left in the cell. verdict: true, false, both,
        none; where the split is not known "true or false", or what is sure of it.
    notes : list of sentences on what was left out or is not known.

    Raises
    ------
    Refusal : fewer than two comparable capacities of one direction.

    Source: thesis 3.3 (C/30 at 20, 0 and −20 °C: 31.001, 30.975, 28.820 Ah).
    """
    points, notes = comparable_capacities(rows)
    losses, measured = [], "; ".join(notes)
    for name in ("discharge", "charge"):
        same_direction = [point for point in points if point.direction == name]
        if len(same_direction) < 2:
            continue
        # Slow tests first: a fast reference hides the loss that it has itself.
        able = [point for point in same_direction if point.c_rate <= SLOW_C_RATE] or same_direction
        near = min(able, key=lambda p: abs(p.temperature_celsius - REFERENCE_CELSIUS))
        reference = slowest(able, name, near.temperature_celsius)[0]
        same_direction, slower = _no_slower(same_direction, reference)
        notes += slower
        share, reason = repeatability(same_direction, reference, assumed_share=assumed_share)
        repeat_ampere_hour = share * reference.capacity_ampere_hour
        split, split_notes = _of_direction(same_direction, reference, repeat_ampere_hour)
        losses += split
        notes += [*filter(None, [reason]), *split_notes]
    if not losses:
        reason = measured or "too few were measured"
        raise Refusal(f"fewer than two comparable capacities: {reason}")
    return _with_residual_charge(losses), notes


def _no_slower(points, reference):
    """Points at the reference's rate and faster, and a sentence on each slower one.

    What a slower test moves beyond the reference is its rate's, not its temperature's.
    """
    kept, slower = [], []
    for point in points:
        if point.c_rate < reference.c_rate and not same_rate(point.c_rate, reference.c_rate):
            slower.append(
                f"{point.direction} at {point.temperature_celsius:g} °C and {point.c_rate:.2g}C is "
                f"left out: the slowest at {reference.temperature_celsius:g} °C, which it would be "
                f"held against, has {reference.c_rate:.2g}C"
            )
        else:
            kept.append(point)
    return kept, slower


def _of_direction(points, reference, repeat_ampere_hour):
    """Losses of one direction, coldest last, and a sentence for each temperature without split."""
    points = sorted(points, key=lambda p: (-p.temperature_celsius, p.c_rate))
    true_losses = _true_losses(points, reference, repeat_ampere_hour)
    losses = [_loss(point, reference, true_losses, repeat_ampere_hour) for point in points]
    unknown = sorted({loss["temperature_celsius"] for loss in losses if not loss["known"]})
    wanted = f"no {reference.direction} at up to {SLOW_C_RATE:g}C"
    notes = [
        said_of(f"{wanted} at {c:g} °C", "loss to rate and to temperature not separable")
        for c in unknown
    ]
    if reference.c_rate > SLOW_C_RATE:
        at = f"{wanted} at {reference.temperature_celsius:g} °C: the reference is the one at"
        notes.append(f"{at} {reference.c_rate:.2g}C, so a loss that it has too is not seen")
    return losses, notes


def _true_losses(points, reference, repeat_ampere_hour):
    """Each temperature with a slow test near, that test, its true loss and std [1]."""
    true_losses = []
    for celsius in sorted({point.temperature_celsius for point in points}):
        slow_point = slowest(points, reference.direction, celsius)[0]
        at_reference = same_temperature(celsius, reference.temperature_celsius)
        if slow_point.c_rate <= SLOW_C_RATE or (at_reference and slow_point is reference):
            loss = _relative_loss(reference, slow_point, repeat_ampere_hour)
            true_losses.append((celsius, slow_point, *loss))
    return true_losses


def _relative_loss(start, end, repeat_ampere_hour):
    """Share of the first capacity that the second lacks, and its standard deviation [1]."""
    if start is end:
        return 0.0, 0.0
    # Both capacities scatter; of one and the same nothing is lost, without any error.
    ratio = end.capacity_ampere_hour / start.capacity_ampere_hour
    end_std, start_std = (_std(point, repeat_ampere_hour) for point in (end, start))
    spread = np.hypot(end_std, ratio * start_std)
    return 1 - ratio, spread / start.capacity_ampere_hour


def _std(point, repeat_ampere_hour):
    """Standard deviation of a capacity [Ah]: from repeats, at least the cell's repeatability."""
    measured_std = np.nan_to_num(point.std_ampere_hour)
    return max(measured_std, repeat_ampere_hour / np.sqrt(len(point.tests)))


def _loss(point, reference, true_losses, repeat_ampere_hour):
    """Loss of one capacity against the reference, split where a slow test allows it."""
    whole = reference.capacity_ampere_hour
    total, total_std = _relative_loss(reference, point, repeat_ampere_hour)
    celsius = point.temperature_celsius
    near = (one for one in true_losses if same_temperature(one[0], celsius))
    _, slow, *true_loss = next(near, (celsius, None))
    if slow is None:
        true, false = _bounds(point, reference, true_losses, total, total_std)
    else:
        scale = slow.capacity_ampere_hour / whole
        rest, rest_std = _relative_loss(slow, point, repeat_ampere_hour)
        true, false = _interval(*true_loss), _interval(rest * scale, rest_std * scale)
    names = ["total_percent", "total_std_percent"]
    for part in ("true", "false"):
        names += [f"{part}{end}_percent" for end in ("", "_std", "_lower", "_upper")]
    losses = (100 * value for value in (total, total_std, *true, *false))
    return {
        "direction": point.direction,
        "temperature_celsius": celsius,
        "c_rate": point.c_rate,
        "capacity_ampere_hour": point.capacity_ampere_hour,
        "std_ampere_hour": _std(point, repeat_ampere_hour),
        "held_ampere_hour": point.held_ampere_hour,
        "reference_ampere_hour": whole,
        "reference_celsius": reference.temperature_celsius,
        "slow_c_rate": slow.c_rate if slow else np.nan,
        **dict(zip(names, losses, strict=True)),
        "left_in_percent": np.nan,
        "known": slow is not None,
        "verdict": _verdict(true, false, slow is not None, total > NORMAL_95 * total_std),
        "tests": ";".join(sorted(point.tests)),
    }


def _interval(value, std):
    """Value, standard deviation and 95 % limits."""
    return value, std, value - NORMAL_95 * std, value + NORMAL_95 * std


# ASSUME: A cell does not truly lose less by growing colder.
def _bounds(point, reference, true_losses, total, std):
    """Limits of true and false loss at a temperature without a slow test."""
    least, most = total - NORMAL_95 * std, total + NORMAL_95 * std
    celsius = point.temperature_celsius
    warmer, colder = [0.0], []
    for tested, _, share, share_std in true_losses:
        if tested > celsius:
            warmer.append(share - NORMAL_95 * share_std)
        elif tested < celsius:
            colder.append(share + NORMAL_95 * share_std)
    held = point.held_ampere_hour / reference.capacity_ampere_hour
    # What a held voltage brought back was not truly lost.
    high = max(min([most - held, *colder]), 0.0)
    low = min(max(warmer), high)
    false = (max(least - high, 0.0), max(most - low, 0.0))
    return (np.nan, np.nan, low, high), (np.nan, np.nan, *false)


def _verdict(true, false, split_known, lost):
    """Kind of loss in words; a part counts where its interval lies above zero."""
    parts = int(true[2] > 0), int(false[2] > 0)
    if not split_known and parts == (0, 0):
        return "true or false" if lost else "none"
    names = {(1, 1): "both", (1, 0): "true", (0, 1): "false", (0, 0): "none"}
    return names[parts] + ("" if split_known or parts == (1, 1) else " or both")
