"""Cut a clean series into steps."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    params = snakemake.params
    job.save(cw.segment(job.load(snakemake.input.series), params.cell, params.settings).rows)
