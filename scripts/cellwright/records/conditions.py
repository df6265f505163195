"""When two tests were made alike, and when a cell rests: said once for all rooms.

Each bound lies in the middle between what laboratories call the same and the nearest that they call
another. Where a bound is asked of tests, what their sheet leaves blank has the value stated here.
"""

import numpy as np

from cellwright.settings.tests import Segment

REFERENCE_CELSIUS = 25.0
# Rates that are chosen to differ stand 5:4 apart or more (C/5 and C/4, 1C and 1.25C): the bound is
# the geometric middle of such two. A C/20 is 0.047 to 0.051 C over real ratings and currents.
SAME_RATE = 1.25**0.5
# Temperatures that are chosen to differ stand 5 K apart or more; a chamber, its sensor and what the
# sheet states agree within half of that.
SAME_CELSIUS = 2.5
# States of charge that are chosen to differ stand 5 % apart; those that are set by counting agree
# within half of that.
SAME_SOC = 0.02
# A check-up's own tests are a few cycles; check-ups lie tens of cycles apart.
SAME_CHECKUP_CYCLES = 5.0

# A current channel reads zero within 0.1 % of its range, and spans at most four times the rating.
AT_REST_C_RATE = Segment().rest_c_rate
# The slowest load that is a test of its own is C/30. What a step of rates (5:4) and more below it
# is read is no load: a sensor's offset in a rest, a leak, the noise of one row.
LOW_C_RATE = 1.0 / 30.0 / SAME_RATE**2
# Of the largest current of a record, where no capacity is known to set its readings against.
AT_REST_SHARE = 0.01


def at_rest(current_ampere, capacity_ampere_hour):
    """Whether no current flows: the reading is within C/250 of zero.

    Parameters
    ----------
    current_ampere : number or (n,) [A]. capacity_ampere_hour : of the cell or group [Ah].
    """
    return np.abs(current_ampere) <= AT_REST_C_RATE * capacity_ampere_hour


def low_current(current_ampere, capacity_ampere_hour):
    """Whether a reading is no load, but what a sensor's offset, a leak or noise may be: below C/37.

    Parameters
    ----------
    current_ampere : number or (n,) [A]. capacity_ampere_hour : of the cell or group [Ah].
    """
    return np.abs(current_ampere) <= LOW_C_RATE * capacity_ampere_hour


def at_rest_in_record(current_ampere):
    """Rows (n,) of a record without current: within 1 % of its largest, no capacity being known.

    Parameters
    ----------
    current_ampere : (n,) [A].
    """
    size = np.abs(current_ampere)
    return size <= AT_REST_SHARE * size.max(initial=0.0)


def same_rate(first, second):
    """Whether two rates or currents are one: within a factor of √(5/4), 11.8 %.

    Parameters
    ----------
    first, second : above zero, of one unit; numbers or arrays.
    """
    ratio = np.divide(first, second)
    return (ratio <= SAME_RATE) & (ratio >= 1.0 / SAME_RATE)


# Rates [1/h] that laboratories choose; below C/10 they lie closer than a reading at rest can tell.
ROUND_RATES = np.array(
    [0.01, 1 / 50, 1 / 40, 1 / 30, 1 / 25, 1 / 20, 1 / 15, 1 / 12, 0.1, 1 / 8, 0.15, 0.2, 1 / 4]
    + [0.3, 0.33, 1 / 3, 0.4, 0.5, 0.6, 2 / 3, 0.67, 0.7, 3 / 4, 0.8, 0.9, 1, 1.2, 1.25, 1.5, 2]
    + [2.5, 3, 4, 5, 6, 7, 8, 10]
)
LEAST_ROUND_RATE = 0.1
ROUND_AMPERE = np.array([1, 1.2, 1.25, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 7.5, 8, 9, 10])
ROUND_SHARE = 0.02  # within which any tester holds the current that it is set to


