# The results contract: plain CSV tables, the summary, what was left out, the manifest.

SCORES, FILTERED = (
    [
        f"results/{stage}/{cell}/{row['test']}.parquet"
        for cell, rows in SCORED.items()
        for row in rows
    ]
    for stage in ("validation", "soc")
)
MODELS = [f"results/models/{cell}.json" for cell in MODELLED]
TABLE_INPUTS = {
    "capacity": [*everywhere("capacity", *CAPACITY_KINDS), *everywhere("ageing_cycles", "ageing")],
    "resistance": everywhere("resistance", *PULSE_KINDS),
    "ocv": [
        *everywhere("ocv_functions", "ocv"),
        *[f"results/ocv_functions_temperature/{cell}.parquet" for cell in STEPPED],
    ],
    "eis": everywhere("eis", "eis"),
    "temperature_prediction": [
        f"results/temperature_prediction/{cell}.parquet" for cell in COMPENSATED
    ],
    "temperature": [
        *[f"results/temperature/{cell}.parquet" for cell in VARIED],
        *[f"results/resistance_surface/{cell}.parquet" for cell in PULSED],
        *[f"results/temperature_of_type/{cell}.parquet" for cell in KINDRED],
        *[f"results/polarisation/{cell}.parquet" for cell in RELAXED],
        *[f"results/ocv_laws/{cell}.parquet" for cell in STEPPED],
        *LOSS_LAWS,
    ],
    "capacity_loss": [f"results/capacity_loss/{cell}.parquet" for cell in COLD],
    "ica_temperature": [f"results/ica_temperature/{cell}.parquet" for cell in COLD_PEAKS],
    "fast_charge": everywhere("fast_charge", "fast_charge"),
    "ageing": everywhere("ageing_temperature", "ageing"),
    "ica": everywhere("ica", "ica"),
    "models": [f"results/parameters/{cell}.parquet" for cell in MODELLED],
    "identification_methods": [
        f"results/identification_methods/{cell}.parquet" for cell in COMPARED
    ],
    "choice": [f"results/choice/{cell}.parquet" for cell in MODELLED],
    "validation": SCORES,
    "soc": FILTERED,
    "packs": [p for group in PAIRS for p in artefacts("pack", group, "group")],
}
TABLES = [*TABLE_INPUTS, "missing_effect", "excluded"]
COLD_WORDS = [f"results/cold_limit/{cell}.json" for cell in CHILLED]
STAGES = [
    *everywhere("ingest", *SERIES_KINDS),
    *everywhere("spectrum", "eis"),
    *everywhere("clean", *SERIES_KINDS),
    *everywhere("segment", *SERIES_KINDS),
    *everywhere("relaxation", *RELAXATION_KINDS),
    *[path for cell in CELLS for path in rest_curves(cell)],
    *[f"results/basis/{cell}.json" for cell in CELLS],
    *[f"results/identify/{cell}.json" for cell in IDENTIFIED],
    *[f"results/bias/{cell}.json" for cell in BIASED],
    *[path for cell in COMPENSATED for path in left_out_of(cell)],
    *[f"results/compensation/{cell}.parquet" for cell in COMPENSATED],
    *[f"results/branches/{group}.json" for group in sorted(set(GROUPED.values()))],
    *MODELS,
    *EXPORTED["pybamm_thevenin.json"],
    *[path for paths in TABLE_INPUTS.values() for path in paths],
    *[f"results/thermometer/{cell}.parquet" for cell in THERMOMETERS],
    *COLD_WORDS,
    *[f"results/missing_effect/{cell}/verdict.json" for cell in SEARCHED],
    *[f"results/missing_effect/{group}/verdict.json" for group in GROUPS_SEARCHED],
]


rule table:
    input:
        lambda w: TABLE_INPUTS[w.table],
    output:
        table="results/tables/{table}.csv",
    log:
        "logs/table/{table}.log",
    wildcard_constraints:
        table=either(TABLE_INPUTS),
    params:
        tests=TEST_FACTS,
    message:
        "Table {wildcards.table}.csv of the whole campaign."
    script:
        "../../scripts/tables/table.py"


rule excluded:
    input:
        STAGES,
    output:
        "results/tables/excluded.csv",
    log:
        "logs/excluded.log",
    params:
        files={f"{cell}/{test}": row["file"] for (cell, test), row in TESTS.items()},
    message:
        "What was left out, at which stage, and why."
    script:
        "../../scripts/tables/excluded.py"


rule summary:
    input:
        tables=[f"results/tables/{table}.csv" for table in TABLES],
        models=MODELS,
    output:
        "results/summary.csv",
    log:
        "logs/summary.log",
    params:
        cells=list(CELLS.values()),
    message:
        "One row per cell: capacity, health, resistance, model and its error."
    script:
        "../../scripts/tables/summary.py"


rule checks:
    input:
        tables=[f"results/tables/{table}.csv" for table in TABLES],
        summary="results/summary.csv",
        laws=[local(str(path)) for path in Path(PIPELINE, "tests/artefacts").glob("*.py")],
    output:
        "results/tables/checks.csv",
    log:
        "logs/checks.log",
    message:
        "Hold the results against physics (tests/artefacts)."
    script:
        "../../scripts/tables/checks.py"
