"""Capacity of one cell from parts of its charge: between two rests, by its open-circuit voltage."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    basis = job.load(inputs.basis)
    tests = job_inputs.tests_with_steps(inputs.steps, inputs.series)
    found = cw.capacity_between_rests(tests, basis, params.instrument)
    job.note(*found.notes)
    job.save(found.rows)
