"""Numbers of several tests of one cell held against each other: what cannot both be true is said.

A gain of the current or of the clock shows in no record by itself. Two tests of one cell, made
alike at one age and temperature, show it.
"""

from itertools import combinations

import numpy as np

from cellwright.records.anchor import UNRELAXED_VOLT
from cellwright.records.conditions import (
    AT_REST_C_RATE,
    LEAST_ROUND_RATE,
    ROUND_SHARE,
    checkups_of,
    is_round_rate,
    off_round,
    same_rate,
    same_temperature,
)

REPEAT_SHARE = 0.03  # by which one cell's capacity at one rate repeats, over testers and days
SLOWER_SHARE = 0.02  # by which a slower load may give less than a faster one: rests, self-discharge
# ASSUME: Up to 1.2C and from 10 °C on a good cell gives three quarters of what it gives slowly.
LEAST_SHARE, FASTEST_C_RATE, COLDEST_CELSIUS = 0.75, 1.2, 10.0
WARMED_KELVIN = 5.0  # by its own load: a warmer cell gives more
SAME_SOC, RESISTANCE_FACTOR = 0.05, 1.5  # kinetics, direction and rests change a resistance by less
ANY_SOC_FACTOR = 2.0  # the first sample of a pulse hardly hangs on the SoC, but near empty
LEAST_SOC, DELAY_FACTOR = 0.1, 2.0  # the latter also by which a decade of delay adds at most
SIGMAS = 2.0
LEAST_TESTS = 2  # that show which currents a laboratory sets
FINEST_SHARE = 0.003  # by which a tester of class 0.1 % of its range is off a third of that range
LEAST_REPEATS, REPEATED_SHARE = 3, 0.01  # ages at which it sets one current, and reads it so alike


def with_disagreements(rows, *, quantity):
    """Rows of one table of tests, each with what other tests of its cell say against it.

    Parameters
    ----------
    rows : of stage `capacity` or `resistance`, with cell, test, cycle, ambient_temperature_celsius
        and doubt. quantity : "capacity" or "resistance".

    Returns
    -------
    rows, new ones where their `doubt` has grown.
    """
    against, currents = [{} for _ in rows], _currents_of_tests(rows)
    for first, second, same_age, same_celsius in _pairs(rows):
        pair = (rows[first], rows[second]), (rows[second], rows[first])
        said = [_currents(*one, currents) if same_age else "" for one in pair]
        comparing = COMPARING.get((quantity, same_age))
        if comparing and same_celsius and not any(said):
            said = [comparing(*one) for one in pair]
        if any(said):
            against[first][second], against[second][first] = said
    # What more tests speak against is in doubt, not each of them; of two alone both are.
    said = [
        [words for other, words in found.items() if len(against[other]) <= len(found)]
        for found in against
    ]
    return [
        row | {"doubt": _joined(row, words, unusual)}
        for row, words, unusual in zip(rows, said, _unusual_currents(rows, currents), strict=True)
    ]


def _joined(row, words, unusual):
    others = f"{len(words) - 1} more test{'s' if len(words) > 2 else ''}"
    more = [f"and {others} against it"] * (len(words) > 1)
    against = " ".join([*words[:1], *more])
    return "; ".join(filter(None, [row.get("doubt"), against, unusual]))


def _key(row):
    return row["cell"], row["test"]


def _cycled(rows):
    """Tests of many cycles: their capacities differ because the cell ages."""
    cycles = {}
    for row in rows:
        cycles.setdefault(_key(row), set()).add(row["cycle"])
    return {key for key, found in cycles.items() if len(found) > 1}


def _pairs(rows):
    """Numbers of two rows of one cell, direction and delay; whether of one age, one temperature.

    They are of different tests, neither of them one of many cycles.
    """
    cells, cycled = {}, _cycled(rows)
    for number, row in enumerate(rows):
        if _key(row) not in cycled:
            kind = (row["cell"], row["direction"], row.get("delay_second"))
            cells.setdefault(kind, []).append(number)
    for members in cells.values():
        ages = checkups_of([rows[k]["cycle"] for k in members])
        for (first, age), (second, other) in combinations(zip(members, ages, strict=True), 2):
            celsius = (_celsius(rows[k]) for k in (first, second))
            if rows[first]["test"] != rows[second]["test"]:
                yield first, second, age == other, same_temperature(*celsius)


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


