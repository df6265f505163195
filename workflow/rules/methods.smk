# Identification methods compared: the thesis' three, lmfit and this project's, on the same pulses.

# Cells with pulses that may be fitted.
COMPARED = dict.fromkeys(cell for cell in CELLS if tests(cell, *PULSE_KINDS, roles=["fit"]))


rule identification_methods:
    input:
        series=PLAN.own_fitted("clean", *PULSE_KINDS),
        steps=PLAN.own_fitted("segment", *PULSE_KINDS),
        basis="results/basis/{cell}.json",
    output:
        "results/identification_methods/{cell}.parquet",
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
