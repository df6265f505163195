"""A cell's model as the rest of the pipeline uses it, and its parameters as rows."""

import artefact
from cellwright.models.rows import model_of, parameter_rows

with artefact.Job(snakemake) as job:
    model = model_of(job.load(snakemake.input[0]), snakemake.wildcards.cell)
    job.save(model, snakemake.output.model)
    job.save(parameter_rows(model), snakemake.output.parameters)
