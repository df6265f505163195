"""Numbers of the demo campaign for the tutorial, from the record that every run is held against."""

from documentation.library_tables import table
from real_cells import record

FIRST, CELLS = "C1", ("C1", "C2", "C3", "C4", "C5")
AT_HALF = "25 °C, 50 % SoC"
CAPACITY, PULSE = "25 °C, discharge, C/2", f"{AT_HALF}, after 10 s"


def of_first() -> str:
    """Markdown table of what the pipeline says of the first cell."""
    numbers = _recorded()
    pulse = numbers[FIRST, "pulse resistance"]
    rows = [
        ("capacity, discharge at C/2, 25 °C", numbers[FIRST, "capacity"][CAPACITY]),
        (f"OCV, {AT_HALF}", numbers[FIRST, "open-circuit voltage"][AT_HALF]),
    ]
    for delay in ("first sample", "after 1 s", "after 10 s"):
        rows.append((f"resistance of a pulse, {delay}", pulse[f"{AT_HALF}, {delay}"]))
    return table((f"of {FIRST}", "value"), rows)


def of_cells() -> str:
    """Markdown table of the cells of the first one's type beside each other."""
    numbers, rows = _recorded(), []
    for cell in CELLS:
        lost = numbers.get((cell, "lithium lost"), {"": "–"})
        (cycle, share), *_ = lost.items()
        resistance = numbers.get((cell, "pulse resistance"), {PULSE: "–"})[PULSE]
        aged = cycle.removeprefix("cycle ") or "0"
        rows.append((cell, aged, numbers[cell, "capacity"][CAPACITY], resistance, share))
    heads = ("cell", "cycles", "capacity at C/2", "resistance after 10 s", "lithium lost")
    return table(heads, rows)


def of_search() -> str:
    """One sentence: what the search for missing effects gains, in the median of all cells."""
    numbers = _recorded()
    before, after = (
        next(found[""] for key, found in numbers.items() if _is_median(key, when))
        for when in ("before", "after")
    )
    return f"In the median of the demo's cells it lowers the error from {before} to {after}."


def _is_median(key, when):
    of, quantity = key
    return of.startswith("median of ") and quantity == f"error {when} the search"


def _recorded():
    """The demo's numbers with their units: by cell and quantity a dict, by where."""
    numbers = {}
    for row in record.read(record.RECORDED).to_dict("records"):
        if row["campaign"] == "demo" and row["unit"] != "word":
            value = f"{float(row['value']):.4g} {row['unit']}".replace("mohm", "mΩ")
            numbers.setdefault((row["cell"], row["quantity"]), {})[row["where"]] = value
    return numbers
