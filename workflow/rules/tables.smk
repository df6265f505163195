# The results contract: plain CSV tables, the summary, what was left out, the manifest.

from runtime.provenance import files_of

SCORES, FILTERED = (
    [
        f"results/stages/{stage}/{cell}/{row['test']}.parquet"
        for cell, rows in SCORED.items()
        for row in rows
    ]
    for stage in ("validation", "soc")
)
MODELS = [f"results/models/{cell}.json" for cell in MODELLED]
# Tables of what the tests tell by themselves, which need no model, and of the models.
TABLES_OF_TESTS = {
    "capacity": [*everywhere("capacity", *CAPACITY_KINDS), *everywhere("ageing_cycles", "ageing")],
    "resistance": everywhere("resistance", *PULSE_KINDS),
    "relaxation": everywhere("relaxation", *RELAXATION_KINDS),
    "ocv": [
        *everywhere("ocv_functions", "ocv"),
        *[f"results/stages/ocv_functions_temperature/{cell}.parquet" for cell in STEPPED],
    ],
    "eis": everywhere("eis", "eis"),
    "temperature": [
        *[f"results/stages/temperature/{cell}.parquet" for cell in VARIED],
        *[f"results/stages/resistance_surface/{cell}.parquet" for cell in PULSED],
        *[f"results/stages/temperature_of_type/{cell}.parquet" for cell in KINDRED],
        *[f"results/stages/polarisation/{cell}.parquet" for cell in RELAXED],
        *[f"results/stages/ocv_laws/{cell}.parquet" for cell in STEPPED],
        *LOSS_LAWS,
    ],
    "capacity_loss": [f"results/stages/capacity_loss/{cell}.parquet" for cell in COLD],
    "ica_temperature": [f"results/stages/ica_temperature/{cell}.parquet" for cell in COLD_PEAKS],
    "fast_charge": everywhere("fast_charge", "fast_charge"),
    "ageing": everywhere("ageing_temperature", "ageing"),
    "ica": everywhere("ica", "ica"),
    "ica_discharge": everywhere("ica_discharge", "ica", "ocv"),
    "ica_tracks": [f"results/stages/ica_tracks/{cell}.parquet" for cell in FOLLOWED],
}
TABLES_OF_HEALTH = {
    "capacity_between_rests": [
        f"results/stages/capacity_between_rests/{cell}.parquet" for cell in RESTED
    ],
    "health": [f"results/stages/health/{cell}.parquet" for cell in HEALTHY],
    "checkups": [f"results/stages/checkups/{cell}.parquet" for cell in CHECKED],
    "resistance_growth": [f"results/stages/resistance_growth/{cell}.parquet" for cell in CHECKED],
    "fade": [f"results/stages/life/{cell}.parquet" for cell in AGED],
    "fade_laws": [f"results/stages/fade/{cell}.parquet" for cell in AGED],
}
TABLES_OF_GROUPS = {
    "packs": "pack",
    "pack_findings": "pack_findings",
    "pack_spread": "pack_spread",
}
TABLES_OF_MODELS = {
    "temperature_prediction": [
        f"results/stages/temperature_prediction/{cell}.parquet" for cell in COMPENSATED
    ],
    "models": [f"results/stages/parameters/{cell}.parquet" for cell in MODELLED],
    "models_of_checkups": [
        f"results/stages/parameters_of_checkups/{cell}/{cycle}.parquet"
        for cell, cycles in CHECKUPS.items()
        for cycle in cycles
    ],
    "choice": [f"results/stages/choice/{cell}.parquet" for cell in MODELLED],
    "validation": SCORES,
    "thermal": [f"results/stages/thermal_tests/{cell}.parquet" for cell in WARMED],
    "bias": [f"results/stages/bias_ways/{cell}.parquet" for cell in JUDGED],
    "soc": FILTERED,
    "series_packs": [p for group in SERIES for p in artefacts("series_pack", group, "group")],
    "series_pack_cells": [
        p for group in SERIES for p in artefacts("series_pack_cells", group, "group")
    ],
    "nested_packs": [p for group in NESTED for p in artefacts("nested_pack", group, "group")],
    "pack_decisions": [
        *[f"results/stages/pack_decisions/{group}.parquet" for group in PAIRS],
        *[f"results/stages/pack_matching/{fleet}.parquet" for fleet in MATCHED],
    ],
    "pack_checks": [p for group in PAIRS for p in artefacts("pack_checks", group, "group")],
    **{
        table: [p for group in SHARED for p in artefacts(stage, group, "group")]
        for table, stage in TABLES_OF_GROUPS.items()
    },
}
TABLE_INPUTS = TABLES_OF_TESTS | TABLES_OF_HEALTH | TABLES_OF_MODELS
COMPARED_CELLS = ["fleet_health", "fleet_health_lines", "protocols"]
WITH_SUMMARY = [
    "excluded",
    "resistance_definitions",
    "activation_energies",
]  # made beside the summary
TABLES = [*TABLE_INPUTS, *COMPARED_CELLS, "missing_effect", "fleet", *WITH_SUMMARY]
COLD_WORDS = [f"results/stages/cold_limit/{cell}.json" for cell in CHILLED]
STAGES = [
    *everywhere("ingest", *SERIES_KINDS),
    *everywhere("spectrum", "eis"),
    *[f"results/stages/eis_together/{cell}.parquet" for cell in WITH_SPECTRA],
    *everywhere("clean", *SERIES_KINDS),
    *everywhere("segment", *SERIES_KINDS),
    *REPEATS,
    *[path for cell in CELLS for path in FITS.other_curves(cell)],
    *[f"results/stages/basis/{cell}.json" for cell in CELLS],
    *[f"results/stages/degradation_modes/{cell}.parquet" for cell in DEGRADED],
    *[f"results/stages/{stage}/{cell}.parquet" for cell in PEAK_TYPES for stage in PEAK_STAGES],
    *[f"results/stages/health_from_peaks/{cell}.parquet" for cell in FIRST_OF_TYPE],
    *[f"results/stages/plateau_losses/{cell}.parquet" for cell in AGED_SLOWLY],
    *[f"results/stages/identify/{cell}.json" for cell in IDENTIFIED],
    *[f"results/stages/bias/{cell}.json" for cell in BIASED],
    *[f"results/stages/given_model/{cell}.json" for cell in GIVEN],
    *[f"results/stages/bias_worst/{cell}.json" for cell in JUDGED_WORST],
    *[path for cell in COMPENSATED for path in FITS.left_out_models(cell)],
    *[f"results/stages/compensation/{cell}.parquet" for cell in COMPENSATED],
    *[f"results/stages/branches/{group}.json" for group in sorted(set(GROUPED.values()))],
    *[f"results/pack_models/{group}.json" for group in PACK_MODELS],
    *MODELS,
    *[f"results/models/{cell}.json" for cell in UNMODELLED],
    *EXPORTED["pybamm_thevenin.json"],
    *[path for paths in TABLE_INPUTS.values() for path in paths],
    *[f"results/stages/thermometer/{cell}.parquet" for cell in THERMOMETERS],
    *COLD_WORDS,
    *[f"results/missing_effect/{cell}/verdict.json" for cell in SEARCHED],
    *[f"results/missing_effect/{group}/verdict.json" for group in GROUPS_SEARCHED],
]


