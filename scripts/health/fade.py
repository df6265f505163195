"""Fade of one cell over its ageing records: law, knee, remaining cycles."""

import cellwright as cw
from runtime import artefact, job_inputs

inputs, output, params = snakemake.input, snakemake.output, snakemake.params
with artefact.Job(snakemake) as job:
    records = job_inputs.ageing_records(inputs.cycles, inputs.summaries, inputs.compensated)
    found = cw.fade(records, params.cell, params.settings)
    job.note(*found.notes)
    job.save(found.laws, output.laws)
    job.save(found.columns, output.course)
    job.save([found.summary], output.life)
