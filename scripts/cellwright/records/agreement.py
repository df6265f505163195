"""Numbers of several tests of one cell held against each other: what cannot both be true is said.

A gain of the current or of the clock shows in no record by itself. Two tests of one cell, made
alike at one age and temperature, show it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cellwright.messages import Said, doubt_columns, doubts_in
from cellwright.records.anchor import UNRELAXED_VOLT
from cellwright.records.conditions import (
    AT_REST_C_RATE,
    LEAST_ROUND_RATE,
    ROUND_SHARE,
    SAME_CELSIUS,
    checkups_of,
    is_round_rate,
    off_round,
    offs_round,
    same_rate,
    stated_or_reference,
)
from cellwright.records.messages import say
from cellwright.result import Result

REPEAT_SHARE = 0.03  # by which one cell's capacity at one rate repeats, over testers and days
SLOWER_SHARE = 0.02  # by which a slower load may give less than a faster one: rests, self-discharge
# ASSUME: From 10 °C on, a good cell gives at up to 1.2C at least three quarters of its slow
# capacity.
LEAST_SHARE, FASTEST_C_RATE, COLDEST_CELSIUS = 0.75, 1.2, 10.0
FASTER, WARM_KELVIN = 1.5, 3.0  # a load that warms a cell by less says little of another one
WARMED_KELVIN = 5.0  # by its own load: a warmer cell gives more
SAME_SOC, RESISTANCE_FACTOR = 0.05, 1.5  # kinetics, direction and rests change a resistance by less
ANY_SOC_FACTOR = 2.0  # the first sample of a pulse hardly hangs on the SoC, but near empty
LEAST_SOC, DELAY_FACTOR = 0.1, 2.0  # the latter also by which a decade of delay adds at most
# A first sample may have the time of the step itself: no clock of a cycler tells less apart.
LEAST_DELAY_SECOND = 0.01
SIGMAS = 2.0
LEAST_TESTS = 2  # that show which currents a laboratory sets
FINEST_SHARE = 0.003  # by which a tester of class 0.1 % of its range is off a third of that range
LEAST_REPEATS, REPEATED_SHARE = 3, 0.01  # ages at which it sets one current, and reads it so alike


class Compared(NamedTuple):
    """What is compared of the rows of one cell, direction and delay: each (n,), or of one row.

    NaN where not known. test : its number. age : first cycle of its check-up. reference_celsius :
    as stated, 25 where it is not [degC]. ampere : size of the current that was set [A]; was_set :
    whether it was, see `_were_set`. charging : bool. spread_square : variance of a capacity [Ah²].
    log_delay : decades of the true delay in seconds. All others as in the table.
    """

    test: np.ndarray
    age: np.ndarray
    cycle: np.ndarray
    celsius: np.ndarray
    reference_celsius: np.ndarray
    ampere: np.ndarray
    was_set: np.ndarray
    charging: np.ndarray
    c_rate: np.ndarray
    current_ampere: np.ndarray
    capacity_ampere_hour: np.ndarray
    spread_square: np.ndarray
    temperature_mean_celsius: np.ndarray
    soc: np.ndarray
    delay_second: np.ndarray
    log_delay: np.ndarray
    resistance_ohm: np.ndarray
    resistance_std_ohm: np.ndarray
    voltage_before_volt: np.ndarray

    def at(self, rows):
        """One row by its number, or some by a slice."""
        return Compared(*(column[rows] for column in self))


class Rule(NamedTuple):
    """What two rows of different tests must not do.

    same_age : whether it holds for tests of one age, or of two. broken : function (Compared of one
    row, Compared of others) → (n,) bool, whether these speak against that one. words : function
    (row, other) → Said.
    """

    same_age: bool
    broken: Callable
    words: Callable


def disagreements(rows, *, quantity):
    """Rows of several tests, each with what the other tests of its cell say against it in `doubt`.

    rows : of `capacity` or `resistance`, with cell, test, cycle and ambient_temperature_celsius.
    quantity : "capacity" or "resistance".

    Returns rows, new ones where their `doubt` has grown. What cannot both be true of one cell of
    one age is told: a gain of the current or the clock shows in no record by itself.
    Source: docs/capacity.md.
    """
    currents, said = _currents_of_tests(rows), [("", 0)] * len(rows)
    were_set = _were_set(rows)
    for members in _comparable(rows):
        group = [rows[number] for number in members]
        compared = _columns(group, were_set[members])
        for number, against in zip(members, _against(group, compared, quantity), strict=True):
            said[number] = against
    unusual = _unusual_currents(rows, currents)
    told = [
        row | doubt_columns([*doubts_in(row), _with_more(*against), words])
        for row, against, words in zip(rows, said, unusual, strict=True)
    ]
    return Result({"rows": told})


def _with_more(words, tests):
    """What so many tests say against a row, in the words of one of them; "" where none does."""
    if tests < 2:
        return words
    name = "more_one" if tests == 2 else "more_many"
    return Said(say(f"against.{name}", what=words, tests=tests - 1), words.code)


def _against(group, compared, quantity):
    """Of each row the words of the first other one against it, and how many there are.

    What more tests speak against is in doubt, not each of them; of two alone both are.
    """
    rules = CURRENTS, *RULES.get(quantity, ())
    pairs = [_broken_with_later(compared, number, rules) for number in range(len(group))]
    first, second, forth, back = np.concatenate(pairs, axis=1)
    row, other, rule = np.r_[first, second], np.r_[second, first], np.r_[forth, back]
    many = np.bincount(row, minlength=len(group))
    kept = np.flatnonzero(many[other] <= many[row])
    kept = kept[np.lexsort((other[kept], row[kept]))]
    rows, begins, sizes = np.unique(row[kept], return_index=True, return_counts=True)
    said = [("", 0)] * len(group)
    for k, one, tests in zip(rows, kept[begins], sizes, strict=True):
        # Where rules are not quite even-handed one of two may have nothing to say.
        words = rules[rule[one]].words(group[k], group[other[one]]) if rule[one] >= 0 else ""
        said[k] = words, int(tests)
    return said


def _broken_with_later(compared, number, rules):
    """Rules that a row and later ones break: its number, theirs, rule against it, and them (4, p).

    A rule is its number, −1 where none. One row is held against all at once: of thousands of pulses
    there are millions of pairs.
    """
    here, there = compared.at(number), compared.at(slice(number + 1, None))
    others, same_age = there.test != here.test, there.age == here.age
    alike = np.abs(there.reference_celsius - here.reference_celsius) <= SAME_CELSIUS
    with np.errstate(all="ignore"):
        pair = (here, there), (there, here)
        set_apart = np.array([CURRENTS.broken(*one) & same_age & others for one in pair])
        asked = others & alike & ~set_apart.any(axis=0)
        broken = np.where(set_apart, 0, -1)
        # The first rule that is broken is the one that is told.
        for k, rule in reversed(list(enumerate(rules))[1:]):
            of_age = asked & (same_age == rule.same_age)
            if of_age.any():
                broken[np.array([rule.broken(*one) for one in pair]) & of_age] = k
    found = np.flatnonzero((broken >= 0).any(axis=0))
    return np.stack([np.full(len(found), number), found + number + 1, *broken[:, found]])


def _columns(group, were_set):
    """Compared of the rows of one cell, direction and delay."""

    def column(name):
        return np.array([_number(row.get(name)) for row in group])

    numbers = {test: number for number, test in enumerate(dict.fromkeys(r["test"] for r in group))}
    return Compared(
        test=np.array([numbers[row["test"]] for row in group]),
        age=np.array(checkups_of([row["cycle"] for row in group])),
        cycle=np.nan_to_num(column("cycle")),
        celsius=column("ambient_temperature_celsius"),
        reference_celsius=np.array([stated_or_reference(_celsius(row)) for row in group]),
        ampere=np.array([_ampere(row) for row in group]),
        was_set=were_set,
        charging=np.array([row["direction"] == "charge" for row in group]),
        spread_square=np.nan_to_num(column("capacity_std_ampere_hour")) ** 2,
        log_delay=np.log10(np.maximum(column("actual_delay_second"), LEAST_DELAY_SECOND)),
        **{name: column(name) for name in SHARED},
    )


MADE = {"test", "age", "cycle", "celsius", "reference_celsius", "ampere", "was_set", "charging"}
SHARED = [name for name in Compared._fields if name not in MADE | {"spread_square", "log_delay"}]


def _number(value):
    return float("nan") if value is None else float(value)


def _key(row):
    return row["cell"], row["test"]


def _cycled(rows):
    """Tests of many cycles: their capacities differ because the cell ages."""
    cycles = {}
    for row in rows:
        cycles.setdefault(_key(row), set()).add(row["cycle"])
    return {key for key, found in cycles.items() if len(found) > 1}


def _comparable(rows):
    """Numbers of the rows of each cell, direction and delay, without tests of many cycles."""
    cells, cycled = {}, _cycled(rows)
    for number, row in enumerate(rows):
        if _key(row) not in cycled:
            kind = (row["cell"], row["direction"], row.get("delay_second"))
            cells.setdefault(kind, []).append(number)
    return list(cells.values())


def _ampere(row):
    """Size of the current that a test was set to [A], NaN where not known."""
    current = row.get("current_ampere", row.get("mean_current_ampere"))
    return abs(current) if _is_number(current, row.get("c_rate")) else float("nan")


def _currents_of_tests(rows):
    """Rows of each cell's tests, by cell and test, those of no known current left out."""
    found = {}
    for row in rows:
        if _ampere(row) > 0:
            found.setdefault(row["cell"], {}).setdefault(row["test"], []).append(row)
    return found


