"""The table of what was left out."""

from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    job.save(tables.excluded(snakemake.input, snakemake.params.files))
