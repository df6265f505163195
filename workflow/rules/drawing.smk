# Figures: which there are, what each is drawn from, and one job that draws those of a cell.

# What a figure of the search for a missing effect is drawn from: each of its own artefacts.
EFFECT_FIGURES = {
    "validation": {"verdict": "verdict.json", "series": "series.parquet"},
    "map": {"residuals": "map.parquet"},
    "evidence": {"evidence": "evidence.parquet"},
    "ranking": {"ranking": "ranking.parquet"},
}
GROUP_EFFECT_FIGURES = {
    "branches": EFFECT_FIGURES["validation"],
    "group_ranking": EFFECT_FIGURES["ranking"],
}


def figure(kind, *, test=None, settings=None, name=None, **inputs):
    """One figure: (name, what the job that draws it is told); `inputs`: paths of artefacts."""
    name = name or (f"{kind}_{test}" if test else kind)
    return name, {"kind": kind, "test": test, "inputs": inputs, "settings": settings or {}}


def thumbnails(cell):
    """The first twelve records of a cell, one of each kind and temperature first."""
    rows = tests(cell, *SERIES_KINDS)
    seen = {}
    for row in rows:
        seen.setdefault((row["kind"], row["ambient_temperature_celsius"]), row["test"])
    first = list(seen.values())
    return [*first, *[row["test"] for row in rows if row["test"] not in first]][:12]


def figures_of_records(cell):
    """The records themselves, some of them."""
    shown = thumbnails(cell)
    if shown:
        paths = {
            name: [f"results/stages/{stage}/{cell}/{test}.parquet" for test in shown]
            for name, stage in (("series", "clean"), ("steps", "segment"))
        }
        total = {"total": len(tests(cell, *SERIES_KINDS))}
        yield figure("records", settings=total, **paths)


def figures_of_tests(cell):
    """What the tests of a cell tell."""
    drawn_from = {
        "capacity": {"capacity": artefacts("capacity", cell, *CAPACITY_KINDS)},
        "ocv": {
            "curves": artefacts("ocv", cell, "ocv")
            or of_rows("ocv_rests", cell, FITS.resting(cell))
        },
        "resistance": {"pulses": artefacts("resistance", cell, *PULSE_KINDS)},
        "ica": {
            "curves": artefacts("ica_curve", cell, "ica"),
            "peaks": artefacts("ica", cell, "ica"),
            "discharges": artefacts("ica_discharge_curve", cell, "ica", "ocv"),
            "discharge_peaks": artefacts("ica_discharge", cell, "ica", "ocv"),
        },
        "impedance": {"spectra": artefacts("eis_curve", cell, "eis")},
        "impedance_fit": {"spectra": artefacts("eis_curve", cell, "eis")},
        "drt": {
            "curves": artefacts("drt", cell, "eis"),
            "peaks": artefacts("drt_peaks", cell, "eis"),
        },
    }
    return [figure(kind, **paths) for kind, paths in drawn_from.items() if any(paths.values())]


def figures_of_laws(cell):
    """Laws of a cell over temperature, rate and cycle."""
    if cell in VARIED:
        parts = of_cell(cell, points="temperature_points", laws="temperature")
        yield figure("temperature", **parts)
    if cell in STEPPED:
        names = {name: f"ocv_{name}" for name in ("entropic", "surface")}
        names |= {"bias": "ocv_temperature", "functions": "ocv_functions_temperature"}
        yield figure("ocv_temperature", **of_cell(cell, **names))
    if cell in COLD:
        yield figure("capacity_loss", **of_cell(cell, losses="capacity_loss"))
    if cell in COLD_PEAKS:
        names = {"matches": "ica_temperature", "peaks": "ica_temperature_peaks"}
        yield figure("ica_temperature", **of_cell(cell, curves="ica_temperature_curve", **names))
    if tests(cell, "fast_charge"):
        stages = {"series": "clean", "steps": "segment", "numbers": "fast_charge"}
        parts = {name: artefacts(stage, cell, "fast_charge") for name, stage in stages.items()}
        yield figure("fast_charge", **parts)
    for row in tests(cell, "ageing"):
        stages = {name: f"ageing_temperature_{name}" for name in ("cycles", "periods")}
        stages["summary"] = "ageing_temperature"
        yield figure("ageing", test=row["test"], **of_test(cell, row["test"], **stages))
    if cell in AGED:
        yield figure("fade", **of_cell(cell, course="fade_course", life="life"))
    if cell in CHECKED and tests(cell, *PULSE_KINDS, roles=["fit"]):
        yield figure("resistance_growth", **of_cell(cell, growth="resistance_growth"))
    if cell in CHILLED:
        yield figure("arrhenius", **of_cell(cell, points="temperature_points", laws="temperature"))
    if cell in PULSED:
        stages = {"points": "resistance_surface_points", "laws": "resistance_surface"}
        yield figure("surface", **of_cell(cell, **stages))
    if cell in RELAXED:
        yield figure("relaxation", rests=artefacts("relaxation_curve", cell, *RELAXATION_KINDS))
        stages = {"points": "polarisation_points", "laws": "polarisation"}
        yield figure("polarisation", **of_cell(cell, **stages))


