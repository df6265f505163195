# How quantities move with temperature, the open-circuit voltage among them.

VARIED = [
    cell
    for cell in CELLS
    if len(
        {
            row["ambient_temperature_celsius"]
            for row in tests(cell, *CAPACITY_KINDS, *PULSE_KINDS, roles=["fit"])
            if row["ambient_temperature_celsius"] is not None
        }
    )
    >= 3
]


rule temperature:
    input:
        resistance=lambda w: fitted("resistance", w.cell, *PULSE_KINDS),
        capacity=lambda w: fitted("capacity", w.cell, *CAPACITY_KINDS),
    output:
        laws="results/temperature/{cell}.parquet",
        points="results/temperature_points/{cell}.parquet",
    log:
        "logs/temperature/{cell}.log",
    wildcard_constraints:
        cell=either(VARIED),
    params:
        tests=lambda w: {k: v for k, v in TEST_FACTS.items() if k.startswith(f"{w.cell}/")},
        code=code_of("temperature"),
    message:
        "Resistance and capacity of {wildcards.cell} over temperature: quadratic and Arrhenius."
    script:
        "../../scripts/temperature.py"


# Cells with slow tests at three temperatures, or with rests in a chamber that steps.
STEPPED = [
    cell
    for cell in CELLS
    if tests(cell, "ocv_temperature", roles=["fit"])
    or len(
        {
            row["ambient_temperature_celsius"]
            for row in tests(cell, "ocv", roles=["fit"])
            if row["ambient_temperature_celsius"] is not None
        }
    )
    >= 3
]


rule ocv_step:
    input:
        series="results/clean/{cell}/{test}.parquet",
        steps="results/segment/{cell}/{test}.parquet",
        basis="results/basis/{cell}.json",
    output:
        "results/ocv_step/{cell}/{test}.parquet",
    log:
        "logs/ocv_step/{cell}/{test}.log",
    params:
        settings=config["ocv_step"],
        test=test_facts,
        cell=cell_facts,
        code=code_of("ocv_step"),
    message:
        "Shift of the open-circuit voltage of {wildcards.cell} as the chamber steps in {wildcards.test}."
    script:
        "../../scripts/ocv_step.py"


rule ocv_temperature:
    input:
        curves=lambda w: fitted("ocv", w.cell, "ocv"),
        steps=lambda w: fitted("ocv_step", w.cell, "ocv_temperature"),
    output:
        map="results/ocv_temperature/{cell}.parquet",
        entropic="results/ocv_entropic/{cell}.parquet",
        surface="results/ocv_surface/{cell}.parquet",
        functions="results/ocv_functions_temperature/{cell}.parquet",
        laws="results/ocv_laws/{cell}.parquet",
    log:
        "logs/ocv_temperature/{cell}.log",
    wildcard_constraints:
        cell=either(STEPPED),
    params:
        settings=config["ocv_temperature"],
        code=code_of("ocv_temperature"),
    message:
        "Open-circuit voltage of {wildcards.cell} over temperature: bias, entropic coefficient, functions."
    script:
        "../../scripts/ocv_temperature.py"
