"""The open-circuit voltage of one cell over SoC and temperature."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, output = snakemake.input, snakemake.output
    steps = job_inputs.rows_of(inputs.steps, {})
    curves = job_inputs.curves(inputs.curves)
    found = cw.ocv_over_temperature(curves, steps)
    job.note(*found.notes)
    job.save(found.map, output.map)
    job.save(found.entropic, output.entropic)
    job.save(found.surface, output.surface)
    job.save(found.functions, output.functions)
    job.save(found.rows, output.laws)
