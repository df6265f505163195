# Figures are rules, never options of analyses.

EFFECT_FIGURES = ("validation", "map", "evidence", "ranking", "confounding")
FIGURES = {"campaign": ["results/figures/overview.svg"]}
for cell in CELLS:
    names = [
        ("records", TESTS_OF[cell] and tests(cell, *SERIES_KINDS)),
        ("capacity", tests(cell, *CAPACITY_KINDS)),
        ("ocv", tests(cell, "ocv") or resting(cell)),
        ("resistance", tests(cell, *PULSE_KINDS)),
        ("ica", tests(cell, "ica")),
        ("impedance", tests(cell, "eis")),
        ("impedance_fit", tests(cell, "eis")),
        ("drt", tests(cell, "eis")),
        ("temperature", cell in VARIED),
        ("ocv_temperature", cell in STEPPED),
        ("capacity_loss", cell in COLD),
        ("ica_temperature", cell in COLD_PEAKS),
        ("fast_charge", tests(cell, "fast_charge")),
        *[(f"ageing_{row['test']}", True) for row in tests(cell, "ageing")],
        ("arrhenius", cell in CHILLED),
        ("surface", cell in PULSED),
        ("relaxation", cell in RELAXED),
        ("polarisation", cell in RELAXED),
        ("parameters", cell in MODELLED),
        ("identification_methods", cell in COMPARED),
        ("compensation", cell in COMPENSATED),
        *[(f"effect_{name}", cell in SEARCHED) for name in EFFECT_FIGURES],
    ]
    scored = [f"validation_{row['test']}" for row in SCORED.get(cell, [])]
    filtered = [f"soc_{row['test']}" for row in SCORED.get(cell, [])]
    FIGURES[cell] = [
        f"results/figures/{cell}/{name}.svg"
        for name in [n for n, has in names if has] + scored + filtered
    ]
for group in BRANCHES:
    names = [f"effect_{name}" for name in ("branches", "ranking") if group in GROUPS_SEARCHED]
    names += [f"pack_{row['test']}" for row in tests(group, "group") if group in PAIRS]
    FIGURES[group] = [f"results/figures/{group}/{name}.svg" for name in names]


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
        "../../scripts/figure_overview.py"


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
        "../../scripts/figure_records.py"


rule figure_capacity:
    input:
        lambda w: artefacts("capacity", w.cell, *CAPACITY_KINDS),
    output:
        "results/figures/{cell}/capacity.svg",
    log:
        "logs/figures/{cell}_capacity.log",
    message:
        "Figure: capacity of {wildcards.cell}."
    script:
        "../../scripts/figure_capacity.py"


rule figure_ocv:
    input:
        lambda w: artefacts("ocv", w.cell, "ocv") or rest_curves(w.cell),
    output:
        "results/figures/{cell}/ocv.svg",
    log:
        "logs/figures/{cell}_ocv.log",
    message:
        "Figure: open-circuit voltage of {wildcards.cell}."
    script:
        "../../scripts/figure_ocv.py"


rule figure_resistance:
    input:
        lambda w: artefacts("resistance", w.cell, *PULSE_KINDS),
    output:
        "results/figures/{cell}/resistance.svg",
    log:
        "logs/figures/{cell}_resistance.log",
    message:
        "Figure: resistance of {wildcards.cell} over SoC."
    script:
        "../../scripts/figure_resistance.py"


rule figure_ica:
    input:
        curves=lambda w: artefacts("ica_curve", w.cell, "ica"),
        peaks=lambda w: artefacts("ica", w.cell, "ica"),
    output:
        "results/figures/{cell}/ica.svg",
    log:
        "logs/figures/{cell}_ica.log",
    message:
        "Figure: incremental capacity of {wildcards.cell}."
    script:
        "../../scripts/figure_ica.py"


rule figure_impedance:
    input:
        lambda w: artefacts("eis_curve", w.cell, "eis"),
    output:
        "results/figures/{cell}/impedance.svg",
    log:
        "logs/figures/{cell}_impedance.log",
    message:
        "Figure: impedance of {wildcards.cell}."
    script:
        "../../scripts/figure_impedance.py"


rule figure_impedance_fit:
    input:
        lambda w: artefacts("eis_curve", w.cell, "eis"),
    output:
        "results/figures/{cell}/impedance_fit.svg",
    log:
        "logs/figures/{cell}_impedance_fit.log",
    message:
        "Figure: what the circuit leaves of the spectra of {wildcards.cell}."
    script:
        "../../scripts/figure_impedance_fit.py"


rule figure_drt:
    input:
        curves=lambda w: artefacts("drt", w.cell, "eis"),
        peaks=lambda w: artefacts("drt_peaks", w.cell, "eis"),
    output:
        "results/figures/{cell}/drt.svg",
    log:
        "logs/figures/{cell}_drt.log",
    message:
        "Figure: relaxation times in the spectra of {wildcards.cell}."
    script:
        "../../scripts/figure_drt.py"


rule figure_relaxation:
    input:
        lambda w: artefacts("relaxation_curve", w.cell, *RELAXATION_KINDS),
    output:
        "results/figures/{cell}/relaxation.svg",
    log:
        "logs/figures/{cell}_relaxation.log",
    message:
        "Figure: rests of {wildcards.cell} and the exponentials through them."
    script:
        "../../scripts/figure_relaxation.py"


rule figure_polarisation:
    input:
        points="results/polarisation_points/{cell}.parquet",
        laws="results/polarisation/{cell}.parquet",
    output:
        "results/figures/{cell}/polarisation.svg",
    log:
        "logs/figures/{cell}_polarisation.log",
    message:
        "Figure: polarisation of {wildcards.cell} over SoC and temperature."
    script:
        "../../scripts/figure_polarisation.py"


