# What the model of a cell lacks: the search for a missing effect, and its verdicts.

# A cell with any test that a search reads has a verdict file.
ASKED, GROUPS_ASKED, GROUPS_SEARCHED = (
    SEARCHES.asked,
    SEARCHES.groups_asked,
    SEARCHES.groups_searched,
)
VERDICTS = [f"results/missing_effect/{name}/verdict.json" for name in [*ASKED, *GROUPS_ASKED]]
GROUP_PARTS = ["ranking.parquet", "series.parquet", "model.json"]
EFFECT_PARTS = [
    *[f"{name}.parquet" for name in ("ranking", "map", "evidence", "series")],
    *["model.json", "witnesses.parquet"],
]
OWN_VERDICTS = [f"results/missing_effect/{cell}/own/verdict.json" for cell in SEARCHED_OWN]
SEARCHED_EXTERNAL = SEARCHES.searched_external
EXTERNAL_VERDICTS = [
    f"results/missing_effect/{cell}/external/verdict.json" for cell in SEARCHED_EXTERNAL
]
WITNESSES, RESIDUAL_MAPS = (
    [f"results/missing_effect/{cell}/{part}.parquet" for cell in ASKED]
    for part in ("witnesses", "map")
)
# What is measured of a cell without any fit of its drives: it may rule an effect out, and says of
# the verdict in the end whether it agrees.
OTHER_MEASUREMENTS = {
    "eis": PLAN.own_fitted("eis", "eis"),
    "resistance": PLAN.own_fitted("resistance", *PULSE_KINDS),
    "relaxation": PLAN.own_fitted("relaxation", *RELAXATION_KINDS),
    "capacity": PLAN.own_fitted("capacity", *CAPACITY_KINDS),
    "ocv_entropic": where(STEPPED, "results/stages/ocv_entropic/{}.parquet"),
}
FACTS_OF_MEASUREMENTS = {
    "tests": PLAN.dated_facts_of_own_tests,
    "ambient_celsius": PLAN.column_of_tests("ambient_temperature_celsius"),
}


rule effect_search:
    input:
        **OTHER_MEASUREMENTS,
        basis="results/stages/basis/{cell}.json",
        series=own(SEARCHES.series),
        lent_basis=paths_of(references, "results/stages/basis/{}.json"),
        lent_series=gathered(references, SEARCHES.series),
    output:
        verdict="results/missing_effect/{cell}/verdict.json",
        ranking="results/missing_effect/{cell}/ranking.parquet",
        residual_map="results/missing_effect/{cell}/map.parquet",
        evidence="results/missing_effect/{cell}/evidence.parquet",
        series="results/missing_effect/{cell}/series.parquet",
        model="results/missing_effect/{cell}/model.json",
    log:
        "logs/missing_effect/{cell}.log",
    wildcard_constraints:
        cell=either(ASKED),
    # The longest jobs: begun as soon as they can be, so that none is left over at the end.
    priority: 1
    params:
        **FACTS_OF_MEASUREMENTS,
        settings=of_analysis("missing_effect"),
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
        references=PLAN.facts_of_cells(references),
    message:
        "Search for an effect that the model of {wildcards.cell} lacks."
    script:
        "../../scripts/missing_effect/effect_search.py"


rule effect_search_own:
    input:
        model="results/models/{cell}.json",
        basis="results/stages/basis/{cell}.json",
        series=PLAN.own_artefacts("clean", *EFFECT_KINDS),
    output:
        verdict="results/missing_effect/{cell}/own/verdict.json",
        ranking="results/missing_effect/{cell}/own/ranking.parquet",
        residual_map="results/missing_effect/{cell}/own/map.parquet",
        series="results/missing_effect/{cell}/own/series.parquet",
    log:
        "logs/missing_effect/{cell}_own.log",
    wildcard_constraints:
        cell=either(SEARCHED_OWN),
    params:
        settings=of_analysis("missing_effect"),
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
    message:
        "Search for an effect that the model in use of {wildcards.cell} still lacks."
    script:
        "../../scripts/missing_effect/effect_search_own.py"


def simulated_contents(wildcards):
    """What the simulated files of a cell hold; of what is missing the job itself will report."""
    return contents_of(SEARCHES.simulated_files(wildcards).values())


rule effect_search_external:
    input:
        basis="results/stages/basis/{cell}.json",
        series=PLAN.own_rows("clean", SEARCHES.simulated_tests),
        simulated=local_files(simulated_contents),
    output:
        verdict="results/missing_effect/{cell}/external/verdict.json",
        ranking="results/missing_effect/{cell}/external/ranking.parquet",
        residual_map="results/missing_effect/{cell}/external/map.parquet",
        series="results/missing_effect/{cell}/external/series.parquet",
    log:
        "logs/missing_effect/{cell}_external.log",
    wildcard_constraints:
        cell=either(SEARCHED_EXTERNAL),
    params:
        settings=of_analysis("missing_effect"),
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
        content=simulated_contents,
        files=SEARCHES.simulated_files,
    message:
        "Search for an effect that your simulator of {wildcards.cell} lacks."
    script:
        "../../scripts/missing_effect/effect_search_external.py"


rule missing_effect_group:
    input:
        models=SEARCHES.group_models,
        series=PLAN.own_artefacts("clean", "group"),
    output:
        verdict="results/missing_effect/{group}/verdict.json",
        ranking="results/missing_effect/{group}/ranking.parquet",
        series="results/missing_effect/{group}/series.parquet",
        model="results/missing_effect/{group}/model.json",
    log:
        "logs/missing_effect/{group}.log",
    wildcard_constraints:
        group=either(GROUPS_ASKED),
    params:
        branches=own(BRANCHES.get),
        lenders=SEARCHES.lenders,
    message:
        "Search for an effect in one branch of the parallel group {wildcards.group}."
    script:
        "../../scripts/missing_effect/missing_effect_group.py"


rule witnesses:
    input:
        **OTHER_MEASUREMENTS,
        verdict="results/missing_effect/{cell}/verdict.json",
        model="results/missing_effect/{cell}/model.json",
        series="results/missing_effect/{cell}/series.parquet",
        basis="results/stages/basis/{cell}.json",
    output:
        "results/missing_effect/{cell}/witnesses.parquet",
    log:
        "logs/missing_effect/{cell}_witnesses.log",
    wildcard_constraints:
        cell=either(ASKED),
    params:
        **FACTS_OF_MEASUREMENTS,
    message:
        "What other measurements of {wildcards.cell} say of its verdict."
    script:
        "../../scripts/missing_effect/witnesses.py"


rule missing_effect:
    input:
        verdicts=VERDICTS,
        own=OWN_VERDICTS,
        external=EXTERNAL_VERDICTS,
        witnesses=WITNESSES,
    output:
        table="results/tables/missing_effect.csv",
    log:
        "logs/table/missing_effect.log",
    message:
        "Verdicts of the whole campaign: what the models of its cells and groups lack."
    script:
        "../../scripts/missing_effect/missing_effect.py"


rule fleet:
    input:
        verdicts=[f"results/missing_effect/{cell}/verdict.json" for cell in ASKED],
        witnesses=WITNESSES,
    output:
        table="results/tables/fleet.csv",
    log:
        "logs/table/fleet.log",
    params:
        types={
            cell: f"{chemistry}, {rating:g} Ah"
            for (chemistry, rating), cells in OF_TYPE.items()
            for cell in cells
        },
    message:
        "Cells of each type beside each other: which effect all show, and which one alone."
    script:
        "../../scripts/missing_effect/fleet.py"
