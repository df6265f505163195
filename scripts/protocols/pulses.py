"""Resistance at stated delays into each pulse of one test, and the depolarisation in its rests."""

import cellwright as cw
from runtime import artefact, job_inputs

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
paths, about = (inputs.series, inputs.steps, inputs.basis), job_inputs.facts_of_job(snakemake)
with artefact.Job(snakemake, output.resistance) as job:
    record, once = [job.load(path) for path in paths], artefact.load_first(inputs.repeats)
    settings = {"repeats": once, "instrument": params.instrument}
    found = cw.resistance(*record, *about, params.resistance, **settings)
    job.note(*found.notes)
    job.save(found.rows)
with artefact.Job(snakemake, output.rests, output.curve) as job:
    record, once = [job.load(path) for path in paths], artefact.load_first(inputs.repeats)
    found = cw.relaxation(*record, *about, repeats=once)
    job.note(*found.notes)
    job.save(found.rows, output.rests)
    job.save(found.curve, output.curve)