def figures_of_health(cell):
    """How a cell aged: dQ/dV over its life with its peaks, modes, capacity from peaks."""
    if cell in FOLLOWED:
        curves = artefacts("ica_curve", cell, "ica"), artefacts("ica_life_curve", cell, "ageing")
        tracks = {"tracks": f"results/stages/ica_tracks/{cell}.parquet"}
        yield figure("ica_tracks", curves=curves[0], lives=curves[1], **tracks)
    if cell in AGED_SLOWLY or AGEING.aged_by_rests(cell):
        yield figure("degradation_modes", **of_cell(cell, modes="degradation_modes"))
    if cell in FIRST_OF_TYPE:
        calibration = f"results/stages/peak_calibration/{FIRST_OF_TYPE[cell]}.parquet"
        settings = {"cell": cell}
        yield figure("health_from_peaks", settings=settings, calibration=calibration)


def figures_of_models(cell):
    """A cell's model, what it lacks, and both over measurement."""
    if cell in MODELLED:
        yield figure("parameters", model=f"results/models/{cell}.json")
    if cell in COMPENSATED:
        parts = of_cell(cell, fitted="compensation", proof="temperature_prediction")
        yield figure("compensation", **parts)
    if cell in SEARCHED:
        yield from figures_of_effect(cell, EFFECT_FIGURES)
    scored = [row["test"] for row in SCORED.get(cell, [])]
    for test in scored:
        parts = of_test(cell, test, series="simulation", scores="validation")
        yield figure("validation", test=test, **parts)
    for test in scored:
        yield figure("soc", test=test, **of_test(cell, test, series="soc_series", scores="soc"))


def figures_of_effect(owner, figures):
    """Figures of the search in a cell or group."""
    for name, parts in figures.items():
        paths = {part: f"results/missing_effect/{owner}/{file}" for part, file in parts.items()}
        called = f"effect_{name.removeprefix('group_')}"
        yield figure(f"effect_{name}", name=called, **paths)


def figures_of_group(group):
    """Figures of a group: its wiring, the search in it, its tests, the ways to its cells' models."""
    models = [f"results/models/{cell}.json" for cell in LEAVES[group] if cell in MODELLED]
    yield figure("wiring", settings={"rows": WIRED[group]}, models=models)
    if group in GROUPS_SEARCHED:
        yield from figures_of_effect(group, GROUP_EFFECT_FIGURES)
    for row in tests(group, "group") if group in SHARED else ():
        parts = of_test(group, row["test"], series="pack_series", scores="pack")
        yield figure("pack", test=row["test"], **parts)
        parts = of_test(group, row["test"], spread="pack_spread", findings="pack_findings")
        yield figure("pack_spread", test=row["test"], **parts)
    for row in tests(group, "group") if group in SERIES else ():
        stages = {"waterfall": "series_pack_waterfall", "cells": "series_pack_cells"}
        yield figure("series_pack", test=row["test"], **of_test(group, row["test"], **stages))
        parts = of_test(group, row["test"], series="series_pack_series")
        yield figure("weakest", test=row["test"], **parts)
    for row in tests(group, "group") if group in NESTED else ():
        parts = of_test(group, row["test"], series="nested_pack_series", scores="nested_pack")
        yield figure("nested_pack", test=row["test"], **parts)
    ways = [
        f"results/stages/bias_ways/{first}.parquet" for first in LENT.judged_with(LEAVES[group])
    ]
    if ways:
        yield figure("ways", settings={"cells": list(LEAVES[group])}, ways=ways)


