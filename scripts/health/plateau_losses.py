"""Charge lost by each plateau of one cell's slow curve between its check-ups."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    tests = job_inputs.tests(snakemake.input)
    found = cw.plateau_losses(tests, snakemake.params.cell)
    job.note(*found.notes)
    job.save(found.rows)
