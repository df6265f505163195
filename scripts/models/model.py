"""A cell's model as the rest of the pipeline uses it: its member, and why it was chosen."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = cw.finish_model(
        params.cell,
        job.load(inputs.source),
        artefact.load_first(inputs.basis),
        job_inputs.tests(inputs.series),
        left_out=job_inputs.tests(inputs.left_out),
        left_out_temperatures=[rows for rows, _ in artefact.load_all(inputs.temperatures)],
        effects=artefact.load_first(inputs.effects),
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    job.save(found.content, snakemake.output.model)
    job.save(found.parameters, snakemake.output.parameters)
    job.save(found.choice, snakemake.output.choice)
