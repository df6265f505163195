"""Capacity of one cell lost to temperature and rate, split into true and false."""

from cellwright.laws.capacity_loss import capacity_losses, law_rows
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    rows = tables.rows_of(snakemake.input, snakemake.params.tests)
    losses, notes = capacity_losses(rows, **snakemake.params.settings)
    job.note(*notes)
    job.save(losses, snakemake.output.losses)
    job.save(law_rows(losses), snakemake.output.laws)
