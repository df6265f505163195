"""Capacity and open-circuit voltage of one slow test, as table and as analytic functions."""

import cellwright as cw
from runtime import artefact

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake, output.capacity) as job:
    record = job.load(inputs.series), job.load(inputs.steps)
    found = cw.capacity(*record, params.cell, whole_swing=True, test=params.test)
    job.note(*found.notes)
    job.save(found.rows)
with artefact.Job(snakemake, output.curve, output.functions, inputs=[inputs.series]) as job:
    about = {"least_hour": params.least_hour, "test": params.test}
    found = cw.ocv(job.load(inputs.series), params.cell, **about)
    job.note(*found.notes)
    arrays, facts = artefact.split(found.curve)
    job.save(arrays, output.curve, **facts)
    job.save(found.functions, output.functions)