# ASSUME: A laboratory sets two tests of one age to one current, or to two that are 5:4 apart.
def _currents(row, other, tests):
    """What the current of another test says against that of one, "" where nothing.

    Not of a single pulse among others of its test, which a limit may have cut short.
    """
    here, there = _ampere(row), _ampere(other)
    if not (here > 0 and there > 0 and same_rate(here, there)):
        return ""
    rates = row["c_rate"], other["c_rate"]
    # Both read zero within their offset; what only a part of the current steps by was not set.
    zero = 2 * AT_REST_C_RATE * max(here / rates[0], there / rates[1])
    alike = abs(here / there / (rates[0] / rates[1]) - 1) <= ROUND_SHARE
    if not alike or abs(here - there) <= ROUND_SHARE * max(here, there) + zero:
        return ""
    if not all(_was_set(one, tests[one["cell"]][one["test"]]) for one in (row, other)):
        return ""
    return f"its current is {here:.4g} A, in {other['test']} {there:.4g} A: set to be the same?"


def _was_set(row, own):
    """Whether the current of a row is a capacity's, of its test's only pulse, or of two of them."""
    if "delay_second" not in row:
        return True
    alike = [
        one
        for one in own
        if (one["direction"], one["delay_second"]) == (row["direction"], row["delay_second"])
    ]
    size = _ampere(row)
    return len(alike) == 1 or (
        sum(abs(_ampere(one) - size) <= ROUND_SHARE * size for one in alike) > 1
    )


