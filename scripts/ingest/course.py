"""The tests of one cell in time: which came before each, and whether it left the cell full."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    tests = job_inputs.tests_with_steps(snakemake.input.steps, snakemake.input.series)
    found = cw.course(tests, snakemake.params.cell)
    job.note(*found.notes)
    job.save(found.rows)
