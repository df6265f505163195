# What the model of a cell lacks: the search for a missing effect, and its verdicts.

EFFECT_KINDS = ("capacity", *PULSE_KINDS, "drive")


def searched_series(cell):
    """Series that a search of the plain base reads: the slow tests, too, which hold the OCV."""
    return [*artefacts("clean", cell, *EFFECT_KINDS), *fitted("clean", cell, "ocv")]


def searchable(cell):
    """Whether the sheet has tests to fit and one for proof, or so many that one can be spared.

    Of the first check-up alone: an aged cell lacks what a fresh one's model does not know.
    """
    rows = tests(cell, *EFFECT_KINDS)
    young = in_first_checkup([row["cycle"] for row in rows])
    first = [row for row, among in zip(rows, young) if among]
    fit = [row for row in first if row["role"] in ("fit", "split")]
    proof = [row for row in first if row["role"] in ("validation", "split")]
    return bool(fit and proof) or len(fit) >= 3


# A cell with any such test has a verdict file; one that cannot be searched says there why.
ASKED = dict.fromkeys(
    cell for cell in CELLS if config["missing_effect"]["enabled"] and tests(cell, *EFFECT_KINDS)
)
SEARCHED = dict.fromkeys(cell for cell in CELLS if cell in ASKED and searchable(cell))
# A group is asked where it has tests and its cells lie on one bar each, which is the group that the
# search simulates. A branch is held against its cell's model, else its type's.
GROUPS_ASKED = [
    group
    for group, rows in PARALLEL.items()
    if config["missing_effect"]["enabled"] and tests(group, "group")
    if not any(row["link_resistance_ohm"] for row in rows)
]


def lender(cell):
    """The cell whose search tells what a branch's cell is like: itself, else one of its type."""
    return next((c for c in [cell, *peers(cell)] if c in SEARCHED), cell)


def group_models(wildcards):
    """Models that the searches of a group's cells by themselves have left."""
    lenders = dict.fromkeys(lender(row["cell"]) for row in BRANCHES[wildcards.group])
    return [f"results/missing_effect/{cell}/model.json" for cell in lenders if cell in SEARCHED]


def group_searchable(group):
    """Whether its branches have models, and its tests leave one for proof."""
    modelled = all(lender(row["cell"]) in SEARCHED for row in BRANCHES[group])
    fit = tests(group, "group", roles=["fit"])
    proof = tests(group, "group", roles=["validation"])
    return modelled and (bool(fit and proof) or len(fit) >= 3)


GROUPS_SEARCHED = [group for group in GROUPS_ASKED if group_searchable(group)]
VERDICTS = [f"results/missing_effect/{name}/verdict.json" for name in [*ASKED, *GROUPS_ASKED]]
GROUP_PARTS = ["ranking.parquet", "series.parquet", "model.json"]
EFFECT_PARTS = [
    *[f"{name}.parquet" for name in ("ranking", "map", "evidence", "series")],
    *["confounding.parquet", "menu.parquet", "model.json", "witnesses.parquet"],
]
# What the model in use lacks is asked of cells with a model that were searched at all.
ASKED_OF_OWN = "own" in config["missing_effect"]["bases"]
SEARCHED_OWN = [cell for cell in SEARCHED if ASKED_OF_OWN and cell in MODELLED]
OWN_VERDICTS = [f"results/missing_effect/{cell}/own/verdict.json" for cell in SEARCHED_OWN]
# What a simulator of the user's lacks is asked of cells with simulated tests to fit and for proof.
ASKED_OF_EXTERNAL = "external" in config["missing_effect"]["bases"]


def simulated_tests(cell):
    """Tests of a cell that take part in a search and for which the user has simulated a voltage."""
    return [row for row in tests(cell, *EFFECT_KINDS) if row["simulated_file"]]


SEARCHED_EXTERNAL = [cell for cell in ASKED if ASKED_OF_EXTERNAL and simulated_tests(cell)]
EXTERNAL_VERDICTS = [
    f"results/missing_effect/{cell}/external/verdict.json" for cell in SEARCHED_EXTERNAL
]
WITNESSES, RESIDUAL_MAPS = (
    [f"results/missing_effect/{cell}/{part}.parquet" for cell in ASKED]
    for part in ("witnesses", "map")
)


def dated_facts(wildcards):
    """What tables say of each test of a cell, and when it began, where the sheet has that."""
    facts = facts_of_own_tests(wildcards)
    dates = {f"{row['cell']}/{row['test']}": row["started"] for row in TESTS_OF[wildcards.cell]}
    return {key: one | {"started": dates[key]} for key, one in facts.items()}


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
    "tests": dated_facts,
    "ambient_celsius": lambda w: {
        row["test"]: row["ambient_temperature_celsius"] for row in TESTS_OF[w.cell]
    },
}


rule effect_search:
    input:
        **OTHER_MEASUREMENTS,
        basis="results/stages/basis/{cell}.json",
        series=own(searched_series),
        lent_basis=paths_of(references, "results/stages/basis/{}.json"),
        lent_series=gathered(references, searched_series),
    output:
        verdict="results/missing_effect/{cell}/verdict.json",
        ranking="results/missing_effect/{cell}/ranking.parquet",
        residual_map="results/missing_effect/{cell}/map.parquet",
        evidence="results/missing_effect/{cell}/evidence.parquet",
        series="results/missing_effect/{cell}/series.parquet",
        confounding="results/missing_effect/{cell}/confounding.parquet",
        menu="results/missing_effect/{cell}/menu.parquet",
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
        member="results/stages/member/{cell}.json",
        basis="results/stages/basis/{cell}.json",
        series=PLAN.own_artefacts("clean", *EFFECT_KINDS),
    output:
        verdict="results/missing_effect/{cell}/own/verdict.json",
        ranking="results/missing_effect/{cell}/own/ranking.parquet",
        residual_map="results/missing_effect/{cell}/own/map.parquet",
        series="results/missing_effect/{cell}/own/series.parquet",
        model="results/missing_effect/{cell}/own/model.json",
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
    return contents_of(row["simulated_file"] for row in simulated_tests(wildcards.cell))


rule effect_search_external:
    input:
        basis="results/stages/basis/{cell}.json",
        series=PLAN.own_rows("clean", simulated_tests),
        simulated=lambda w: [local(file) for file in simulated_contents(w)],
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
        files=lambda w: {row["test"]: row["simulated_file"] for row in simulated_tests(w.cell)},
    message:
        "Search for an effect that your simulator of {wildcards.cell} lacks."
    script:
        "../../scripts/missing_effect/effect_search_external.py"


rule missing_effect_group:
    input:
        models=group_models,
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
        lenders=lambda w: {row["cell"]: lender(row["cell"]) for row in BRANCHES[w.group]},
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
