"""Simulated and real records side by side: medians by source, a verdict, and the page about it."""

import csv
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from virtual_lab.reality import figures, noise, records, responses
from virtual_lab.reality.records import Number, Skipped, Source

# Quantities that are comparable between cells of different kind and size; others are only listed.
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
    """One quantity: medians by source, and a verdict on each simulated source."""

    subject: str
    condition: str
    quantity: str
    unit: str
    medians: dict[str, float]
    verdicts: dict[str, str]


def comparison_rows(numbers: list[Number]) -> list[ComparisonRow]:
    """One row a quantity, sorted by subject and condition."""
    values, real = defaultdict(lambda: defaultdict(list)), {}
    for number in numbers:
        key = (number.subject, number.condition, number.quantity, number.unit)
        values[key][number.source].append(number.value)
        real[number.source] = number.real
    subjects = ("noise", "clock", "relaxation", "pulse", "peaks")
    keys = sorted(values, key=lambda key: (subjects.index(key[0]), key[1], key[2]))
    return [_comparison_row(key, values[key], real) for key in keys]


def _comparison_row(key, sources, real) -> ComparisonRow:
    medians = {source: float(np.median(values)) for source, values in sources.items()}
    of_real = [value for source, value in medians.items() if real[source]]
    judged = is_compared(key[2], key[1])
    verdicts = {
        source: verdict(value, of_real)
        for source, value in medians.items()
        if not real[source] and judged and of_real
    }
    return ComparisonRow(*key, medians, verdicts)


def is_compared(quantity: str, condition: str) -> bool:
    """Whether a quantity means the same for any cell.

    Of a relaxation the shares until one end are enough: 40 s after a pulse, else 600 s and 3500 s.
    A dynamic load ends with any current, so nothing can be compared after it.
    """
    if condition == "after a dynamic load":
        return False
    if quantity.startswith("share of "):
        ends = ("40 s",) if condition.endswith("pulse") else ("600 s", "3500 s")
        return quantity.split(" by ")[0].removeprefix("share of ") in ends
    comparable = quantity in COMPARED or quantity.startswith(COMPARED_STARTS)
    return comparable and (quantity, condition) not in NOT_JUDGED


def verdict(value: float, real: list[float]) -> str:
    """Within the range of real records (a tenth off allowed), or above or below and by how much."""
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
    """The page as Markdown; `pictures` are the subjects that have a figure."""
    parts = ["# The laboratory beside reality", _opening(sources), "## Where it differs"]
    parts += [_differences(rows)]
    for subject, title in SUBJECT_TITLES.items():
        chosen = [row for row in rows if row.subject == subject and _is_on_page(row)]
        parts += [f"## {title}", METHODS[subject]]
        parts += [f"![{title}]({subject}.png)"] if subject in pictures else []
        parts += [_markdown_table(chosen, sources)]
    lines = [f"- {one.source} {one.test}: {one.reason}" for one in skipped]
    parts += ["## Not looked at", "\n".join(lines) or "Nothing that was asked for is missing."]
    return "\n\n".join(parts) + "\n"


def _is_on_page(row) -> bool:
    """Whether the page shows a quantity; single peaks and other times are in reality.csv only."""
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
    lines, inside = [], 0
    for row in rows:
        unit = "" if row.unit == "1" else f" {row.unit}"
        of_real = {s: value for s, value in row.medians.items() if s not in row.verdicts}
        real = ", ".join(f"{source} {_number(value)}" for source, value in of_real.items())
        for source, said in row.verdicts.items():
            inside += said == "within"
            number = f"{_number(row.medians[source])}{unit}"
            line = (
                f"- {source}, {row.condition}: {row.quantity} is {number}: {said} (real: {real})."
            )
            lines += [line] if said != "within" else []
    return "\n".join([*lines, f"- Within what real records span: {inside} further comparisons."])


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


def _number(value: float) -> str:
    return f"{value:.3g}"


SUBJECTS = {
    "noise": noise.look_at_noise,
    "relaxation": responses.look_at_rests,
    "pulse": responses.look_at_pulses,
    "peaks": responses.look_at_charges,
}
DOTS_PER_INCH = 130


class Findings(NamedTuple):
    """Numbers of all records, curves by subject, and skipped tests."""

    numbers: list[Number]
    curves: dict[str, list]
    skipped: list[Skipped]


def look(sources: list[Source], *, celsius: float = 25.0, most_cells: int = 8) -> Findings:
    """Numbers and curves of the campaigns' records near one temperature [°C]."""
    findings = Findings([], {subject: [] for subject in SUBJECTS}, [])
    for source in sources:
        for record in records.load(source, celsius=celsius, most_cells=most_cells):
            _add(findings, record)
    return findings


def _add(findings, record):
    if isinstance(record, Skipped):
        findings.skipped.append(record)
        return
    for subject, look_at in SUBJECTS.items():
        numbers, curves = look_at(record)
        findings.numbers.extend(numbers)
        findings.curves[subject].extend(curves)


def write(findings: Findings, sources: list[Source], folder: Path) -> None:
    """reality.csv, reality.md and up to four pictures (of real curves: not to be published)."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {subject for subject in SUBJECTS if findings.curves[subject]}
    for subject in sorted(pictures):
        drawing = getattr(figures, subject)(findings.curves[subject], sources)
        drawing.savefig(folder / f"{subject}.png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    with (folder / "reality.csv").open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(Number._fields)
        writer.writerows(
            number._replace(value=f"{number.value:.6g}") for number in findings.numbers
        )
    rows = comparison_rows(findings.numbers)
    met = {number.source for number in findings.numbers}
    text = page_text(
        rows, [s for s in sources if s.name in met], findings.skipped, pictures=pictures
    )
    (folder / "reality.md").write_text(text, encoding="utf-8")
