"""Table of all cells: how often each name stays when one record is left out of the search."""

from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    job.save(tables.rows_of(snakemake.input, {}))
