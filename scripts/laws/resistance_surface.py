"""Resistance of one cell over SoC and temperature: three forms, and whether it separates."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    params = snakemake.params
    rows = job_inputs.rows_of(snakemake.input.resistance, params.tests)
    found = cw.resistance_surface(rows, delay_second=params.delay_second)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.laws)
    job.save(found.points, snakemake.output.points)
