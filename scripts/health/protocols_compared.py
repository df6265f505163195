"""Ageing protocols of each type of cells compared."""

import cellwright as cw
from runtime import artefact, type_inputs

inputs, params = snakemake.input, snakemake.params
with artefact.Job(snakemake) as job:
    told = (inputs.lives, inputs.courses, params.types, params.protocols)
    job.save(type_inputs.protocol_table(*told, cw.compare_protocols))
