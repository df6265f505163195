# Figures of models, filters and groups over measurement, and of the search for what is missing.


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
        "../../scripts/figures_of_models/figure_parameters.py"


rule figure_identification_methods:
    input:
        "results/identification_methods/{cell}.parquet",
    output:
        "results/figures/{cell}/identification_methods.svg",
    log:
        "logs/figures/{cell}_identification_methods.log",
    message:
        "Figure: circuits of {wildcards.cell} by identification method."
    script:
        "../../scripts/figures_of_models/figure_identification_methods.py"


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
        "../../scripts/figures_of_models/figure_validation.py"


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
        "../../scripts/figures_of_models/figure_soc.py"


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
        "../../scripts/figures_of_models/figure_pack.py"


rule figure_compensation:
    input:
        laws="results/compensation/{cell}.parquet",
        proof="results/temperature_prediction/{cell}.parquet",
    output:
        "results/figures/{cell}/compensation.svg",
    log:
        "logs/figures/{cell}_compensation.log",
    message:
        "Figure: model of {wildcards.cell} at temperatures left out of its fit."
    script:
        "../../scripts/figures_of_models/figure_compensation.py"


rule figure_missing_effect:
    input:
        verdict="results/missing_effect/{cell}/verdict.json",
        ranking="results/missing_effect/{cell}/ranking.parquet",
        map="results/missing_effect/{cell}/map.parquet",
        evidence="results/missing_effect/{cell}/evidence.parquet",
        series="results/missing_effect/{cell}/series.parquet",
        confounding="results/missing_effect/{cell}/confounding.parquet",
    output:
        validation="results/figures/{cell}/effect_validation.svg",
        map="results/figures/{cell}/effect_map.svg",
        evidence="results/figures/{cell}/effect_evidence.svg",
        ranking="results/figures/{cell}/effect_ranking.svg",
        confounding="results/figures/{cell}/effect_confounding.svg",
    log:
        "logs/figures/{cell}_missing_effect.log",
    wildcard_constraints:
        cell=either(ASKED),
    params:
        gates={name: config["missing_effect"][name] for name in ("bic", "validation_chi_square")},
    message:
        "Figures: effect that the model of {wildcards.cell} lacks, and the evidence for it."
    script:
        "../../scripts/figures_of_models/figure_missing_effect.py"


rule figure_missing_effect_group:
    input:
        verdict="results/missing_effect/{group}/verdict.json",
        ranking="results/missing_effect/{group}/ranking.parquet",
        series="results/missing_effect/{group}/series.parquet",
    output:
        branches="results/figures/{group}/effect_branches.svg",
        ranking="results/figures/{group}/effect_ranking.svg",
    log:
        "logs/figures/{group}_missing_effect.log",
    wildcard_constraints:
        group=either(GROUPS_ASKED),
    params:
        gates=config["missing_effect_group"]["gates"],
    message:
        "Figures: effect in one branch of {wildcards.group}, and the evidence for it."
    script:
        "../../scripts/figures_of_models/figure_missing_effect_group.py"