def _were_set(rows):
    """Whether the current of each row is a capacity's, its test's only pulse, or two pulses' (n,).

    A single pulse among others of its test a limit may have cut short.
    """
    found, pulses = np.array([_ampere(row) > 0 for row in rows], bool), {}
    for number in np.flatnonzero(found):
        row = rows[number]
        if "delay_second" in row:
            kind = (*_key(row), row["direction"], row["delay_second"])
            pulses.setdefault(kind, []).append(number)
    for numbers in pulses.values():
        sizes = np.array([_ampere(rows[number]) for number in numbers])
        if len(numbers) > 1:
            found[numbers] = [
                np.sum(np.abs(sizes - size) <= ROUND_SHARE * size) > 1 for size in sizes
            ]
    return found


# ASSUME: A laboratory sets two tests of one age to one current, or to two that are 5:4 apart.
def _set_apart(here, there):
    """Two currents that were set to be one and are not."""
    rates = here.c_rate / there.c_rate
    alike = same_rate(here.ampere, there.ampere)
    alike = alike & (np.abs(here.ampere / there.ampere / rates - 1) <= ROUND_SHARE)
    # Both read zero within their offset; what only a part of the current steps by was not set.
    zero = 2 * AT_REST_C_RATE * np.maximum(here.ampere / here.c_rate, there.ampere / there.c_rate)
    off = ROUND_SHARE * np.maximum(here.ampere, there.ampere) + zero
    return alike & (np.abs(here.ampere - there.ampere) > off) & here.was_set & there.was_set


