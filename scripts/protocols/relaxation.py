"""Depolarisation in the rests of one test: two exponentials each, or why not."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    record = [job.load(path) for path in (inputs.series, inputs.steps, inputs.basis)]
    about, once = job_inputs.facts_of_job(snakemake), artefact.load_first(inputs.repeats)
    found = cw.relaxation(*record, *about, repeats=once)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.rests)
    job.save(found.curve, snakemake.output.curve)
