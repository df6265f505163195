"""A cell's model for other tools: PyBaMM's Thevenin model, and a look-up table."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    found = cw.export_model(job.load(snakemake.input[0]))
    job.note(*found.notes)
    job.save(found.pybamm, snakemake.output.pybamm)
    job.save(found.lookup, snakemake.output.lookup)
    job.save(found.temperature, snakemake.output.temperature)
