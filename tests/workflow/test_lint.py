"""`snakemake --lint` has nothing to say but what is named here, each with its reason."""

import re
import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import starts

# A law for who changes rules: what the linter finds, no run of a user meets.
pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
# Finding → (where it may stand, why it stays).
EXCEPTIONS = {
    "Specify a conda environment or container for each rule.": (
        r"rule \w+",
        "All rules run in the one environment of environment.lock, whose hash every artefact "
        "carries. `run` installs it with hashes, container/Dockerfile makes an image of it; no "
        "image is published that a rule could name.",
    ),
    "Mixed rules and functions in same snakefile.": (
        r"snakefile .+/rules/(drawing|health|ingest|laws|loss|missing_effect"
        r"|models|pack|pack_decisions|pack_export|report)\.smk",
        "Which tests a stage takes stands as a function above the rules of that stage; what "
        "several stages use is in common.smk. Apart, both files would have to be read together.",
    ),
}


def findings(snakefile, *arguments):
    """(where, title) of each finding of Snakemake's own linter."""
    said = starts.forked("--snakefile", str(ROOT / snakefile), "--lint", *arguments).said
    found, where = [], ""
    for line in said.splitlines():
        if line.startswith("Lints for "):
            where = line.removeprefix("Lints for ").rstrip(":")
        elif line.startswith("    * "):
            found.append((where, line.removeprefix("    * ").rstrip(":")))
    assert found or "Congratulations" in said, said
    return found


@pytest.fixture(scope="module")
def found():
    return findings("Snakefile")


def test_the_linter_finds_nothing_that_is_not_named_here(found):
    unknown = [
        f"{where}: {title}"
        for where, title in found
        if title not in EXCEPTIONS or not re.match(EXCEPTIONS[title][0], where)
    ]
    assert not unknown


def test_no_exception_outlives_its_finding(found):
    counts = Counter(title for _, title in found)
    assert sorted(counts) == sorted(EXCEPTIONS)
    functions = [where for where, title in found if title.startswith("Mixed")]
    named = EXCEPTIONS["Mixed rules and functions in same snakefile."][0]
    assert len(functions) == len(re.findall(r"[a-z_]+(?=[|)])", named.partition("rules/")[2]))


def test_the_virtual_laboratory_has_no_other_findings():
    found = findings("lab/Snakefile", "--config", "campaign=scale", "cells=1")
    assert {title for _, title in found} == {next(iter(EXCEPTIONS))}
