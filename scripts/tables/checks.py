"""Tests of results, run on the tables of this campaign: the laws in tests/artefacts."""

from pathlib import Path

from runtime import artefact, results_check

with artefact.Job(snakemake) as job:
    job.save(results_check.outcomes(Path(snakemake.input.summary).with_name("tables")))
