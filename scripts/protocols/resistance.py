"""Resistance at stated delays into each pulse of one test."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    record = [job.load(path) for path in (inputs.series, inputs.steps, inputs.basis)]
    about, once = job_inputs.facts_of_job(snakemake), artefact.load_first(inputs.repeats)
    settings = {"repeats": once, "instrument": snakemake.params.instrument}
    found = cw.resistance(*record, *about, snakemake.params.settings, **settings)
    job.note(*found.notes)
    job.save(found.rows)
