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
