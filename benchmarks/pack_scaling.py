"""Time of packs over the number of cells and steps: table and picture of docs/packs.md.

./run python benchmarks/pack_scaling.py
"""

import csv
from pathlib import Path

import cell
import group
import matplotlib
import numpy as np
from matplotlib.figure import Figure
from timing import cpu_second

from cellwright.packs.kernel import Keep
from cellwright.packs.simulate import simulate_pack

DOCS = Path(__file__).resolve().parents[1] / "docs"
PICTURE = DOCS / "pictures" / "pack-scaling.svg"
KEPT = Path(__file__).resolve().parent / "pack_scaling.csv"
CELLS, STEPS = (10, 30, 100, 300, 1000, 3000, 10_000), (100, 300, 1000, 3000, 10_000, 30_000)
FIXED_STEPS, FIXED_CELLS, RUNS = 1000, 100, 5
KINDS = {
    "star": (group.plain_cells, 0.0),
    "ladder": (group.plain_cells, group.BAR),
    "star with kinetics and hysteresis": (group.chosen_cells, 0.0),
}


def main():
    """Measure, keep the numbers, draw them."""
    rows = [
        {
            "wiring": name,
            "cells": cells,
            "steps": steps,
            "cpu_second": _measured(name, cells, steps),
        }
        for name in KINDS
        for cells, steps in [(c, FIXED_STEPS) for c in CELLS] + [(FIXED_CELLS, s) for s in STEPS]
    ]
    with KEPT.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[0], lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    for name in KINDS:
        for over in ("cells", "steps"):
            x, y = _line(rows, name, over)
            large = slice(-3, None)
            slope = np.polyfit(np.log(x[large]), np.log(y[large]), 1)[0]
            print(f"{name}: CPU time goes with {over} to the power {slope:.2f}")
    _picture(rows)


def _measured(name, cells, steps):
    """Least CPU time of some runs, the pack's voltage kept [s]."""
    maker, bar = KINDS[name]
    pack, wiring, time = maker(cells), group.wired(cells, bar), np.arange(float(steps))
    load, found = cells * cell.drive(steps), []
    for _ in range(RUNS):
        begin = cpu_second()
        simulate_pack(time, load, pack, wiring, initial_soc=0.8, keep=Keep(0))
        found.append(cpu_second() - begin)
    return round(min(found), 6)


def _line(rows, name, over):
    other, fixed = ("steps", FIXED_STEPS) if over == "cells" else ("cells", FIXED_CELLS)
    at = [row for row in rows if row["wiring"] == name and row[other] == fixed]
    # A hundred cells with a thousand steps stand in both series.
    at = {row[over]: row["cpu_second"] for row in at}
    return np.array(sorted(at)), np.array([at[x] for x in sorted(at)])


def _picture(rows):
    with matplotlib.rc_context({"svg.hashsalt": "pack-scaling", "svg.fonttype": "none"}):
        figure = Figure(figsize=(9, 3.6), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        titles = {
            "cells": f"{FIXED_STEPS:,} steps of 1 s",
            "steps": f"{FIXED_CELLS} cells, steps of 1 s",
        }
        for panel, (over, title) in zip(panels, titles.items(), strict=True):
            for name in KINDS:
                panel.loglog(*_line(rows, name, over), "o-", label=name, markersize=4)
            panel.set_xlabel(f"{over} [1]")
            panel.set_title(title, loc="left")
            panel.grid(alpha=0.3)
        panels[0].set_ylabel("CPU time [s]")
        panels[0].legend(frameon=False)
        figure.savefig(PICTURE, metadata={"Date": None})


if __name__ == "__main__":
    main()
