"""Identify the equivalent circuits of one cell from its own tests."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = cw.identify(
        params.cell,
        job.load(snakemake.input.basis),
        job_inputs.tests(snakemake.input.series),
        members=params.members,
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    job.save(found.content)
