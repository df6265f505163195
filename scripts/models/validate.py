"""Simulate one test that took no part in the fit, and score the simulation."""

from cellwright.identification.validation import validate
from cellwright.records.facts import CellFacts
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = validate(
        job.load(snakemake.input.model),
        CellFacts(**params.cell),
        facts.test(snakemake),
        split_rest_second=params.settings["split_rest_second"],
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
