# The compensated model: each temperature left out of the fit and predicted from the others.


def known_celsius(cell):
    """Temperatures as stated at which a cell's model may be identified."""
    stated = {row["ambient_temperature_celsius"] for row in fit_tests(cell)}
    return sorted(stated - {None})


# Two temperatures are the least that a law can go through, and one is left out.
LEAVES_OUT = config["models"]["leave_temperatures_out"]
COMPENSATED = dict.fromkeys(
    cell for cell in CELLS if LEAVES_OUT and cell in EXCITED and len(known_celsius(cell)) >= 3
)


def left_out_of(cell):
    """Models of a cell without each of its temperatures."""
    return [f"results/stages/left_out/{cell}/{celsius:g}.json" for celsius in known_celsius(cell)]


def predictable(cell, roles):
    """Series of drives and pulses at a stated temperature that a model is identified at."""
    rows = tests(cell, *FIT_ROLES, roles=roles)
    known = known_celsius(cell)
    near = [row for row in rows if row["ambient_temperature_celsius"] in known]
    return of_rows("clean", cell, near)


rule identify_without:
    input:
        basis="results/stages/basis/{cell}.json",
        whole="results/stages/identify/{cell}.json",
        series=own(fit_series),
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
        left_out=own(left_out_of),
        series=own(partial(predictable, roles=["fit", "split"])),
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
        "Compare laws over temperature of {wildcards.cell}: each temperature predicted from the others."
    script:
        "../../scripts/compensation/compensation.py"


rule temperature_prediction:
    input:
        whole="results/stages/identify/{cell}.json",
        left_out=own(left_out_of),
        laws="results/stages/compensation/{cell}.parquet",
        series=own(partial(predictable, roles=["validation", "split"])),
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