def _set_apart_in_words(row, other):
    here, there = _ampere(row), _ampere(other)
    return say("against.current", here=here, test=other["test"], there=there)


def _unusual_currents(rows, tests):
    """In words for each row, that its test's current alone of those of its cell is no round one.

    A gain, a clipping or a rounding of the current makes another of what was set.
    """
    alone = {
        (cell, test)
        for cell, of_cell in tests.items()
        for test in {
            *_alone_not_round({test: _off_round(own) for test, own in of_cell.items()}),
            *_alone_set_otherwise({test: _set_by(own) for test, own in of_cell.items()}),
        }
    }
    repeats = {cell: _repeats(of_cell) for cell, of_cell in tests.items()}
    return [
        _unusual(row, len(tests[row["cell"]]) - 1)
        if _key(row) in alone
        else _unlike_repeats(row, repeats.get(row["cell"], {}).get(row["direction"]))
        for row in rows
    ]


def _off_round(own):
    """Whether the rows of a test are of round currents, and the share by which they are off them.

    NaN where all are so slow that what the ammeter reads at rest makes another rate of them.
    """
    offs = [
        off_round(row["c_rate"], _ampere(row)) for row in own if row["c_rate"] >= LEAST_ROUND_RATE
    ]
    are_round = sum(is_round_rate(row["c_rate"], _ampere(row)) for row in own) >= len(own) / 2
    return are_round, float(np.median(offs)) if offs else np.nan


