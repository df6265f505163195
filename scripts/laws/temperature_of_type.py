"""Pulse resistance over temperature across cells of one type."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    rows = job_inputs.rows_of(snakemake.input.resistance, snakemake.params.tests)
    found = cw.temperature_laws_of_type(rows, snakemake.params.settings)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.laws)
    job.save(found.points, snakemake.output.points)
