"""Simulate a parallel group and score its branch currents."""

from cellwright.packs.group import validate_group
from runtime import artefact, facts

with artefact.Job(snakemake) as job:
    found = validate_group(
        [job.load(path) for path in snakemake.input.models],
        facts.branches(snakemake.params.branches),
        facts.test(snakemake),
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
