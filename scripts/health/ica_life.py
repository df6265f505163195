"""Incremental capacity of charges spread over one ageing record, and their peaks."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs = snakemake.input
    record = [job.load(path) for path in (inputs.series, inputs.steps, inputs.cycles)]
    found = cw.ica_life(*record)
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.peaks)
    job.save(found.curves, snakemake.output.curves)
