"""Capacity of one cell from parts of its charge: between two rests, by its open-circuit voltage."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    basis = job.load(inputs.basis)
    tests = facts.tests_with_steps(inputs.steps, inputs.series)
    found = cw.capacity_between_rests(tests, basis, params.instrument)
    job.note(*found.notes)
    job.save(found.rows)
