"""Fast charge of one cell over temperature."""

import cellwright as cw
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    found = cw.fast_charge_laws(tables.rows_of(snakemake.input, snakemake.params.tests))
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.laws)
    job.save(found.points, snakemake.output.points)
