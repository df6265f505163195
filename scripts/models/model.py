"""A cell's model as the rest of the pipeline uses it, with what its member still lacked."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.add_own_effects(
        job.load(inputs.member),
        artefact.load_first(inputs.effects),
        choice=artefact.rows(job.load(inputs.choice)),
        cell=params.cell,
        left_out=job_inputs.tests(inputs.left_out),
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    job.save(found.content, snakemake.output.model)
    job.save(found.parameters, snakemake.output.parameters)
    job.save(found.choice, snakemake.output.choice)
