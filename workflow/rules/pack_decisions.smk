# What a series pack can give, decisions on a pack, and cells of one type put together.


def median_celsius(group):
    """Median of the stated temperatures of a group's tests; 25 °C where none is stated."""
    rows = [row["ambient_temperature_celsius"] for row in TESTS_OF[group]]
    stated = sorted(celsius for celsius in rows if celsius is not None)
    return stated_or_reference(stated[len(stated) // 2] if stated else None)


# Cells of one type that have a model of their own pulses or drives, under a name that a file may have.
MATCHED = {
    "".join(c if c.isalnum() else "_" for c in name): names
    for name, names in FITS.types_of(EXCITED).items()
    if 4 <= len(names) <= 200
}


rule series_pack:
    input:
        series="results/stages/clean/{group}/{test}.parquet",
        models=models_of_group,
    output:
        pack="results/stages/series_pack/{group}/{test}.parquet",
        cells="results/stages/series_pack_cells/{group}/{test}.parquet",
        power="results/stages/series_pack_power/{group}/{test}.parquet",
        waterfall="results/stages/series_pack_waterfall/{group}/{test}.parquet",
        series="results/stages/series_pack_series/{group}/{test}.parquet",
    log:
        "logs/series_pack/{group}/{test}.log",
    wildcard_constraints:
        group=either(SERIES),
    params:
        test=test_facts,
        members=own(WIRED.get),
        cells=PLAN.facts_of_cells(LEAVES.get),
        settings=config["pack_decisions"],
    message:
        "Series pack {wildcards.group} through {wildcards.test}: errors, limits, power, balancing."
    script:
        "../../scripts/pack_decisions/series_pack.py"


rule pack_decisions:
    input:
        models=models_of_group,
        capacities=PLAN.fitted_of(LEAVES.get, "capacity", "capacity"),
        thermal=thermal_of_group,
    output:
        "results/stages/pack_decisions/{group}.parquet",
    log:
        "logs/pack_decisions/{group}.log",
    wildcard_constraints:
        group=either(PAIRS),
    params:
        members=own(WIRED.get),
        cells=PLAN.facts_of_cells(LEAVES.get),
        tests=PLAN.facts_of_tests_of_cells(LEAVES.get),
        celsius=own(median_celsius),
        settings=config["pack_decisions"],
    message:
        "Decisions on pack {wildcards.group}: uncertainty, which cell to replace, safe window of SoC."
    script:
        "../../scripts/pack_decisions/pack_decisions.py"


rule pack_matching:
    input:
        models=paths_of(MATCHED.get, "results/models/{}.json"),
        capacities=PLAN.fitted_of(MATCHED.get, "capacity", "capacity"),
    output:
        gains="results/stages/pack_matching/{fleet}.parquet",
        assembly="results/stages/pack_assembly/{fleet}.parquet",
    log:
        "logs/pack_matching/{fleet}.log",
    wildcard_constraints:
        fleet=either(MATCHED),
    params:
        cells=PLAN.facts_of_cells(MATCHED.get),
        tests=PLAN.facts_of_tests_of_cells(MATCHED.get),
        settings=config["pack_decisions"],
    message:
        "Cells of type {wildcards.fleet} put together: matched beside random assemblies."
    script:
        "../../scripts/pack_decisions/pack_matching.py"
