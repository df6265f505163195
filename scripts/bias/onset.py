"""Resistance at stated delays into each pulse of one test."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    record = [job.load(path) for path in (inputs.series, inputs.steps, inputs.basis)]
    found = cw.resistance(
        *record, params.test, params.cell, params.settings, instrument=params.instrument
    )
    job.note(*found.notes)
    job.save(found.rows)
