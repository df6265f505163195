# Identification methods compared: the thesis' three, lmfit and this project's, on the same pulses.
# No part of the main job: `snakemake methods`.

# Cells with pulses that may be fitted.
COMPARED = dict.fromkeys(cell for cell in CELLS if tests(cell, *PULSE_KINDS, roles=["fit"]))


rule identification_methods:
    input:
        series=PLAN.own_fitted("clean", *PULSE_KINDS),
        steps=PLAN.own_fitted("segment", *PULSE_KINDS),
        basis="results/stages/basis/{cell}.json",
    output:
        "results/stages/identification_methods/{cell}.parquet",
    log:
        "logs/identification_methods/{cell}.log",
    wildcard_constraints:
        cell=either(COMPARED),
    params:
        cell=cell_facts,
    message:
        "Identify the pulses of {wildcards.cell} by each method, to compare them."
    script:
        "../../scripts/methods/identification_methods.py"


rule figure_methods:
    input:
        "results/stages/identification_methods/{cell}.parquet",
    output:
        "results/stages/identification_methods/{cell}.svg",
    log:
        "logs/figure_methods/{cell}.log",
    wildcard_constraints:
        cell=either(COMPARED),
    message:
        "Figure: the pulses of {wildcards.cell} by each identification method."
    script:
        "../../scripts/methods/figure_methods.py"


rule methods:
    input:
        rows=[f"results/stages/identification_methods/{cell}.parquet" for cell in COMPARED],
        figures=[f"results/stages/identification_methods/{cell}.svg" for cell in COMPARED],
    output:
        "results/tables/identification_methods.csv",
    log:
        "logs/methods.log",
    params:
        tests=TEST_FACTS,
    message:
        "Identification methods compared on the pulses of the whole campaign: {output}."
    script:
        "../../scripts/methods/methods.py"
