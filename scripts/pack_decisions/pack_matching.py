"""Cells of one type put together, and what that brings beside random assemblies."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    models = [job.load(path) for path in inputs.models]
    capacities = job_inputs.rows_of(inputs.capacities, params.tests)
    found = cw.match_cells(models, params.cells, capacities, params.settings)
    job.save(found.rows, snakemake.output.gains)
    job.save(found.assembly, snakemake.output.assembly)
