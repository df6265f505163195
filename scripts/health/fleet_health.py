"""Resistance against capacity over the cells of each type, outliers named."""

from runtime import artefact, fleets

with artefact.Job(snakemake) as job:
    cells, lines = fleets.resistance_tables(
        snakemake.input.check_ups, snakemake.input.resistances, snakemake.params.types
    )
    job.save(cells, snakemake.output.cells)
    job.save(lines, snakemake.output.lines)
