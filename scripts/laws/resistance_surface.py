"""Resistance of one cell over SoC and temperature: three forms, and whether it separates."""

from cellwright.laws.surface import law_rows, point_rows, sentences, surfaces
from runtime import artefact, lean, tables

with artefact.Job(snakemake) as job:
    rows = tables.rows_of(snakemake.input.resistance, snakemake.params.tests)
    lean.import_lmfit()
    found, reasons = surfaces(rows, **snakemake.params.settings)
    job.note(*reasons, *sentences(found))
    job.save(law_rows(found), snakemake.output.laws)
    job.save(point_rows(found), snakemake.output.points)
