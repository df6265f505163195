"""One CSV table of the results contract."""

import artefact
import tables

with artefact.Job(snakemake) as job:
    job.save(tables.rows_of(snakemake.input, snakemake.params.tests), snakemake.output.table)
