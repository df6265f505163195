# How far models reach over temperature: each one left out of the fit and predicted from the others.

# Two temperatures are the least that tell a law, and one is left out.
LEAVES_OUT = config["models"]["leave_temperatures_out"]
COMPENSATED = dict.fromkeys(
    cell for cell in CELLS if LEAVES_OUT and cell in EXCITED and len(FITS.fit_celsius(cell)) >= 3
)


rule identify_without:
    input:
        basis="results/stages/basis/{cell}.json",
        whole="results/stages/identify/{cell}.json",
        series=own(FITS.fit_series),
    output:
        "results/stages/left_out/{cell}/{celsius}.json",
    log:
        "logs/left_out/{cell}/{celsius}.log",
    wildcard_constraints:
        cell=either(COMPENSATED),
        celsius=r"-?[\d.]+",
    params:
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
    message:
        "Model of {wildcards.cell} without the tests at {wildcards.celsius} °C."
    script:
        "../../scripts/compensation/identify_without.py"


rule compensation:
    input:
        whole="results/stages/identify/{cell}.json",
        left_out=own(FITS.left_out_models),
        series=own(partial(FITS.predictable, roles=["fit", "split"])),
    output:
        "results/stages/compensation/{cell}.parquet",
    log:
        "logs/compensation/{cell}.log",
    wildcard_constraints:
        cell=either(COMPENSATED),
    params:
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
    message:
        "Predict the fitted tests of {wildcards.cell} at each temperature from the others."
    script:
        "../../scripts/compensation/compensation.py"


rule temperature_prediction:
    input:
        whole="results/stages/identify/{cell}.json",
        left_out=own(FITS.left_out_models),
        series=own(partial(FITS.predictable, roles=["validation", "split"])),
    output:
        "results/stages/temperature_prediction/{cell}.parquet",
    log:
        "logs/temperature_prediction/{cell}.log",
    wildcard_constraints:
        cell=either(COMPENSATED),
    params:
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
    message:
        "Predict {wildcards.cell} at temperatures that took no part in the fit."
    script:
        "../../scripts/compensation/temperature_prediction.py"
