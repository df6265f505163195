"""Resistance and capacity of one cell over temperature."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    stages = (inputs.capacity, inputs.resistance, inputs.eis)
    rows = [job_inputs.rows_of(paths, params.tests) for paths in stages]
    found = cw.temperature_laws(*rows, params.settings)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.laws)
    job.save(found.points, snakemake.output.points)
