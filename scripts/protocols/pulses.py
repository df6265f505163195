"""Resistance at stated delays into each pulse of one test, and the depolarisation in its rests."""

import cellwright as cw
from runtime import artefact

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
paths = inputs.series, inputs.steps, inputs.basis
with artefact.Job(snakemake, output.resistance) as job:
    record = [job.load(path) for path in paths]
    found = cw.resistance(*record, params.test, params.cell, params.resistance)
    job.note(*found.notes)
    job.save(found.rows)
with artefact.Job(snakemake, output.rests, output.curve) as job:
    record = [job.load(path) for path in paths]
    found = cw.relaxation(*record, params.test, params.cell, params.relaxation)
    job.note(*found.notes)
    job.save(found.rows, output.rests)
    job.save(found.curve, output.curve)
