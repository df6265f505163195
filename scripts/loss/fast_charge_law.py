"""Fast charge of one cell over temperature."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    found = cw.fast_charge_laws(job_inputs.rows_of(snakemake.input, snakemake.params.tests))
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.laws)
    job.save(found.points, snakemake.output.points)
