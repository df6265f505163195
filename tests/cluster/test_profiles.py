"""Profiles for other machines: every key is an option, none of the default profile is lost."""

import re
import subprocess
import sys

import pytest
import yaml
from two_cells import ROOT, needs

PROFILES = ROOT / "workflow" / "profiles"
ELSEWHERE = {
    "slurm": "snakemake-executor-plugin-slurm",
    "object_storage": "snakemake-storage-plugin-s3",
    "kubernetes": "snakemake-executor-plugin-kubernetes",
    "aws_batch": "snakemake-executor-plugin-aws-batch",
}
# What other machines need otherwise: more attempts, and time until files are seen.
OTHERWISE = {"retries", "latency-wait"}


def profile(name):
    return yaml.safe_load((PROFILES / name / "config.yaml").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def options():
    """Names of all options of Snakemake and its plugins."""
    needs(*ELSEWHERE.values())
    program = [sys.executable, "-m", "snakemake", "--help"]
    said = subprocess.run(program, capture_output=True, text=True, check=True).stdout
    return set(re.findall(r"--([a-z0-9][a-z0-9-]*)", said))


def test_every_profile_is_tested():
    assert {path.name for path in PROFILES.iterdir()} == {"default", "warm", *ELSEWHERE}


@pytest.mark.parametrize("name", ELSEWHERE)
def test_every_key_is_an_option(name, options):
    assert set(profile(name)) <= options


@pytest.mark.parametrize("name", ELSEWHERE)
def test_what_decides_on_running_again_is_that_of_the_default_profile(name):
    default, other = profile("default"), profile(name)
    assert {key: other.get(key) for key in default if key not in OTHERWISE} == {
        key: value for key, value in default.items() if key not in OTHERWISE
    }


@pytest.mark.parametrize("name", ["kubernetes", "aws_batch"])
def test_a_profile_that_was_not_run_says_so(name):
    text = (PROFILES / name / "config.yaml").read_text(encoding="utf-8")
    assert "NOT RUN where this repository was made" in text
