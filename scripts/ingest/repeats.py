"""Which stretches the tests of one cell have in common: each is one measurement."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    found = cw.repeats(job_inputs.tests(snakemake.input.series), roles=snakemake.params.roles)
    job.note(*found.notes)
    job.save(found.rows)
