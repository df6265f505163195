# Figures of laws over temperature, rate and cycle.


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
        "../../scripts/figures_of_laws/figure_polarisation.py"


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
        "../../scripts/figures_of_laws/figure_temperature.py"


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
        "../../scripts/figures_of_laws/figure_ocv_temperature.py"


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
        "../../scripts/figures_of_laws/figure_capacity_loss.py"


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
        "../../scripts/figures_of_laws/figure_ica_temperature.py"


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
        "../../scripts/figures_of_laws/figure_ageing.py"


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
        "../../scripts/figures_of_laws/figure_arrhenius.py"


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
        "../../scripts/figures_of_laws/figure_surface.py"
