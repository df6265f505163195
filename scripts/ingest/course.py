"""The tests of one cell in time: which came before each, and whether it left the cell full."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    tests = facts.tests_with_steps(snakemake.input.steps, snakemake.input.series)
    found = cw.course(tests, snakemake.params.cell)
    job.note(*found.notes)
    job.save(found.rows)
