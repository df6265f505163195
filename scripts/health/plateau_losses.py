"""Charge lost by each plateau of one cell's slow curve between its check-ups."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    tests = facts.tests(snakemake.input)
    found = cw.plateau_losses(tests, snakemake.params.cell)
    job.note(*found.notes)
    job.save(found.rows)
