"""Read campaigns, look at every record, and write table, figures and page into a folder."""

import csv
from pathlib import Path
from typing import NamedTuple

from virtual_lab.reality import comparison, figures, noise, page, peaks, pulse, records, relaxation
from virtual_lab.reality.findings import Number
from virtual_lab.reality.records import Skipped, Source

SUBJECTS = {"noise": noise, "relaxation": relaxation, "pulse": pulse, "peaks": peaks}
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
    for subject, module in SUBJECTS.items():
        numbers, curves = module.look(record)
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
    rows = comparison.table(found.numbers)
    met = {number.source for number in found.numbers}
    text = page.text(rows, [s for s in sources if s.name in met], found.skipped, pictures=pictures)
    (folder / "reality.md").write_text(text, encoding="utf-8")
