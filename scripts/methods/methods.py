"""CSV table of the identification methods on the pulses of all cells."""

from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    job.save(tables.rows_of(snakemake.input.rows, snakemake.params.tests))
