"""The one list of measured quantities: unit, which side is better, and how much may change."""

from typing import NamedTuple

SIDES = ("lower", "higher", "near", "equal", "shown")


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
