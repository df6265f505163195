"""Legs of a slow test: from one turning point of its counted charge to the next."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.numerics.turns import turning_points
from cellwright.protocols.half_cycles import weighted_median

CELL_SECOND = 120.0  # between two rows: in more the cell relaxes, and a step is no resistance
AT_ONCE_SECOND = 10.0  # in more a cell's own relaxation is in it, not leads and contacts alone


class Leg(NamedTuple):
    """From one turning point of the net charge to the next, and its slow steady current in it.

    sign : 1 charge, −1 discharge. first_row, last_row : the turning points.
    capacity_ampere_hour : between them [Ah]. current_ampere : of the slow part, signed [A].
    rows : rows of the slow part. end_volt : voltage at its last row [V].
    step_in_volt, step_out_volt : jump of the voltage as the slow current starts from rest and
    as it stops [V]; NaN where no row at rest lies next to it. at_once_volt : both, within 10 s.
    conditioned : True if the leg was completed in another file than its slow part.
    """

    sign: int
    first_row: int
    last_row: int
    capacity_ampere_hour: float
    current_ampere: float
    rows: np.ndarray
    end_volt: float
    step_in_volt: float
    step_out_volt: float
    at_once_volt: tuple
    conditioned: bool


def legs_of(test_time_second, current_ampere, voltage_volt, charge_ampere_hour, file_index):
    """Legs of a record between turning points of its charge; pauses and dithers are no turns.

    test_time_second, current_ampere, voltage_volt, charge_ampere_hour : (n,) [s], [A], [V], [Ah].
    file_index : (n,) int, which of the joined files a row is from.

    Returns legs: list of Leg in time order.
    """
    # Cyclers dither about a turn, and a remainder is drawn at another temperature: neither turns.
    turns = turning_points(charge_ampere_hour, least=0.05 * np.ptp(charge_ampere_hour))
    columns = (test_time_second, current_ampere, voltage_volt, charge_ampere_hour, file_index)
    legs = [_leg(first, last, *columns) for first, last in pairwise(turns)]
    return [leg for leg in legs if leg is not None]


def _leg(first, last, time, current, voltage, charge, files):
    """Leg between two turning points; None if no current was recorded there."""
    sign = int(np.sign(charge[last] - charge[first]))
    moved = sign * np.diff(charge[first : last + 1], prepend=charge[first])
    flowing = np.flatnonzero((sign * current[first : last + 1] > 0) & (moved > 0))
    if not len(flowing):
        return None
    amperes, moved = sign * current[first + flowing], moved[flowing]
    slow = _steady_current(amperes, moved)
    steady = np.abs(amperes - slow) < 0.05 * slow
    share = np.bincount(files[first + flowing], moved * steady)
    rows = (first + flowing)[steady & (files[first + flowing] == share.argmax())]
    # Relative to the slow current itself: an offset of the sensor is no small part of it.
    at_rest = np.abs(current) < 0.05 * slow
    ends, about = ((rows[0], rows[0] - 1), (rows[-1], rows[-1] + 1)), (time, voltage, at_rest)
    step_in, step_out = (_jump(*end, *about, within=CELL_SECOND) for end in ends)
    return Leg(
        sign=sign,
        first_row=int(first),
        last_row=int(last),
        capacity_ampere_hour=float(abs(charge[last] - charge[first])),
        current_ampere=float(sign * slow),
        rows=rows,
        end_volt=float(voltage[rows[-1]]),
        step_in_volt=step_in,
        step_out_volt=step_out,
        at_once_volt=tuple(_jump(*end, *about, within=AT_ONCE_SECOND) for end in ends),
        conditioned=bool(files[last] != share.argmax()),
    )


def _steady_current(amperes, moved):
    """Current at which most charge flowed, to 10 % [A]; a tapering hold spreads over many."""
    # Two neighbouring bands, so that a current at the edge of one is not split.
    band = np.floor(np.log(amperes) / np.log(1.1)).astype(int)
    band -= band.min()
    flow = np.append(np.bincount(band, moved), 0.0)
    fullest = (flow[:-1] + flow[1:]).argmax()
    inside = (band == fullest) | (band == fullest + 1)
    return weighted_median(amperes[inside], moved[inside])


def _jump(row, neighbour, time, voltage, at_rest, *, within):
    """Size of the voltage step between a row under current and a row at rest next to it."""
    adjacent = 0 <= neighbour < len(time) and at_rest[neighbour]
    if not adjacent or abs(time[row] - time[neighbour]) > within:
        return np.nan
    return float(abs(voltage[row] - voltage[neighbour]))