def _alone_not_round(found):
    """Tests (test → `_off_round`) whose current alone is no round one, or not as near to it.

    How near a tester comes to what it is set to the others show: twice their largest share is none.
    """
    for test, (are_round, off) in found.items():
        others = [other for name, other in found.items() if name != test]
        if len(others) < LEAST_TESTS or not all(round_too for round_too, _ in others):
            continue
        known = [share for _, share in others if share == share]
        finer = max(FINEST_SHARE, 2 * max(known, default=np.inf))
        if not are_round or (len(known) >= LEAST_REPEATS and off > finer):
            yield test


def _set_by(own):
    """Whether most rows of a test are of round C-rates, and whether of round ampere: two bools.

    None where all are so slow that what the ammeter reads at rest makes another rate of them.
    """
    fast = [(row["c_rate"], _ampere(row)) for row in own if row["c_rate"] >= LEAST_ROUND_RATE]
    if not fast:
        return None
    offs = np.array([offs_round(*row) for row in fast])
    return tuple(np.mean(offs <= ROUND_SHARE, axis=0) >= 0.5)


def _alone_set_otherwise(found):
    """Tests (test → `_set_by`) that alone are not set by C-rate, or by ampere, as the others are.

    A current of 5 A is no round one where all others are C/2 and 1C of 2.6 Ah.
    """
    for test, own in found.items():
        others = [by for name, by in found.items() if name != test and by is not None]
        for one in (0, 1):
            # Those that are round either way tell nothing.
            told = sum(by[one] and not by[1 - one] for by in others)
            if own and not own[one] and told >= LEAST_TESTS and all(by[one] for by in others):
                yield test


def _unlike_repeats(row, others):
    """In words, that a capacity's current is not the one that several other tests agree on.

    others : Repeats of the cell's capacities in this direction.
    """
    if "delay_second" in row or not _ampere(row) > 0:
        return ""
    here = _ampere(row)
    elsewhere = others.test != others.numbers[row["test"]]
    alike = elsewhere & same_rate(others.ampere, here)
    # Another rate may have been meant, but then a round one.
    if alike.any() or off_round(row["c_rate"], here) <= ROUND_SHARE:
        elsewhere = alike
    # Of one age they show one setting; over ages, that it does not go with the capacity.
    if len(np.unique(others.cycle[elsewhere])) < LEAST_REPEATS:
        return ""
    amperes = others.ampere[elsewhere]
    usual = float(np.median(amperes))
    off = np.abs(np.append(here, amperes) - usual) > REPEATED_SHARE * usual
    if not off[0] or off[1:].any():
        return ""
    return say("against.unlike_repeats", here=here, tests=len(amperes), usual=usual)


