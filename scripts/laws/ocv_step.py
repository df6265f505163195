"""Shift of the open-circuit voltage in rests of one test in a chamber that steps."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    record = [job.load(path) for path in (inputs.series, inputs.steps, inputs.basis)]
    found = cw.chamber_steps(*record, params.test, params.cell)
    job.note(*found.notes)
    job.save(found.rows)
