"""Simulate a parallel group and score its branch currents."""

import artefact
from cellwright.models.group_score import validate_group

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
