# The report, the manifest of all artefacts, and the checks of both.

from runtime.contract import stage_of
from runtime.provenance import assumptions, run_facts

ASSUMPTIONS = assumptions()

FINAL = [
    "results/report.html",
    "results/summary.csv",
    "results/tables/checks.csv",
    *[f"results/tables/{table}.csv" for table in TABLES],
    *STAGES,
    *EXPORTED["lookup.csv"],
    *EXPORTED["over_temperature.csv"],
    *[f"results/pack_models/{group}/lookup.csv" for group in PACK_MODELS],
    *VERDICTS,
    *OWN_VERDICTS,
    *EXTERNAL_VERDICTS,
    *[f"results/missing_effect/{cell}/{part}" for cell in ASKED for part in EFFECT_PARTS],
    *[f"results/missing_effect/{g}/{part}" for g in GROUPS_ASKED for part in GROUP_PARTS],
    *FIGURES["the campaign"],
    *FIGURE_FOLDERS,
]


def predicted(stage):
    """Paths of one stage's artefacts for the tests that each cell's model was scored on."""
    return [path for cell, rows in SCORED.items() for path in of_rows(stage, cell, rows)]


rule report:
    input:
        tables=[f"results/tables/{table}.csv" for table in TABLES],
        checks="results/tables/checks.csv",
        summary="results/summary.csv",
        figures=[*FIGURES["the campaign"], *FIGURE_FOLDERS],
        artefacts=STAGES,
        verdicts=VERDICTS,
        witnesses=WITNESSES,
        maps=RESIDUAL_MAPS,
        cold=COLD_WORDS,
        lookups=EXPORTED["lookup.csv"],
        pybamm=EXPORTED["pybamm_thevenin.json"],
        # What a laboratory simulated, for the reader alone: of real cells there is no such file.
        truth=[path for path in ("data/simulated.csv",) if Path(path).is_file()],
        simulated=predicted("simulation"),
        series=predicted("clean"),
        curves=[
            path
            for cell in CELLS
            for stage, kind in (("ocv", "ocv"), ("ica_curve", "ica"))
            for path in artefacts(stage, cell, kind)
        ],
    output:
        "results/report.html",
    log:
        "logs/report.log",
    params:
        cells=list(CELLS.values()),
        tests=CAMPAIGN.tests,
        groups=CAMPAIGN.groups,
        figures=FIGURES,
        # By a function: what is in braces would be taken for a wildcard.
        title=lambda w: config["title"],
        choices=CHOICES,
        settings=lambda w: config,
        assumptions=ASSUMPTIONS,
        run=run_facts(),
        # No inputs: their paths are others where the clone lies elsewhere.
        look=files_of(f"{PIPELINE}/workflow/report"),
    message:
        "Write results/report.html."
    script:
        "../../scripts/report/report.py"


rule contents:
    output:
        "results/README.md",
        # What reads the tables for PyBaMM: it needs PyBaMM and nothing of this project.
        thevenin="results/models/thevenin.py",
    log:
        "logs/contents.log",
    params:
        # By a function: what is in braces would be taken for a wildcard.
        has=lambda w: {
            "title": config["title"],
            "tables": TABLES,
            "stages": sorted({stage_of(path) for path in STAGES}),
        },
    message:
        "What lies where in the results: results/README.md."
    script:
        "../../scripts/report/contents.py"


rule manifest:
    input:
        FINAL,
        "results/README.md",
    output:
        "results/stages/manifest.tsv",
    log:
        "logs/manifest.log",
    message:
        "Checksums of every artefact: results/stages/manifest.tsv."
    script:
        "../../scripts/report/manifest.py"


def crate_facts(wildcards):
    """What a crate says of a campaign that no artefact does."""
    run = {name: run_facts()[name] for name in ("version", "command")}
    return {"title": config["title"]} | run | config["publication"]


rule crate:
    input:
        manifest="results/stages/manifest.tsv",
    output:
        crate="results/ro-crate-metadata.json",
        workflow=directory("results/stages/workflow"),
    log:
        "logs/crate.log",
    params:
        about=crate_facts,
        rules=lambda w: {
            rule.name: {
                "does": rule.message or rule.name,
                "script": Path("scripts", *Path(str(rule.script)).parts[-2:]).as_posix(),
            }
            for rule in workflow.rules
            if rule.script
        },
    message:
        "The run for other people's tools: results/ro-crate-metadata.json."
    script:
        "../../scripts/report/crate.py"


rule verify:
    log:
        "logs/verify.log",
    # To fail is its answer: nothing is gained by asking twice.
    retries: 0
    message:
        "Compare every artefact with the manifest."
    script:
        "../../scripts/report/verify.py"


rule accepted:
    input:
        excluded="results/tables/excluded.csv",
        report="results/report.html",
    output:
        touch("results/stages/accepted"),
    log:
        "logs/accepted.log",
    retries: 0
    message:
        "strict: true, so nothing may be excluded."
    script:
        "../../scripts/report/accepted.py"