def _unusual_currents(rows, tests):
    """In words for each row, that its test's current alone of those of its cell is no round one.

    A gain, a clipping or a rounding of the current makes another of what was set.
    """
    alone = {
        (cell, test)
        for cell, of_cell in tests.items()
        for test in _alone_not_round({test: _off_round(own) for test, own in of_cell.items()})
    }
    return [
        _unusual(row, len(tests[row["cell"]]) - 1)
        if _key(row) in alone
        else _unlike_repeats(row, tests.get(row["cell"], {}))
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


def _unlike_repeats(row, tests):
    """In words, that a capacity's current is not the one that several other tests agree on."""
    if "delay_second" in row or not _ampere(row) > 0:
        return ""
    here, direction = _ampere(row), row["direction"]
    others = [
        one
        for test, own in tests.items()
        for one in own
        if test != row["test"] and one["direction"] == direction
    ]
    alike = [one for one in others if same_rate(_ampere(one), here)]
    # Another rate may have been meant, but then a round one.
    if alike or off_round(row["c_rate"], here) <= ROUND_SHARE:
        others = alike
    # Of one age they show one setting; over ages, that it does not go with the capacity.
    if len({one["cycle"] or 0 for one in others}) < LEAST_REPEATS:
        return ""
    usual = float(np.median([_ampere(one) for one in others]))
    off = [abs(size - usual) > REPEATED_SHARE * usual for size in (here, *map(_ampere, others))]
    if not off[0] or any(off[1:]):
        return ""
    return f"its current is {here:.4g} A, in {len(others)} other tests {usual:.4g} A"


def _unusual(row, others):
    size = f"its current of {_ampere(row):.4g} A ({row['c_rate']:.3g}C)"
    return f"{size} is no round one, as those of {others} other tests of the cell are"


def _celsius(row):
    return row["ambient_temperature_celsius"]


def _capacities(row, other):
    """What another complete capacity of one direction says against one, "" where nothing.

    What a charge takes hangs on how far the discharge before it emptied the cell.
    """
    here, there = row["capacity_ampere_hour"], other["capacity_ampere_hour"]
    spread = _spread(row, other)
    rates, warm = (row["c_rate"], other["c_rate"]), _warm(row) and _warm(other)
    where = f"{other['test']} gives {there:.4g} Ah at {other['c_rate']:.3g}C"
    if same_rate(*rates):
        if row["direction"] == "charge":
            return ""
        apart = abs(here - there) > REPEAT_SHARE * max(here, there) + spread
        return f"{where}, the same rate" if apart else ""
    pair = (row, other) if rates[0] < rates[1] else (other, row)
    slow, fast = (one["capacity_ampere_hour"] for one in pair)
    if not _warmed(*pair[::-1]) and fast > (1 + SLOWER_SHARE) * slow + spread:
        return f"{where}: a slower load gives no less than a faster one"
    if warm and max(rates) <= FASTEST_C_RATE and fast < LEAST_SHARE * slow - spread:
        return f"{where}: no good cell loses so much to its rate"
    return ""


def _ages(row, other):
    """What the capacity at another age says against one: no older cell gives more, nor faster."""
    younger, older = sorted((row, other), key=lambda one: one["cycle"] or 0)
    sizes = [one["capacity_ampere_hour"] for one in (younger, older)]
    more = sizes[1] > (1 + REPEAT_SHARE) * sizes[0] + _spread(row, other)
    # A wrong current is a wrong rate too.
    slower = older["c_rate"] < younger["c_rate"] and not same_rate(
        older["c_rate"], younger["c_rate"]
    )
    if not more or slower or _warmed(older, younger):
        return ""
    there = f"{other['capacity_ampere_hour']:.4g} Ah at cycle {other['cycle'] or 0:g}"
    return f"{other['test']} gives {there}: no older cell gives more"


def _spread(row, other):
    """How far two capacities may lie apart by their standard deviations [Ah]."""
    stds = [one["capacity_std_ampere_hour"] for one in (row, other)]
    return SIGMAS * sum(std**2 for std in stds if std is not None and std == std) ** 0.5


def _warmed(row, other):
    """Whether a cell was warmer by its own load than in another test."""
    here, there = (one["temperature_mean_celsius"] for one in (row, other))
    return _is_number(here, there) and here > there + WARMED_KELVIN


def _warm(row):
    celsius = _celsius(row)
    return not _is_number(celsius) or celsius >= COLDEST_CELSIUS


def _is_number(*values):
    return all(value is not None and value == value for value in values)


# A first sample may have the time of the step itself: no clock of a cycler tells less apart.
LEAST_DELAY_SECOND = 0.01


def _resistances(row, other):
    """What another pulse resistance says against one, at the same delay.

    At the same SoC any two are alike, the first samples of discharges at any SoC. Near empty a few
    per cent of SoC are another resistance. Of first samples that come at other delays the later one
    is the larger: it adds at most as much again a decade.
    """
    socs = row["soc"], other["soc"]
    if _is_number(*socs) and min(socs) < LEAST_SOC:
        return ""
    if wrong := _rests(row, other):
        return wrong
    near = _is_number(*socs) and abs(socs[0] - socs[1]) <= SAME_SOC
    stated = _is_number(_celsius(row), _celsius(other))
    if not near and (row["delay_second"] > 0 or row["direction"] != "discharge" or not stated):
        return ""
    here, there = row["resistance_ohm"], other["resistance_ohm"]
    spread = SIGMAS * (row["resistance_std_ohm"] + other["resistance_std_ohm"])
    factor = RESISTANCE_FACTOR if near else ANY_SOC_FACTOR
    delays = (max(one["actual_delay_second"], LEAST_DELAY_SECOND) for one in (row, other))
    later = np.subtract(*np.log10(list(delays)))
    if (here - there) * later > 0:
        factor *= DELAY_FACTOR ** abs(later)
    if max(here, there) - spread <= factor * min(here, there):
        return ""
    place = f" at {socs[1]:.0%} SoC" if _is_number(socs[1]) else ""
    return f"{other['test']} gives {1e3 * there:.3g} mΩ{place}"


def _rests(row, other):
    """What the rest before another pulse says against that before one, "" where nothing.

    At a higher SoC a cell rests no lower, whatever its hysteresis. Two pulses of one share of the
    rating for their current begin at rest.
    """
    names = ("soc", "voltage_before_volt", "c_rate", "current_ampere")
    known = [[one.get(name) for name in names] for one in (row, other)]
    if not _is_number(*known[0], *known[1]) or 0 in (known[0][2], known[1][2]):
        return ""
    sizes = [abs(current) / rate for _, _, rate, current in known]
    (low, low_volt, *_), (high, high_volt, *_) = sorted(known)
    at_rest = abs(sizes[0] / sizes[1] - 1) <= ROUND_SHARE
    if not at_rest or high - low <= SAME_SOC or low_volt - high_volt <= UNRELAXED_VOLT:
        return ""
    return f"{other['test']} rests at {known[1][1]:.3f} V at {known[1][0]:.0%} SoC"


COMPARING = {
    ("capacity", True): _capacities,
    ("capacity", False): _ages,
    ("resistance", True): _resistances,
}
