"""Measured quantities: unit, which side is better, how much may change, and words for places."""

import math
from typing import NamedTuple

# Columns of a table of numbers: what it is a number of, and what is to be known of it.
KEYS = ["campaign", "cell", "quantity", "where"]
COLUMNS = [*KEYS, "value", "unit", "better", "tolerance_absolute", "tolerance_relative"]
COLUMNS += ["published", "published_source"]
SIDES = ("lower", "higher", "near", "equal", "shown")

C_RATES = {
    **{f"C/{k}": 1 / k for k in (100, 50, 40, 30, 25, 20, 15, 10, 8, 5, 4, 3, 2)},
    **{f"{k:g}C": k for k in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20)},
}


class Quantity(NamedTuple):
    """What a number is, and when another one is worse.

    unit : of the number; "word" for a word.
    better : "lower" and "higher" say which side is better; "near" means that it must stay, unless
        it comes nearer to the published one; "equal" is for words that must stay; "shown" is never
        checked.
    absolute : how much it may change [unit].
    relative : that much more, as a part of the recorded number.
    topic : heading of the page below which it stands.
    """

    unit: str
    better: str
    absolute: float
    relative: float
    topic: str


CELL, MODEL, SEARCH, RUN = "Cells", "Models and filters", "What is missing", "The run"
TRUTH = "Against the truth"
ERROR = {"better": "lower", "absolute": 0.3, "relative": 0.05}  # mV or mA, and 5 % more
SOC = {"unit": "% of SoC", "better": "lower", "absolute": 0.3, "relative": 0.0}
COUNT = {"better": "lower", "absolute": 0.0, "relative": 0.0, "topic": RUN}
SHOWN = {"better": "shown", "absolute": 0.0, "relative": 0.0}

QUANTITIES = {
    "capacity": Quantity("Ah", "near", 0.0, 0.002, CELL),
    "open-circuit voltage": Quantity("V", "near", 0.002, 0.0, CELL),
    "pulse resistance": Quantity("mohm", "near", 0.0, 0.02, CELL),
    "spectrum: real part where it crosses the axis": Quantity("mohm", "near", 0.0, 0.02, CELL),
    "spectrum: ohmic resistance": Quantity("mohm", "near", 0.0, 0.02, CELL),
    "spectrum: charge-transfer resistance": Quantity("mohm", "near", 0.0, 0.05, CELL),
    "resistance of the model, mean over SoC": Quantity("mohm", "near", 0.0, 0.05, CELL),
    "capacity inside the group": Quantity("Ah", "near", 0.0, 0.005, CELL),
    "chosen member": Quantity("word", topic=MODEL, **SHOWN),
    "best member": Quantity("word", topic=MODEL, **SHOWN),
    "error of the chosen member": Quantity("mV", topic=MODEL, **ERROR),
    "error of the best member": Quantity("mV", topic=MODEL, **ERROR),
    "error of the chosen member over the best member's": Quantity("1", "lower", 0.05, 0.05, MODEL),
    "error of a filter's SoC": Quantity(topic=MODEL, **SOC),
    "error of a filter's SoC, with a fault": Quantity(topic=MODEL, **SOC),
    "error of the dual filter's capacity": Quantity("%", "lower", 0.3, 0.05, MODEL),
    "error of the branch current": Quantity("mA", topic=MODEL, **ERROR),
    "error of the group's voltage": Quantity("mV", topic=MODEL, **ERROR),
    "verdict": Quantity("word", "equal", 0.0, 0.0, SEARCH),
    "named effects": Quantity("word", "equal", 0.0, 0.0, SEARCH),
    "error before the search": Quantity("mV", topic=SEARCH, **SHOWN),
    "error after the search": Quantity("mV", topic=SEARCH, **ERROR),
    "gap closed": Quantity("%", "higher", 3.0, 0.0, SEARCH),
    "right verdicts": Quantity("count", "higher", 0.0, 0.0, SEARCH),
    "false names and false alarms": Quantity("count", "lower", 0.0, 0.0, SEARCH),
    "left out": Quantity("count", **COUNT),
    "internal errors": Quantity("count", **COUNT),
    "laws of physics broken": Quantity("count", **COUNT),
    "flagged samples": Quantity("count", **COUNT),
    "time of all jobs": Quantity("s", topic=RUN, **SHOWN),
    "error against the truth": Quantity("", "lower", 0.0, 0.1, TRUTH),
    "rows that the truth has and the results have not": Quantity("count", "lower", 0.0, 0.0, TRUTH),
    "share that is right": Quantity("%", "higher", 0.5, 0.0, TRUTH),
}


def topics() -> list[str]:
    """Headings below which the quantities stand, in the order of the list."""
    return list(dict.fromkeys(one.topic for one in QUANTITIES.values()))


def rate_in_words(c_rate: float) -> str:
    """The customary rate next to this one: C/20, 1C.

    Parameters
    ----------
    c_rate : float [1/h]
        Current over rated capacity, of either sign.
    """
    if not c_rate or math.isnan(c_rate):
        return "rate not known"
    return min(C_RATES, key=lambda name: abs(math.log(abs(c_rate) / C_RATES[name])))


def celsius_in_words(temperature: float) -> str:
    """A chamber temperature [°C] with its unit, or that it is not known."""
    return "temperature not known" if math.isnan(temperature) else f"{temperature:g} °C"


def place(*parts: str) -> str:
    """Where a number was measured, out of several parts; empty parts are left out."""
    return ", ".join(part for part in parts if part)
