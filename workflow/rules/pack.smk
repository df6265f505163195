# Cells in parallel: branch currents from the cells' models, scored against the measured ones.

PAIRS = [
    group
    for group, rows in BRANCHES.items()
    if tests(group, "group") and all(row["cell"] in MODELLED for row in rows)
]


rule branches:
    input:
        series=lambda w: fitted("clean", w.group, "group"),
        steps=lambda w: fitted("segment", w.group, "group"),
    output:
        "results/branches/{group}.json",
    log:
        "logs/branches/{group}.log",
    wildcard_constraints:
        group=either(set(GROUPED.values())),
    params:
        cell=cell_facts,
        branches=lambda w: BRANCHES[w.group],
    message:
        "Models of the cells of group {wildcards.group} from its own branch currents."
    script:
        "../../scripts/pack/branches.py"


rule pack:
    input:
        series="results/clean/{group}/{test}.parquet",
        models=lambda w: [f"results/models/{row['cell']}.json" for row in BRANCHES[w.group]],
    output:
        scores="results/pack/{group}/{test}.parquet",
        series="results/pack_series/{group}/{test}.parquet",
    log:
        "logs/pack/{group}/{test}.log",
    wildcard_constraints:
        group=either(PAIRS),
    params:
        test=test_facts,
        branches=lambda w: BRANCHES[w.group],
    message:
        "Simulate the parallel group {wildcards.group} through {wildcards.test}."
    script:
        "../../scripts/pack/pack.py"