rule tables_of_tests:
    input:
        **TABLES_OF_TESTS,
    output:
        **{name: f"results/tables/{name}.csv" for name in TABLES_OF_TESTS},
    log:
        "logs/tables_of_tests.log",
    params:
        tests=TEST_FACTS,
    message:
        "Tables of what the tests of the whole campaign tell."
    script:
        "../../scripts/tables/tables_of_tests.py"


rule tables_of_health:
    input:
        **TABLES_OF_HEALTH,
    output:
        **{name: f"results/tables/{name}.csv" for name in TABLES_OF_HEALTH},
    log:
        "logs/tables_of_health.log",
    params:
        tests=TEST_FACTS,
    message:
        "Tables of the health of all cells."
    script:
        "../../scripts/tables/tables_of_health.py"


rule tables_of_models:
    input:
        **TABLES_OF_MODELS,
    output:
        **{name: f"results/tables/{name}.csv" for name in TABLES_OF_MODELS},
    log:
        "logs/tables_of_models.log",
    params:
        tests=TEST_FACTS,
    message:
        "Tables of the models of the whole campaign, and of their errors."
    script:
        "../../scripts/tables/tables_of_models.py"


rule summary:
    input:
        tables=[f"results/tables/{table}.csv" for table in TABLES if table not in WITH_SUMMARY],
        stages=STAGES,
        models=MODELS,
        verdicts=VERDICTS,
    output:
        excluded="results/tables/excluded.csv",
        summary="results/summary.csv",
        resistances="results/tables/resistance_definitions.csv",
        energies="results/tables/activation_energies.csv",
        checks="results/tables/checks.csv",
    log:
        "logs/summary.log",
    params:
        cells=list(CELLS.values()),
        files={f"{cell}/{test}": row["file"] for (cell, test), row in TESTS.items()},
        laws=files_of(f"{PIPELINE}/tests/artefacts"),
    message:
        "What was left out and why, one row per cell, and the results held against physics."
    script:
        "../../scripts/tables/summary.py"
