"""The points over temperature that laws are fitted to, from the tables of tests."""

from itertools import product
from typing import NamedTuple

import numpy as np

from cellwright.messages import Said, doubt_columns, doubts_in, said_of
from cellwright.records.conditions import SAME_SOC, in_first_checkup, same_rate
from cellwright.settings import Temperature

TEMPERATURE = Temperature()
PREFERRED_C_RATE = 1.0  # of pulses, where several rates reach as many temperatures: the usual one


class Point(NamedTuple):
    """One quantity at one temperature; `quantity` says what, at which SoC, delay and rate.

    std : of the value from its own measurement, NaN where not known. family : quantities that
    differ in SoC only. soc : NaN where the quantity has none. doubts : what speaks against the
    tests that it is from, each by its name.
    """

    quantity: str
    unit: str
    temperature_celsius: float
    value: float
    std: float = np.nan
    family: str = ""
    soc: float = np.nan
    doubts: tuple = ()


def doubts_of_test(row):
    """What speaks against a row of a test, with the test's name where it has one: tuple of Said."""
    test = row.get("test")
    return tuple(Said(f"{test}: {one}" if test else one, one.code) for one in doubts_in(row))


def rows_of_points(points):
    """Points as rows of a table: list of dict, what speaks against each as columns of doubt.

    Parameters
    ----------
    points : list of Point, or of a cell's point among those of its type.
    """
    rows = [point._asdict() for point in points]
    return [row | doubt_columns(row.pop("doubts")) for row in rows]


def point_of(row):
    """Point of a row of such a table."""
    known = {name: row[name] for name in Point._fields if name in row}
    return Point(**known, doubts=tuple(doubts_in(row)))


def capacity_points(rows):
    """Points of discharge capacity at each temperature [Ah], one quantity per rate.

    Parameters
    ----------
    rows : list of dict, rows of stage `capacity` with ambient_temperature_celsius and cycle.
    """
    points, rates = [], []
    # Sorted, so that names of rates do not depend on the order of the files.
    for row in sorted(
        first_check_up(rows), key=lambda r: (r["ambient_temperature_celsius"], r["c_rate"])
    ):
        if row["direction"] != "discharge":
            continue
        rate = _rate_seen(row["c_rate"], rates)
        celsius, value = row["ambient_temperature_celsius"], row["capacity_ampere_hour"]
        quantity = f"capacity at {rate:.2g}C"
        about = {"family": "capacity", "doubts": doubts_of_test(row)}
        points.append(Point(quantity, "Ah", celsius, value, **about))
    return points


def _rate_seen(rate, rates, *, or_less=False):
    """First rate seen so far that is the same, or not less; else the rate, which is added."""
    match = next(
        (seen for seen in rates if same_rate(rate, seen) or (or_less and rate < seen)), None
    )
    if match is None:
        rates.append(rate)
    return match or rate


def impedance_points(rows):
    """Ohmic and charge-transfer resistance of fitted circuits [ohm] at each SoC and temperature.

    Parameters
    ----------
    rows : list of dict, rows of stage `eis` with ambient_temperature_celsius, soc and cycle of the
        sheet. The temperature is the sheet's: the channel in an impedance file may read
        differently from that of the other records, and curves must not mix the two.
        States of charge no more than 2 % apart are one; a resistance of a relative standard
        deviation above 0.5 is left out.

    Returns
    -------
    points : list of Point, each with the standard deviation of its fit.
    notes : list of sentences on what was left out.
    """
    with_soc = [
        row for row in first_check_up(rows) if row["soc"] is not None and np.isfinite(row["soc"])
    ]
    with_soc.sort(key=lambda row: (row["soc"], row["ambient_temperature_celsius"]))
    level = level_means([row["soc"] for row in with_soc], apart=SAME_SOC)
    points, notes = [], []
    for kind, column in (("ohmic", "r_ohmic_ohm"), ("charge-transfer", "r_charge_transfer_ohm")):
        # Charge transfer must also be distinguished from diffusion.
        determined = [
            row
            for row in with_soc
            if (column == "r_ohmic_ohm" or row.get("charge_transfer_told", True))
            and row[column] > 0
            and row[f"{column}_std"] <= 0.5 * row[column]
        ]
        what, how = f"{kind} resistance", "impedance"
        for row in determined:
            soc, celsius = level[row["soc"]], row["ambient_temperature_celsius"]
            quantity = f"{what} at {100 * soc:.0f} % SoC, {how}"
            value, std = row[column], row[f"{column}_std"]
            family, doubts = f"{what}, {how}", doubts_of_test(row)
            points.append(Point(quantity, "Ohm", celsius, value, std, family, soc, doubts))
        vague = len(with_soc) - len(determined)
        count = f"{vague} of {len(with_soc)} spectra"
        notes += [f"{what}, {how}: {count} do not determine it"] if vague else []
    return points, notes


