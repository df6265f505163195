"""Shift of the open-circuit voltage of one cell since its first check-up."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    found = cw.ocv_shifts(
        job_inputs.tests_with_steps(snakemake.input.steps, snakemake.input.series)
    )
    job.note(*found.notes)
    job.save(found.rows)
