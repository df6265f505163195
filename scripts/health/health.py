"""State of health of one cell by each method that its tests allow."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    job.save(cw.state_of_health(**job_inputs.told_of_health(snakemake.input)).rows)
