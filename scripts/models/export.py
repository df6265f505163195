"""A cell's model for other tools: PyBaMM's Thevenin model, and a look-up table."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    scores = job_inputs.rows_of_tests(snakemake.input.validation)
    found = cw.export_model(job.load(snakemake.input.model), validation=scores)
    job.note(*found.notes)
    job.save(found.pybamm, snakemake.output.pybamm)
    job.save(found.lookup, snakemake.output.lookup)
    job.save(found.temperature, snakemake.output.temperature)
