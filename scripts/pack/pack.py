"""Simulate a parallel group and score its branch currents."""

from cellwright.packs.group import validate_group
from runtime import artefact

with artefact.Job(snakemake) as job:
    found = validate_group(
        [job.load(path) for path in snakemake.input.models],
        snakemake.params.branches,
        job.load(snakemake.input.series),
        test=snakemake.wildcards.test,
        celsius=snakemake.params.test["ambient_temperature_celsius"],
    )
    job.note(*found.notes)
    job.save(found.rows, snakemake.output.scores)
    job.save(found.series, snakemake.output.series)
