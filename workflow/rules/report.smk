# The report, the manifest of all artefacts, and the checks of both.

from provenance import assumptions

ASSUMPTIONS = assumptions()

FINAL = [
    "results/report.html",
    "results/summary.csv",
    "results/tables/checks.csv",
    *[f"results/tables/{table}.csv" for table in TABLES],
    *STAGES,
    *EXPORTED["lookup.csv"],
    *EXPORTED["over_temperature.csv"],
    *VERDICTS,
    *[f"results/missing_effect/{cell}/{part}" for cell in ASKED for part in EFFECT_PARTS],
    *[f"results/missing_effect/{g}/{part}" for g in GROUPS_ASKED for part in GROUP_PARTS],
    *[path for paths in FIGURES.values() for path in paths],
]


rule report:
    input:
        tables=[f"results/tables/{table}.csv" for table in TABLES],
        checks="results/tables/checks.csv",
        summary="results/summary.csv",
        figures=[path for paths in FIGURES.values() for path in paths],
        artefacts=STAGES,
        verdicts=VERDICTS,
        cold=COLD_WORDS,
        template=f"{workflow.basedir}/workflow/report/report.html.j2",
        captions=f"{workflow.basedir}/workflow/report/captions.yaml",
    output:
        "results/report.html",
    log:
        "logs/report.log",
    params:
        cells=list(CELLS.values()),
        tests=CAMPAIGN.tests,
        groups=CAMPAIGN.groups,
        figures=FIGURES,
        modelled=MODELLED,
        title=config["title"],
        choices=CHOICES,
        assumptions=ASSUMPTIONS,
        code=code_of("report"),
    message:
        "Write results/report.html."
    script:
        "../../scripts/report.py"


rule manifest:
    input:
        FINAL,
    output:
        "results/manifest.tsv",
    log:
        "logs/manifest.log",
    params:
        code=code_of("manifest"),
    message:
        "Checksums of every artefact: results/manifest.tsv."
    script:
        "../../scripts/manifest.py"


rule verify:
    log:
        "logs/verify.log",
    # To fail is its answer: nothing is gained by asking twice.
    retries: 0
    params:
        code=code_of("verify"),
    message:
        "Compare every artefact with the manifest."
    script:
        "../../scripts/verify.py"


rule accepted:
    input:
        excluded="results/tables/excluded.csv",
        report="results/report.html",
    output:
        touch("results/accepted"),
    log:
        "logs/accepted.log",
    retries: 0
    params:
        code=code_of("accepted"),
    message:
        "strict: true, so nothing may be excluded."
    script:
        "../../scripts/accepted.py"
