"""Capacities of the complete charges and discharges of one test."""

import cellwright as cw
from runtime import artefact, facts, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    record = job.load(inputs.series), job.load(inputs.steps)
    before = {"test": facts.of_job(snakemake)[0], "course": artefact.load_first(inputs.course)}
    before["curves"] = lending.curves(inputs.curves)
    found = cw.capacity(*record, params.cell, params.instrument, whole_swing=False, **before)
    job.note(*found.notes)
    job.save(found.rows)
