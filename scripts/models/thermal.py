"""Thermal constants of one cell from tests whose temperature was logged."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, output, params = snakemake.input, snakemake.output, snakemake.params
    about = (params.cell, job.load(inputs.model), job_inputs.tests(inputs.series))
    found = cw.thermal_constants(*about, split_rest_second=params.split_rest_second)
    job.note(*found.notes)
    job.save(found.content, output.constants)
    job.save(found.rows, output.tests)
