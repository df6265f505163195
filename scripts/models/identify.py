"""Identify the equivalent circuits of one cell from its own tests."""

import cellwright as cw
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = cw.identify(
        params.cell,
        job.load(snakemake.input.basis),
        facts.tests(snakemake.input.series),
        members=params.members,
        split_rest_second=params.split_rest_second,
    )
    job.note(*found.notes)
    job.save(found.content)
