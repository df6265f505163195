"""Which capacities may be compared over temperature, and how well one repeats."""

from typing import NamedTuple

import numpy as np

from cellwright.laws.points import fresh

SAME_CELSIUS = 3.0  # chamber temperatures this near are one
SAME_RATE = 1.12  # rates this near are one (a C/20 is 0.047 to 0.051 over real currents)


class Reached(NamedTuple):
    """Charge that one direction reaches at one temperature and rate, mean over its tests.

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
def reached(rows, *, mismatch_kelvin=5.0, slow_c_rate=0.06):
    """Capacities of one cell, comparable ones only, repeats joined.

    1. Only the earliest check-up: age must not pass for temperature. 2. A row whose cell was
    colder on average than the chamber is said to be by more than `mismatch_kelvin`, or in a slow
    test warmer by as much, was not made at that temperature, and is left out. 3. Temperatures
    within 3 K and rates within 12 % are one; rows of one record under two kinds count once.

    Parameters
    ----------
    rows : list of dict, of stage `capacity` with test, cycle and ambient_temperature_celsius.
    mismatch_kelvin : [K]. slow_c_rate : [1/h].

    Returns
    -------
    points : list of Reached, std still that of repeats (NaN for a single test).
    left_out : list of sentences.
    """
    found, left_out, seen = {}, [], set()
    for row in sorted(fresh(rows), key=lambda r: r["ambient_temperature_celsius"]):
        fault = _fault(row, mismatch_kelvin, slow_c_rate)
        if fault:
            left_out.append(f"{row['test']}, {row['direction']}: {fault}")
            continue
        same = (row["direction"], round(row["capacity_ampere_hour"], 9), row["c_rate"])
        if same not in seen:
            seen.add(same)
            found.setdefault(_key(row, found), []).append(row)
    return [_point(key, mine) for key, mine in found.items()], left_out


def _fault(row, mismatch, slow):
    stated, measured = row["ambient_temperature_celsius"], row["temperature_mean_celsius"]
    off = measured - stated
    wrong = off < -mismatch or (off > mismatch and row["c_rate"] <= slow)
    return f"stated {stated:g} °C, the cell was at {measured:.1f} °C" if wrong else ""


def _key(row, found):
    """The group a row belongs to: one that is near, or a new one of its own."""
    direction, celsius = row["direction"], row["ambient_temperature_celsius"]
    near = [
        key
        for key in found
        if key[0] == direction
        and abs(key[1] - celsius) <= SAME_CELSIUS
        and max(key[2] / row["c_rate"], row["c_rate"] / key[2]) <= SAME_RATE
    ]
    return near[0] if near else (direction, celsius, row["c_rate"])


def _point(key, rows):
    size = np.array([row["constant_current_ampere_hour"] for row in rows])
    held = np.array([row["capacity_ampere_hour"] for row in rows]) - size
    within = [row["capacity_std_ampere_hour"] for row in rows]
    spread = size.std(ddof=1) if len(rows) > 1 else within[0]
    repeats = len(rows) if len(rows) > 1 else rows[0]["repeats"]
    return Reached(
        direction=key[0],
        temperature_celsius=float(np.mean([r["ambient_temperature_celsius"] for r in rows])),
        c_rate=float(np.mean([row["c_rate"] for row in rows])),
        capacity_ampere_hour=float(size.mean()),
        std_ampere_hour=float(spread / np.sqrt(repeats)),
        tests=tuple(row["test"] for row in rows),
        held_ampere_hour=float(held.mean()),
    )


def slowest(points, direction, celsius):
    """Points of a direction at a temperature (within 3 K), slowest first."""
    here = [
        point
        for point in points
        if point.direction == direction and abs(point.temperature_celsius - celsius) <= SAME_CELSIUS
    ]
    return sorted(here, key=lambda point: point.c_rate)


def repeatability(points, reference, *, assumed_share, slow_c_rate):
    """Standard deviation of one capacity from test to test, as a share of it, in one direction.

    From repeats, and from what physics forbids: a cell that is warmer than the reference and
    moves less slowly than it did there has aged or did not start alike, so the deficit measures
    how well capacities of this cell compare. The larger of that and `assumed_share`.

    Parameters
    ----------
    points : list of Reached of one direction. reference : Reached.
    assumed_share, slow_c_rate : [1], [1/h].

    Returns
    -------
    share : float [1]. reason : where warmer tests gave less, a sentence, else "".
    """
    squares, warm = [], []
    for point in points:
        count = len(point.tests)
        if count > 1:
            one = point.std_ampere_hour / point.capacity_ampere_hour
            squares.append((one**2 * count, count - 1))
        deficit = 1 - point.capacity_ampere_hour / reference.capacity_ampere_hour
        warmer = point.temperature_celsius > reference.temperature_celsius + SAME_CELSIUS
        if warmer and point.c_rate <= slow_c_rate:
            squares.append((max(deficit, 0.0) ** 2 / 2, 1))
            warm += [_warm(point, deficit)] if deficit > assumed_share else []
    freedom = sum(count for _, count in squares)
    share = np.sqrt(sum(s * count for s, count in squares) / freedom) if freedom else 0.0
    return max(float(share), assumed_share), "; ".join(warm)


def _warm(point, deficit):
    return (
        f"{point.direction} at {point.temperature_celsius:g} °C gives {100 * deficit:.1f} % less "
        "than at the reference, which warmth cannot do: age or an unequal start, counted as scatter"
    )
