"""Numbers of simulated and of real records side by side: per source a median, and a verdict."""

from collections import defaultdict
from typing import NamedTuple

import numpy as np

from virtual_lab.reality.findings import Number

# What can be compared between cells of different kind and size; the rest is told, not judged.
COMPARED = {
    *("white noise of voltage", "samples that repeat the voltage"),
    *("slow scatter of voltage over white", "step of voltage", "noise of current over rating"),
    *("white noise of temperature", "step of temperature", "scatter of the interval"),
    *("shortest to longest interval", "correlation of successive intervals"),
    *("stretched exponent", "narrowest peak, width", "highest peak, height over capacity"),
    "time to full current",
}
COMPARED_STARTS = ("resistance after 0.1 s", "resistance after 1 s", "resistance after 3")
NOT_JUDGED = {("slow scatter of voltage over white", "under constant current")}
NEAR = 0.1


class Row(NamedTuple):
    """One quantity: medians by source, and for each laboratory how it lies to the real ones."""

    subject: str
    condition: str
    quantity: str
    unit: str
    medians: dict[str, float]
    verdicts: dict[str, str]


def table(found: list[Number]) -> list[Row]:
    """Rows in the order in which their subjects and conditions were met."""
    groups, real = defaultdict(lambda: defaultdict(list)), {}
    for number in found:
        key = (number.subject, number.condition, number.quantity, number.unit)
        groups[key][number.source].append(number.value)
        real[number.source] = number.real
    return [_row(key, sources, real) for key, sources in sorted(groups.items(), key=_order)]


def _order(item):
    (subject, condition, quantity, _), _ = item
    return ("noise", "clock", "relaxation", "pulse", "peaks").index(subject), condition, quantity


def _row(key, sources, real) -> Row:
    medians = {source: float(np.median(values)) for source, values in sources.items()}
    known = [value for source, value in medians.items() if real[source]]
    judged = is_compared(key[2], key[1])
    verdicts = {
        source: verdict(value, known)
        for source, value in medians.items()
        if not real[source] and judged and known
    }
    return Row(*key, medians, verdicts)


def is_compared(quantity: str, condition: str) -> bool:
    """Whether a quantity means the same for any cell.

    Of a relaxation the shares of one way are enough: 40 s after a pulse, else 600 s and 3500 s. A
    dynamic load ends with any current, so nothing can be said after it.
    """
    if condition == "after a dynamic load":
        return False
    if quantity.startswith("share of "):
        ends = ("40 s",) if condition.endswith("pulse") else ("600 s", "3500 s")
        return quantity.split(" by ")[0].removeprefix("share of ") in ends
    known = quantity in COMPARED or quantity.startswith(COMPARED_STARTS)
    return known and (quantity, condition) not in NOT_JUDGED


def verdict(value: float, real: list[float]) -> str:
    """Within what real records show (a tenth off allowed), or above or below and by how much."""
    low, high = min(real), max(real)
    slack = NEAR * max(abs(low), abs(high))
    if low - slack <= value <= high + slack:
        return "within"
    side, limit = ("above", high) if value > high else ("below", low)
    if limit * value > 0:
        ratio = max(value / limit, limit / value)
        return f"{side}, {ratio:.2g} times"
    return f"{side}, {abs(value - limit):.2g} off"
