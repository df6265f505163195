"""One CSV table of the results contract."""

from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    job.save(tables.rows_of(snakemake.input, snakemake.params.tests), snakemake.output.table)
