"""Shift of the open-circuit voltage of one cell since its first check-up."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    found = cw.ocv_shifts(facts.tests_with_steps(snakemake.input.steps, snakemake.input.series))
    job.note(*found.notes)
    job.save(found.rows)
