"""Estimate the SoC of one test that took no part in the fit by every filter, and score it."""

from cellwright.filters.evaluate import soc_runs
from cellwright.records.facts import CellFacts
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = soc_runs(
        job.load(snakemake.input.model),
        CellFacts(**params.cell),
        facts.test(snakemake),
        settings=params.settings,
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
