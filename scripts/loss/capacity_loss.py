"""Capacity of one cell lost to temperature and rate, split into true and false."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    rows = job_inputs.rows_of(snakemake.input, snakemake.params.tests)
    found = cw.capacity_loss(rows)
    job.note(*found.notes)
    job.save(found.points, snakemake.output.losses)
    job.save(found.rows, snakemake.output.laws)
