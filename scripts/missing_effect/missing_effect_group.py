"""Search for what one branch of a parallel group has of its own, and prove it on other tests."""

from cellwright.effects.groups.finding import missing_group_effect
from runtime import artefact, lending

with artefact.Job(snakemake) as job:
    inputs, params = snakemake.input, snakemake.params
    found = missing_group_effect(
        snakemake.wildcards.group,
        params.branches,
        lending.known_cells(params.branches, params.lenders, inputs.models),
        lending.tests(inputs.series),
        settings=params.settings,
    )
    job.note(*found.notes)
    for name, path in snakemake.output.items():
        job.save(getattr(found, name), path)
