"""Voltage over SoC of a long load, of a cell of which nothing slower tells the OCV."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = cw.ocv_from_load(
        job.load(snakemake.input.series),
        params.cell,
        {"test": snakemake.wildcards.test, **params.test},
    )
    job.note(*found.notes)
    arrays, facts = artefact.split(found.curve)
    job.save(arrays, capacity_source=found.capacity_source, **facts)
