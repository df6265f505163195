# Cellwright: raw files of cyclers and impedance analysers in, validated models and a report out.
# What the user has and wants stands in config/ of the campaign (--directory), defaults in the schemas.

from snakemake.utils import min_version

min_version("9.0")


include: "workflow/rules/common.smk"
include: "workflow/rules/ingest.smk"
include: "workflow/rules/protocols.smk"
include: "workflow/rules/models.smk"
include: "workflow/rules/compensation.smk"
include: "workflow/rules/laws.smk"
include: "workflow/rules/loss.smk"
include: "workflow/rules/pack.smk"
include: "workflow/rules/missing_effect.smk"
include: "workflow/rules/benchmark.smk"
include: "workflow/rules/real.smk"
include: "workflow/rules/tables.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"


wildcard_constraints:
    cell="[A-Za-z0-9_-]+",
    test="[A-Za-z0-9_-]+",


rule all:
    default_target: True
    input:
        "results/report.html",
        "results/summary.csv",
        "results/manifest.tsv",
        [f"results/tables/{table}.csv" for table in TABLES],
        "results/accepted" if config["strict"] else [],
    message:
        "Everything is up to date: results/report.html."


# An artefact is refused where it breaks the contract. Mended, the contract makes it anew.
for one in workflow.rules:
    if one.output:
        one.set_params(contract=held_against(one.output))


onsuccess:
    print("Where the time went:", *run_log.slowest(Path.cwd(), STARTED), sep="\n  ")
