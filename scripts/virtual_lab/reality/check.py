"""Simulated and real records side by side: medians by source, a verdict, and the page about it."""

import csv
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from virtual_lab.reality import figures, noise, records, responses
from virtual_lab.reality.records import Number, Skipped, Source

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


class ComparisonRow(NamedTuple):
    """One quantity: medians by source, and for each laboratory how it lies to the real ones."""

    subject: str
    condition: str
    quantity: str
    unit: str
    medians: dict[str, float]
    verdicts: dict[str, str]


def comparison_rows(found: list[Number]) -> list[ComparisonRow]:
    """Rows in the order in which their subjects and conditions were met."""
    groups, real = defaultdict(lambda: defaultdict(list)), {}
    for number in found:
        key = (number.subject, number.condition, number.quantity, number.unit)
        groups[key][number.source].append(number.value)
        real[number.source] = number.real
    return [
        _comparison_row(key, sources, real) for key, sources in sorted(groups.items(), key=_order)
    ]


def _order(item):
    (subject, condition, quantity, _), _ = item
    return ("noise", "clock", "relaxation", "pulse", "peaks").index(subject), condition, quantity


def _comparison_row(key, sources, real) -> ComparisonRow:
    medians = {source: float(np.median(values)) for source, values in sources.items()}
    known = [value for source, value in medians.items() if real[source]]
    judged = is_compared(key[2], key[1])
    verdicts = {
        source: verdict(value, known)
        for source, value in medians.items()
        if not real[source] and judged and known
    }
    return ComparisonRow(*key, medians, verdicts)


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


SUBJECT_TITLES = {
    "noise": "Noise and resolution",
    "clock": "Clock",
    "relaxation": "Relaxation after a load",
    "pulse": "Response to a step of current",
    "peaks": "Incremental capacity",
}
METHODS = {
    "noise": (
        "Of a rest the second half, of a constant current the middle half. White noise is taken "
        "from second differences, which a slow drift does not touch; rounding to steps is part of "
        "it (a step s alone gives s/√12). Under load the open-circuit curve bends the record at "
        "low frequencies: only the flat right end of that spectrum is noise."
    ),
    "clock": "Stamps of the same stretches. A correlation of −0.5 means a clock that keeps to a "
    "grid and misses each point a little; 0 means one that is late anew each time.",
    "relaxation": "The way is the change from the last sample under load to the end named, so that "
    "the ohmic jump is part of it. The stretched exponent is that of V∞ − A·exp(−(t/τ)^β), from "
    "1 s on: 1 for a single RC pair, about 0.5 for many of them.",
    "pulse": "Time counts from the edge; where samples are 1 s apart the edge is known to half of "
    "that, and times below it are left out.",
    "peaks": "Charge counted into bins of 1 mV and smoothed by a Gaussian of 5 mV (LFP: 2 mV), "
    "over the charge of the whole step. Widths are at half the prominence.",
}


def page_text(rows: list[ComparisonRow], sources, skipped, *, pictures: set[str]) -> str:
    """Markdown; `pictures` are the subjects that have a figure beside it."""
    parts = ["# The laboratory beside reality", _opening(sources), "## Where it differs"]
    parts += [_differences(rows)]
    for subject, title in SUBJECT_TITLES.items():
        chosen = [row for row in rows if row.subject == subject and _is_told(row)]
        parts += [f"## {title}", METHODS[subject]]
        parts += [f"![{title}]({subject}.png)"] if subject in pictures else []
        parts += [_markdown_table(chosen, sources)]
    parts += ["## Not looked at", _skipped(skipped)]
    return "\n\n".join(parts) + "\n"


def _is_told(row) -> bool:
    """Single peaks and ways to other ends are in reality.csv; the page would drown in them."""
    if row.quantity.startswith(("share of ", "way of ")):
        share = row.quantity.replace("way of", "share of")
        return is_compared(share, row.condition)
    return not row.quantity.startswith("peak ")


