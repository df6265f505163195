"""Open-circuit voltage of one slow test, as table and as analytic functions."""

import cellwright as cw
from runtime import artefact

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = cw.ocv(job.load(snakemake.input.series), params.cell, least_hour=params.least_hour)
    job.note(*found.notes)
    arrays, facts = artefact.split(found.curve)
    job.save(arrays, snakemake.output.curve, **facts)
    job.save(found.functions, snakemake.output.functions)
