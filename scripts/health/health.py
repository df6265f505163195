"""State of health of one cell by each method that its tests allow."""

import cellwright as cw
from runtime import artefact, lives

with artefact.Job(snakemake) as job:
    job.save(cw.state_of_health(**lives.found(snakemake.input)).rows)
