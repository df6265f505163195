"""Depolarisation in the rests of one test: two exponentials each, or why not."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    record = [job.load(path) for path in (inputs.series, inputs.steps, inputs.basis)]
    found = cw.relaxation(*record, params.test, params.cell, params.settings)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.rests)
    job.save(found.curve, snakemake.output.curve)
