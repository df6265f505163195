# State of health: what slow curves of check-ups tell of lithium and active material lost.

SLOW_CURVE_KINDS = ("ocv", "ica")


def slow_check_ups(cell):
    """Cycles at which a cell has a test that may be a slow curve; blank: fresh."""
    return {row["cycle"] or 0 for row in tests(cell, *SLOW_CURVE_KINDS, roles=["fit"])}


def fresh_cells(cell):
    """The marked cell of the type that stands for the fresh state of a cell with one check-up."""
    marked = [c for c in references(cell) if slow_check_ups(c)]
    return marked[:1] if len(slow_check_ups(cell)) == 1 else []


AGED_SLOWLY = cells_where(lambda cell: len(slow_check_ups(cell)) >= 2)
DEGRADED = cells_where(lambda cell: cell in AGED_SLOWLY or fresh_cells(cell))


def half_cells_of(cell):
    """What the sheet says of a cell's half cells, and its chemistry."""
    names = ("chemistry", "negative_half_cell", "positive_half_cell")
    return {name: CELLS[cell].get(name) for name in names}


def half_cell_files(cell):
    """Files among the half cells of a cell: what ends in .csv is no name of the library."""
    given = half_cells_of(cell).values()
    return [name for name in given if str(name).lower().endswith(".csv")]


rule degradation_modes:
    input:
        own=lambda w: fitted("clean", w.cell, *SLOW_CURVE_KINDS),
        fresh=lambda w: [
            p for c in fresh_cells(w.cell) for p in fitted("clean", c, *SLOW_CURVE_KINDS)
        ],
        half_cells=lambda w: half_cell_files(w.cell),
    output:
        "results/degradation_modes/{cell}.parquet",
    log:
        "logs/degradation_modes/{cell}.log",
    wildcard_constraints:
        cell=either(DEGRADED),
    params:
        settings=config["degradation_modes"],
        cell=cell_facts,
        materials=lambda w: half_cells_of(w.cell),
        fresh=lambda w: [facts_of(c) for c in fresh_cells(w.cell)],
    message:
        "Lithium and active material lost by {wildcards.cell}, from slow curves of its check-ups."
    script:
        "../../scripts/health/degradation_modes.py"


rule plateau_losses:
    input:
        lambda w: fitted("clean", w.cell, *SLOW_CURVE_KINDS),
    output:
        "results/plateau_losses/{cell}.parquet",
    log:
        "logs/plateau_losses/{cell}.log",
    wildcard_constraints:
        cell=either(AGED_SLOWLY),
    params:
        settings=config["degradation_modes"],
        cell=cell_facts,
    message:
        "Charge lost by each plateau of {wildcards.cell} between its check-ups."
    script:
        "../../scripts/health/plateau_losses.py"