rule figure_temperature:
    input:
        points="results/temperature_points/{cell}.parquet",
        laws="results/temperature/{cell}.parquet",
    output:
        "results/figures/{cell}/temperature.svg",
    log:
        "logs/figures/{cell}_temperature.log",
    message:
        "Figure: resistance and capacity of {wildcards.cell} over temperature."
    script:
        "../../scripts/figure_temperature.py"


rule figure_ocv_temperature:
    input:
        map="results/ocv_temperature/{cell}.parquet",
        entropic="results/ocv_entropic/{cell}.parquet",
        surface="results/ocv_surface/{cell}.parquet",
        functions="results/ocv_functions_temperature/{cell}.parquet",
    output:
        "results/figures/{cell}/ocv_temperature.svg",
    log:
        "logs/figures/{cell}_ocv_temperature.log",
    message:
        "Figure: open-circuit voltage of {wildcards.cell} over temperature."
    script:
        "../../scripts/figure_ocv_temperature.py"


rule figure_capacity_loss:
    input:
        "results/capacity_loss/{cell}.parquet",
    output:
        "results/figures/{cell}/capacity_loss.svg",
    log:
        "logs/figures/{cell}_capacity_loss.log",
    message:
        "Figure: capacity of {wildcards.cell} lost to temperature and rate."
    script:
        "../../scripts/figure_capacity_loss.py"


rule figure_ica_temperature:
    input:
        matches="results/ica_temperature/{cell}.parquet",
        peaks="results/ica_temperature_peaks/{cell}.parquet",
        curves="results/ica_temperature_curve/{cell}.parquet",
    output:
        "results/figures/{cell}/ica_temperature.svg",
    log:
        "logs/figures/{cell}_ica_temperature.log",
    message:
        "Figure: incremental capacity of {wildcards.cell} by temperature."
    script:
        "../../scripts/figure_ica_temperature.py"


rule figure_fast_charge:
    input:
        series=lambda w: artefacts("clean", w.cell, "fast_charge"),
        steps=lambda w: artefacts("segment", w.cell, "fast_charge"),
        numbers=lambda w: artefacts("fast_charge", w.cell, "fast_charge"),
    output:
        "results/figures/{cell}/fast_charge.svg",
    log:
        "logs/figures/{cell}_fast_charge.log",
    message:
        "Figure: fast charges of {wildcards.cell} by temperature."
    script:
        "../../scripts/figure_fast_charge.py"


rule figure_ageing:
    input:
        summary="results/ageing_temperature/{cell}/{test}.parquet",
        cycles="results/ageing_temperature_cycles/{cell}/{test}.parquet",
        periods="results/ageing_temperature_periods/{cell}/{test}.parquet",
    output:
        "results/figures/{cell}/ageing_{test}.svg",
    log:
        "logs/figures/{cell}_ageing_{test}.log",
    message:
        "Figure: cycles of {wildcards.cell} in {wildcards.test} over temperature."
    script:
        "../../scripts/figure_ageing.py"


rule figure_arrhenius:
    input:
        points="results/temperature_points/{cell}.parquet",
        laws="results/temperature/{cell}.parquet",
    output:
        "results/figures/{cell}/arrhenius.svg",
    log:
        "logs/figures/{cell}_arrhenius.log",
    message:
        "Figure: Arrhenius lines of {wildcards.cell}."
    script:
        "../../scripts/figure_arrhenius.py"


rule figure_surface:
    input:
        points="results/resistance_surface_points/{cell}.parquet",
        laws="results/resistance_surface/{cell}.parquet",
    output:
        "results/figures/{cell}/surface.svg",
    log:
        "logs/figures/{cell}_surface.log",
    message:
        "Figure: resistance of {wildcards.cell} over SoC and temperature."
    script:
        "../../scripts/figure_surface.py"


rule figure_parameters:
    input:
        "results/models/{cell}.json",
    output:
        "results/figures/{cell}/parameters.svg",
    log:
        "logs/figures/{cell}_parameters.log",
    message:
        "Figure: model parameters of {wildcards.cell} over SoC."
    script:
        "../../scripts/figure_parameters.py"


rule figure_validation:
    input:
        series="results/simulation/{cell}/{test}.parquet",
        scores="results/validation/{cell}/{test}.parquet",
    output:
        "results/figures/{cell}/validation_{test}.svg",
    log:
        "logs/figures/{cell}_validation_{test}.log",
    message:
        "Figure: model over measurement, {wildcards.cell} {wildcards.test}."
    script:
        "../../scripts/figure_validation.py"


rule figure_soc:
    input:
        series="results/soc_series/{cell}/{test}.parquet",
        scores="results/soc/{cell}/{test}.parquet",
    output:
        "results/figures/{cell}/soc_{test}.svg",
    log:
        "logs/figures/{cell}_soc_{test}.log",
    message:
        "Figure: state of charge by filters, {wildcards.cell} {wildcards.test}."
    script:
        "../../scripts/figure_soc.py"


rule figure_pack:
    input:
        series="results/pack_series/{group}/{test}.parquet",
        scores="results/pack/{group}/{test}.parquet",
    output:
        "results/figures/{group}/pack_{test}.svg",
    log:
        "logs/figures/{group}_pack_{test}.log",
    message:
        "Figure: branch currents of {wildcards.group} in {wildcards.test}."
    script:
        "../../scripts/figure_pack.py"
