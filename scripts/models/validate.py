"""Simulate one test that took no part in the fit, and score the simulation."""

from cellwright.identification.validation import validate
from runtime import artefact

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = validate(
        job.load(snakemake.input.model),
        params.cell,
        params.test,
        job.load(snakemake.input.series),
        split_rest_second=params.settings["split_rest_second"],
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
