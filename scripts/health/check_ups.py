"""Ratings of one cell at each check-up, and growth of its resistance."""

import cellwright as cw
from runtime import artefact, job_inputs

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake) as job:
    rows = job_inputs.check_up_rows([inputs.capacities, inputs.resistances], params.tests)
    found = cw.check_ups(*rows, params.cell, job_inputs.throughputs(inputs.courses))
    job.note(*found.notes)
    job.save(job_inputs.with_sheet(found.rows, params.sheet), output.rows)
    job.save(found.growth, output.growth)
