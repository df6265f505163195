"""Simulate one test that took no part in the fit, and score the simulation."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    validation = cw.validate(
        job.load(inputs.model),
        job.load(inputs.series),
        *facts.of_job(snakemake),
        split_rest_second=params.split_rest_second,
    )
    job.note(*validation.notes)
    job.save(validation.rows, snakemake.output.scores)
    job.save(validation.series, snakemake.output.series)
