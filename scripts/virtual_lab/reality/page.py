"""The page beside the figures: what was compared, where the laboratory differs, by how much."""

from virtual_lab.reality.comparison import Row, is_compared

TITLES = {
    "noise": "Noise and resolution",
    "clock": "Clock",
    "relaxation": "Relaxation after a load",
    "pulse": "Response to a step of current",
    "peaks": "Incremental capacity",
}
HOW = {
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


def text(rows: list[Row], sources, skipped, *, pictures: set[str]) -> str:
    """Markdown; `pictures` are the subjects that have a figure beside it."""
    parts = ["# The laboratory beside reality", _opening(sources), "## Where it differs"]
    parts += [_differences(rows)]
    for subject, title in TITLES.items():
        chosen = [row for row in rows if row.subject == subject and _is_told(row)]
        parts += [f"## {title}", HOW[subject]]
        parts += [f"![{title}]({subject}.png)"] if subject in pictures else []
        parts += [_table(chosen, sources)]
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


def _table(rows, sources) -> str:
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