def level_means(values, *, apart):
    """For each value the mean of its run, values that lie no further apart than a distance: dict.

    Parameters
    ----------
    values : sequence of numbers. apart : largest distance from the first of a run.
    """
    runs = []
    for value in sorted(set(values)):
        if runs and value - runs[-1][0] <= apart:
            runs[-1].append(value)
        else:
            runs.append([value])
    return {value: float(np.mean(run)) for run in runs for value in run}


def first_check_up(rows):
    """Those `rows` (dicts) of known ambient_temperature_celsius that are of the earliest check-up.

    Age must not pass for temperature.
    """
    with_temperature = [row for row in rows if row["ambient_temperature_celsius"] is not None]
    young = in_first_checkup([row["cycle"] for row in with_temperature])
    return [row for row, among in zip(with_temperature, young, strict=True) if among]


def mean_per_temperature(points):
    """Points with repeats at one temperature averaged, per quantity.

    Three spectra at one temperature determine the resistance there better, not its change with
    temperature: an error of the chamber, or of the law, moves all three at once.

    Parameters
    ----------
    points : list of Point.
    """
    runs = grouped(points, lambda point: (point.quantity, point.temperature_celsius))
    return [
        run[0]._replace(
            value=float(np.mean([point.value for point in run])),
            std=float(np.sqrt(np.sum([point.std**2 for point in run])) / len(run)),
            doubts=tuple(dict.fromkeys(one for point in run for one in point.doubts)),
        )
        for run in runs.values()
    ]


def grouped(items, key):
    """Lists of items by `key(item)`, in the order in which the keys first appear: dict."""
    groups = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


def with_enough_temperatures(points, *, temperatures=3):
    """Points of the quantities that are known at so many temperatures or more."""
    tested = {}
    for point in points:
        tested.setdefault(point.quantity, set()).add(point.temperature_celsius)
    return [point for point in points if len(tested[point.quantity]) >= temperatures]


def pulses_of_kind(rows, direction, delay_second):
    """Those `rows` of stage `resistance` that are of one direction and delay and have a SoC."""
    return [
        row
        for row in rows
        if row["direction"] == direction
        and row["delay_second"] == delay_second
        and row["soc"] is not None
        and np.isfinite(row["soc"])
    ]


def resistance_points(rows, *, delay_second=TEMPERATURE.delay_second, soc=TEMPERATURE.soc):
    """Pulse resistance [ohm] at stated SoC and each temperature, discharge and charge apart.

    Resistance depends on the current where charge transfer is slow, in the cold most of all. So
    all temperatures of a quantity come from pulses of one rate: the one that most
    temperatures have, and of those the nearest to `PREFERRED_C_RATE`. Where no rate reaches three
    temperatures, each temperature gives its nearest, and a note says so.

    Parameters
    ----------
    rows : list of dict, rows of stage `resistance` with ambient_temperature_celsius and cycle.
    delay_second : delays that are followed over temperature [s].
    soc : states of charge [1]; between two pulses no further than 12 % away the resistance is
        interpolated, a single one serves within 5 %.

    Returns
    -------
    points : list of Point. notes : list of sentences on what was left out or mixed.
    """
    points, notes, young = [], [], first_check_up(rows)
    for direction, delay, level in product(("discharge", "charge"), delay_second, soc):
        pulses = pulses_of_kind(young, direction, delay)
        courses = {
            rate: _resistance_over_temperature(same_rate, level)
            for rate, same_rate in rate_classes(pulses).items()
        }
        courses = {rate: course for rate, course in courses.items() if course}
        chosen, note = _at_one_rate(courses)
        what, when = resistance_name(direction, delay)
        quantity, family = f"{what} at {100 * level:.0f} % SoC, {when}", f"{what}, {when}"
        points += [
            Point(quantity, "Ohm", celsius, ohm, std, family, level, doubts)
            for celsius, (ohm, std, doubts) in sorted(chosen.items())
        ]
        notes += [said_of(quantity, note)] if note else []
    return points, notes


def resistance_name(direction, delay_second):
    """Name of a pulse resistance and of its delay, without its SoC; discharges have no prefix."""
    when = "first sample" if delay_second == 0 else f"{delay_second:g} s"
    return f"{'charge ' if direction == 'charge' else ''}resistance", when


def rate_classes(rows):
    """Median rate → its rows; a class ends where the next rate is no longer the same."""
    classes, last = [], np.nan
    for row in sorted((row for row in rows if row["c_rate"] > 0), key=lambda row: row["c_rate"]):
        if not same_rate(row["c_rate"], last):
            classes.append([])
        classes[-1].append(row)
        last = row["c_rate"]
    return {float(np.median([row["c_rate"] for row in alike])): alike for alike in classes}


