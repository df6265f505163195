# How quantities move with temperature.

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


# Cells that were rested on purpose; of the others a rest is what lay between two other tests.
RESTED_KINDS = [
    kind for kind in ("relaxation", "hppc", "ocv_temperature") if kind in RELAXATION_KINDS
]
RELAXED = [cell for cell in CELLS if RESTED_KINDS and tests(cell, *RESTED_KINDS, roles=["fit"])]


rule polarisation:
    input:
        lambda w: fitted("relaxation", w.cell, *RELAXATION_KINDS),
    output:
        laws="results/polarisation/{cell}.parquet",
        points="results/polarisation_points/{cell}.parquet",
    log:
        "logs/polarisation/{cell}.log",
    wildcard_constraints:
        cell=either(RELAXED),
    params:
        tests=lambda w: {k: v for k, v in TEST_FACTS.items() if k.startswith(f"{w.cell}/")},
        code=code_of("polarisation"),
    message:
        "Polarisation of {wildcards.cell} over SoC and temperature, and its laws."
    script:
        "../../scripts/polarisation.py"
