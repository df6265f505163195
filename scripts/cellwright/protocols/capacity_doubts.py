"""What speaks against a capacity: its own rows, the other half of its cycle, the sheet.

Each function gives sentences with their codes (`Said`); none changes a number.
"""

import numpy as np

from cellwright.messages import Said, doubts_in
from cellwright.protocols.balance import LOST_SHARE
from cellwright.protocols.half_cycles import NAMES, NEAR_VOLT, main_load
from cellwright.protocols.messages import say
from cellwright.series.doubts import RATING_SHARE, doubts_said
from cellwright.series.steps import LEAST_HELD_ROWS, constant_current_end, held_quantity

COARSE_SHARE = LOST_SHARE  # of a charge: less that a start or a digit hides is not told
BEYOND_VOLT = 0.03  # a tester ends a load within its own sampling and lead drop of the cut-off
DRIFT_SHARE = 0.02  # within which any tester holds a current; its noise is less in the median
UNFINISHED_C_RATE = 0.1  # a hold that a record ends in above it was not finished
# ASSUME: A good cell gives at least half of its rating: at up to 1.2C from 10 °C on, at up to C/10
# from −20 °C on.
COLD_CELSIUS, FAST_C_RATE = 10.0, 1.2
COLDEST_CELSIUS, SLOW_C_RATE = -20.0, 1 / 10
THERMOMETER_KELVIN = 10.0  # between a thermometer at the start and the stated temperature


def doubts_of(half, partner, row, columns, steps, limits, doubt, sheet):
    """Reasons to distrust the capacity of this half cycle: list of Said.

    Parameters
    ----------
    half : HalfCycle. partner : the complete other half of its cycle, or None. row : what was
        measured of it, with `off` and `digit_of_cycle`, see `balance`, `coarse`.
        columns, steps, limits : as of `half_cycles`.
    doubt : (n,) flags of `series.doubts.Doubt`, or None. sheet : rating [Ah] and temperature
        [degC] as stated, or None each.
    """
    return [
        *_of_its_rows(half, columns, steps, limits, doubt),
        *([] if partner is None else _of_partner(partner, doubt)),
        *(_of_start(half) if _begins_unsure(half) else []),
        *_of_balance(half, partner, row["off"]),
        *_of_digit(row),
        *_of_sheet(row, *sheet),
    ]


def _begins_unsure(half):
    """Whether what a start may lack is more than a cycle's charge differs by anyway."""
    unsure = half.missing_ampere_hour > COARSE_SHARE * half.moved_ampere_hour
    return bool(half.words and (half.under_load or unsure))


def _of_start(half):
    """What an unsure start is known from: list of Said."""
    told = doubts_in({"doubt": half.words, "doubt_codes": half.code})
    return [Said(one, f"half.{one.code}") for one in told]


def _of_its_rows(half, columns, steps, limits, doubt):
    """What the rows of a half cycle themselves say against it, in words."""
    current, voltage, _ = columns
    said = doubts_said(doubt, _own_rows(half))
    # The last row itself may lie anywhere beyond: a steep end between two rows.
    limit, end = limits[half.sign > 0], float(voltage[half.last_row - 1])
    if half.sign * (end - limit) > BEYOND_VOLT:
        said.append(say("capacity.beyond", end=end, limit=limit))
    rows = _constant_rows(half, columns, steps, limit)
    if (drift := _drift(np.abs(current[rows]))) and not held_quantity(current[rows], voltage[rows]):
        said.append(say("capacity.drifts", begun=drift[0], ended=drift[1]))
    left = abs(float(current[-1]))
    if half.last_row == len(current) - 1 and steps.cv_first_row[half.loads[-1]] >= 0:
        said += [say("capacity.unfinished", ampere=left)] * _unfinished(left, half, steps)
    return said


def mode_in_words(half, columns, steps, limits):
    """What a tester held instead of the current, in words; "" where it held the current.

    half : HalfCycle. columns, steps, limits : as of `half_cycles`.
    """
    rows = _constant_rows(half, columns, steps, limits[half.sign > 0])
    current, voltage = (column[rows] for column in columns[:2])
    held = held_quantity(current, voltage) if _drift(np.abs(current)) else ()
    return "at a constant {} of {:.4g} {}".format(*held) if held else ""


def _constant_rows(half, columns, steps, limit):
    """Rows of a half cycle's main load between its edges, before a voltage is held: a slice.

    At or beyond the cut-off [V] a voltage is held, whatever came after it.
    """
    voltage, step = columns[1], main_load(half, steps)[0]
    first, last = int(steps.first_row[step]), int(steps.last_row[step])
    end = constant_current_end(first, last, steps.cv_first_row[step])
    beyond = half.sign * (voltage[first:end] - (np.nan if limit is None else limit))
    end = first + int(np.argmax(np.append(beyond > -NEAR_VOLT, True)))
    return slice(first + 1, max(end - 1, first + 1))  # first and last row may hold the edges


def _drift(size):
    """First and last level of what is held (n,) that moves by more than 2 %; else None."""
    if len(size) < LEAST_HELD_ROWS:
        return None
    eighth = len(size) // 8
    begun, ended = float(np.median(size[:eighth])), float(np.median(size[-eighth:]))
    return (begun, ended) if abs(ended - begun) > DRIFT_SHARE * max(begun, ended) else None


def _own_rows(half):
    """Rows whose flags speak of a half cycle: to the first one after it, where its load ends."""
    return slice(half.first_row, half.last_row + 2)


def _of_partner(partner, doubt):
    """What speaks against the other half of the cycle, and so against the efficiency."""
    return [
        say("capacity.other_half", half=NAMES[partner.sign], what=what)
        for what in doubts_said(doubt, _own_rows(partner))
    ]


def _unfinished(left, half, steps):
    rates = np.abs(steps.c_rate[half.loads[-1]] / (steps.current_mean_ampere[half.loads[-1]] or 1))
    return bool(left * rates > UNFINISHED_C_RATE)


def _of_balance(half, partner, off):
    """That the other half of a cycle moves another charge, in words."""
    if not off > 0:
        return []
    share, moved = off / half.moved_ampere_hour, partner.moved_ampere_hour
    return [say("capacity.balance", half=NAMES[-half.sign], moved=moved, off=off, share=share)]


def _of_digit(row):
    """That the current is read too coarsely, in words: its error is up to √3 of its deviation."""
    share = np.sqrt(3.0) * row["digit_of_cycle"] / row["capacity_ampere_hour"]
    return [say("capacity.coarse", share=share)] if share > COARSE_SHARE else []


def _of_sheet(row, rated, celsius):
    """What the sheet says against a capacity, in words."""
    said = []
    if rated:
        share = row["capacity_ampere_hour"] / rated
        measured = [row["temperature_mean_celsius"], celsius]
        coldest = min((t for t in measured if t is not None and t == t), default=COLD_CELSIUS)
        most = FAST_C_RATE if coldest >= COLD_CELSIUS else SLOW_C_RATE
        slow = row["rate"] / rated <= most and coldest >= COLDEST_CELSIUS
        little = share < RATING_SHARE[0] and slow
        if little or share > RATING_SHARE[1]:
            alike = abs(row["capacity_ampere_hour"] - 1) < 0.1
            name = "c_rates" if alike else "rating"
            said.append(say(f"capacity.{name}", share=share, rated=rated))
    started = row["temperature_start_celsius"]
    if celsius is not None and abs(started - celsius) > THERMOMETER_KELVIN:
        said.append(say("capacity.chamber", started=started, celsius=celsius))
    return said
