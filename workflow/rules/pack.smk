# Groups of cells: their currents and voltages from the cells' models, scored against the measured.

# Groups with tests; one of whose cells has no model says so and is left out.
PAIRS = [group for group in BRANCHES if tests(group, "group")]
# Those of groups in groups; of single cells in parallel; of single cells in series.
NESTED = [group for group in PAIRS if len(WIRED[group]) > len(BRANCHES[group])]
SHARED = [group for group in PAIRS if group in PARALLEL]
SERIES = [group for group in PAIRS if group not in NESTED and group not in SHARED]
models_of_group = paths_of(FITS.modelled_leaves, "results/models/{}.json")
thermal_of_group = paths_of(FITS.warmed_leaves, "results/stages/thermal/{}.json")


rule branches:
    input:
        series=PLAN.own_fitted("clean", "group"),
        steps=PLAN.own_fitted("segment", "group"),
    output:
        "results/stages/branches/{group}.json",
    log:
        "logs/branches/{group}.log",
    wildcard_constraints:
        group=either(set(GROUPED.values())),
    params:
        cell=cell_facts,
        branches=own(BRANCHES.get),
    message:
        "Models of the cells of group {wildcards.group} from its own branch currents."
    script:
        "../../scripts/pack/branches.py"


rule pack:
    input:
        series="results/stages/clean/{group}/{test}.parquet",
        models=models_of_group,
        capacities=PLAN.fitted_of(LEAVES.get, "capacity", "capacity"),
        thermal=thermal_of_group,
    output:
        scores="results/stages/pack/{group}/{test}.parquet",
        findings="results/stages/pack_findings/{group}/{test}.parquet",
        spread="results/stages/pack_spread/{group}/{test}.parquet",
        series="results/stages/pack_series/{group}/{test}.parquet",
    log:
        "logs/pack/{group}/{test}.log",
    wildcard_constraints:
        group=either(SHARED),
    params:
        test=test_facts,
        branches=own(WIRED.get),
    message:
        "Simulate the group {wildcards.group} through {wildcards.test}."
    script:
        "../../scripts/pack/pack.py"


rule nested_pack:
    input:
        series="results/stages/clean/{group}/{test}.parquet",
        models=models_of_group,
    output:
        scores="results/stages/nested_pack/{group}/{test}.parquet",
        series="results/stages/nested_pack_series/{group}/{test}.parquet",
    log:
        "logs/nested_pack/{group}/{test}.log",
    wildcard_constraints:
        group=either(NESTED),
    params:
        test=test_facts,
        members=own(WIRED.get),
    message:
        "Simulate the pack {wildcards.group} of groups through {wildcards.test}."
    script:
        "../../scripts/pack/nested_pack.py"


def simulated_channels(wildcards):
    """The simulated channels of a test, which tell swapped ones, where there are some."""
    stages = {"pack_series": SHARED, "nested_pack_series": NESTED}
    found = [stage for stage, groups in stages.items() if wildcards.group in groups]
    return [f"results/stages/{stage}/{wildcards.group}/{wildcards.test}.parquet" for stage in found]


rule pack_checks:
    input:
        series="results/stages/clean/{group}/{test}.parquet",
        simulated=simulated_channels,
    output:
        "results/stages/pack_checks/{group}/{test}.parquet",
    log:
        "logs/pack_checks/{group}/{test}.log",
    wildcard_constraints:
        group=either(PAIRS),
    params:
        test=test_facts,
        branches=own(WIRED.get),
    message:
        "Do the channels of {wildcards.group} in {wildcards.test} agree with each other?"
    script:
        "../../scripts/pack/pack_checks.py"
