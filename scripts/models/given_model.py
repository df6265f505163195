"""The model of a cell that is known as a table of OCV and resistance."""

import cellwright as cw
from runtime import artefact, user_tables

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = cw.model_of_table(
        snakemake.wildcards.cell,
        user_tables.read(params.table, user_tables.MODEL, params.content),
        capacity_ampere_hour=params.capacity_ampere_hour,
        source=params.table,
    )
    job.note(*found.notes)
    job.save(found.content)
