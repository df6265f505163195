"""Decisions on one pack: what it gives and how sure that is, which cell to replace, safe window."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    models = [job.load(path) for path in inputs.models]
    capacities = job_inputs.rows_of(inputs.capacities, params.tests)
    pack = (models, params.members, params.cells, capacities, params.settings)
    thermal = [content for content, _ in artefact.load_all(inputs.thermal)]
    found = cw.pack_decisions(*pack, temperature_celsius=params.celsius, thermal=thermal)
    job.note(*found.notes)
    job.save(found.rows)
