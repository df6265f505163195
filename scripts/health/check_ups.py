"""Ratings of one cell at each check-up, and growth of its resistance."""

import cellwright as cw
from runtime import artefact, lives

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake) as job:
    rows = lives.check_up_rows([inputs.capacities, inputs.resistances], params.tests)
    found = cw.check_ups(*rows, params.cell, lives.throughputs(inputs.courses))
    job.note(*found.notes)
    job.save(lives.with_sheet(found.rows, params.sheet), output.rows)
    job.save(found.growth, output.growth)