def preferred_rate(reached):
    """Rate with the most entries, such as temperatures, of equals the nearest to 1 C [1/h].

    `reached` : dict, rate → its entries; not empty.
    """
    return max(_by_distance(reached), key=lambda rate: len(reached[rate]))


def _by_distance(rates):
    """Rates sorted by their ratio to the preferred one, nearest first."""
    return sorted(rates, key=lambda rate: abs(np.log(rate / PREFERRED_C_RATE)))


def _resistance_over_temperature(rows, level):
    """Temperature → (resistance, std, doubt) [ohm] where pulses lie near a state of charge."""
    groups = grouped(rows, lambda row: row["ambient_temperature_celsius"])
    resistances = {celsius: _interpolated(pulses, level) for celsius, pulses in groups.items()}
    return {celsius: value for celsius, value in resistances.items() if value is not None}


def _at_one_rate(courses):
    """Temperature → (resistance, std, doubt) [ohm] at one rate, and a note on what is left out."""
    if not courses:
        return {}, ""
    everywhere = sorted({celsius for course in courses.values() for celsius in course})
    rate = preferred_rate(courses)
    missing = [celsius for celsius in everywhere if celsius not in courses[rate]]
    if not missing or len(courses[rate]) >= 3:
        return courses[rate], without_rate(rate, missing)
    # Better currents that differ than no law at all; the note says so.
    nearest = _by_distance(courses)
    used = {c: next(rate for rate in nearest if c in courses[rate]) for c in everywhere}
    rates = f"{min(used.values()):.2g}C to {max(used.values()):.2g}C"
    mixed = {celsius: courses[rate][celsius] for celsius, rate in used.items()}
    note = f"pulses of {rates} at different temperatures: current and temperature are mixed"
    return mixed, note if len(everywhere) >= 3 else ""


def without_rate(rate, temperatures):
    """Note on temperatures [°C] that have no pulse of a rate [1/h]; "" where there are none."""
    where = ", ".join(f"{celsius:g}" for celsius in temperatures)
    return f"no pulse at {rate:.2g}C at {where} °C, left out" if where else ""


def _interpolated(rows, level):
    """Resistance, its std [ohm] and its doubt at a SoC, between the pulses on either side of it."""
    rows = sorted(rows, key=lambda row: row["soc"])
    # Over 12 % of SoC resistance is straight enough; one pulse alone stands for 5 %.
    below = [row for row in rows if level - 0.12 <= row["soc"] <= level]
    above = [row for row in rows if level <= row["soc"] <= level + 0.12]
    if below and above:
        low, high = below[-1], above[0]
        width = high["soc"] - low["soc"]
        # Two pulses at one SoC: their mean.
        share = (level - low["soc"]) / width if width > 0 else 0.5
        (ohm, std), (more, other) = (
            [part * row[name] for name in RESISTANCE]
            for part, row in ((1 - share, low), (share, high))
        )
        return (
            float(ohm + more),
            float(np.hypot(std, other)),
            tuple(dict.fromkeys([*doubts_of_test(low), *doubts_of_test(high)])),
        )
    nearest = min(rows, key=lambda row: abs(row["soc"] - level))
    if abs(nearest["soc"] - level) > 0.05:
        return None
    return *(nearest[name] for name in RESISTANCE), doubts_of_test(nearest)


RESISTANCE = ("resistance_ohm", "resistance_std_ohm")


def fast_charge_points(rows):
    """Share charged, its time and its kind at each temperature; one quantity per rate.

    Parameters
    ----------
    rows : list of dict, of stage `fast_charge` with ambient_temperature_celsius and cycle; of the
        earliest check-up those from empty count.

    Returns
    -------
    points : list of Point.
    """
    charges = sorted(
        (row for row in first_check_up(rows) if row["from_empty"]),
        key=lambda row: (-row["ambient_temperature_celsius"], row["c_rate"]),
    )
    rates, points = [], []
    for row in charges:
        celsius, doubts = row["ambient_temperature_celsius"], doubts_of_test(row)
        # The set current shows at warm temperatures; in the cold the voltage cuts it at once.
        rate = _rate_seen(row["c_rate"], rates, or_less=True)
        points += [
            Point(f"{name} at up to {rate:.2g}C", unit, celsius, value, doubts=doubts)
            for name, unit, value in _quantities(row)
            if value > 0
        ]
    return points


def _quantities(row):
    """Name, unit and value of each quantity of one fast charge."""
    yield f"share charged in {row['minutes']:g} min", "1", row["share"]
    # Once the voltage limits the charge, the resistance sets the ratio of charged to not charged:
    # it may follow an Arrhenius law where the share, bounded by 1, cannot.
    if row["share"] < 1:
        ratio = row["share"] / (1 - row["share"])
        yield f"charged over not charged in {row['minutes']:g} min", "1", ratio
    yield "share of it at constant current", "1", row["constant_current_share"]
    yield "time to 80 %", "min", row["minutes_to_80"]
