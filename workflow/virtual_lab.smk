# The demo campaign, made anew: raw files, sheets and truth, by physics (PyBaMM) and a measurement
# chain. From the repository's root, in an environment made from environment-lab.lock:
#     snakemake -s workflow/virtual_lab.smk --cores 2 --forceall

import sys
from pathlib import Path

sys.path.insert(0, str(Path(workflow.basedir).parent / "scripts"))

from virtual_lab.campaign import plan

TESTS = plan()


rule all:
    input:
        [f"config/{sheet}.tsv" for sheet in ["cells", "tests", "groups"]],
        "tests/truth/truth.json",
    message:
        "The demo campaign lies in data/, its sheets in config/, its truth in tests/truth/."


rule test:
    output:
        raw="data/{cell}/{test}.{suffix}",
        truth=temp(".virtual_lab/data/{cell}/{test}.{suffix}.json"),
    wildcard_constraints:
        test="[A-Za-z0-9_-]+",
    message:
        "Simulate and measure {wildcards.test} of {wildcards.cell}."
    shell:
        "python scripts/make_demo.py test {wildcards.cell} {wildcards.test}"


rule sheets:
    input:
        [test.file for test in TESTS],
    output:
        [f"config/{sheet}.tsv" for sheet in ["cells", "tests", "groups"]],
    message:
        "Write the campaign's sheets, with the checksum of each raw file."
    shell:
        "python scripts/make_demo.py sheets"


rule truth:
    input:
        [f".virtual_lab/{test.file}.json" for test in TESTS],
    output:
        "tests/truth/truth.json",
    message:
        "Gather what is true about cells and tests."
    shell:
        "python scripts/make_demo.py truth"
