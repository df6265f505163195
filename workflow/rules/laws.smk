# How quantities move with temperature, the open-circuit voltage among them.


VARIED = dict.fromkeys(
    cell
    for cell in CELLS
    if len(chamber_temperatures(cell, *CAPACITY_KINDS, *PULSE_KINDS, "eis")) >= 3
)
PULSED = dict.fromkeys(cell for cell in CELLS if len(chamber_temperatures(cell, *PULSE_KINDS)) >= 3)
CHILLED = dict.fromkeys(
    cell
    for cell in CELLS
    if max(len(chamber_temperatures(cell, k)) for k in [*PULSE_KINDS, "eis"]) >= 3
)

# Cells of one type that were pulsed at few temperatures each, many together; by the first of them.
KINDRED = {}
for cell, row in CELLS.items():
    if chamber_temperatures(cell, *PULSE_KINDS) and cell not in PULSED and row["chemistry"]:
        KINDRED.setdefault((row["chemistry"], row["rated_capacity_ampere_hour"]), []).append(cell)
KINDRED = {
    cells[0]: cells
    for cells in KINDRED.values()
    if len(set().union(*(chamber_temperatures(cell, *PULSE_KINDS) for cell in cells))) >= 3
}


def facts_of_tests_of_type(wildcards):
    """What the sheet says of each test of a cell, and of its kindred."""
    return PLAN.facts_of_tests_of(dict.fromkeys([wildcards.cell, *KINDRED.get(wildcards.cell, [])]))


rule temperature:
    input:
        resistance=PLAN.own_fitted("resistance", *PULSE_KINDS),
        capacity=PLAN.own_fitted("capacity", *CAPACITY_KINDS),
        eis=PLAN.own_fitted("eis", "eis"),
    output:
        laws="results/stages/temperature/{cell}.parquet",
        points="results/stages/temperature_points/{cell}.parquet",
    log:
        "logs/temperature/{cell}.log",
    wildcard_constraints:
        cell=either(VARIED),
    params:
        tests=facts_of_tests_of_type,
        settings=config["temperature"],
    message:
        "Resistance and capacity of {wildcards.cell} over temperature: quadratic and Arrhenius."
    script:
        "../../scripts/laws/temperature.py"


rule cold_limit:
    input:
        points="results/stages/temperature_points/{cell}.parquet",
        laws="results/stages/temperature/{cell}.parquet",
    output:
        "results/stages/cold_limit/{cell}.json",
    log:
        "logs/cold_limit/{cell}.log",
    wildcard_constraints:
        cell=either(CHILLED),
    message:
        "What limits {wildcards.cell} in the cold, in words."
    script:
        "../../scripts/laws/cold_limit.py"


rule resistance_surface:
    input:
        resistance=PLAN.own_fitted("resistance", *PULSE_KINDS),
    output:
        laws="results/stages/resistance_surface/{cell}.parquet",
        points="results/stages/resistance_surface_points/{cell}.parquet",
    log:
        "logs/resistance_surface/{cell}.log",
    wildcard_constraints:
        cell=either(PULSED),
    params:
        tests=facts_of_tests_of_type,
        delay_second=config["temperature"]["delay_second"],
    message:
        "Resistance of {wildcards.cell} over SoC and temperature: three forms, tested."
    script:
        "../../scripts/laws/resistance_surface.py"


rule temperature_of_type:
    input:
        resistance=PLAN.fitted_of(KINDRED.get, "resistance", *PULSE_KINDS),
    output:
        laws="results/stages/temperature_of_type/{cell}.parquet",
        points="results/stages/temperature_of_type_points/{cell}.parquet",
    log:
        "logs/temperature_of_type/{cell}.log",
    wildcard_constraints:
        cell=either(KINDRED),
    params:
        tests=facts_of_tests_of_type,
        settings=config["temperature"],
    message:
        "Resistance over temperature across the cells of the type of {wildcards.cell}."
    script:
        "../../scripts/laws/temperature_of_type.py"


# Cells with slow tests at three temperatures, or with rests in a chamber that steps.
STEPPED = dict.fromkeys(
    cell
    for cell in CELLS
    if tests(cell, "ocv_temperature", roles=["fit"]) or len(chamber_temperatures(cell, "ocv")) >= 3
)


rule ocv_step:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        basis="results/stages/basis/{cell}.json",
    output:
        "results/stages/ocv_step/{cell}/{test}.parquet",
    log:
        "logs/ocv_step/{cell}/{test}.log",
    params:
        test=test_facts,
        cell=cell_facts,
    message:
        "Shift of the open-circuit voltage of {wildcards.cell} as the chamber steps in {wildcards.test}."
    script:
        "../../scripts/laws/ocv_step.py"


rule ocv_temperature:
    input:
        curves=PLAN.own_fitted("ocv", "ocv"),
        steps=PLAN.own_fitted("ocv_step", "ocv_temperature"),
    output:
        map="results/stages/ocv_temperature/{cell}.parquet",
        entropic="results/stages/ocv_entropic/{cell}.parquet",
        surface="results/stages/ocv_surface/{cell}.parquet",
        functions="results/stages/ocv_functions_temperature/{cell}.parquet",
        laws="results/stages/ocv_laws/{cell}.parquet",
    log:
        "logs/ocv_temperature/{cell}.log",
    wildcard_constraints:
        cell=either(STEPPED),
    message:
        "Open-circuit voltage of {wildcards.cell} over temperature: bias, entropic coefficient, functions."
    script:
        "../../scripts/laws/ocv_temperature.py"


# Cells that were rested on purpose; of the others a rest is what lay between two other tests.
RESTED_KINDS = ("relaxation", "hppc", "ocv_temperature")
RELAXED = dict.fromkeys(cell for cell in CELLS if tests(cell, *RESTED_KINDS, roles=["fit"]))


rule polarisation:
    input:
        PLAN.own_fitted("relaxation", *RELAXATION_KINDS),
    output:
        laws="results/stages/polarisation/{cell}.parquet",
        points="results/stages/polarisation_points/{cell}.parquet",
    log:
        "logs/polarisation/{cell}.log",
    wildcard_constraints:
        cell=either(RELAXED),
    params:
        tests=facts_of_own_tests,
    message:
        "Polarisation of {wildcards.cell} over SoC and temperature, and its laws."
    script:
        "../../scripts/laws/polarisation.py"