class Repeats(NamedTuple):
    """Currents [A], cycles and tests (n,) of one cell's rows in one direction; numbers of tests."""

    ampere: np.ndarray
    cycle: np.ndarray
    test: np.ndarray
    numbers: dict


def _repeats(tests):
    """Repeats of each direction of a cell, from the rows of its tests."""
    rows = [row for own in tests.values() for row in own]
    numbers, found = {test: number for number, test in enumerate(tests)}, {}
    for direction in dict.fromkeys(row["direction"] for row in rows):
        own = [row for row in rows if row["direction"] == direction]
        columns = ([_ampere(r) for r in own], [r["cycle"] or 0 for r in own])
        test = np.array([numbers[row["test"]] for row in own])
        found[direction] = Repeats(*map(np.array, columns), test, numbers)
    return found


def _unusual(row, others):
    return say("against.not_round", ampere=_ampere(row), c_rate=row["c_rate"], tests=others)


def _celsius(row):
    return row["ambient_temperature_celsius"]


def _is_number(*values):
    return all(value is not None and value == value for value in values)


def _apart(here, there, share):
    """Whether capacities lie apart by more than a share and their standard deviations."""
    first, second = here.capacity_ampere_hour, there.capacity_ampere_hour
    return np.abs(first - second) > share * np.maximum(first, second) + _spread(here, there)


def _spread(here, there):
    """How far two capacities may lie apart by their standard deviations [Ah]."""
    return SIGMAS * (here.spread_square + there.spread_square) ** 0.5


def _repeats_apart(here, there):
    """Two capacities at one rate; what a charge takes hangs on the discharge before it."""
    return same_rate(here.c_rate, there.c_rate) & ~here.charging & _apart(here, there, REPEAT_SHARE)


def _slow_and_fast(here, there, name):
    """A column of that of two tests which was slower, and of the other."""
    slower, one, other = here.c_rate < there.c_rate, getattr(here, name), getattr(there, name)
    return np.where(slower, one, other), np.where(slower, other, one)


def _slower_gives_less(here, there):
    slow, fast = _slow_and_fast(here, there, "capacity_ampere_hour")
    cool, warm = _slow_and_fast(here, there, "temperature_mean_celsius")
    more = fast > (1 + SLOWER_SHARE) * slow + _spread(here, there)
    # By its own load a cell may be so much warmer that it gives more.
    return more & ~same_rate(here.c_rate, there.c_rate) & ~(warm > cool + WARMED_KELVIN)


def _lost_to_rate(here, there):
    slow, fast = _slow_and_fast(here, there, "capacity_ampere_hour")
    warm = ~(here.celsius < COLDEST_CELSIUS) & ~(there.celsius < COLDEST_CELSIUS)
    usual = np.maximum(here.c_rate, there.c_rate) <= FASTEST_C_RATE
    little = fast < LEAST_SHARE * slow - _spread(here, there)
    return warm & usual & little & ~same_rate(here.c_rate, there.c_rate)


# ASSUME: Losses grow with the square of the current; at 1.5 times the current they double.
def _warms_less(here, there):
    """A faster load warms a cell, above its chamber, by less than half of what a slower one did."""
    first, second = (one.temperature_mean_celsius - one.celsius for one in (here, there))
    here_faster = here.c_rate > there.c_rate
    fast, slow = np.where(here_faster, first, second), np.where(here_faster, second, first)
    ratio = np.maximum(here.c_rate, there.c_rate) / np.minimum(here.c_rate, there.c_rate)
    return (ratio >= FASTER) & (slow > WARM_KELVIN) & (fast < slow / 2)


