"""Capacity and open-circuit voltage of one slow test, as table and as analytic functions."""

import cellwright as cw
from runtime import artefact

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
before = {"test": params.test}
with artefact.Job(snakemake, output.capacity) as job:
    record = job.load(inputs.series), job.load(inputs.steps)
    before["course"] = artefact.load_first(inputs.course)
    found = cw.capacity(*record, params.cell, params.instrument, whole_swing=True, **before)
    job.note(*found.notes)
    job.save(found.rows)
curve_from = [inputs.series, *inputs.course]
with artefact.Job(snakemake, output.curve, output.functions, inputs=curve_from) as job:
    about = {"least_hour": params.least_hour, **before}
    found = cw.ocv(job.load(inputs.series), params.cell, **about)
    job.note(*found.notes)
    arrays, facts = artefact.split(found.curve)
    job.save(arrays, output.curve, **facts)
    job.save(found.functions, output.functions)