# Of every cell and group: what its figures are drawn from, in the report's order.
DRAWN_FROM = {
    cell: dict(
        [
            *figures_of_records(cell),
            *figures_of_tests(cell),
            *figures_of_laws(cell),
            *figures_of_health(cell),
            *figures_of_models(cell),
        ]
    )
    for cell in CELLS
} | {group: dict(figures_of_group(group)) for group in BRANCHES}
# Cells seen at two cycles of their life.
LIVED = dict.fromkeys(
    cell for cell in CELLS if cell in AGED or len(PLAN.cycles(cell, *CAPACITY_KINDS)) > 1
)
HEALTH_FIGURES = [
    *(["results/figures/lives.svg"] if LIVED else []),
    # Of fewer cells of a type no line is drawn; tables and page say so.
    *(["results/figures/fleet.svg"] if max(map(len, FLEETS.values()), default=0) >= 6 else []),
]
BIAS_FIGURES = ["results/figures/bias.svg"] if JUDGED else []
# Paths of all figures: of the campaign, under a name that none else can have, of every cell and group.
FIGURES = {"the campaign": ["results/figures/overview.svg", *BIAS_FIGURES, *HEALTH_FIGURES]} | {
    owner: [f"results/figures/{owner}/{name}.svg" for name in figures]
    for owner, figures in DRAWN_FROM.items()
}
# What Snakemake follows: a folder of figures for each cell or group that has some.
FIGURE_FOLDERS = [f"results/figures/{owner}" for owner, figures in DRAWN_FROM.items() if figures]


def inputs_of_figures(wildcards):
    """All artefacts that the figures of a cell or group are drawn from."""
    figures = DRAWN_FROM[wildcards.owner].values()
    return sorted({path for drawn in figures for path in paths_in(drawn["inputs"])})


def paths_in(inputs):
    """Paths of inputs that are a path or a list of paths each."""
    return [p for part in inputs.values() for p in ([part] if isinstance(part, str) else part)]


rule figures:
    input:
        inputs_of_figures,
    output:
        directory("results/figures/{owner}"),
    log:
        "logs/figures/{owner}.log",
    params:
        figures=own(DRAWN_FROM.get),
        owner_kind=lambda w: "cell" if w.owner in CELLS else "group",
    message:
        "Figures of {wildcards.owner}."
    script:
        "../../scripts/drawing/figures.py"


rule figure_lives:
    input:
        health="results/tables/health.csv",
        fade="results/tables/fade.csv",
        courses=[f"results/stages/fade_course/{cell}.parquet" for cell in AGED],
    output:
        "results/figures/lives.svg",
    log:
        "logs/figures/lives.log",
    params:
        protocols={cell: CELLS[cell]["ageing_protocol"] for cell in LIVED},
    message:
        "Figure: state of health over the lives of all cells."
    script:
        "../../scripts/drawing/figure_lives.py"


rule figure_fleet:
    input:
        cells="results/tables/fleet_health.csv",
        lines="results/tables/fleet_health_lines.csv",
    output:
        "results/figures/fleet.svg",
    log:
        "logs/figures/fleet.log",
    message:
        "Figure: resistance against capacity over the cells of each type."
    script:
        "../../scripts/drawing/figure_fleet.py"


rule figure_bias:
    input:
        [f"results/stages/bias_ways/{cell}.parquet" for cell in JUDGED],
    output:
        "results/figures/bias.svg",
    log:
        "logs/figures/bias.log",
    params:
        types={cell: "{} {:g} Ah".format(*FITS.type_of(cell)) for cell in JUDGED},
    message:
        "Figure: four ways to the models of the cells of each type."
    script:
        "../../scripts/drawing/figure_bias.py"


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
        cells={
            cell: sheets.type_name(CELLS[cell])
            for cell in CELLS
            if TESTS_OF[cell] or cell in MODELLED
        },
    message:
        "Figure: the campaign at a glance."
    script:
        "../../scripts/drawing/figure_overview.py"
