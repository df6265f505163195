# Whole campaigns with known truth: raw files and sheets in the input contract, truth/ beside. In
# the laboratory's own environment (environment-lab.lock), from the repository's root:
#     ./run --lab snakemake -s workflow/virtual_lab.smk --cores 2 --config campaign=thesis
# campaign: demo (the committed one, over itself), thesis, hidden or scale. More options, each as
# name=value: folder (default virtual/<campaign>), seed, and the campaign's own, see
# docs/virtual-laboratory.md. Two more targets, which need no laboratory and run in either
# environment: how close the pipeline came to the truth, and the laboratory beside real records.
#     ./run snakemake -s workflow/virtual_lab.smk --cores 2 score --config campaign=thesis
#     ./run snakemake -s workflow/virtual_lab.smk --cores 2 reality --config real=FOLDER

import hashlib
import json
import sys
from pathlib import Path

SCRIPTS = Path(workflow.basedir).parent / "scripts"
sys.path.insert(0, str(SCRIPTS))

from runtime import job_environment
from virtual_lab import campaigns

job_environment.prepare(str(SCRIPTS))
CAMPAIGN = config.get("campaign", "demo")
OPTIONS = campaigns.options(CAMPAIGN, config)
FOLDER = Path(config.get("folder", campaigns.FOLDERS[CAMPAIGN]))
PLAN = campaigns.plan(CAMPAIGN, **OPTIONS)
MAKE = f"python scripts/tools/make_campaign.py {CAMPAIGN} {FOLDER} '{json.dumps(OPTIONS)}'"
REAL = ["a123", "panasonic", "cs2_35"]
LOGS = FOLDER / "logs" / "virtual_lab"
SHEETS = ["cells", "tests", *(["groups"] if PLAN.groups else [])]
# An edit of the laboratory makes its campaigns anew, as an edit of the science does for results.
CODE = hashlib.sha256(
    b"".join(path.read_bytes() for path in sorted((SCRIPTS / "virtual_lab").rglob("*.py")))
).hexdigest()


rule all:
    input:
        [FOLDER / "config" / f"{sheet}.tsv" for sheet in SHEETS],
        FOLDER / "config" / "config.yaml",
        FOLDER / PLAN.truth / "README.md",
    message:
        f"{len(PLAN.cells)} cells and {len(PLAN.tests)} tests lie in {FOLDER}, their truth in {FOLDER / PLAN.truth}."


for batch, tests in PLAN.batches().items():

    rule:
        name:
            f"make_{batch}"
        output:
            raw=[FOLDER / test.file for test in tests],
            truth=FOLDER / ".virtual_lab" / f"{batch}.json",
        log:
            LOGS / f"{batch}.log",
        params:
            make=MAKE,
            batch=batch,
            options=OPTIONS,
            code=CODE,
        message:
            f"Simulate and measure {', '.join(dict.fromkeys(test.cell for test in tests))}."
        shell:
            "{params.make} {params.batch} > {log} 2>&1"


rule sheets:
    input:
        [FOLDER / ".virtual_lab" / f"{batch}.json" for batch in PLAN.batches()],
    output:
        sheets=[FOLDER / "config" / f"{sheet}.tsv" for sheet in SHEETS],
        choices=FOLDER / "config" / "config.yaml",
        truth=FOLDER / PLAN.truth / "README.md",
    log:
        LOGS / "sheets.log",
    params:
        make=MAKE,
        options=OPTIONS,
        code=CODE,
    message:
        "Write the campaign's sheets, with the checksum of each raw file, and gather its truth."
    shell:
        "{params.make} > {log} 2>&1"


rule score:
    input:
        FOLDER / "results" / "summary.csv",
    output:
        page=FOLDER / "results" / "score" / "score.html",
        table=FOLDER / "results" / "score" / "score.csv",
        markdown=FOLDER / "results" / "score" / "score.md",
    log:
        LOGS / "score.log",
    params:
        code=CODE,
        folder=FOLDER,
        title=f"Scores: {CAMPAIGN}",
        truth=FOLDER / PLAN.truth,
    message:
        "Compare what the pipeline found with what is true."
    shell:
        "python scripts/tools/score_campaign.py {params.folder} --truth {params.truth}"
        " --title {params.title:q} --markdown {output.markdown} > {log} 2>&1"


rule reality:
    output:
        "virtual/reality/reality.md",
    log:
        "logs/virtual_lab/reality.log",
    params:
        folder=FOLDER,
        real=[Path(config.get("real", "real")) / name for name in REAL],
        code=CODE,
    message:
        "Set the laboratory's records beside real ones."
    shell:
        "python scripts/tools/check_reality.py virtual/reality {params.folder} --real {params.real}"
        " > {log} 2>&1"
