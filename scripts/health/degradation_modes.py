"""Lithium and active material lost by one cell, from slow curves or rests."""

import cellwright as cw
from runtime import artefact, job_inputs, user_tables

with artefact.Job(snakemake) as job:
    params = snakemake.params
    found = cw.degradation_modes(
        job_inputs.tests(snakemake.input.own),
        params.cell,
        params.materials["chemistry"],
        rests=job_inputs.tests(snakemake.input.rests),
        half_cells=user_tables.half_cells(params.materials, params.content),
        fresh=job_inputs.fresh_cell(params.fresh, snakemake.input.fresh),
    )
    job.note(*found.notes)
    job.save(found.rows)
