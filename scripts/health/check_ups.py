"""Ratings of one cell at each check-up, and growth of its resistance."""

import cellwright as cw
from runtime import artefact, lives, tables

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake) as job:
    capacities, resistances = (
        tables.rows_of(paths, params.tests) for paths in (inputs.capacities, inputs.resistances)
    )
    throughputs = lives.throughputs(inputs.courses)
    found = cw.check_ups(capacities, resistances, params.cell, throughputs)
    job.note(*found.notes)
    job.save(lives.with_sheet(found.rows, params.sheet), output.rows)
    job.save(found.growth, output.growth)
