"""Search for what one branch of a parallel group has of its own, and prove it on other tests."""

import cellwright as cw
from runtime import artefact, job_inputs

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    cells = job_inputs.known_cells(params.branches, params.lenders, inputs.models)
    tests, group = job_inputs.tests(inputs.series), snakemake.wildcards.group
    found = cw.missing_group_effect(group, params.branches, cells, tests)
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
