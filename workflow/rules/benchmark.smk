# How well missing effects are found: a campaign of the virtual laboratory, searched and scored.
# No part of the main job: `snakemake missing_effect_benchmark`.

import hashlib

BENCHMARK = config["benchmark"]
HIDDEN = BENCHMARK["folder"]
SIZES = ["seed", "cells", "healthy", "unknown", "two", "physics", "groups"]
OPTIONS = " ".join(f"{name}={BENCHMARK[name]}" for name in SIZES)


def laboratory(wildcards):
    """Hash of what makes the campaign: an edit of the laboratory makes it anew."""
    folder = PIPELINE / "lab" / "virtual_lab"
    making = [p for p in folder.rglob("*.py") if p.parent.name not in ("score", "reality")]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(making))).hexdigest()[:16]


rule effect_campaign:
    output:
        tests=f"{HIDDEN}/config/tests.tsv",
        truth=f"{HIDDEN}/truth/README.md",
    log:
        "logs/effect_campaign.log",
    threads: workflow.cores
    # Its jobs run lab/tools/make_campaign.py in the laboratory's own environment.
    params:
        # Derived, as Snakemake sees it: a clone that was moved makes no campaign anew.
        pipeline=lambda w, output: PIPELINE,
        folder=subpath(output.tests, ancestor=2),
        options=OPTIONS,
        laboratory=laboratory,
    message:
        "The virtual laboratory hides effects in cells: {params.options}."
    shell:
        "{params.pipeline}/run --lab snakemake -s {params.pipeline}/lab/Snakefile"
        " --directory {params.pipeline} --cores {threads} --config campaign=hidden"
        " folder=$PWD/{params.folder} {params.options} > {log} 2>&1"


rule effect_left_out:
    input:
        tests=rules.effect_campaign.output.tests,
        truth=rules.effect_campaign.output.truth,
    output:
        "results/effect_answers/left_out.json",
    log:
        "logs/effect_left_out.log",
    params:
        folder=subpath(input.tests, ancestor=2),
        options=OPTIONS,
    message:
        "For each cell of the benchmark, the effects that its second search may not use."
    script:
        "../../scripts/benchmark/effect_left_out.py"


rule effect_answers:
    input:
        tests=rules.effect_campaign.output.tests,
        left_out=rules.effect_left_out.output[0],
    output:
        "results/effect_answers/{batch}.parquet",
    log:
        "logs/effect_answers/{batch}.log",
    wildcard_constraints:
        batch=r"\d+",
    params:
        folder=subpath(input.tests, ancestor=2),
        batches=BENCHMARK["batches"],
        settings={
            "clean": config["clean"],
            "segment": config["segment"],
            "ocv": {"least_hour": config["ocv"]["least_hour"]},
            "models": {"split_rest_second": config["models"]["split_rest_second"]},
            "missing_effect": of_analysis("missing_effect"),
            "missing_effect_group": config["missing_effect_group"],
            "benchmark": {
                name: BENCHMARK[name] for name in ["paired_chemistry", "seed", "control_every"]
            },
        },
    message:
        "Search batch {wildcards.batch} of {params.batches} of the hidden campaign, and its controls."
    script:
        "../../scripts/benchmark/effect_answers.py"


rule missing_effect_benchmark:
    input:
        tests=rules.effect_campaign.output.tests,
        truth=rules.effect_campaign.output.truth,
        answers=[f"results/effect_answers/{n}.parquet" for n in range(BENCHMARK["batches"])],
    output:
        page="results/effect_scores/benchmark.md",
        confusion="results/effect_scores/effect-confusion.svg",
        power="results/effect_scores/effect-power.svg",
        cells="results/effect_scores/cells.parquet",
        goals="results/effect_scores/goals.parquet",
    log:
        "logs/missing_effect_benchmark.log",
    params:
        folder=subpath(input.tests, ancestor=2),
        options=OPTIONS,
    message:
        "Score every search against the hidden truth: {output.page}."
    script:
        "../../scripts/benchmark/missing_effect_benchmark.py"