def _older_gives_more(here, there):
    """No older cell gives more, nor faster; a wrong current is a wrong rate too."""
    here_older = here.cycle > there.cycle

    def of_ages(name):
        one, other = getattr(here, name), getattr(there, name)
        return np.where(here_older, other, one), np.where(here_older, one, other)

    young, old = of_ages("capacity_ampere_hour")
    rate, old_rate = of_ages("c_rate")
    cool, warm = of_ages("temperature_mean_celsius")
    more = old > (1 + REPEAT_SHARE) * young + _spread(here, there)
    slower = (old_rate < rate) & ~same_rate(old_rate, rate)
    return more & ~slower & ~(warm > cool + WARMED_KELVIN)


def _of_capacity(name):
    """Words of a rule that two capacities break: function (row, other) → Said."""

    def words(_row, other):
        return say(
            f"against.{name}",
            test=other["test"],
            ampere_hour=other["capacity_ampere_hour"],
            c_rate=other["c_rate"],
            cycle=other["cycle"] or 0,
            celsius=other["temperature_mean_celsius"],
        )

    return words


def _near_empty(here, there):
    """Where a few per cent of SoC are another resistance."""
    return np.minimum(here.soc, there.soc) < LEAST_SOC


def _resistances_apart(here, there):
    """Resistances of two pulses at the same delay.

    At the same SoC any two are alike, the first samples of discharges at any SoC. Of first samples
    that come at other delays the later one is the larger: it adds at most as much again a decade.
    """
    near = np.abs(here.soc - there.soc) <= SAME_SOC
    stated = (here.celsius == here.celsius) & (there.celsius == there.celsius)
    anywhere = ~(here.delay_second > 0) & ~here.charging & stated
    first, second = here.resistance_ohm, there.resistance_ohm
    later = here.log_delay - there.log_delay
    factor = np.where(near, RESISTANCE_FACTOR, ANY_SOC_FACTOR)
    factor = factor * DELAY_FACTOR ** np.where((first - second) * later > 0, np.abs(later), 0.0)
    least, most = np.minimum(first, second), np.maximum(first, second)
    spread = SIGMAS * (here.resistance_std_ohm + there.resistance_std_ohm)
    return (near | anywhere) & ~_near_empty(here, there) & ~(most - spread <= factor * least)


def _resistance_in_words(_row, other):
    name = "resistance_at" if _is_number(other["soc"]) else "resistance"
    about = {"test": other["test"], "soc": other["soc"]}
    return say(f"against.{name}", milliohm=1e3 * other["resistance_ohm"], **about)


def _rests_lower(here, there):
    """At a higher SoC a cell rests no lower, whatever its hysteresis.

    Two pulses of one share of the rating for their current begin at rest.
    """
    sizes = [np.abs(one.current_ampere) / one.c_rate for one in (here, there)]
    at_rest = (np.abs(sizes[0] / sizes[1] - 1) <= ROUND_SHARE) & (here.c_rate * there.c_rate != 0)
    higher = np.where(here.soc > there.soc, 1.0, -1.0)
    above = higher * (here.voltage_before_volt - there.voltage_before_volt)
    apart = np.abs(here.soc - there.soc) > SAME_SOC
    return at_rest & apart & (-above > UNRELAXED_VOLT) & ~_near_empty(here, there)


def _rest_in_words(_row, other):
    volt, soc = other["voltage_before_volt"], other["soc"]
    return say("against.rest", test=other["test"], volt=volt, soc=soc)


CURRENTS = Rule(True, _set_apart, _set_apart_in_words)  # whatever the temperature
RULES = {  # of tests at one temperature, in the order in which they are told
    "capacity": (
        Rule(True, _repeats_apart, _of_capacity("repeat")),
        Rule(True, _slower_gives_less, _of_capacity("slower_gives_less")),
        Rule(True, _lost_to_rate, _of_capacity("lost_to_rate")),
        Rule(True, _warms_less, _of_capacity("warms_less")),
        Rule(False, _older_gives_more, _of_capacity("older_gives_more")),
    ),
    "resistance": (
        Rule(True, _rests_lower, _rest_in_words),
        Rule(True, _resistances_apart, _resistance_in_words),
    ),
}