def _opening(sources) -> str:
    real = ", ".join(source.name for source in sources if source.real) or "none"
    simulated = ", ".join(source.name for source in sources if not source.real)
    return (
        f"Simulated: {simulated}. Real: {real}. All records went through the same readers and the "
        "same cutting into steps. Numbers are medians over all steps of a source; `reality.csv` "
        "has each of them. *Within* means: not more than a tenth outside of what the real records "
        "span. Other cells, sizes and instruments differ by right; what counts is a laboratory "
        "outside of all of them."
    )


def _differences(rows) -> str:
    lines = [
        f"- {source}, {row.condition}: {row.quantity} is {_number(row.medians[source])}"
        f"{_unit(row.unit)}: {verdict} (real: {_reals(row)})."
        for row in rows
        for source, verdict in row.verdicts.items()
        if verdict != "within"
    ]
    inside = sum(v == "within" for row in rows for v in row.verdicts.values())
    return "\n".join([*lines, f"- Within what real records span: {inside} further comparisons."])


def _reals(row) -> str:
    return ", ".join(
        f"{source} {_number(value)}"
        for source, value in row.medians.items()
        if source not in row.verdicts
    )


def _markdown_table(rows, sources) -> str:
    names = [s.name for s in sources if any(s.name in row.medians for row in rows)]
    if not rows:
        return "No record of this kind."
    head = ["condition", "quantity", "unit", *names, "laboratory"]
    lines = [head, ["---"] * len(head)]
    for row in rows:
        values = [_number(row.medians[n]) if n in row.medians else "" for n in names]
        said = "; ".join(f"{s}: {v}" for s, v in row.verdicts.items())
        lines.append([row.condition, row.quantity, row.unit, *values, said])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _skipped(skipped) -> str:
    lines = [f"- {s.source} {s.test}: {s.reason}" for s in skipped]
    return "\n".join(lines) or "Nothing that was asked for is missing."


def _number(value: float) -> str:
    return f"{value:.3g}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


SUBJECTS = {
    "noise": noise.look_at_noise,
    "relaxation": responses.look_at_rests,
    "pulse": responses.look_at_pulses,
    "peaks": responses.look_at_charges,
}
DOTS_PER_INCH = 130


class Findings(NamedTuple):
    """Numbers of all records, curves by subject, and what was left out."""

    numbers: list[Number]
    curves: dict[str, list]
    skipped: list[Skipped]


def look(sources: list[Source], *, celsius: float = 25.0, most_cells: int = 8) -> Findings:
    """Everything found in the campaigns' records near one temperature [°C]."""
    found = Findings([], {subject: [] for subject in SUBJECTS}, [])
    for source in sources:
        for record in records.load(source, celsius=celsius, most_cells=most_cells):
            _add(found, record)
    return found


def _add(found, record):
    if isinstance(record, Skipped):
        found.skipped.append(record)
        return
    for subject, look_at in SUBJECTS.items():
        numbers, curves = look_at(record)
        found.numbers.extend(numbers)
        found.curves[subject].extend(curves)


def write(found: Findings, sources: list[Source], folder: Path) -> None:
    """reality.csv, reality.md and up to four pictures (of real curves: not to be published)."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {subject for subject in SUBJECTS if found.curves[subject]}
    for subject in sorted(pictures):
        drawing = getattr(figures, subject)(found.curves[subject], sources)
        drawing.savefig(folder / f"{subject}.png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    with (folder / "reality.csv").open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(Number._fields)
        writer.writerows(number._replace(value=f"{number.value:.6g}") for number in found.numbers)
    rows = comparison_rows(found.numbers)
    met = {number.source for number in found.numbers}
    text = page_text(rows, [s for s in sources if s.name in met], found.skipped, pictures=pictures)
    (folder / "reality.md").write_text(text, encoding="utf-8")
