"""Search for what one branch of a parallel group has of its own, and prove it on other tests."""

import cellwright as cw
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    known = lending.known_cells(params.branches, params.lenders, inputs.models)
    tests, group = lending.tests(inputs.series), snakemake.wildcards.group
    found = cw.missing_group_effect(group, params.branches, known, tests, params.settings)
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
