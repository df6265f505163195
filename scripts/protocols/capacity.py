"""Capacities of the complete charges and discharges of one test."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    record = job.load(inputs.series), job.load(inputs.steps)
    before = {
        "test": job_inputs.facts_of_job(snakemake)[0],
        "course": artefact.load_first(inputs.course),
    }
    before["curves"] = job_inputs.curves(inputs.curves)
    found = cw.capacity(*record, params.cell, params.instrument, whole_swing=False, **before)
    job.note(*found.notes)
    job.save(found.rows)
