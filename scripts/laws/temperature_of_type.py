"""Pulse resistance over temperature across cells of one type."""

from cellwright.laws.of_type import points_of_type, sentences_of_type
from cellwright.laws.points import enough
from cellwright.laws.temperature import law_rows
from runtime import artefact, tables

with artefact.Job(snakemake) as job:
    rows = tables.rows_of(snakemake.input.resistance, snakemake.params.tests)
    found = points_of_type(rows, **snakemake.params.settings)
    points = enough(found.points)
    laws, reasons = law_rows(points)
    job.note(*found.notes, *sentences_of_type(points), *reasons)
    job.save(laws, snakemake.output.laws)
    job.save(points, snakemake.output.points)