def is_round_rate(rate, current_ampere):
    """Whether a rate is one that laboratories choose, or its current a round one in ampere.

    Parameters
    ----------
    rate : above zero [1/h]. current_ampere : above zero [A].
    """
    slow = rate < LEAST_ROUND_RATE
    near = np.abs(rate - ROUND_RATES) <= ROUND_SHARE * ROUND_RATES + AT_REST_C_RATE
    return bool(slow or np.any(near) or off_round(rate, current_ampere) <= ROUND_SHARE)


def off_round(rate, current_ampere):
    """Share by which a current is off the nearest that laboratories choose, as rate or in ampere.

    Parameters
    ----------
    rate : above zero [1/h]. current_ampere : above zero [A].
    """
    return min(offs_round(rate, current_ampere))


def offs_round(rate, current_ampere):
    """Shares by which a current is off the nearest that laboratories choose as rate, and in ampere.

    Parameters
    ----------
    rate : above zero [1/h]. current_ampere : above zero [A].
    """
    leading = current_ampere / 10 ** np.floor(np.log10(current_ampere))
    pairs = (rate, ROUND_RATES), (leading, ROUND_AMPERE)
    return tuple(float(np.min(np.abs(size / chosen - 1))) for size, chosen in pairs)


def grouped_alike(items, alike):
    """Lists of items, each in the first list whose first member is `alike` to it, else a new one.

    For what is compared with a tolerance: `alike(first, item)` need not be an equivalence.
    """
    groups = []
    for item in items:
        group = next((group for group in groups if alike(group[0], item)), None)
        if group is None:
            groups.append([item])
        else:
            group.append(item)
    return groups


# ASSUME: A test without a stated temperature was made at 25 °C.
def stated_or_reference(celsius):
    """A stated temperature [degC], 25 °C where none is.

    Parameters
    ----------
    celsius : number; None or NaN where not stated.
    """
    return REFERENCE_CELSIUS if celsius is None or celsius != celsius else celsius


def same_temperature(first, second):
    """Whether two temperatures are one: within 2.5 K [degC]; one that is not stated is 25 °C.

    Parameters
    ----------
    first, second : numbers; None or NaN where not stated.
    """
    return abs(stated_or_reference(first) - stated_or_reference(second)) <= SAME_CELSIUS


def same_soc(first, second):
    """Whether two states of charge are one: within 2 %.

    Parameters
    ----------
    first, second : numbers [1].
    """
    return abs(first - second) <= SAME_SOC


# ASSUME: Tests within 5 cycles of each other are of a cell of one age.
def checkups_of(cycles):
    """First cycle of the check-up that each test belongs to, in the order given.

    Parameters
    ----------
    cycles : of the tests; None or NaN, not stated, is a new cell's.

    Returns
    -------
    first : list of cycles: those of tests that follow the first of them within 5 cycles are equal.
    """
    known = [0.0 if cycle is None or cycle != cycle else float(cycle) for cycle in cycles]
    first, begin = {}, -np.inf
    for cycle in sorted(set(known)):
        begin = cycle if cycle > begin + SAME_CHECKUP_CYCLES else begin
        first[cycle] = begin
    return [first[cycle] for cycle in known]


def in_first_checkup(cycles):
    """Whether each test belongs to the earliest check-up among them, a list of bool.

    Parameters
    ----------
    cycles : of the tests; None, not stated, is a new cell's.
    """
    first = checkups_of(cycles)
    return [cycle == min(first) for cycle in first]


def of_first_checkup(tests):
    """Tests of the earliest check-up, and the names of the later ones, which see an aged cell.

    Parameters
    ----------
    tests : list of MeasuredTest.

    Returns
    -------
    first : list of MeasuredTest. later : list of names.
    """
    among = in_first_checkup([test.facts.cycle for test in tests])
    pairs = list(zip(tests, among, strict=True))
    return [t for t, first in pairs if first], [t.facts.test for t, first in pairs if not first]
