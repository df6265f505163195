# Which figures there are, and those of the whole campaign and of the records in it.

EFFECT_FIGURES = ("validation", "map", "evidence", "ranking", "confounding")
GROUP_EFFECT_FIGURES = ("branches", "ranking")


def figures_of_cell(cell):
    """Names of the figures that a cell's tests, laws and models allow, in the report's order."""
    scored = [row["test"] for row in SCORED.get(cell, [])]
    allowed = {
        "records": TESTS_OF[cell] and tests(cell, *SERIES_KINDS),
        "capacity": tests(cell, *CAPACITY_KINDS),
        "ocv": tests(cell, "ocv") or resting(cell),
        "resistance": tests(cell, *PULSE_KINDS),
        "ica": tests(cell, "ica"),
        "impedance": tests(cell, "eis"),
        "impedance_fit": tests(cell, "eis"),
        "drt": tests(cell, "eis"),
        "temperature": cell in VARIED,
        "ocv_temperature": cell in STEPPED,
        "capacity_loss": cell in COLD,
        "ica_temperature": cell in COLD_PEAKS,
        "fast_charge": tests(cell, "fast_charge"),
        **{f"ageing_{row['test']}": True for row in tests(cell, "ageing")},
        "arrhenius": cell in CHILLED,
        "surface": cell in PULSED,
        "relaxation": cell in RELAXED,
        "polarisation": cell in RELAXED,
        "parameters": cell in MODELLED,
        "identification_methods": cell in COMPARED,
        "compensation": cell in COMPENSATED,
        **{f"effect_{name}": cell in SEARCHED for name in EFFECT_FIGURES},
        **{f"validation_{test}": True for test in scored},
        **{f"soc_{test}": True for test in scored},
    }
    return [name for name, there in allowed.items() if there]


def figures_of_group(group):
    """Names of the figures of a group: of the search in it, and of its tests."""
    effects = GROUP_EFFECT_FIGURES if group in GROUPS_SEARCHED else ()
    packed = tests(group, "group") if group in PAIRS else ()
    return [f"effect_{name}" for name in effects] + [f"pack_{row['test']}" for row in packed]


FIGURE_NAMES = {cell: figures_of_cell(cell) for cell in CELLS}
FIGURE_NAMES |= {group: figures_of_group(group) for group in BRANCHES}
# Paths of all figures: of the campaign, of every cell, of every group.
FIGURES = {"campaign": ["results/figures/overview.svg"]} | {
    cell_or_group: [f"results/figures/{cell_or_group}/{name}.svg" for name in names]
    for cell_or_group, names in FIGURE_NAMES.items()
}


rule figure_overview:
    input:
        capacity="results/tables/capacity.csv",
        resistance="results/tables/resistance.csv",
        validation="results/tables/validation.csv",
    output:
        "results/figures/overview.svg",
    log:
        "logs/figures/overview.log",
    params:
        cells=[cell for cell in CELLS if TESTS_OF[cell] or cell in MODELLED],
    message:
        "Figure: the campaign at a glance."
    script:
        "../../scripts/figures_of_campaign/figure_overview.py"


def thumbnails(wildcards):
    """The first twelve records of a cell, one of each kind and temperature first."""
    rows = tests(wildcards.cell, *SERIES_KINDS)
    seen = {}
    for row in rows:
        seen.setdefault((row["kind"], row["ambient_temperature_celsius"]), row["test"])
    first = list(seen.values())
    return [*first, *[row["test"] for row in rows if row["test"] not in first]][:12]


def of_thumbnails(stage):
    """Input function: one stage's artefacts of the records that are drawn."""
    return lambda wildcards: [
        f"results/{stage}/{wildcards.cell}/{test}.parquet" for test in thumbnails(wildcards)
    ]


rule figure_records:
    input:
        series=of_thumbnails("clean"),
        steps=of_thumbnails("segment"),
    output:
        "results/figures/{cell}/records.svg",
    log:
        "logs/figures/{cell}_records.log",
    params:
        total=lambda w: len(tests(w.cell, *SERIES_KINDS)),
    message:
        "Figure: records of {wildcards.cell}."
    script:
        "../../scripts/figures_of_campaign/figure_records.py"
