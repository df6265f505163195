"""Polarisation of one cell over SoC and temperature, and its laws."""

from cellwright.laws.polarisation import compared, law_rows, laws_of, paragraph
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    found = compared(tables.rows_of(snakemake.input, snakemake.params.tests))
    laws, reasons = laws_of(found.points)
    job.note(paragraph(found, laws), *reasons)
    job.save(law_rows(laws), snakemake.output.laws)
    job.save(found.points, snakemake.output.points)
