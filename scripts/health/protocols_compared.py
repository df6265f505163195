"""Ageing protocols of each type of cells compared."""

from runtime import artefact, fleets

inputs, params = snakemake.input, snakemake.params
with artefact.Job(snakemake) as job:
    found = fleets.protocol_table(inputs.lives, inputs.courses, params.types, params.protocols)
    job.save(found)
