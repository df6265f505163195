"""Simulate one test that took no part in the fit, and score the simulation."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    params, inputs = snakemake.params, snakemake.input
    about = (job.load(inputs.model), job.load(inputs.series), params.test, params.cell)
    found = cw.validate(*about, split_rest_second=params.split_rest_second)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
