"""Capacities of the complete charges and discharges of one test."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    record = job.load(snakemake.input.series), job.load(snakemake.input.steps)
    found = cw.capacity(*record, snakemake.params.cell, whole_swing=False)
    job.note(*found.notes)
    job.save(found.rows)
