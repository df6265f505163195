"""The table of what was left out."""

import artefact
import tables

with artefact.Job(snakemake) as job:
    job.save(tables.excluded(snakemake.input, snakemake.params.files))
