"""Search for what one branch of a parallel group has of its own, and prove it on other tests."""

from cellwright.effects.groups.finding import missing_group_effect
from runtime import artefact, facts, known

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    branches = facts.branches(params.branches)
    found = missing_group_effect(
        snakemake.wildcards.group,
        branches,
        known.known_cells(branches, params.lenders, inputs.models),
        facts.tests(inputs.series),
        settings=params.settings,
    )
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
