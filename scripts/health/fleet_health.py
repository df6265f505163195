"""Resistance against capacity over the cells of each type, outliers named."""

import cellwright as cw
from runtime import artefact, type_inputs

with artefact.Job(snakemake) as job:
    cells, lines = type_inputs.fleet_tables(
        snakemake.input.check_ups,
        snakemake.input.resistances,
        snakemake.params.types,
        cw.fleet_resistance,
    )
    job.save(cells, snakemake.output.cells)
    job.save(lines, snakemake.output.lines)
